# SPDX-License-Identifier: GPL-3.0-or-later
"""Packing of images into the .blend, within Blender's limit of size."""

from __future__ import annotations

from ...projection.user_error import Message

# Blender counts the bytes of a packed file in 31 bits and cuts off larger files without an error.
LARGEST_FILE = 2**31
# The most bytes of an EXR besides its pixels: a header and 16 bytes a line.
BESIDES_PIXELS = 2**22

TOO_LARGE = (
    "'{0}' has more than the 2 GB that Blender can keep of an image in a .blend: "
    "save it with Image > Save As, or closing the file and undo lose it"
)


def pack(image) -> str:
    """Pack a float image into the file, as an EXR.

    Returns a message to the user if the image is too large, else "". Too large an image stays in memory only.
    """
    width, height = image.size
    if width * height * image.depth // 8 + BESIDES_PIXELS < LARGEST_FILE:
        image.pack()
        return ""
    # Otherwise an older packed image would come back instead of this one.
    if image.packed_file:
        image.unpack(method="REMOVE")
    image.filepath_raw = ""
    return Message(TOO_LARGE, image.name)
