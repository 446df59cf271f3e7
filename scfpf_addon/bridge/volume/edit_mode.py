# SPDX-License-Identifier: GPL-3.0-or-later
"""Edit-volume mode: a camera's control surfaces shown in front and free for clicking, else out of the way.

The mode is ``Object.scfpf.edit_volume``; what it does is in the surfaces' own switches, so that undo,
files and Blender's selection need nothing of ours. Out of the mode a surface that Blender draws as a wire is
drawn as its box: the many black edges would run through our lines. A dense mesh stays one in the mode.
"""

from __future__ import annotations

import bpy

# Meshes of more faces stay boxes in the mode too: in a whole view, lines are a dozen pixels apart then.
MOST_WIRED = 1024


class EditVolumeError(ValueError):
    """A camera or a surface that the mode cannot change; the message says what to do."""


def set_edit_volume(camera, on: bool) -> None:
    """Switch the mode of one camera; a surface that another camera has too stays free while that is in it.

    Raises EditVolumeError for a camera or a surface that is linked from another file; then nothing changes.
    """
    for obj in (camera, *_surfaces(camera)):
        if not obj.is_editable:
            raise EditVolumeError(
                f"'{obj.name}' is linked from another file: make a library override of it first"
            )
    camera.scfpf.edit_volume = on


def obey(camera) -> None:
    """Let a camera's surfaces follow the modes of the cameras that have them; linked ones stay."""
    cameras = _cameras()
    for surface in _surfaces(camera):
        if surface.is_editable:
            free = in_edit_volume(surface, cameras)
            _set(surface, not free, free)


def in_edit_volume(surface, cameras=None) -> bool:
    """Whether a camera that has the surface is in the mode. cameras: all of the file, if they are known."""
    return any(
        other.scfpf.edit_volume and surface in _surfaces(other) and other.users_collection
        for other in cameras or _cameras()
    )


def release(surface) -> None:
    """Give a surface that a list has lost the switches of an ordinary object, if no list has it now.

    A deleted camera that lives on for a pointer does not count.
    """
    if not surface.is_editable:
        return
    cameras = _cameras()
    listed = any(surface in _surfaces(other) and other.users_collection for other in cameras)
    free = in_edit_volume(surface, cameras)
    _set(surface, listed and not free, free)


def _set(surface, hide_select: bool, in_front: bool) -> None:
    if surface.hide_select != hide_select:
        surface.hide_select = hide_select
    if surface.show_in_front != in_front:
        surface.show_in_front = in_front
    # A mesh of the artist's own that is drawn otherwise stays so.
    as_box = hide_select or (in_front and _is_dense(surface))
    before, after = ("WIRE", "BOUNDS") if as_box else ("BOUNDS", "WIRE")
    if surface.display_type == before:
        surface.display_type = after


def _is_dense(surface) -> bool:
    """Whether a surface's wires would cover it all with black."""
    return surface.type == "MESH" and len(surface.data.polygons) > MOST_WIRED


def _surfaces(camera) -> list:
    return [slot.object for slot in camera.scfpf.surfaces if slot.object is not None]


def _cameras():
    # Whether they are in a collection is asked of few: that looks through all collections.
    return [obj for obj in bpy.data.objects if obj.type == "CAMERA" and obj.scfpf.surfaces]
