# SPDX-License-Identifier: GPL-3.0-or-later
"""The image datablock with the passes of the last picture with layers, as Image Editors and compositors show.

It is a packed multilayer file. Undo restores that file, but leaves what has been loaded of it.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping
from pathlib import Path

import bpy

from ...bridge.blender.packing import LARGEST_FILE, TOO_LARGE
from ...bridge.render.result_image import redraw_image_editors
from ...projection.user_error import Message
from .exr_passes import Pass, write_passes

IMAGE_NAME = "SCFPF Render Passes"
# The custom property of the image that was made here.
MADE_KEY = "scfpf_passes"


def passes_image():
    """The image datablock of the passes, or None."""
    return bpy.data.images.get((IMAGE_NAME, None))


def deliver_passes(passes: Mapping[str, Pass], layer: str, save: Callable | None, keeps: bool) -> str:
    """Make an image datablock of passes.

    passes: by name, of one size. layer: the name of their view layer. save: called with the image, None for
    nothing. keeps: whether it is kept in the file afterwards. Returns a warning if it is too large, else "".
    Raises what ``save`` does.
    """
    with tempfile.TemporaryDirectory(prefix="scfpf-") as folder:
        path = os.path.join(folder, "passes.exr")
        write_passes(path, layer, passes)
        if not keeps:
            image = bpy.data.images.load(path)
            try:
                if save is not None:
                    save(image)
            finally:
                bpy.data.images.remove(image)
            return ""
        image = _image(path)
        is_small = Path(path).stat().st_size < LARGEST_FILE
        try:
            if save is not None:
                save(image)
            if is_small:
                image.pack()
        finally:
            image.filepath_raw = f"//{IMAGE_NAME}.exr"
            if not image.packed_file:
                bpy.data.images.remove(image)
        redraw_image_editors()
        return "" if is_small else Message(TOO_LARGE, IMAGE_NAME)


def _image(path: str):
    """The datablock, which shows a file."""
    image = passes_image()
    if image is not None and MADE_KEY not in image:
        image.name, image = f"{IMAGE_NAME} (other)", None
    if image is None:
        image = bpy.data.images.load(path)
        image.name, image.use_fake_user, image[MADE_KEY] = IMAGE_NAME, True, True
        return image
    if image.packed_file:
        image.unpack(method="REMOVE")
    image.filepath_raw = path
    image.buffers_free()
    return image


def history_changed() -> None:
    """Read the pixels again after undo or redo, which Blender does not."""
    image = passes_image()
    if image is not None and image.packed_file:
        image.buffers_free()
