# SPDX-License-Identifier: GPL-3.0-or-later
"""The volume that a camera had before a drag gave it other control surfaces, so that Esc brings it back.

A copy of the camera, in no scene, lists the old surfaces while others take their places: surfaces that a
camera lists are not deleted.
"""

from __future__ import annotations

import bpy

from ..blender.scene_objects import delete_with_data, object_by_uid
from ..blender.slot_animation import AIM_TARGETS, SLOT_PATH, curve_collections
from ..camera.flexible_camera import clear_surfaces, make_flexible
from ..mappings.mapping_edits import clear_mappings
from ..volume.camera_members import all_cameras, grids_of, surfaces_of
from .target_views import AimError

# The settings of a volume that a solution replaces.
SETTINGS = ("basis", "reparameterisation", "fit", "fitted_aspect", "u_range", "v_range", "active_surface")


class KeptVolume:
    """A camera's present volume. Call either ``bring_back`` or ``drop`` once."""

    def __init__(self, camera) -> None:
        """Raises AimError if keyframes or drivers move the volume's settings: they cannot be brought back."""
        paths = (curve.data_path for curves in curve_collections(camera) for curve in curves)
        if any(found[1] != AIM_TARGETS for found in map(SLOT_PATH.match, paths) if found is not None):
            raise AimError("The surfaces or mappings of '{0}' are keyframed: press Solve first", camera.name)
        copy = camera.copy()
        copy.scfpf.volume_object = None
        copy.animation_data_clear()
        self._copy = copy.session_uid

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
        bpy.data.objects.remove(copy)

    def drop(self, camera) -> None:
        """Delete the kept surfaces, grids and curves that nothing else uses, as replacing them would have."""
        copy = object_by_uid(self._copy)
        if copy is None:
            return
        members = surfaces_of(copy) + grids_of(copy)
        curves = [mapping.curve for mapping in copy.scfpf.mappings if mapping.curve is not None]
        bpy.data.objects.remove(copy)
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
