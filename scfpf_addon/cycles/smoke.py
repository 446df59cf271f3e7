# SPDX-License-Identifier: GPL-3.0-or-later
"""Volumes in which rays begin, which Cycles does not notice through the rig.

Cycles looks for volumes around its camera, and the rig's camera is far below the scene. The world's own
volume is everywhere, and so there as well.
"""

from __future__ import annotations

from collections.abc import Iterator

import bpy
import numpy as np

from ..bridge.blender.rig_mark import has_other_animation, is_rig_part
from ..bridge.blender.scene_objects import originals
from ..bridge.blender.slot_animation import curve_collections
from ..bridge.scene.mesh_arrays import foreach, of_mesh
from ..bridge.scene.read_visibility import rendered_objects
from ..projection.typing import Array, BoolArray
from ..projection.volume.viewing_volume import Projection
from .hidden_surfaces import hidden_from_rigs
from .seen_data import links, might_use_each, seen_instances, unevaluated_objects
from .skipping.bodies import corners_of, mesh_triangles
from .skipping.stillness import motion_of

# Sampled positions across and up the near surface.
PLACES = 3
# Frames with keyframes that are looked at, at most.
MOST_KEYS = 9
# A direction that no face or edge that people model is parallel to.
ASKEW = np.array([0.0131, 0.0173, 1.0])
# Pairs of points and triangles that are intersected at a time.
MOST_PAIRS = 4_000_000


def smoke_around(scene, projection: Projection) -> str:
    """The name of an object whose volume holds a part of the near surface at present, or an empty string.

    Of instances it is the object that makes them. Of objects that no viewport evaluates the boxes count.
    """
    if not _may_have_smoke():
        return ""
    x, y = (a.ravel() for a in np.meshgrid(*(np.linspace(0.02, 0.98, PLACES),) * 2))
    image = projection.parameters(x, y)
    points = projection.volume.controls(image.u, image.v).points[0]
    points = points[:, image.mask & np.isfinite(points).all(axis=0)]
    names = set()
    for obj, matrix, instancer in seen_instances(scene, _has_smoke):
        if _holds(obj, matrix, points):
            names.add(instancer.name)
    for obj, reached in might_use_each(unevaluated_objects(scene)):
        boxes = _boxes(obj) if _reaches_smoke(reached) else ()
        if any(_in_box(box, matrix, points).any() for box, matrix in boxes):
            names.add(obj.name)
    return min(names, default="")


def changing_smoke(scene, all_of_it: bool = False) -> list[str]:
    """The names of objects whose smoke may be elsewhere, or is there, at other frames only.

    It goes by animation, drivers, constraints, modifiers and what an object depends on, without evaluating
    frames; in case of doubt smoke may change. all_of_it: whether still smoke counts too, as the volume moves.
    """
    if scene.frame_start == scene.frame_end or not _may_have_smoke():
        return []
    movers = motion_of(scene, hidden_from_rigs()).movers
    shown = set().union(*(rendered_objects(layer) for layer in scene.view_layers))
    may = {
        obj
        for obj in shown
        if (all_of_it or obj.session_uid in movers)
        and (not obj.hide_render or has_other_animation(obj))
        and not is_rig_part(obj)
    }
    return sorted(obj.name for obj, reached in might_use_each(may) if _reaches_smoke(reached))


def keyed_frames(names: tuple[str, ...]) -> list[int]:
    """At most MOST_KEYS frames at which objects, or their parents, have keyframes; sorted."""
    owners: set = set()
    for obj in (bpy.data.objects.get(name) for name in names):
        while obj is not None and obj not in owners:
            owners.add(obj)
            obj = obj.parent
    curves = (curve for obj in owners for found in curve_collections(obj) for curve in found)
    frames = sorted({round(key.co[0]) for curve in curves for key in curve.keyframe_points})
    return frames[:: -(-len(frames) // MOST_KEYS)] if frames else []


def may_move_smoke(depsgraph) -> bool:
    """Return whether an update moves, shows or hides objects of a file with smoke."""
    return any(each.id.id_type == "OBJECT" for each in depsgraph.updates) and _may_have_smoke()


def may_change_smoke(depsgraph, shows_others: bool) -> bool:
    """Return whether an edit may let smoke change with the frame.

    shows_others: whether the update brings other geometry or materials into sight.
    """
    is_due = shows_others or depsgraph.id_type_updated("ACTION")
    if not is_due:
        updated = originals(each.id for each in depsgraph.updates if each.id.id_type == "OBJECT")
        is_due = any(has_other_animation(obj) or len(obj.constraints) or obj.parent for obj in updated)
    return is_due and _may_have_smoke()


def _may_have_smoke() -> bool:
    return any(_is_volume(material) for material in bpy.data.materials) or bool(len(bpy.data.volumes))


def _has_smoke(obj, materials: set) -> bool:
    return obj.type == "VOLUME" or any(_is_volume(material) for material in materials)


def _reaches_smoke(reached: set) -> bool:
    return any(each.id_type == "VOLUME" or _is_volume(each) for each in reached)


def _is_volume(each) -> bool:
    return each.id_type == "MATERIAL" and links(each, "OUTPUT_MATERIAL", "Volume")


def _holds(obj, matrix: Array, points: Array) -> bool:
    """Return whether an evaluated object at a matrix (4, 4) holds any of some points (3, N).

    A mesh does by its faces, another object by its box.
    """
    box = np.array(obj.bound_box, np.float64)
    if obj.type != "MESH":
        return bool(_in_box(box, matrix, points).any())
    vertices, triangles = of_mesh(obj, mesh_triangles)
    if len(triangles) == 0:
        return False
    near = _in_box(vertices, matrix, points)
    if not near.any():
        return False
    return bool(_inside(vertices[triangles], _placed(points[:, near], matrix)).any())


def _placed(points: Array, matrix: Array) -> Array:
    """Points (3, N) of the world in the space of a matrix; NaN if it is flat."""
    try:
        inverse = np.linalg.inv(matrix)
    except np.linalg.LinAlgError:
        return np.full_like(points, np.nan)
    placed: Array = inverse[:3, :3] @ points + inverse[:3, 3:]
    return placed


def _in_box(corners: Array, matrix: Array, points: Array) -> BoolArray:
    """Return which points (3, N) of the world are in the box around corners (C, 3) in a matrix' space."""
    low, high = (end[:, None] for end in (corners.min(axis=0), corners.max(axis=0)))
    placed = _placed(points, matrix)
    inside: BoolArray = ((placed >= low) & (placed <= high)).all(axis=0)
    return inside


def _inside(triangles: Array, points: Array) -> BoolArray:
    """Return which points (3, N) are inside triangles (T, 3, 3): a ray from there crosses an odd number."""
    crossed = np.zeros(points.shape[1], np.intp)
    step = max(1, MOST_PAIRS // points.shape[1])
    for first in range(0, len(triangles), step):
        start, one, other = np.moveaxis(triangles[first : first + step], 1, 0)
        one, other = one - start, other - start
        across = np.cross(ASKEW, other)
        scale = (one * across).sum(axis=1)
        with np.errstate(divide="ignore", invalid="ignore"):
            # Möller and Trumbore.
            away = points.T[:, None] - start
            turned = np.cross(away, one)
            u, v = (away * across).sum(axis=2) / scale, turned @ ASKEW / scale
            along = (turned * other).sum(axis=2) / scale
        crossed += ((u >= 0) & (v >= 0) & (u + v <= 1) & (along > 0)).sum(axis=1)
    inside: BoolArray = crossed % 2 == 1
    return inside


def _boxes(obj, matrix: Array | None = None) -> Iterator[tuple[Array, Array]]:
    """The corners (8, 3) and the matrix (4, 4) of each smoking object that an unevaluated one shows."""
    own = _place(obj)
    own = own if matrix is None else matrix @ own
    if obj.type != "EMPTY":
        yield _box(obj), own
    elif obj.instance_type == "COLLECTION" and obj.instance_collection is not None:
        own[:3, 3] -= own[:3, :3] @ np.array(obj.instance_collection.instance_offset)
        parts = {part for part in obj.instance_collection.all_objects if not part.hide_render and part != obj}
        for part, reached in might_use_each(parts):
            if _reaches_smoke(reached):
                yield from _boxes(part, own)


def _place(obj) -> Array:
    """The matrix (4, 4) of an unevaluated object to the world, without constraints."""
    own = np.array(obj.matrix_basis, np.float64)
    if obj.parent is None:
        return own
    place: Array = _place(obj.parent) @ np.array(obj.matrix_parent_inverse, np.float64) @ own
    return place


def _box(obj) -> Array:
    """The corners (8, 3) of the box around an unevaluated object, without the effect of modifiers."""
    if obj.type == "MESH" and len(obj.data.vertices):
        return corners_of(foreach(obj.data.vertices, "co", 3).astype(np.float64))
    return np.array(obj.bound_box, np.float64)
