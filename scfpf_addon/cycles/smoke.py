# SPDX-License-Identifier: GPL-3.0-or-later
"""Volumes in which rays begin, which Cycles does not notice through the rig.

Cycles looks for volumes around its camera, and the rig's camera is far below the scene. The world's own
volume is everywhere, and so there as well.
"""

from __future__ import annotations

import numpy as np
from mathutils import Vector
from mathutils.bvhtree import BVHTree

from ..projection.typing import Array
from ..projection.volume.viewing_volume import Projection

# Sampled positions across and up the near surface.
PLACES = 3
# Most faces of an object that a point's ray is followed through.
MOST_FACES = 64
# A ray goes on this far behind a face, as a share of the object's size.
BEHIND = 1e-5
UP = Vector((0.0, 0.0, 1.0))


def smoke_around(depsgraph, projection: Projection) -> str:
    """The name of an object whose volume holds a part of the near surface, or an empty string.

    depsgraph: evaluated. Objects that viewports hide count, those that its view layer excludes do not.
    """
    objects = depsgraph.view_layer.objects
    candidates = [obj for obj in objects if not obj.hide_render and _is_smoke(obj)]
    if not candidates:
        return ""
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(0.02, 0.98, PLACES),) * 2))
    image = projection.parameters(x, y)
    points = projection.volume.controls(image.u, image.v).points[0]
    points = points[:, image.mask & np.isfinite(points).all(axis=0)].T
    for obj in candidates:
        if any(_is_inside(obj.evaluated_get(depsgraph), point, depsgraph) for point in points):
            return obj.name
    return ""


def _is_smoke(obj) -> bool:
    if obj.type == "VOLUME":
        return True
    return obj.type == "MESH" and any(_is_volume(slot.material) for slot in obj.material_slots)


def _is_volume(material) -> bool:
    if material is None or material.node_tree is None:
        return False
    return any(
        node.type == "OUTPUT_MATERIAL" and node.inputs["Volume"].is_linked
        for node in material.node_tree.nodes
    )


def _is_inside(obj, point: Array, depsgraph) -> bool:
    """Return whether a point is inside an evaluated object: by the faces above it, or else by its box.

    A volume, or an object that viewports hide, has no known faces.
    """
    place = obj.matrix_world.inverted_safe() @ Vector(point)
    low, high = (
        Vector(end(corner[axis] for corner in obj.bound_box) for axis in range(3)) for end in (min, max)
    )
    if any(not a <= value <= b for a, value, b in zip(low, place, high, strict=True)):
        return False
    if obj.type == "VOLUME" or not obj.is_evaluated:
        return True
    inside, step = False, BEHIND * max((high - low).length, BEHIND)
    faces = _faces_in_edit_mode(obj, depsgraph) if obj.data.is_editmode else None
    for _ in range(MOST_FACES):
        if faces is None:
            met, place, _, _ = obj.ray_cast(place, UP)
        else:
            place = faces.ray_cast(place, UP)[0]
            met = place is not None
        if not met:
            return inside
        inside, place = not inside, place + UP * step
    return inside


def _faces_in_edit_mode(obj, depsgraph) -> BVHTree:
    """The faces of an evaluated object in Edit Mode, which to_mesh() makes."""
    try:
        obj.to_mesh()
        return BVHTree.FromObject(obj.original, depsgraph)
    finally:
        obj.to_mesh_clear()
