# SPDX-License-Identifier: GPL-3.0-or-later
"""The image datablock of the last render, and its content after undo.

The datablock is float, scene-linear and premultiplied, shown through the scene's view transform like a
render. ``write_result`` packs it, which keeps it bit for bit through save, reload and undo, up to 2 GB. Its
caller makes one undo push afterwards, or undoing another step removes the image.

Undo restores the packed file but leaves the pixels in memory alone. Handlers here drop those pixels, or an
editor would show the newer image and a saved file would hold the older one.
"""

from __future__ import annotations

import uuid

import bpy
import numpy as np

from ...shading.typing import Single
from ..blender.packing import pack

IMAGE_NAME = "SCFPF Render"
# Image.depth of four float32 channels.
FLOAT_RGBA_BITS = 128
# The custom property of the image that names its content; undo restores it with the packed file.
STAMP = "scfpf_render"

# The stamp of the pixels in memory, which undo does not restore.
_in_memory = ""


def result_image():
    """The image datablock of the last render, or None."""
    return bpy.data.images.get((IMAGE_NAME, None))


def write_result(pixels: Single):
    """Make a finished image the datablock's content; return the datablock.

    pixels: (H, W, 4) float32, scene-linear, premultiplied, row 0 at the bottom. An existing datablock is
    resized, so that editors go on showing it.
    """
    show_progress(pixels)
    keep_result()
    return result_image()


def keep_result() -> str:
    """Pack the image that ``show_progress`` showed; return a warning if it is too large for that, else "".

    The file is as large as the image: callers should release their own pixels before.
    """
    global _in_memory
    image = result_image()
    warning = pack(image)
    _in_memory = image[STAMP] = uuid.uuid4().hex
    return warning


def only_in_memory() -> bool:
    """Return whether the last image is neither packed, because it is too large, nor saved."""
    image = result_image()
    return image is not None and not image.packed_file and STAMP in image and image.is_dirty


def show_progress(pixels: Single):
    """Show an image in the making: faster than ``write_result``, but lost on reload and undo."""
    height, width = pixels.shape[:2]
    image = _prepared_image(width, height)
    image.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).reshape(-1))
    image.update()
    redraw_image_editors()
    return image


def discard_progress() -> None:
    """Undo ``show_progress``: restore the last finished image, or remove the datablock."""
    image = result_image()
    if image is None:
        return
    if image.packed_file or image.filepath:
        image.buffers_free()
    else:
        bpy.data.images.remove(image)
    redraw_image_editors()


def redraw_image_editors() -> None:
    """Redraw every Image Editor."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                area.tag_redraw()


def _prepared_image(width: int, height: int):
    """The datablock with a float buffer of a size and the settings of a render."""
    image = result_image()
    if image is not None and not (image.is_float and image.depth == FLOAT_RGBA_BITS):
        # An image of the user's by this name, or one whose file is gone: it cannot hold a render.
        image.name = f"{IMAGE_NAME} (other)"
        image = None
    if image is None:
        image = bpy.data.images.new(IMAGE_NAME, width, height, alpha=True, float_buffer=True)
    _set(image, "alpha_mode", "PREMUL")
    _set(image, "colorspace_settings.name", _scene_linear())
    if tuple(image.size) != (width, height):
        image.scale(width, height)
    image.use_view_as_render = True
    # Without a user the datablock would not be saved.
    image.use_fake_user = True
    return image


def _set(image, path: str, value: str) -> None:
    """Set a property if it differs, because Blender reloads the image's buffer whenever it is set."""
    if image.path_resolve(path) != value:
        owner, _, name = path.rpartition(".")
        setattr(image.path_resolve(owner) if owner else image, name, value)


def _scene_linear() -> str:
    """The name of the file's working colour space, which Blender gives a new float image."""
    probe = bpy.data.images.new(IMAGE_NAME, 1, 1, float_buffer=True)
    name = probe.colorspace_settings.name
    bpy.data.images.remove(probe)
    return name


def history_changed() -> None:
    """Read the pixels again after undo or redo, which Blender does not."""
    global _in_memory
    image = result_image()
    if image is None or image.get(STAMP, "") == _in_memory or not (image.packed_file or STAMP in image):
        return
    # Blender reads the pixels again from the packed file. An image that was too large to be packed is lost,
    # and no other image may replace it.
    image.buffers_free()
    _in_memory = image.get(STAMP, "")
    redraw_image_editors()
