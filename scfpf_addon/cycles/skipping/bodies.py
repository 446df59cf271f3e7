# SPDX-License-Identifier: GPL-3.0-or-later
"""The things that a camera ray of Cycles may meet, as convex bodies: triangles, and boxes around the rest."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from itertools import product
from typing import NamedTuple

import numpy as np

from ...bridge.blender.rig_mark import PASSING_KEY, has_other_animation, is_rig_part
from ...bridge.scene.instances import SHAPELESS, Instance, MeshTable, instances
from ...bridge.scene.mesh_arrays import corner_vertices, foreach, triangle_corners
from ...projection.typing import Array, IndexArray
from ..seen_data import links, materials_of

# Triangles of all instances together. Beyond the first number small instances count as boxes, those whose
# boxes are at most this share of the volume; beyond the second number all others do.
MANY_TRIANGLES, MOST_TRIANGLES = 2_000_000, 8_000_000
SMALL = 1 / 64
# Voxels by which smoke may reach beyond the box of its grid.
VOXELS = 2.0
# Corners of the unit box.
CORNERS = np.array(list(product((0.0, 1.0), repeat=3)))


class Unbounded(ValueError):
    """Something of unknown extent. The message names it, as a sentence without its end."""


class Part(NamedTuple):
    """A convex part of an object, or its triangles. points: (V, 3), its own space.

    triangles: (T, 3), None for the hull of the points.
    """

    points: Array
    triangles: IndexArray | None


class Bodies:
    """Bodies in world space, gathered from depsgraphs."""

    def __init__(self) -> None:
        self._parts: list[tuple[Part, Array]] = []
        self._boxes: list[Array] = []

    def read(self, depsgraph, wanted: Callable[[Instance], bool] | None = None) -> None:
        """Add what a render depsgraph's view layer shows. wanted: None for all. Raises Unbounded."""
        for _, matrix, parts in seen_parts(depsgraph, wanted):
            self._parts += [(part, matrix) for part in parts]

    def add_boxes(self, boxes: Array) -> None:
        """Add boxes in world space by their corners (8, 3, M)."""
        self._boxes.append(boxes)

    def points(self, size: float = math.inf) -> list[Array]:
        """Triangles (3, 3, M) and boxes (8, 3, M): points, coordinates, bodies.

        size: of the volume. It decides which instances are small.
        """
        total = sum(len(part.triangles) for part, _ in self._parts if part.triangles is not None)
        triangles, boxes, count = [np.empty((3, 3, 0))], [np.empty((8, 3, 0)), *self._boxes], 0
        for part, matrix in self._parts:
            own = part.triangles
            if own is not None and total > MANY_TRIANGLES:
                corners = corners_of(part.points)
                is_small = np.ptp(placed_points(corners, matrix), axis=0).max() <= SMALL * size
                if is_small or count + len(own) > MOST_TRIANGLES:
                    part, own = Part(corners, None), None
            placed = placed_points(part.points, matrix)
            if own is None:
                boxes.append(placed[:, :, None])
            else:
                count += len(own)
                triangles.append(placed[own].transpose(1, 2, 0))
        return [np.concatenate(triangles, axis=2), np.concatenate(boxes, axis=2)]


def seen_parts(depsgraph, wanted: Callable[[Instance], bool] | None = None) -> Iterator[tuple]:
    """Each instance that camera rays may meet: its key, its matrix (4, 4) and its parts. Raises Unbounded.

    The key is the same at all times of a scene. An instance counts even if its instancer or its collection
    hides it, since nothing tells when that changes. In a temporary scene it does not change.
    """
    meshes = MeshTable(_triangles_of)
    # By object and data.
    known: dict[tuple[int, int], list[Part]] = {}
    override = depsgraph.view_layer_eval.material_override
    passing = depsgraph.view_layer if PASSING_KEY in depsgraph.scene else None
    for instance in instances(depsgraph):
        obj = instance.obj
        if passing is not None and instance.owner.indirect_only_get(view_layer=passing):
            continue
        if obj.type in SHAPELESS or _is_hidden(obj) or (wanted is not None and not wanted(instance)):
            continue
        matrix = instance.matrix
        look = instance.key.uid, instance.data
        if obj.type == "LIGHT":
            matrix, parts = _lamp_parts(obj.data, matrix)
        elif look in known:
            parts = known[look]
        else:
            is_mesh = obj.type == "MESH"
            parts = known[look] = _mesh_parts(instance, override, meshes) if is_mesh else [_box_of(obj)]
        yield (instance.key.owner_uid, instance.key.uid, *instance.numbers), matrix, parts


def placed_points(points: Array, matrix: Array) -> Array:
    """Points (V, 3) in world space."""
    with np.errstate(invalid="ignore", over="ignore"):
        placed: Array = points @ matrix[:3, :3].T + matrix[:3, 3]
    return placed


def corners_of(points: Array) -> Array:
    """The corners (8, 3) of the box around points (V, 3)."""
    low, high = points.min(axis=0), points.max(axis=0)
    corners: Array = low + CORNERS * (high - low)
    return corners


def _mesh_parts(instance: Instance, override, meshes: MeshTable[list[Part]]) -> list[Part]:
    """The parts of a mesh's instance. meshes: the triangles of each."""
    obj = instance.obj
    _require_bounded(obj)
    own = meshes.of(instance)
    whole = [Part(corners_of(part.points), None) for part in own]
    if _is_diced(obj):
        return whole
    return own + (whole if _is_filled(obj, override) else [])


def _triangles_of(mesh) -> list[Part]:
    vertices, triangles = mesh_triangles(mesh)
    return [Part(vertices, triangles)] if len(triangles) else []


def _lamp_parts(lamp, matrix: Array) -> tuple[Array, list[Part]]:
    """The matrix of a lamp and the box around what it shows, if it shows anything."""
    if lamp.type == "SUN":
        return matrix, []
    if lamp.type == "AREA":
        sides = 0.5 * max(lamp.size, lamp.size_y)
        half = np.array([sides, sides, 0.0])
    else:
        half = np.full(3, lamp.shadow_soft_size)
        # Cycles ignores the scale of these lamps, or does not, by version.
        half = half * max(1.0, np.abs(matrix[:3, :3]).max() * np.sqrt(3.0))
        matrix = np.vstack([np.hstack([np.eye(3), matrix[:3, 3:]]), [0.0, 0.0, 0.0, 1.0]])
    return matrix, [Part(corners_of(np.stack([-half, half])), None)]


def _is_hidden(obj) -> bool:
    """Return whether camera rays of the rig never meet an evaluated object."""
    own = obj.original
    return is_rig_part(own) or (not obj.visible_camera and not has_other_animation(own))


def mesh_triangles(mesh) -> tuple[Array, Array]:
    """Vertices (V, 3) and triangles (T, 3) of an evaluated mesh."""
    if len(mesh.polygons) == 0:
        return np.empty((0, 3)), np.empty((0, 3), np.int32)
    mesh.calc_loop_triangles()
    vertices = foreach(mesh.attributes["position"].data, "vector", 3).astype(np.float64)
    return vertices, corner_vertices(mesh)[triangle_corners(mesh)].reshape(-1, 3)


def _require_bounded(obj) -> None:
    """Raise Unbounded if hair of particles may lead out of an object's faces."""
    for system in obj.particle_systems:
        if system.settings.type == "HAIR" and system.settings.render_type == "PATH":
            raise Unbounded(f"The particle hair of '{obj.name}' has no known bounds")


def _is_filled(obj, override) -> bool:
    """Return whether smoke fills an object: then its inside is not empty."""
    materials = {override} if override else materials_of(obj)
    return any(links(material, "OUTPUT_MATERIAL", "Volume") for material in materials)


def _is_diced(obj) -> bool:
    """Return whether Cycles subdivides an object itself: the result lies within the hull of its vertices."""
    cycles = getattr(obj.original, "cycles", None)
    if getattr(cycles, "use_adaptive_subdivision", False):
        return True
    return any(getattr(modifier, "use_adaptive_subdivision", False) for modifier in obj.original.modifiers)


def _box_of(obj) -> Part:
    """The box around hair curves, points or a volume. Raises Unbounded."""
    corners = np.array(obj.bound_box, np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    if not (high > low).any() or not np.isfinite(corners).all():
        raise Unbounded(f"'{obj.name}' has no known bounds")
    if obj.type == "VOLUME":
        # Blender 4.5 places the box half a voxel low, and interpolation reaches beyond it.
        voxels = [np.abs(np.array(grid.matrix_object)[:3, :3]).sum(axis=1) for grid in obj.data.grids]
        beyond = VOXELS * np.max(voxels, axis=0, initial=0.0)
        low, high = low - beyond, high + beyond
    radius = getattr(obj.data, "attributes", {}).get("radius")
    if radius is not None and len(radius.data):
        low, high = (
            side + sign * foreach(radius.data, "value").max() for side, sign in ((low, -1), (high, 1))
        )
    return Part(corners_of(np.stack([low, high])), None)
