# SPDX-License-Identifier: GPL-3.0-or-later
"""Control surfaces are hidden, shown, deleted and restored with their camera.

A surface that is hidden with its camera is marked with the view layer's name, so that surfaces which the
artist has hidden stay hidden. Only surfaces that were made for the camera are deleted with it.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import NamedTuple

import bpy

from ..blender.rig_mark import is_rig_part
from ..blender.scene_objects import delete_with_data, editable_collections, holds
from ..surfaces.kinds import PARAMETRIC_KINDS
from ..volume.camera_members import surfaces_of

# The start of a mark, before the view layer's name: hidden by this module, or by the artist before.
OURS, ARTIST = "+", "-"


class _Deleted(NamedTuple):
    """The camera of a surface that was deleted with it, and the surface's collections, as session ids."""

    camera: int
    collections: tuple[int, ...]


class MadeSurfaces:
    """The surfaces that were made for cameras, at the last sync, in session ids.

    _own: the camera of each surface that exists. _cameras: all cameras. _deleted: surfaces that were deleted
    with their camera, which undo may bring back.
    """

    def __init__(self) -> None:
        self._own: dict[int, int] = {}
        self._cameras: set[int] = set()
        self._deleted: dict[int, _Deleted] = {}

    def clear(self) -> None:
        """Forget everything, for another file."""
        self.__init__()

    def forget_owners(self) -> None:
        """Keep existing surfaces after undo: a surface without a camera may belong to the restored step."""
        self._own.clear()

    def sync(self, cameras: Iterable) -> None:
        """Delete the surfaces of deleted cameras; link those that undo has brought back with their camera.

        cameras: all that are in a collection.
        """
        existing = {camera.session_uid: camera for camera in cameras}
        listed = {surface for camera in existing.values() for surface in surfaces_of(camera)}
        known = self._own.keys() | self._deleted.keys()
        lost = []
        for obj in list(bpy.data.objects) if known else ():
            uid = obj.session_uid
            if uid not in known:
                continue
            camera = existing.get(self._camera_of(uid))
            if camera is None and obj not in listed and _may_go(obj, self._camera_of(uid)):
                lost.append(obj)
            elif camera is not None and uid in self._deleted:
                self._bring_back(obj, camera, obj in listed)
        self._delete(lost)
        self._cameras = set(existing)
        self._own = {
            surface.session_uid: uid
            for uid, camera in existing.items()
            for surface in surfaces_of(camera)
            if surface.parent == camera and is_made(surface)
        }

    def _camera_of(self, uid: int) -> int:
        return self._own[uid] if uid in self._own else self._deleted[uid].camera

    def _bring_back(self, surface, camera, is_listed: bool) -> None:
        """Link a restored surface to its former collections, which undo need not have restored.

        A surface that the artist has deleted or taken off the list is not linked again.
        """
        deleted = self._deleted[surface.session_uid]
        is_back = camera.session_uid not in self._cameras
        if is_listed and is_back and not surface.users_collection:
            roots = [scene.collection for scene in bpy.data.scenes]
            where = [c for c in (*bpy.data.collections, *roots) if c.session_uid in deleted.collections]
            for collection in [c for c in where if c.is_editable] or editable_collections(camera):
                collection.objects.link(surface)
        elif not is_listed or not surface.users_collection:
            del self._deleted[surface.session_uid]

    def _delete(self, lost: list) -> None:
        uses = bpy.data.user_map(subset=set(lost)) if lost else {}
        for surface in lost:
            if any(_is_used_by(user) for user in uses[surface] - {surface}):
                continue
            collections = tuple(c.session_uid for c in surface.users_collection)
            self._deleted[surface.session_uid] = _Deleted(self._camera_of(surface.session_uid), collections)
            delete_with_data(surface)


def is_made(surface) -> bool:
    """Return whether the extension made a surface for a camera. Older files do not mark parametric ones."""
    own = surface.scfpf_surface
    return own.is_made or (
        own.kind in PARAMETRIC_KINDS and surface.type == "MESH" and not surface.data.vertices
    )


def _may_go(surface, camera: int) -> bool:
    """Return whether a surface may be deleted with a camera, given by its session id.

    Mark and parent are read again, as they may have changed without a notice.
    """
    if not is_made(surface) or (surface.parent is not None and surface.parent.session_uid != camera):
        return False
    return bool(surface.users_collection) and surface.is_editable and not surface.override_library


def _is_used_by(user) -> bool:
    """Return whether a datablock that refers to a surface keeps it: the artist's objects and data do."""
    if isinstance(user, (bpy.types.Collection, bpy.types.Scene)):
        return False
    if not isinstance(user, bpy.types.Object):
        return True
    # Tables, and deleted cameras that a pointer keeps in the file, are in no collection.
    return bool(user.users_collection) and not user.scfpf_surface.is_volume and not is_rig_part(user)


def hide_with_cameras(scene, view_layer, cameras: Iterable) -> None:
    """Hide the surfaces whose cameras are all hidden in a view layer; show the others again.

    cameras: all of the file. This sets the eye, as H does. Linked surfaces stay unchanged.
    """
    shown: dict = {}
    # Without the scene's own collection: it cannot be hidden, yet in new scenes it is not marked visible.
    layers = _layers(view_layer.layer_collection)[1:]
    hidden = {layer.collection.session_uid for layer in layers if not layer.is_visible}
    for camera in cameras:
        if not holds(view_layer.objects, camera):
            continue
        visible = _is_visible(camera, view_layer, hidden)
        for surface in surfaces_of(camera):
            if surface.is_editable:
                shown[surface] = shown.get(surface, False) or visible
    for surface, is_shown in shown.items():
        _follow_eye(surface, scene, view_layer, is_shown)


def _layers(layer) -> list:
    return [layer, *(inner for child in layer.children for inner in _layers(child))]


def _is_visible(camera, view_layer, hidden: set[int]) -> bool:
    """Return whether a view layer shows a camera. hidden: collections that it does not show.

    ``Object.visible_get`` also considers the local view of the context's viewport.
    """
    if camera.hide_viewport or camera.hide_get(view_layer=view_layer):
        return False
    return not hidden or any(c.session_uid not in hidden for c in camera.users_collection)


def show_again(surface) -> None:
    """Show a surface in all view layers in which it was hidden with a former camera."""
    for scene in bpy.data.scenes if surface.scfpf_surface.hidden_in else ():
        for view_layer in scene.view_layers:
            _follow_eye(surface, scene, view_layer, True)


def _follow_eye(surface, scene, view_layer, is_shown: bool) -> None:
    """Hide or show a surface in a view layer, and write or remove its mark."""
    marks = surface.scfpf_surface.hidden_in.splitlines()
    place = f"{scene.name}/{view_layer.name}"
    mark = next((m for m in marks if m[1:] == place), None)
    if is_shown == (mark is None) or not holds(view_layer.objects, surface):
        return
    if is_shown:
        marks.remove(mark)
        if mark[0] == OURS:
            surface.hide_set(False, view_layer=view_layer)
            # Alt-H selects everything that it shows.
            if surface.hide_select and surface.select_get(view_layer=view_layer):
                surface.select_set(False, view_layer=view_layer)
    else:
        hidden = surface.hide_get(view_layer=view_layer)
        marks.append((ARTIST if hidden else OURS) + place)
        surface.hide_set(True, view_layer=view_layer)
    surface.scfpf_surface.hidden_in = "\n".join(marks)
