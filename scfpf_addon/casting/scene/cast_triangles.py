# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles in cast space, in float64: planes, barycentric weights, neighbours.

Embree works in float32, whose precision is lost far from the origin. So the triangles
are re-centred and scaled in float64 first. That space is *cast space*. Embree only
finds candidates there; hits are computed from the float64 triangles.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, Float32Array, IndexArray
from ..common.hits import CastError, NothingToCastAt
from ..common.parallel import AtFirstUse, chunks, parallel_map
from .cast_space import CastSpace
from .neighbours import edge_neighbours

# A larger coordinate cannot be squared twice in float64; it counts as not finite.
LARGEST_COORDINATE = 1e60

# A triangle whose height is a smaller share of its length has no usable
# barycentric coordinates: float64 keeps 16 digits, the inside test needs some.
FLATTEST = 1e-12

# Secondary rays start this share of the triangle's largest coordinate off its
# plane: 32 float32 roundings (2⁻²³), since Embree rounds the triangle's corners
# and the ray's origin. After Wächter & Binder, Ray Tracing Gems (2019), ch. 6.
ORIGIN_OFFSET = 2.0**-18

# A piece of a large triangle (``graded_triangles``) reaches at most this many times as far from the origin as
# any of its points, or as the core.
PIECE_REACH = 4.0


class CastTriangles:
    """Triangles in cast space.

    vertices: (V, 3) float64, world space; triangles: (T, 3) int32. Triangles with a vertex that is not
    finite and those without area are unusable: never hit. All triangles keep their indices.
    space: that of another scene, which these triangles share; None for their own.
    Raises CastError for an index out of range, NothingToCastAt if no triangle is usable.

    centre, scale, core: see ``CastSpace``, also ``space``. matrix: (4, 4), world to cast space.
    vertices: (3, V) in cast space. lower, upper: (3,) bounds in cast space, within [-1, 1] in a
    space of their own.
    usable: (T,). planes: (4, T) unit normal and offset, so that planes[:3]·p + planes[3] is the
    height of p over the triangle.
    """

    def __init__(
        self,
        vertices: Array,
        triangles: NDArray[np.int32],
        space: CastSpace | None = None,
    ) -> None:
        vertices = np.asarray(vertices, np.float64).reshape(-1, 3)
        self.triangles = np.ascontiguousarray(triangles, np.int32).reshape(-1, 3)
        if self.triangles.size and not 0 <= self.triangles.min() <= self.triangles.max() < len(vertices):
            raise CastError("a triangle names a vertex that does not exist")
        finite: BoolArray = np.ones(len(vertices), bool)
        self.usable: BoolArray = np.ones(len(self.triangles), bool)
        with np.errstate(invalid="ignore"):
            if not max(vertices.max(initial=0.0), -vertices.min(initial=0.0)) < LARGEST_COORDINATE:
                finite = np.all(np.abs(vertices) < LARGEST_COORDINATE, axis=1)
                self.usable = np.all(finite[self.triangles], axis=1)
        if not self.usable.any():
            raise NothingToCastAt("the scene has no triangles: add a mesh, or show one in renders")
        self._place(vertices, finite, space)
        sizes = self._measure()
        if space is None and self.usable.any():
            better = self.space.with_core(vertices, self.triangles, self.usable, sizes)
            if better:
                self._place(vertices, finite, better)
                self._measure()
        self._weights = AtFirstUse(partial(_weights_of, self.vertices, self.triangles, self.usable))
        self._find_neighbours()
        if not self.usable.any():
            raise NothingToCastAt("the scene has no triangle with an area: check the objects' scale")

    def _place(self, vertices: Array, finite: BoolArray, space: CastSpace | None) -> None:
        """Choose cast space, unless it is given, and transform the vertices into it."""
        used = np.zeros(len(vertices), bool)
        used[self.triangles if self.usable.all() else self.triangles[self.usable]] = True
        self.space = space or CastSpace.around(vertices if used.all() else vertices[used])
        self.centre, self.scale, self.core = self.space
        self.matrix: Array = np.diag([self.scale, self.scale, self.scale, 1.0])
        self.matrix[:3, 3] = -self.scale * self.centre
        # Vertices of no usable triangle stay at the origin.
        kept = finite & used
        self.vertices: Array = np.zeros((3, len(vertices)))
        for row, places, middle in zip(self.vertices, vertices.T, self.centre, strict=True):
            np.subtract(places, middle, out=row, where=kept)
        self.vertices *= self.scale
        self.lower: Array = self.vertices.min(axis=1)
        self.upper: Array = self.vertices.max(axis=1)

    def _measure(self) -> NDArray[np.float32]:
        """Compute the planes; triangles without area become unusable. Returns the triangles' sizes, (T,)."""
        sizes = np.empty(len(self.usable), np.float32)
        self.planes: Array = np.empty((4, len(self.usable)))
        self._largest = np.empty(len(self.usable), np.float32)
        largest = np.abs(self.vertices).max(axis=0).astype(np.float32)

        def measure(some: slice) -> None:
            """Planes and largest coordinates of a chunk of triangles."""
            corners = _corners_of(self.triangles[some])
            first, along, across = _edges(self.vertices, corners)
            normal = _cross(along, across)
            area = np.einsum("ct,ct->t", normal, normal)
            longest = np.maximum(np.einsum("ct,ct->t", along, along), np.einsum("ct,ct->t", across, across))
            sizes[some] = np.sqrt(longest)
            self.usable[some] &= area > (FLATTEST * longest) ** 2
            normal *= np.sqrt(_inverse(area, self.usable[some]))
            _fill(self.planes[:, some], normal, first)
            reach = [largest.take(corner, mode="clip") for corner in corners]
            np.maximum(np.maximum(reach[0], reach[1]), reach[2], out=self._largest[some])

        parallel_map(measure, chunks(len(self.usable)))
        return sizes

    def _find_neighbours(self) -> None:
        """Let the neighbours be those of the present usable triangles."""
        self._neighbours = AtFirstUse(partial(_neighbours_of, self.triangles, self.usable))

    @property
    def weights(self) -> Array:
        """(8, T): gradients and offsets of the barycentric weights of the second and the third corner.

        Made at first use, since flat shading needs none. Parts of a scene share them.
        """
        return self._weights.get()

    @property
    def neighbours(self) -> NDArray[np.int32]:
        """(3, T): the triangle across the edge opposite each corner, -1 at a border.

        Only of usable triangles. Made at first use, since straight casting does not need it.
        """
        return self._neighbours.get()

    def corners_at(self, which: IndexArray) -> Array:
        """The corners of triangles ``which`` (n,), (3 corners, 3, n)."""
        corners: Array = self.vertices.take(self.triangles[which].T, 1).swapaxes(0, 1)
        return corners

    def normals(self, triangles: IndexArray) -> Array:
        """Unit geometric normals (3, N); corners are counter-clockwise seen from their tip."""
        normals: Array = self.planes[:3].take(triangles, 1)
        return normals

    def heights(self, positions: Array, triangles: IndexArray) -> Array:
        """Heights (N,) of positions (3, N) over the triangles' planes."""
        plane = self.planes.take(triangles, 1)
        height: Array = np.einsum("cn,cn->n", plane[:3], positions)
        height += plane[3]
        return height

    def barycentric(self, positions: Array, triangles: IndexArray) -> Array:
        """Weights (2, N) of the triangles' second and third corners at positions (3, N)."""
        rows = self.weights.take(triangles, 1, mode="wrap")
        weights = np.empty((2, positions.shape[1]))
        for target, row in zip(weights, (rows[:4], rows[4:]), strict=True):
            np.einsum("cn,cn->n", row[:3], positions, out=target)
            target += row[3]
        return weights

    def clipped_barycentric(self, positions: Array, triangles: IndexArray) -> Array:
        """The weights of ``barycentric``, moved into the triangle where positions are outside."""
        weights = np.clip(self.barycentric(positions, triangles), 0.0, 1.0)
        weights /= np.maximum(weights.sum(axis=0), 1.0)
        return weights

    def offset_origins(self, positions: Array, triangles: IndexArray, directions: NDArray[Any]) -> Array:
        """Origins (3, N) of secondary rays that leave ``triangles`` (N,) at ``positions`` (3, N).

        They are moved off the triangle's plane to the side of ``directions`` (3, N), by ``offsets``.
        """
        normal = self.normals(triangles)
        side = np.copysign(self.offsets(triangles, positions), np.einsum("cn,cn->n", normal, directions))
        origins: Array = positions + normal * side
        return origins

    def offsets(self, triangles: IndexArray, positions: NDArray[Any]) -> Float32Array:
        """The distances (N,) by which rays from ``positions`` (3, N) are moved off ``triangles`` (N,)."""
        offsets: Float32Array = self._largest.take(triangles, mode="wrap")
        if self.core < np.inf:
            reach = np.abs(positions).max(axis=0).astype(np.float32)
            np.minimum(offsets, PIECE_REACH * np.maximum(reach, np.float32(self.core)), out=offsets)
        offsets *= np.float32(ORIGIN_OFFSET)
        return offsets


def _corners_of(triangles: NDArray[np.int32]) -> IndexArray:
    """The vertices of triangles (n, 3), (3, n), in the layout that NumPy indexes fastest with."""
    return triangles.T.astype(np.intp, order="C")


def _edges(vertices: Array, corners: IndexArray) -> tuple[Array, Array, Array]:
    """The first of corners (3, n) among vertices (3, V), and the edges to the second and third, (3, n)."""
    first, along, across = (vertices.take(corner, 1, mode="clip") for corner in corners)
    along -= first
    across -= first
    return first, along, across


def _weights_of(vertices: Array, triangles: NDArray[np.int32], usable: BoolArray) -> Array:
    """The weights of triangles (T, 3), 0 for those that are not usable (T,)."""
    weights: Array = np.empty((8, len(usable)))

    def weigh(some: slice) -> None:
        """Gradients and offsets of a chunk of triangles."""
        first, along, across = _edges(vertices, _corners_of(triangles[some]))
        normal = _cross(along, across)
        inverse = _inverse(np.einsum("ct,ct->t", normal, normal), usable[some])
        _fill(weights[:4, some], _cross(across, normal) * inverse, first)
        _fill(weights[4:, some], _cross(normal, along) * inverse, first)

    parallel_map(weigh, chunks(len(usable)))
    return weights


def _neighbours_of(triangles: NDArray[np.int32], usable: BoolArray) -> NDArray[np.int32]:
    """The neighbours of triangles (T, 3) among those that are usable (T,)."""
    which = np.flatnonzero(usable).astype(np.int32)
    # A miss stays one.
    numbers = np.append(which, np.int32(-1))
    neighbours = np.full((3, len(usable)), -1, np.int32)
    neighbours[:, which] = numbers.take(edge_neighbours(triangles[which]))
    return neighbours


def _inverse(area: Array, usable: BoolArray) -> Array:
    """1 over the squared areas (n,), 0 where they are not usable."""
    return np.divide(1.0, area, out=np.zeros_like(area), where=usable)


def _cross(a: Array, b: Array) -> Array:
    """Vector products of two (3, n) arrays, (3, n); np.cross takes twice as long."""
    product, term = np.empty_like(a), np.empty(a.shape[1])
    for row, (i, j) in zip(product, ((1, 2), (2, 0), (0, 1)), strict=True):
        np.multiply(a[i], b[j], out=row)
        row -= np.multiply(a[j], b[i], out=term)
    return product


def _fill(rows: Array, gradient: Array, first: Array) -> None:
    """Write linear functions of position (4, n) with ``gradient`` (3, n) that are 0 at ``first`` (3, n)."""
    rows[:3] = gradient
    rows[3] = -np.einsum("ct,ct->t", gradient, first)
