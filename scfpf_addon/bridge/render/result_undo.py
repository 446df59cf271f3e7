# SPDX-License-Identifier: GPL-3.0-or-later
"""Keeps the picture that is shown and the picture that is saved the same when the user undoes a render.

Undo takes the image datablock's packed file back but leaves its pixels in memory
alone: without this module an editor would show the newer picture and a saved file
would hold the older one.
"""

from __future__ import annotations

import uuid

import bpy
from bpy.app.handlers import persistent

from .result_image import redraw_image_editors, result_image

# The custom property of the image that names its content; undo takes it back with the packed file.
STAMP = "scfpf_render"

# The stamp of the pixels in memory: what undo does not take back.
_in_memory = ""


def stamp_result(image) -> None:
    """Call after a new picture was written to the image datablock."""
    global _in_memory
    _in_memory = image[STAMP] = uuid.uuid4().hex


def only_in_memory() -> bool:
    """Whether the last picture is too large for the file and not saved, so that nothing brings it back."""
    image = result_image()
    return image is not None and not image.packed_file and STAMP in image and image.is_dirty


@persistent
def _after_undo(_scene, _depsgraph=None) -> None:
    global _in_memory
    image = result_image()
    if image is None or image.get(STAMP, "") == _in_memory or not (image.packed_file or STAMP in image):
        return
    # The pixels are read again from the packed file when they are asked for. What was too large to be packed
    # is lost, and no other picture may stand for it.
    image.buffers_free()
    _in_memory = image.get(STAMP, "")
    redraw_image_editors()


def register():
    bpy.app.handlers.undo_post.append(_after_undo)
    bpy.app.handlers.redo_post.append(_after_undo)


def unregister():
    bpy.app.handlers.redo_post.remove(_after_undo)
    bpy.app.handlers.undo_post.remove(_after_undo)
