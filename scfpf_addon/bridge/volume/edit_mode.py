# SPDX-License-Identifier: GPL-3.0-or-later
"""The Edit Volume mode: a camera's control surfaces are in front and selectable in it, else unselectable.

The mode is ``Object.scfpf.edit_volume``. It sets display properties of the surfaces, which undo, files and
Blender's selection handle. Outside of the mode, wires become bounding boxes: their many black edges would
cover the lines of the overlay. A dense mesh remains a box in the mode.
"""

from __future__ import annotations

from ...projection.user_error import UserError
from ..blender.all_or_nothing import keep
from .camera_members import all_cameras, cameras_with, surfaces_of

# Meshes of more faces are always boxes: their wires would be less than a dozen pixels apart.
MOST_WIRED = 1024


def set_edit_volume(camera, on: bool) -> None:
    """Switch the mode of one camera. A surface stays selectable while another of its cameras is in the mode.

    Raises UserError for a camera or a surface that is linked from another file; then nothing changes.
    """
    for obj in (camera, *surfaces_of(camera)):
        if not obj.is_editable:
            raise UserError(
                "'{0}' is linked from another file: make a library override of it first", obj.name
            )
    camera.scfpf.edit_volume = on


def show_by_mode(camera) -> None:
    """Show the editable surfaces of a camera as the modes of all their cameras demand."""
    cameras = all_cameras()
    for surface in surfaces_of(camera):
        if surface.is_editable:
            is_edited = _is_edited(cameras_with(surface, cameras=cameras))
            _show(surface, not is_edited, is_edited)


def release(surface) -> None:
    """Show a surface that a list has lost as an ordinary object, unless another list has it."""
    if not surface.is_editable:
        return
    # A deleted camera stays in the file while a pointer refers to it.
    cameras = [camera for camera in cameras_with(surface) if camera.users_collection]
    is_edited = _is_edited(cameras)
    _show(surface, bool(cameras) and not is_edited, is_edited)


def _is_edited(cameras) -> bool:
    """Return whether one of the cameras that have a surface is in the mode, and is not deleted."""
    return any(camera.scfpf.edit_volume and camera.users_collection for camera in cameras)


def _show(surface, hide_select: bool, in_front: bool) -> None:
    keep(surface, "hide_select", "show_in_front", "display_type")
    if surface.hide_select != hide_select:
        surface.hide_select = hide_select
    if surface.show_in_front != in_front:
        surface.show_in_front = in_front
    # Other display types are the artist's choice.
    as_box = hide_select or (in_front and _is_dense(surface))
    before, after = ("WIRE", "BOUNDS") if as_box else ("BOUNDS", "WIRE")
    if surface.display_type == before:
        surface.display_type = after


def _is_dense(surface) -> bool:
    """Return whether a surface's wires would cover it with black."""
    return surface.type == "MESH" and len(surface.data.polygons) > MOST_WIRED
