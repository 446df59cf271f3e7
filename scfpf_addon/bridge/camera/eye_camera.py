# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera whose volume is one eye's projection of another: for renders that take the camera of a scene.

Its surfaces are grids over the image, so that mappings and ranges are in them.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager

import bpy
import numpy as np
from mathutils import Matrix

from ...projection.typing import Array
from ...projection.user_error import UserError
from ...projection.volume.viewing_volume import Projection
from ..blender.scene_objects import delete_with_data, object_by_uid
from ..volume.volume_object import delete_volume_object
from .flexible_camera import NewSurface, make_flexible, replace_surfaces

NAME = "SCFPF Eye"
# Points of a grid across the image.
COLUMNS = 257
# Surfaces that are bilinear over the image but for this share of their size have points at corners only.
STRAIGHT = 1e-9
HOLES = "The picture of '{0}' has places without projectors: choose another engine than Cycles by its rig"


@contextmanager
def eye_camera(scene, camera, place: Array, projection: Projection) -> Iterator:
    """Yield a flexible camera in a scene, with a camera's lens, that sees what a projection sees.

    place: (4, 4), rigid, of the camera. projection: in world space, without layers. Raises UserError where it
    has no projectors. Keep no reference to the camera between renders: look it up by its session id.
    """
    made: list[int] = []
    try:
        grids = _grids(projection.transformed(np.linalg.inv(place)))
        if grids is None:
            raise UserError(HOLES, camera.name)
        eye = bpy.data.objects.new(NAME, camera.data.copy())
        made.append(eye.session_uid)
        eye.data.animation_data_clear()
        eye.matrix_world = Matrix(place.tolist())
        scene.collection.objects.link(eye)
        surfaces = [
            NewSurface(f"{NAME} {number}", "GRID", np.eye(4), None, each) for number, each in enumerate(grids)
        ]
        replace_surfaces(eye, surfaces)
        settings, volume = eye.scfpf, projection.volume
        settings.basis, settings.fit = volume.basis, "NONE"
        settings.pixel_error, settings.samples = camera.scfpf.pixel_error, camera.scfpf.samples
        for slot, weight in zip(settings.surfaces, volume.weights or (), strict=False):
            slot.weight = weight
        make_flexible(eye, again=True)
        made += [slot.object.session_uid for slot in settings.surfaces]
        scene.view_layers[0].update()
        yield eye
    finally:
        eye = object_by_uid(made[0]) if made else None
        if eye is not None and eye.scfpf.volume_object is not None:
            delete_volume_object(eye.scfpf.volume_object)
        for uid in reversed(made):
            # Handlers or undo may have removed it.
            if (obj := object_by_uid(uid)) is not None:
                delete_with_data(obj)


def _grids(projection: Projection) -> list[Array] | None:
    """The control points at a grid of image positions, (R, C, 3) a surface; None if there are holes."""
    rows = max(2, round((COLUMNS - 1) / projection.aspect) + 1)
    x, y = (axis.ravel() for axis in np.meshgrid(np.linspace(0, 1, COLUMNS), np.linspace(0, 1, rows)))
    points, valid = projection.projectors(x, y)
    if not valid.all() or not np.isfinite(points).all():
        return None
    grids = np.moveaxis(points, 1, 2).reshape(len(points), rows, COLUMNS, 3)
    corners = grids[:, :: rows - 1, :: COLUMNS - 1]
    weights = np.stack([1.0 - y, y])[:, None] * np.stack([1.0 - x, x])
    flat = np.einsum("vun,kvuc->knc", weights, corners).reshape(grids.shape)
    size = max(float(np.abs(grids).max()), np.finfo(float).tiny)
    return list(corners if np.abs(flat - grids).max() <= STRAIGHT * size else grids)
