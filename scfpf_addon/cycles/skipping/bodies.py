# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything that a camera ray of Cycles may meet, as convex bodies: triangles, and boxes around the rest."""

from __future__ import annotations

from itertools import product

import numpy as np

from ...bridge.blender.rig_mark import has_other_animation, is_rig_part
from ...bridge.scene.mesh_arrays import corner_vertices, foreach, of_mesh, triangle_corners
from ...projection.typing import Array
from .reasons import links

# Objects of these types show nothing to Cycles' rays.
UNSEEN = {"ARMATURE", "CAMERA", "EMPTY", "LATTICE", "LIGHT_PROBE", "SPEAKER"}
# Triangles of all instances together; the instances beyond count as boxes.
MOST_TRIANGLES = 8_000_000
# Corners of the unit box.
CORNERS = np.array(list(product((0.0, 1.0), repeat=3)))


class Unbounded(ValueError):
    """Something of unknown extent. The message names it, as a sentence without its end."""


class Bodies:
    """Bodies in world space, gathered from depsgraphs."""

    def __init__(self) -> None:
        self._meshes: dict[int, tuple[Array, Array]] = {}
        self._triangles: list[Array] = []
        self._boxes: list[Array] = []
        self._count = 0

    def read(self, depsgraph) -> None:
        """Add what a render depsgraph's view layer shows. Raises Unbounded."""
        self._meshes.clear()
        override = depsgraph.view_layer_eval.material_override
        for instance in depsgraph.object_instances:
            obj = instance.object
            if obj.type in UNSEEN or _is_hidden(obj):
                continue
            matrix = np.array(instance.matrix_world, np.float64)
            if obj.type == "LIGHT":
                self._add_light(obj, matrix)
            elif obj.type == "MESH":
                self._add_mesh(obj, matrix, override)
            else:
                self._add_box(_box_of(obj), matrix)

    def points(self) -> list[Array]:
        """Triangles (3, 3, M) and boxes (8, 3, M): points, coordinates, bodies."""
        triangles = np.concatenate(self._triangles, axis=2) if self._triangles else np.empty((3, 3, 0))
        boxes = np.stack(self._boxes, axis=2) if self._boxes else np.empty((8, 3, 0))
        return [triangles, boxes]

    def _add_mesh(self, obj, matrix: Array, override) -> None:
        _require_bounded(obj)
        key = obj.data.as_pointer()
        if key not in self._meshes:
            self._meshes[key] = of_mesh(obj, _triangles)
        vertices, triangles = self._meshes[key]
        if len(triangles) == 0:
            return
        self._count += len(triangles)
        as_box = self._count > MOST_TRIANGLES or _is_diced(obj)
        if as_box or _is_filled(obj, override):
            self._add_box(np.stack([vertices.min(axis=0), vertices.max(axis=0)]), matrix)
        if as_box:
            return
        with np.errstate(invalid="ignore", over="ignore"):
            placed = vertices @ matrix[:3, :3].T + matrix[:3, 3]
        self._triangles.append(placed[triangles].transpose(1, 2, 0))

    def _add_box(self, box: Array, matrix: Array) -> None:
        """Add a box given by its lower and upper corner (2, 3)."""
        corners = box[0] + CORNERS * (box[1] - box[0])
        self._boxes.append(corners @ matrix[:3, :3].T + matrix[:3, 3])

    def _add_light(self, obj, matrix: Array) -> None:
        lamp = obj.data
        if lamp.type == "SUN":
            return
        if lamp.type == "AREA":
            sides = 0.5 * max(lamp.size, lamp.size_y)
            half = np.array([sides, sides, 0.0])
        else:
            half = np.full(3, lamp.shadow_soft_size)
            # Cycles ignores the scale of these lamps, or does not, by version.
            half = half * max(1.0, np.abs(matrix[:3, :3]).max() * np.sqrt(3.0))
            matrix = np.vstack([np.hstack([np.eye(3), matrix[:3, 3:]]), [0.0, 0.0, 0.0, 1.0]])
        self._add_box(np.stack([-half, half]), matrix)


def _is_hidden(obj) -> bool:
    """Whether camera rays of the rig never meet an evaluated object."""
    own = obj.original
    return is_rig_part(own) or (not obj.visible_camera and not has_other_animation(own))


def _triangles(mesh) -> tuple[Array, Array]:
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
    """Whether smoke fills an object: then its inside is not empty."""
    materials = [override] if override else [slot.material for slot in obj.material_slots]
    return any(links(material, "OUTPUT_MATERIAL", "Volume") for material in materials)


def _is_diced(obj) -> bool:
    """Whether Cycles subdivides an object itself: the result lies within the hull of its vertices."""
    cycles = getattr(obj.original, "cycles", None)
    if getattr(cycles, "use_adaptive_subdivision", False):
        return True
    return any(getattr(modifier, "use_adaptive_subdivision", False) for modifier in obj.original.modifiers)


def _box_of(obj) -> Array:
    """The box around hair curves, points or a volume, its lower and upper corner (2, 3). Raises Unbounded."""
    corners = np.array(obj.bound_box, np.float64)
    low, high = corners.min(axis=0), corners.max(axis=0)
    if not (high > low).any() or not np.isfinite(corners).all():
        raise Unbounded(f"'{obj.name}' has no known bounds")
    radius = getattr(obj.data, "attributes", {}).get("radius")
    if radius is not None and len(radius.data):
        low, high = (
            side + sign * foreach(radius.data, "value").max() for side, sign in ((low, -1), (high, 1))
        )
    return np.stack([low, high])
