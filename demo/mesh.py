# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes made of grids, boxes, lathes and badges, and materials of constants."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import bmesh
import bpy
import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Colour = tuple[float, float, float]
# A parametric surface: (p, q, height above it) -> points, the last axis x, y, z.
Surface = Callable[[Array, Array, Array], Array]

# An angle between the steps of rounded edges (up to 30 degrees) and the corners of bars and boxes.
SHARP_ANGLE = np.radians(38.0)
# A hundredth of a millimetre: far below any edge, far above float32's rounding of a car's length.
WELD_DISTANCE = 1e-5
# A box's faces: bits 0, 1 and 2 of a corner's number say high x, y and z.
BOX_FACES = [(0, 2, 3, 1), (4, 5, 7, 6), (0, 1, 5, 4), (2, 6, 7, 3), (0, 4, 6, 2), (1, 3, 7, 5)]


def material(
    name: str,
    colour: Colour,
    roughness: float = 0.6,
    metallic: float = 0.0,
    emission: float = 0.0,
) -> bpy.types.Material:
    """A Principled BSDF of constants; emission is the strength of the same colour."""
    result = bpy.data.materials.new(name)
    if result.node_tree is None:
        result.use_nodes = True
    inputs = result.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = (*colour, 1.0)
    inputs["Metallic"].default_value = metallic
    inputs["Roughness"].default_value = roughness
    inputs["Emission Color"].default_value = (*colour, 1.0)
    inputs["Emission Strength"].default_value = emission
    result.diffuse_color = (*colour, 1.0)
    result.metallic, result.roughness = metallic, roughness
    return result


def smooth_table(table: Sequence[tuple[float, float]], at: ArrayLike) -> Array:
    """Cubic Hermite interpolation of (position, value) rows, constant outside them.

    Slopes are the harmonic mean of the neighbouring ones, which never overshoots
    (Fritsch & Butland 1984).
    """
    x, y = np.asarray(table, np.float64).T
    step, rise = np.diff(x), np.diff(y) / np.diff(x)
    left, right = rise[:-1], rise[1:]
    same = left * right > 0
    inner = np.zeros(len(left))
    inner[same] = 2 * left[same] * right[same] / (left[same] + right[same])
    slopes = np.concatenate([[0.0], inner, [0.0]])
    position = np.clip(np.asarray(at, np.float64), x[0], x[-1])
    i = np.clip(np.searchsorted(x, position, "right") - 1, 0, len(step) - 1)
    s = (position - x[i]) / step[i]
    return np.asarray(
        y[i] * (1 + 2 * s) * (1 - s) ** 2
        + y[i + 1] * s**2 * (3 - 2 * s)
        + step[i] * s * (1 - s) * (slopes[i] * (1 - s) - slopes[i + 1] * s)
    )


class MeshBuilder:
    """A collection of vertices and of faces, each with the name of a material; z is up."""

    def __init__(self) -> None:
        self._vertices: list[Array] = []
        self._faces: list[NDArray[np.int64]] = []
        self._materials: list[list[str]] = []
        self._smooth: list[bool] = []
        self._count = 0

    def add(
        self,
        vertices: ArrayLike,
        faces: ArrayLike,
        materials: str | Sequence[str],
        smooth: bool = False,
    ) -> None:
        """vertices (n, 3); faces (m, corners), anticlockwise from outside; one material, or m."""
        points = np.asarray(vertices, np.float64).reshape(-1, 3)
        corners = np.asarray(faces, np.int64)
        self._vertices.append(points)
        self._faces.append(corners + self._count)
        self._materials.append([materials] * len(corners) if isinstance(materials, str) else list(materials))
        self._smooth.append(smooth)
        self._count += len(points)

    def add_copies(self, vertices: Array, faces: ArrayLike, offsets: Array, materials: Sequence[str]) -> None:
        """One template (n, 3) repeated at offsets (k, 3); materials one a template face."""
        corners = np.asarray(faces, np.int64)
        shift = np.arange(len(offsets))[:, None, None] * len(vertices)
        self.add(
            vertices + offsets[:, None, :],
            (corners + shift).reshape(-1, corners.shape[1]),
            list(materials) * len(offsets),
        )

    def grid(
        self, points: Array, materials: str | Sequence[str], smooth: bool = True, closed: bool = False
    ) -> None:
        """Quads over points (rows, columns, 3); closed joins the last column to the first."""
        rows, columns = points.shape[:2]
        index = np.arange(rows * columns).reshape(rows, columns)
        if closed:
            index = np.concatenate([index, index[:, :1]], axis=1)
        quads = np.stack([index[:-1, :-1], index[:-1, 1:], index[1:, 1:], index[1:, :-1]], axis=-1)
        self.add(points, quads.reshape(-1, 4), materials, smooth)

    def hexahedron(self, corners: Array, materials: str) -> None:
        """Six faces over corners (8, 3): bits 0, 1 and 2 of a corner's number say high x, y and z."""
        self.add(corners, BOX_FACES, materials)

    def box(self, low: ArrayLike, high: ArrayLike, materials: str) -> None:
        """A box along the axes from its lowest to its highest corner."""
        bounds = np.array([low, high], np.float64)
        corners = [[bounds[i & 1, 0], bounds[i >> 1 & 1, 1], bounds[i >> 2, 2]] for i in range(8)]
        self.hexahedron(np.array(corners), materials)

    def lathe(
        self, profile: ArrayLike, segments: int, axis: str, centre: ArrayLike, materials: str | Sequence[str]
    ) -> None:
        """Revolve profile (n, 2) of (radius, along) about an axis through centre; materials one a row."""
        radius, along = np.asarray(profile, np.float64).T
        angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)
        ring = radius[:, None, None] * np.stack([np.cos(angle), np.sin(angle)], axis=-1)
        depth = np.broadcast_to(along[:, None, None], (len(along), segments, 1))
        first, second = ring[..., :1], ring[..., 1:]
        order = {"X": [depth, first, second], "Y": [second, depth, first], "Z": [first, second, depth]}[axis]
        points = np.concatenate(order, axis=-1) + np.asarray(centre, np.float64)
        if not isinstance(materials, str):
            materials = [name for name in materials for _ in range(segments)]
        self.grid(points, materials, closed=True)

    def ball(
        self,
        centre: ArrayLike,
        radii: ArrayLike,
        materials: str,
        exponent: float = 1.0,
        segments: int = 24,
    ) -> None:
        """An ellipsoid; an exponent below 1 makes it boxier."""
        latitude = np.linspace(-np.pi / 2, np.pi / 2, segments // 2 + 1)[:, None]
        longitude = np.linspace(0, 2 * np.pi, segments, endpoint=False)[None, :]

        def power(value: Array) -> Array:
            return np.asarray(np.sign(value) * np.abs(value) ** exponent)

        directions = [
            power(np.cos(latitude)) * power(np.cos(longitude)),
            power(np.cos(latitude)) * power(np.sin(longitude)),
            power(np.sin(latitude)) * np.ones_like(longitude),
        ]
        points = np.stack(directions, axis=-1) * np.asarray(radii) + np.asarray(centre)
        self.grid(points, materials, closed=True)

    def badge(
        self,
        surface: Surface,
        outline: Array,
        rings: Sequence[tuple[float, float, str]],
    ) -> None:
        """A raised plate that follows a surface: rings of an outline (n, 2) from the rim to its centre.

        A ring is (scale of the outline, height above the surface, material of the band up to the next
        ring); the last ring is closed to its centre.
        """
        centre = (outline.max(axis=0) + outline.min(axis=0)) / 2
        scales = np.array([ring[0] for ring in rings] + [0.5 * rings[-1][0], 0.0])
        heights = np.array([ring[1] for ring in rings] + [rings[-1][1]] * 2)
        flat = centre + scales[:, None, None] * (outline - centre)
        points = surface(flat[..., 0], flat[..., 1], np.broadcast_to(heights[:, None], flat.shape[:2]))
        names = [ring[2] for ring in rings] + [rings[-1][2]]
        self.grid(points, [name for name in names for _ in range(len(outline))], closed=True)

    def strip(self, surface: Surface, path: ArrayLike, width: float, height: float, materials: str) -> None:
        """A thin line along path (n, 2) on a surface, raised by height."""
        points = np.asarray(path, np.float64)
        along = np.gradient(points, axis=0)
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        across = np.array([-0.5, -0.25, 0.25, 0.5])[:, None, None] * width
        flat = points + across * np.stack([-along[:, 1], along[:, 0]], axis=-1)
        rise = np.array([-height, height, height, -height])[:, None] * np.ones(len(points))
        self.grid(surface(flat[..., 0], flat[..., 1], rise), materials)

    def sweep(self, path: Array, outward: Array, section: Array, materials: str) -> None:
        """A bar, its ends closed: section (k, 2) of (outward, up), path and outward directions (n, 3)."""
        scale = np.ones(len(path))
        path, outward = (np.concatenate([a[:1], a, a[-1:]]) for a in (path, outward))
        scale = np.concatenate([[0.0], scale, [0.0]])[:, None, None]
        up = np.array([0.0, 0.0, 1.0])
        points = path[:, None] + scale * (section[:, :1] * outward[:, None] + section[:, 1:] * up)
        self.grid(points, materials, closed=True)

    def mesh(
        self,
        name: str,
        palette: Mapping[str, bpy.types.Material],
        outward: bool = False,
        sharp: float = SHARP_ANGLE,
    ) -> bpy.types.Mesh:
        """The Blender mesh.

        outward: weld coincident vertices and let normals point outwards. sharp: edges steeper than this
        angle, in radians, stay sharp.
        """
        result = bpy.data.meshes.new(name)
        faces = [face for block in self._faces for face in block.tolist()]
        result.from_pydata(np.concatenate(self._vertices), [], faces)
        names = [item for block in self._materials for item in block]
        slots = {item: i for i, item in enumerate(dict.fromkeys(names))}
        for item in slots:
            result.materials.append(palette[item])
        result.polygons.foreach_set("material_index", [slots[item] for item in names])
        smooth = [s for s, block in zip(self._smooth, self._faces, strict=True) for _ in range(len(block))]
        result.polygons.foreach_set("use_smooth", smooth)
        if outward:
            _weld_and_orient(result)
        result.set_sharp_from_angle(angle=sharp)
        result.update()
        return result


def _weld_and_orient(mesh: bpy.types.Mesh) -> None:
    work = bmesh.new()
    work.from_mesh(mesh)
    bmesh.ops.remove_doubles(work, verts=work.verts, dist=WELD_DISTANCE)
    bmesh.ops.recalc_face_normals(work, faces=work.faces)
    work.to_mesh(mesh)
    work.free()


def rounded_rectangle(
    width: float, height: float, radius: float, centre: tuple[float, float] = (0, 0)
) -> Array:
    """Outline (n, 2), anticlockwise, of a rectangle with round corners and points along its edges."""
    corners = []
    for turn, (sx, sy) in enumerate([(1, 1), (-1, 1), (-1, -1), (1, -1)]):
        angle = np.radians(90 * turn + np.linspace(0, 90, 5))
        middle = np.array([sx * (width / 2 - radius), sy * (height / 2 - radius)])
        corners.append(middle + radius * np.stack([np.cos(angle), np.sin(angle)], axis=-1))
    path = np.concatenate(corners)
    pieces = []
    for start, end in zip(path, np.roll(path, -1, axis=0), strict=True):
        count = max(1, int(np.ceil(np.linalg.norm(end - start) / 0.08)))
        pieces.append(start + np.linspace(0, 1, count, endpoint=False)[:, None] * (end - start))
    return np.concatenate(pieces) + np.asarray(centre)


def subdivided(points: Array, triangles: NDArray[np.int64], times: int) -> tuple[Array, NDArray[np.int64]]:
    """Triangles, each split ``times`` times into four at the middles of its edges; corners are not shared."""
    corners = points[triangles]
    for _ in range(times):
        a, b, c = np.moveaxis(corners, 1, 0)
        ab, bc, ca = (a + b) / 2, (b + c) / 2, (c + a) / 2
        split = [(a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)]
        corners = np.concatenate([np.stack(part, axis=1) for part in split])
    return corners.reshape(-1, points.shape[1]), np.arange(corners.shape[0] * 3).reshape(-1, 3)


def ellipse(width: float, height: float, centre: tuple[float, float], segments: int = 30) -> Array:
    """Outline (segments, 2), anticlockwise."""
    angle = np.linspace(0, 2 * np.pi, segments, endpoint=False)
    return np.stack([width / 2 * np.cos(angle), height / 2 * np.sin(angle)], axis=-1) + np.asarray(centre)


def place(
    name: str,
    mesh: bpy.types.Mesh,
    collection: bpy.types.Collection,
    location: ArrayLike = (0, 0, 0),
    turn: float = 0.0,
    scale: float = 1.0,
    parent: bpy.types.Object | None = None,
) -> bpy.types.Object:
    """An object of a mesh in a collection, turned about z by an angle in radians."""
    result = bpy.data.objects.new(name, mesh)
    result.location = location
    result.rotation_euler = (0, 0, turn)
    result.scale = (scale, scale, scale)
    result.parent = parent
    collection.objects.link(result)
    return result
