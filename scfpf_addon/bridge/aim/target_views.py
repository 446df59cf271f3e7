# SPDX-License-Identifier: GPL-3.0-or-later
"""The views among a camera's targets: their objects, and where they show points in the image."""

from __future__ import annotations

import numpy as np
from mathutils import Matrix

from ...aim.view_map import ViewMap
from ...projection.typing import Array
from ...projection.user_error import Message, UserError
from ..blender.rig_mark import is_rig_part
from ..blender.scene_objects import absent_text, is_absent
from ..camera.ordinary_camera import placement
from ..volume.volume_object import is_volume_object

# Types of objects with a shape that images show.
SHAPES = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
# Of a thing without extent, the radius of the sphere around it, in Blender units.
SMALLEST_RADIUS = 1e-4


def target_objects(target) -> list:
    """The objects of a view or a stay that images show; empties that instance a collection among them."""
    if target.collection is not None:
        candidates = list(target.collection.all_objects)
    else:
        candidates = [] if target.object is None else [target.object, *target.object.children_recursive]
    return [obj for obj in candidates if _is_thing(obj)]


def _is_thing(obj) -> bool:
    if obj.instance_type == "COLLECTION" and obj.instance_collection is not None:
        return True
    is_control = obj.scfpf_surface.kind != "NONE" or is_volume_object(obj) or is_rig_part(obj)
    return obj.type in SHAPES and not is_control


def _corners(obj, matrix) -> Array:
    """The corners of an object's bounding box, (8, 3)."""
    placed = np.array(matrix, np.float64)
    return np.array(obj.bound_box, np.float64) @ placed[:3, :3].T + placed[:3, 3]


def thing_box(objects: list, depsgraph) -> tuple[Array, Array]:
    """The corners low and high, (3,) each, of the box around objects as evaluated. Raises UserError."""
    found = []
    for obj in objects:
        shown = obj.evaluated_get(depsgraph)
        inner = obj.instance_collection
        if obj.instance_type == "COLLECTION" and inner is not None:
            origin = shown.matrix_world @ Matrix.Translation(-inner.instance_offset)
            parts = [part for part in inner.all_objects if _is_thing(part)]
            found += [_corners(part, origin @ part.matrix_world) for part in parts]
        else:
            found.append(_corners(shown, shown.matrix_world))
    finite = [corners for corners in found if np.isfinite(corners).all()]
    if not finite:
        raise UserError("There is nothing to show: choose a collection or an object that renders show")
    points = np.concatenate(finite)
    return points.min(axis=0), points.max(axis=0)


def title_of(target) -> str:
    """The name of a target in messages: that of its thing or its handle."""
    named = target.collection or target.object or target.handle
    return target.name or ("Target" if named is None else named.name)


def view_map(target, depsgraph, aspect: float) -> ViewMap:
    """The map from points to a view. aspect: of the image. Raises UserError."""
    title, eye = title_of(target), target.eye
    if eye is None:
        raise UserError("The view '{0}' has no camera: choose a camera or an empty under Seen From", title)
    if is_absent(eye, depsgraph.scene):
        raise UserError(absent_text(eye, depsgraph.scene, Message("choose another camera under Seen From")))
    objects = target_objects(target)
    if not objects:
        raise UserError("The view '{0}' shows nothing: choose a collection or an object with faces", title)
    low, high = thing_box(objects, depsgraph)
    made = ViewMap(
        to_eye=np.linalg.inv(placement(eye.evaluated_get(depsgraph))),
        is_parallel=eye.type == "CAMERA" and eye.data.type == "ORTHO",
        centre=(low + high) / 2,
        radius=max(float(np.linalg.norm(high - low)) / 2, SMALLEST_RADIUS),
        position=(target.position[0], target.position[1]),
        width=target.width,
        turn=target.turn,
        aspect=aspect,
    )
    if not made.is_visible:
        raise UserError("'{0}' looks away from '{1}': turn it towards what the view shows", eye.name, title)
    return made


def view_positions(target, points: Array, depsgraph, aspect: float) -> Array:
    """Image positions (2, N) at which a view shows world points (3, N), NaN behind its eye.

    Raises as ``view_map``.
    """
    return view_map(target, depsgraph, aspect).positions(points)
