# SPDX-License-Identifier: GPL-3.0-or-later
"""Handlers that keep volume objects and control surfaces consistent with their cameras.

Duplicating, pasting, linking, undoing or deleting a camera leaves its volume object shared, misplaced or
without a camera. The surfaces of a deleted camera stay unselectable. A handler repairs that after each
evaluation. It compares a few numbers of the cameras that the evaluation concerns. It also checks one more
camera each time, as scripts can change a list without Blender telling the handlers.
"""

from __future__ import annotations

from collections.abc import Iterable

import bpy
import numpy as np

from ..blender import versions
from ..volume.camera_members import all_cameras, surfaces_of
from ..volume.edit_mode import release
from ..volume.volume_object import (
    delete_volume_object,
    release_pointers,
    restore_pointers,
    sync_volume_object,
    volume_facts,
)
from .camera_index import CameraIndex
from .surface_sync import MadeSurfaces, hide_with_cameras, show_again


class _SyncState:
    """The file as the last sync left it, in names, session ids and numbers; no Blender data.

    facts: of each camera, None before the first sync of a file. listed: pairs of a surface and its camera.
    repaired: cameras whose volume objects handlers have changed since the last step of undo.
    released: the volume objects of these cameras, while Blender undoes. objects: their number in the file.
    """

    def __init__(self):
        self.index = CameraIndex()
        self.file: tuple = ()
        self.facts: dict[int, tuple] | None = None
        self.listed: set[tuple[int, int]] = set()
        self.surfaces = MadeSurfaces()
        self.repaired: set[int] = set()
        self.released: dict[int, int] = {}
        self.objects = 0


_state = _SyncState()


def forget() -> None:
    """Let the next sync check every camera, whether it has changed or not."""
    _state.facts = None


def sync(concerned: Iterable[int] | None = None) -> None:
    """Repair the volume objects of flexible cameras that have changed since the last sync.

    concerned: session ids of the cameras that may have changed, None for all of them.
    """
    facts, file = _state.facts, _file_facts()
    if facts is not None and concerned is not None and file == _state.file:
        found = {uid: _state.index.find(uid) for uid in concerned}
        if all(camera and volume_facts(camera) == facts[uid] for uid, camera in found.items()):
            return
    cameras = changed = all_cameras()
    if facts is not None and file[1] == _state.file[1]:
        now = {camera.session_uid: volume_facts(camera) for camera in cameras}
        if now == facts and file == _state.file:
            # The cameras may have other names.
            _state.index.fill(cameras)
            return
        changed = [camera for camera in cameras if now[camera.session_uid] != facts.get(camera.session_uid)]
    _repair(cameras, changed)
    versions.settle_view_layers()
    _state.index.fill(cameras)
    _state.file, _state.facts = _file_facts(), {c.session_uid: volume_facts(c) for c in cameras}


def _repair(cameras, changed) -> None:
    """Repair the volume objects of ``changed``, and what belongs to deleted cameras. cameras: all of them."""
    in_scenes = _session_ids(scene.objects for scene in bpy.data.scenes)
    for camera in changed:
        # A deleted camera stays in the file while a pointer refers to it.
        if camera.scfpf.enabled and camera.session_uid in in_scenes:
            before = volume_facts(camera)
            sync_volume_object(camera)
            if volume_facts(camera) != before:
                _state.repaired.add(camera.session_uid)
    linked = _session_ids(
        c.objects for c in (*bpy.data.collections, *(s.collection for s in bpy.data.scenes))
    )
    existing = [camera for camera in cameras if camera.session_uid in linked]
    owned = {camera.scfpf.volume_object for camera in existing}
    for obj in bpy.data.objects:
        # Reloading the library would bring an override back.
        is_left = obj.scfpf_surface.is_volume and obj not in owned
        if is_left and obj.is_editable and not obj.override_library:
            delete_volume_object(obj)
    _state.surfaces.sync(existing)
    _release_lost_surfaces(existing)


def _session_ids(collections) -> set[int]:
    """The session ids of all objects in the collections given."""
    found: set[int] = set()
    for objects in collections:
        numbers = np.empty(len(objects), np.int32)
        objects.foreach_get("session_uid", numbers)
        found.update(numbers.tolist())
    return found


def concerned(depsgraph) -> set[int]:
    """Session ids of the cameras whose volumes an evaluation may have changed."""
    return _state.index.concerned(depsgraph)


def camera_objects() -> list:
    """The camera objects of the file at the last sync; fast unless one is gone or renamed."""
    found = [_state.index.find(uid) for uid in _state.index.cameras()]
    return all_cameras() if None in found else found


def sharers(camera) -> list[str]:
    """Names of the other cameras that share control surfaces with this one; fast enough for panels."""
    own = set(surfaces_of(camera))
    others = {uid for surface in own for uid in _state.index.having(surface)} - {camera.session_uid}
    known = (_state.index.find(uid) for uid in others)
    return sorted(
        other.name
        for other in known
        if other is not None and not own.isdisjoint(surfaces_of(other)) and other.users_collection
    )


def _release_lost_surfaces(cameras) -> None:
    """Make surfaces that a camera has lost ordinary objects, unless another camera has them."""
    pairs = [(surface, camera) for camera in cameras for surface in surfaces_of(camera)]
    listed = {surface for surface, _ in pairs}
    now = {(surface.session_uid, camera.session_uid) for surface, camera in pairs}
    lost = {uid for uid, _ in _state.listed - now}
    _state.listed = now
    for obj in bpy.data.objects:
        if obj.scfpf_surface.kind == "NONE":
            continue
        # The artist may have put a surface that was on no list in front.
        if obj.session_uid in lost or (obj.hide_select and obj not in listed):
            release(obj)
            show_again(obj)


def _file_facts() -> tuple:
    """Numbers that change when a camera object or a scene is added or removed."""
    cameras = bpy.data.cameras
    numbers = np.empty((2, len(cameras)), np.int32)
    cameras.foreach_get("session_uid", numbers[0])
    # Each camera object is a user of its data.
    cameras.foreach_get("users", numbers[1])
    return numbers.tobytes(), tuple(scene.session_uid for scene in bpy.data.scenes)


def scene_updated(scene, depsgraph) -> None:
    """Repair the cameras that an evaluation concerns."""
    # A render job reads the file in another thread.
    if depsgraph.mode != "VIEWPORT" or bpy.app.is_job_running("RENDER"):
        return
    is_new, before = _state.facts is None, _state.objects
    _state.objects = len(bpy.data.objects)
    # The evaluation of one scene does not concern the camera of another that has lost its volume object.
    checks_all = is_new or _state.objects < before
    sync(None if checks_all else concerned(depsgraph) | _state.index.in_turn())
    # Hiding anything counts as an edit of the scene.
    if is_new or depsgraph.id_type_updated("SCENE"):
        _hide_surfaces(scene, scene.view_layers[depsgraph.view_layer.name])


def _hide_surfaces(scene, view_layer) -> None:
    if len(_state.index):
        hide_with_cameras(scene, view_layer, all_cameras())
        versions.settle_view_layers()


def render_begins(_scene) -> None:
    """Repair all cameras before a render in the background."""
    # A script may duplicate a camera and render before anything is evaluated. With a window the render is a
    # job, and everything before it has been evaluated.
    if not bpy.app.is_job_running("RENDER"):
        sync()


def release_for_history() -> None:
    """Clear the pointers that handlers have set, before undo and redo.

    Handlers change datablocks after Blender has stored a step. The next step may lack the objects that they
    have made. Blender then frees these objects but may keep datablocks that point to them.
    """
    repaired = [camera for camera in all_cameras() if camera.session_uid in _state.repaired]
    _state.released = {camera.session_uid: release_pointers(camera) for camera in repaired}
    _state.repaired.clear()


def restore_redone() -> None:
    """Set the pointers again after redo, and repair all cameras."""
    # Objects may have other names and addresses. Deleted ones may exist again although no camera has changed.
    forget()
    released, _state.released = _state.released, {}
    objects = {obj.session_uid: obj for obj in bpy.data.objects} if released else {}
    for camera, volume in released.items():
        if camera in objects and volume in objects:
            restore_pointers(objects[camera], objects[volume])
    # Blender calls no handler when it evaluates a scene that the step has brought back.
    sync()
    _hide_surfaces(bpy.context.scene, bpy.context.view_layer)


def restore_undone() -> None:
    """Set the pointers again after undo, and repair all cameras."""
    _state.surfaces.forget_owners()
    restore_redone()


def file_saves() -> None:
    """Repair all cameras before the file is written."""
    # A script may delete a camera and save before anything is evaluated.
    sync()


def file_loaded() -> None:
    """Repair all cameras of a file that Blender has loaded."""
    # Overrides may have been reset to the library's values, and a load need not evaluate anything.
    forget()
    _state.repaired.clear()
    _state.surfaces.clear()
    sync()
