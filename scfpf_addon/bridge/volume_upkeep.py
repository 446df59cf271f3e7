# SPDX-License-Identifier: GPL-3.0-or-later
"""Volume objects follow what happens to their cameras outside our own operators.

Duplicating, pasting, linking, undoing or deleting a camera leaves its volume
object shared, in the wrong place or behind, and the surfaces of a deleted one out
of reach of the mouse. A handler after each evaluation puts that right. It compares
a few numbers of each camera first, so that it costs next to nothing while none of
them has changed.
"""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent

from . import versions
from .edit_volume import release
from .volume_object import delete_volume_object, sync_volume_object, volume_facts


class _Upkeep:
    """Names and numbers only, no Blender data. facts: None before the first look at a file."""

    def __init__(self):
        self.cameras: list[tuple[str, str | None]] = []
        self.facts: tuple | None = None
        self.listed: set[tuple[int, int]] = set()  # surfaces and their cameras, session ids


_upkeep = _Upkeep()


def forget() -> None:
    """Look at every object again after the next evaluation."""
    _upkeep.facts = None


def tend() -> None:
    """Put the volume objects of all flexible cameras in order, if anything about them has changed."""
    if _upkeep.facts is not None and _facts() == _upkeep.facts:
        return
    cameras = [obj for obj in bpy.data.objects if obj.type == "CAMERA"]
    for camera in cameras:
        # Not those that were deleted and live on for a pointer.
        if camera.scfpf.enabled and camera.users_scene:
            sync_volume_object(camera)
    owned = {camera.scfpf.volume_object for camera in cameras}
    for obj in bpy.data.objects:
        # An override would come back with the library's next reload.
        is_left = obj.scfpf_surface.is_volume and obj not in owned
        if is_left and obj.is_editable and not obj.override_library:
            delete_volume_object(obj)
    _free_surfaces([camera for camera in cameras if camera.users_collection])
    _upkeep.cameras = [(o.name, o.library.filepath if o.library else None) for o in cameras]
    _upkeep.facts = _facts()
    versions.settle_view_layers()


def sharers(camera) -> list[str]:
    """Names of the other cameras that have control surfaces of this one; for panels, which must be quick."""
    own = {slot.object for slot in camera.scfpf.surfaces if slot.object is not None}
    known = (bpy.data.objects.get(key) for key in _upkeep.cameras)
    return [
        other.name
        for other in known
        if other not in (None, camera)
        and other.users_collection
        and not own.isdisjoint(slot.object for slot in other.scfpf.surfaces)
    ]


def _free_surfaces(cameras) -> None:
    """Surfaces that a camera has lost become ordinary, or follow another that has them."""
    pairs = [(slot.object, camera) for camera in cameras for slot in camera.scfpf.surfaces if slot.object]
    listed = {surface for surface, _ in pairs}
    now = {(surface.session_uid, camera.session_uid) for surface, camera in pairs}
    lost = {uid for uid, _ in _upkeep.listed - now}
    _upkeep.listed = now
    for obj in bpy.data.objects:
        if obj.scfpf_surface.kind == "NONE":
            continue
        # Being in front may be the artist's own wish, of one that was on no list before.
        if obj.session_uid in lost or (obj.hide_select and obj not in listed):
            release(obj)


def _facts() -> tuple:
    """What changes when a flexible camera comes, goes or is edited; cheap in a file of many objects."""
    known = [bpy.data.objects.get(key) for key in _upkeep.cameras]
    return (
        # A camera object that comes or goes is one user of its data more or less.
        tuple((data.session_uid, data.users) for data in bpy.data.cameras),
        tuple(scene.session_uid for scene in bpy.data.scenes),
        tuple(None if camera is None else volume_facts(camera) for camera in known),
    )


@persistent
def _evaluated(_scene, depsgraph):
    # A render job reads the file from another thread.
    if depsgraph.mode != "VIEWPORT" or bpy.app.is_job_running("RENDER"):
        return
    tend()


@persistent
def _render_begins(*_):
    # A script may duplicate a camera and render before anything was evaluated. In a
    # window the render is a job, and what precedes it was evaluated.
    if not bpy.app.is_job_running("RENDER"):
        tend()


@persistent
def _undone(*_):
    forget()


@persistent
def _loaded(*_):
    # Overrides may have been taken back to what the library has; nothing need be evaluated after a load.
    forget()
    tend()


HANDLERS = {
    "depsgraph_update_post": _evaluated,
    "render_init": _render_begins,
    "undo_post": _undone,
    "redo_post": _undone,
    "load_post": _loaded,
}


def register():
    forget()
    for name, function in HANDLERS.items():
        getattr(bpy.app.handlers, name).append(function)


def unregister():
    for name, function in HANDLERS.items():
        getattr(bpy.app.handlers, name).remove(function)
