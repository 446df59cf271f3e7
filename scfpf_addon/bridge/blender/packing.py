# SPDX-License-Identifier: GPL-3.0-or-later
"""Images' pixels in the .blend, as far as Blender can keep them there."""

from __future__ import annotations

# Blender counts a packed file's bytes in 31 bits and keeps the beginning of larger ones, without a word.
LARGEST_FILE = 2**31
# What an EXR takes besides its pixels, at most: a header and 16 bytes a line.
BESIDES_PIXELS = 2**22

TOO_LARGE = (
    "'{}' has more than the 2 GB that Blender can keep of an image in a .blend: "
    "save it with Image > Save As, or closing the file and undo lose it"
)


def pack(image) -> str:
    """Keep the pixels of a float image in the file; where they are too many what to tell the user.

    '' where all is well.
    """
    width, height = image.size
    if width * height * image.depth // 8 + BESIDES_PIXELS < LARGEST_FILE:
        image.pack()
        return ""
    # A file of an older picture would come back instead of this one.
    if image.packed_file:
        image.unpack(method="REMOVE")
    image.filepath_raw = ""
    return TOO_LARGE.format(image.name)
