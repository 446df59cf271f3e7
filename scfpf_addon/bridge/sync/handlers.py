# SPDX-License-Identifier: GPL-3.0-or-later
"""Volume objects follow what happens to their cameras outside our own operators.

Duplicating, pasting, linking, undoing or deleting a camera leaves its volume
object shared, in the wrong place or behind, and the surfaces of a deleted one out
of reach of the mouse. A handler after each evaluation puts that right. It compares
a few numbers of those cameras that the evaluation concerns, and of one more in turn: scripts
may take surfaces off a list without a word to Blender.
"""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np
from bpy.app.handlers import persistent

from ..blender import versions
from ..volume.edit_mode import release
from ..volume.volume_object import (
    delete_volume_object,
    members,
    release_pointers,
    restore_pointers,
    sync_volume_object,
    volume_facts,
)
from .camera_index import CameraIndex
from .surface_sync import FollowingSurfaces, hide_with_cameras, show_again


class _Upkeep:
    """Names and numbers only, no Blender data. facts: by camera; None before the first look at a file."""

    def __init__(self):
        self.index = CameraIndex()
        self.file: tuple = ()
        self.facts: dict[int, tuple] | None = None
        self.listed: set[tuple[int, int]] = set()  # surfaces and their cameras, session ids
        self.following = FollowingSurfaces()
        self.mended: set[int] = set()  # cameras whose volume objects were changed since the last undo
        self.released: dict[int, int] = {}  # their volume objects, while Blender undoes


_upkeep = _Upkeep()


def forget() -> None:
    """Put every camera in order after the next evaluation, whatever it looks like."""
    _upkeep.facts = None


def sync(concerned: Iterable[int] | None = None) -> None:
    """Put the volume objects of flexible cameras in order, where anything about them has changed.

    concerned: session ids of the cameras that may have changed, None for all of them.
    """
    facts, file = _upkeep.facts, _file_facts()
    if facts is not None and concerned is not None and file == _upkeep.file:
        found = {uid: _upkeep.index.find(uid) for uid in concerned}
        if all(camera and volume_facts(camera) == facts[uid] for uid, camera in found.items()):
            return
    cameras = _camera_objects()
    changed = cameras
    if facts is not None and file[1] == _upkeep.file[1]:
        now = {camera.session_uid: volume_facts(camera) for camera in cameras}
        if now == facts and file == _upkeep.file:
            _look_up(cameras)  # they may have other names
            return
        changed = [camera for camera in cameras if now[camera.session_uid] != facts.get(camera.session_uid)]
    _put_in_order(cameras, changed)
    versions.settle_view_layers()
    _look_up(cameras)
    _upkeep.file, _upkeep.facts = _file_facts(), {c.session_uid: volume_facts(c) for c in cameras}


def _put_in_order(cameras, changed) -> None:
    """Mend the volume objects of ``changed`` and what belongs to no camera any more. cameras: all of them."""
    shown = _session_ids(scene.objects for scene in bpy.data.scenes)
    for camera in changed:
        # Not those that were deleted and live on for a pointer.
        if camera.scfpf.enabled and camera.session_uid in shown:
            before = volume_facts(camera)
            sync_volume_object(camera)
            if volume_facts(camera) != before:
                _upkeep.mended.add(camera.session_uid)
    linked = _session_ids(
        c.objects for c in (*bpy.data.collections, *(s.collection for s in bpy.data.scenes))
    )
    there = [camera for camera in cameras if camera.session_uid in linked]
    owned = {camera.scfpf.volume_object for camera in there}
    for obj in bpy.data.objects:
        # An override would come back with the library's next reload.
        is_left = obj.scfpf_surface.is_volume and obj not in owned
        if is_left and obj.is_editable and not obj.override_library:
            delete_volume_object(obj)
    _upkeep.following.follow(there)
    _free_surfaces(there)


def _camera_objects() -> list:
    return [obj for obj in bpy.data.objects if obj.type == "CAMERA"]


def _look_up(cameras) -> None:
    _upkeep.index.fill(cameras, _depends_on)


def _depends_on(camera) -> list:
    settings = camera.scfpf
    return [obj for obj in (settings.volume_object, *members(settings)) if obj is not None]


def _session_ids(collections) -> set[int]:
    """The session ids of all objects in the collections given."""
    found: set[int] = set()
    for objects in collections:
        numbers = np.empty(len(objects), np.int32)
        objects.foreach_get("session_uid", numbers)
        found.update(numbers.tolist())
    return found


def concerned(depsgraph) -> set[int]:
    """Session ids of the cameras whose volumes an evaluation's updates may have changed."""
    return _upkeep.index.concerned(depsgraph)


def camera_objects() -> list:
    """The camera objects of the file as of the last look; quick unless one has gone or has another name."""
    found = [_upkeep.index.find(uid) for uid in _upkeep.index.cameras()]
    return _camera_objects() if None in found else found


def sharers(camera) -> list[str]:
    """Names of the other cameras that have control surfaces of this one; for panels, which must be quick."""
    own = {slot.object for slot in camera.scfpf.surfaces if slot.object is not None}
    others = {uid for surface in own for uid in _upkeep.index.having(surface)} - {camera.session_uid}
    known = (_upkeep.index.find(uid) for uid in others)
    return sorted(
        other.name
        for other in known
        if other is not None
        and not own.isdisjoint(slot.object for slot in other.scfpf.surfaces)
        and other.users_collection
    )


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
            show_again(obj)


def _file_facts() -> tuple:
    """What changes when a camera object or a scene comes or goes."""
    cameras = bpy.data.cameras
    numbers = np.empty((2, len(cameras)), np.int32)
    cameras.foreach_get("session_uid", numbers[0])
    # A camera object that comes or goes is one user of its data more or less.
    cameras.foreach_get("users", numbers[1])
    return numbers.tobytes(), tuple(scene.session_uid for scene in bpy.data.scenes)


@persistent
def _evaluated(scene, depsgraph):
    # A render job reads the file from another thread.
    if depsgraph.mode != "VIEWPORT" or bpy.app.is_job_running("RENDER"):
        return
    is_new = _upkeep.facts is None
    sync(None if is_new else concerned(depsgraph) | _upkeep.index.in_turn())
    # What hides anything is told as an edit of the scene.
    if is_new or depsgraph.id_type_updated("SCENE"):
        _hide_surfaces(scene, scene.view_layers[depsgraph.view_layer.name])


def _hide_surfaces(scene, view_layer) -> None:
    if len(_upkeep.index):
        hide_with_cameras(scene, view_layer, _camera_objects())
        versions.settle_view_layers()


@persistent
def _render_begins(*_):
    # A script may duplicate a camera and render before anything was evaluated. In a
    # window the render is a job, and what precedes it was evaluated.
    if not bpy.app.is_job_running("RENDER"):
        sync()


@persistent
def _history_changes(*_):
    """Release what handlers have made before undo and redo: the next step may lack it."""
    changed = [camera for camera in _camera_objects() if camera.session_uid in _upkeep.mended]
    _upkeep.released = {camera.session_uid: release_pointers(camera) for camera in changed}
    _upkeep.mended.clear()


@persistent
def _redone(*_):
    # Objects may have other names, and pointers have moved. What was removed after the step was stored
    # is there again, though all cameras may be as they were before.
    forget()
    released, _upkeep.released = _upkeep.released, {}
    objects = {obj.session_uid: obj for obj in bpy.data.objects} if released else {}
    for camera, volume in released.items():
        if camera in objects and volume in objects:
            restore_pointers(objects[camera], objects[volume])
    # Blender calls no handler for the evaluation of a scene that the step has brought back.
    sync()
    _hide_surfaces(bpy.context.scene, bpy.context.view_layer)


@persistent
def _undone(*_):
    _upkeep.following.undone()
    _redone()


@persistent
def _saving(*_):
    # A script may delete a camera and save before anything was evaluated.
    sync()


@persistent
def _loaded(*_):
    # Overrides may have been taken back to what the library has; nothing need be evaluated after a load.
    forget()
    _upkeep.mended.clear()
    _upkeep.following.clear()
    sync()


HANDLERS = {
    "depsgraph_update_post": _evaluated,
    "render_init": _render_begins,
    "save_pre": _saving,
    "undo_pre": _history_changes,
    "redo_pre": _history_changes,
    "undo_post": _undone,
    "redo_post": _redone,
    "load_post": _loaded,
}


def register():
    forget()
    for name, function in HANDLERS.items():
        getattr(bpy.app.handlers, name).append(function)


def unregister():
    for name, function in HANDLERS.items():
        getattr(bpy.app.handlers, name).remove(function)
