# SPDX-License-Identifier: GPL-3.0-or-later
"""The volume that a camera had before a drag gave it other control surfaces, so that Esc brings it back.

A copy of the camera, in no scene, lists the old surfaces while others take their places: surfaces that a
camera lists are not deleted.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy

from ...projection.user_error import UserError
from ..blender.all_or_nothing import PLACE, Kept, all_or_nothing, at_end, put_back
from ..blender.scene_objects import delete_with_data, object_by_uid
from ..blender.slot_animation import (
    AIM_TARGETS,
    MAPPINGS,
    SLOT_PATH,
    SURFACES,
    curve_collections,
    require_own_items,
)
from ..camera.flexible_camera import clear_surfaces, make_flexible
from ..mappings.mapping_edits import clear_mappings
from ..volume.camera_members import all_cameras, grids_of, surfaces_of

# How a surface is shown, which depends on the lists that have it.
SHOWN = ("hide_select", "show_in_front", "display_type")
# The settings of a volume that a solution replaces.
SETTINGS = ("basis", "reparameterisation", "fit", "fitted_aspect", "u_range", "v_range", "active_surface")


class KeptVolume:
    """A camera's present volume. Call either ``bring_back`` or ``drop`` once."""

    def __init__(self, camera) -> None:
        """Raises UserError if keyframes or drivers move the volume: they cannot be brought back."""
        if _is_keyed(camera):
            raise UserError("The surfaces or mappings of '{0}' are keyframed: press Solve first", camera.name)
        self._copy = _holder_of(camera).session_uid

    def bring_back(self, camera) -> None:
        """Give a camera the kept volume again, and delete the surfaces that it has."""
        copy = object_by_uid(self._copy)
        if copy is None:
            return
        clear_surfaces(camera)
        clear_mappings(camera)
        for items in ("surfaces", "mappings"):
            for item in getattr(copy.scfpf, items):
                _write(item, getattr(camera.scfpf, items).add())
        for name in SETTINGS:
            setattr(camera.scfpf, name, getattr(copy.scfpf, name))
        make_flexible(camera)
        delete_with_data(copy)

    def drop(self, camera) -> None:
        """Delete the kept surfaces, grids and curves that nothing else uses, as replacing them would have."""
        copy = object_by_uid(self._copy)
        if copy is not None:
            _drop(copy, camera)


@contextmanager
def volume_kept(camera) -> Iterator[None]:
    """Bring a camera's volume back, with the shapes of its surfaces and the lens, if the block raises.

    F-curves of the list of surfaces that the block removes stay removed. What it replaces goes at its end.
    Raises UserError, before the block, for a library override of a camera with surfaces or mappings.
    """
    require_own_items(camera.scfpf, SURFACES, MAPPINGS)
    surfaces = [surface for surface in surfaces_of(camera) if surface.is_editable and surface.data]
    actions = {_action_of(surface) for surface in surfaces} - {None}
    with all_or_nothing() as kept:
        backups = {data: data.copy() for data in {surface.data for surface in surfaces}}
        holder = _holder_of(camera)
        for surface in surfaces:
            kept.callback(_restore_data, surface, surface.data, backups)
            kept.keep(surface, *SHOWN, *PLACE)
            kept.keep_keys(surface)
        _keep_camera(kept, camera)
        yield
        at_end(_drop_kept, holder.session_uid, camera.session_uid, backups, actions)


def _drop_kept(holder: int, camera: int, backups: dict, actions: set) -> None:
    """Remove what ``volume_kept`` has kept of a camera. holder, camera: session ids."""
    bpy.data.batch_remove([*backups.values()])
    copy, kept = object_by_uid(holder), object_by_uid(camera)
    if copy is not None and kept is not None:
        _drop(copy, kept)
    bpy.data.batch_remove([action for action in actions if action.users == 0 and action.is_editable])


@contextmanager
def camera_kept(camera) -> Iterator[None]:
    """Restore the settings, the lists, the place and the lens of a camera if the block raises.

    Edits of its surfaces keep what they change themselves.
    """
    with all_or_nothing() as kept:
        _keep_camera(kept, camera)
        yield


def _action_of(surface):
    """The action of a surface's shape keys, or None."""
    keys = getattr(surface.data, "shape_keys", None)
    return None if keys is None or keys.animation_data is None else keys.animation_data.action


def _keep_camera(kept: Kept, camera) -> None:
    """Keep what a new volume sets of a camera and its scenes."""
    kept.keep(camera.scfpf)
    kept.keep(camera, "data", *PLACE)
    if camera.data.is_editable:
        kept.keep(camera.data)
    for scene in camera.users_scene:
        # The first flexible camera of a scene sets it.
        kept.keep(scene.scfpf_sampling, "world_shadows")


def _restore_data(surface, data, backups: dict) -> None:
    """Give a surface its data as they were, under their name. Surfaces may share them."""
    if surface.data != data and data in backups:
        surface.data = data
    if data in backups:
        put_back(backups.pop(data), data)


def _is_keyed(camera) -> bool:
    """Return whether keyframes or drivers move surfaces or mappings of a camera's lists."""
    paths = (curve.data_path for curves in curve_collections(camera) for curve in curves)
    return any(found[1] != AIM_TARGETS for found in map(SLOT_PATH.match, paths) if found is not None)


def _holder_of(camera):
    """A copy of a camera, in no scene, that lists the same surfaces, mappings and grids."""
    copy = camera.copy()
    # The camera is to remain the only user of its lens.
    copy.data = bpy.data.cameras.new(copy.name)
    copy.scfpf.volume_object = None
    copy.animation_data_clear()
    return copy


def _drop(holder, camera) -> None:
    """Remove a ``_holder_of`` a camera, and what nothing else has of what it lists."""
    members = surfaces_of(holder) + grids_of(holder)
    curves = [mapping.curve for mapping in holder.scfpf.mappings if mapping.curve is not None]
    delete_with_data(holder)
    used = {obj for each in all_cameras() for obj in surfaces_of(each) + grids_of(each)}
    for obj in members:
        if obj.parent == camera and obj.is_editable and obj not in used:
            delete_with_data(obj)
    bpy.data.batch_remove([curve for curve in curves if curve.users == 0 and curve.is_editable])


def _write(source, target) -> None:
    """Copy the properties of an item; pointers first, so that a kind finds the datablock that it needs."""
    properties = [p for p in source.bl_rna.properties if not p.is_readonly]
    for own in sorted(properties, key=lambda p: p.type != "POINTER"):
        setattr(target, own.identifier, getattr(source, own.identifier))
