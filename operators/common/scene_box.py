# SPDX-License-Identifier: GPL-3.0-or-later
"""The bounding box of what a scene shows, which cameras and volumes are fitted to."""

from typing import NamedTuple

import numpy as np
from mathutils import Matrix

from ...scfpf_addon.bridge.camera.flexible_camera import control_objects

SHAPES = {"MESH", "CURVE", "SURFACE", "FONT", "META"}


class SceneBox(NamedTuple):
    """An axis-aligned box: low and high corner, each (3,)."""

    low: np.ndarray
    high: np.ndarray

    @property
    def centre(self):
        return (self.low + self.high) / 2

    @property
    def size(self):
        return self.high - self.low

    @property
    def corners(self):
        """The eight corners, (8, 3)."""
        return np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * self.size + self.low


def box_of(corners) -> SceneBox:
    """The box around points (N, 3)."""
    return SceneBox(np.min(corners, axis=0), np.max(corners, axis=0))


def transformed(matrix, points):
    """Points (N, 3) transformed by a (4, 4) matrix."""
    placed = np.array(matrix, np.float64)
    return points @ placed[:3, :3].T + placed[:3, 3]


def corners_of(obj, matrix):
    """The corners of an evaluated object's bounding box, transformed by a (4, 4) matrix, (8, 3)."""
    return transformed(matrix, np.array(obj.bound_box, np.float64))


def _shapes(objects, left_out):
    return [o for o in objects if o.type in SHAPES and not o.hide_render and o.name_full not in left_out]


def scene_box(context, selected_only=False) -> SceneBox | None:
    """The box around everything that the scene, or its selection, can show in an image; None if empty."""
    depsgraph = context.evaluated_depsgraph_get()
    left_out = control_objects()
    corners = []
    for obj in context.view_layer.objects:
        if not obj.visible_get() or obj.hide_render or (selected_only and not obj.select_get()):
            continue
        if obj.instance_type == "COLLECTION" and obj.instance_collection is not None:
            origin = Matrix.Translation(-obj.instance_collection.instance_offset)
            for part in _shapes(obj.instance_collection.all_objects, left_out):
                corners.append(corners_of(part, obj.matrix_world @ origin @ part.matrix_world))
        elif obj.type in SHAPES and obj.name_full not in left_out:
            corners.append(corners_of(obj.evaluated_get(depsgraph), obj.matrix_world))
    finite = [c for c in corners if np.isfinite(c).all()]
    return box_of(np.concatenate(finite)) if finite else None
