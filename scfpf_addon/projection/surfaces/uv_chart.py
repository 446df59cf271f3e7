# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles in the UV square, and the one of them that covers a given (u, v).

A look-up tests the triangles of its bin, lowest number first, many look-ups together.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..typing import Array, BoolArray, IndexArray
from .uv_bins import BLOCK, EDGE_TOLERANCE, Bins, Layout, fill, layout

# A triangle that is thinner than this share of the UV square's side has no inside
# that float32 UVs could resolve.
THINNEST = 1.2e-7


class CoveringTriangles(NamedTuple):
    """The triangles that cover N points.

    triangle: (N,) int64, -1 where nothing does. weights: (2, N) barycentric
    weights of the triangle's second and third corner, 0 where nothing covers.
    """

    triangle: IndexArray
    weights: Array


@dataclass(frozen=True, eq=False)
class UVChart:
    """Triangles with UVs at their corners.

    uv: (T, 3, 2). vertices: (T, 3) the mesh vertex at each corner; corners of
    the same vertex and the same UV join triangles into islands. Where triangles
    overlap the lowest number counts; triangles without an area in UV never do.
    Outside of [0, 1]² nothing is covered. Raises ValueError for no triangles,
    arrays of another shape or UVs that are not finite.
    """

    uv: Array
    vertices: IndexArray

    def __post_init__(self) -> None:
        shape = np.shape(self.uv)
        if shape[1:] != (3, 2) or shape[0] == 0 or np.shape(self.vertices) != shape[:2]:
            raise ValueError(
                f"UVs of at least one triangle need the shape (T, 3, 2), their vertices (T, 3), "
                f"got {shape} and {np.shape(self.vertices)}"
            )
        if not np.isfinite(self.uv).all():
            raise ValueError("UVs must be finite numbers")

    @cached_property
    def edges(self) -> Array:
        """The edges from the first corner to the second and the third, (2, 2, T): edge, then u and v."""
        result: Array = np.ascontiguousarray((self.uv[:, 1:] - self.uv[:, :1]).transpose(1, 2, 0), np.float64)
        return result

    @cached_property
    def double_area(self) -> Array:
        """Twice each triangle's area, negative where it is mirrored, (T,)."""
        (bu, bv), (cu, cv) = self.edges
        area: Array = bu * cv - bv * cu
        return area

    @cached_property
    def used(self) -> BoolArray:
        """Return whether each triangle has an area and touches [0, 1]², (T,)."""
        low, high = self.uv.min(axis=1), self.uv.max(axis=1)
        touching = ((low <= 1.0 + EDGE_TOLERANCE) & (high >= -EDGE_TOLERANCE)).all(axis=1)
        used: BoolArray = touching & (np.abs(self.double_area) > THINNEST * self._sides.max(axis=0))
        return used

    @cached_property
    def _sides(self) -> Array:
        """Lengths of the sides opposite to each corner, (3, T)."""
        b, c = self.edges
        return np.stack([np.hypot(*(c - b)), np.hypot(*c), np.hypot(*b)])

    @cached_property
    def slopes(self) -> Array:
        """Derivatives of the second and third corner's weight by u and v, (2, 2, T); 0 if unused."""
        (bu, bv), (cu, cv) = self.edges
        inverse = np.divide(1.0, self.double_area, out=np.zeros(len(self.uv)), where=self.used)
        return np.array([[cv * inverse, -cu * inverse], [-bv * inverse, bu * inverse]])

    @cached_property
    def islands(self) -> IndexArray:
        """The island that each triangle belongs to, (T,) int32, numbered from 0 by their first triangle.

        Triangles that share a vertex with the same UV are of one island. Unused ones join nothing.
        """
        result = np.zeros(len(self.uv), np.int32)
        used = np.flatnonzero(self.used)
        if len(used) == 0:
            return result
        corners = _numbered(self.vertices[used].ravel(), self.uv[used].reshape(-1, 2)).reshape(-1, 3)
        label = _components(corners)[corners[:, 0]]
        # Island numbers in the order of first appearance.
        _, first, number = np.unique(label, return_index=True, return_inverse=True)
        order = np.empty(len(first), np.int32)
        order[np.argsort(first)] = np.arange(len(first), dtype=np.int32)
        result[used] = order[number]
        return result

    @cached_property
    def _layout(self) -> Layout:
        return layout(self.uv, np.flatnonzero(self.used), self.double_area)

    @cached_property
    def bins(self) -> Bins:
        """The lists of used triangles by bin."""
        return fill(self.uv, self._layout)

    @property
    def mean_overlaps(self) -> float:
        """The mean number of triangles in one place of the used part; builds no bins."""
        return self._layout.mean_overlaps

    @property
    def most_overlaps(self) -> int:
        """The largest number of triangles that a look-up tests."""
        return int(np.diff(self.bins.offsets).max())

    def find(self, u: Array, v: Array) -> CoveringTriangles:
        """The triangle that covers each of the points u, v (N,), and the weights of its corners.

        Points that no triangle covers but that are nearer than EDGE_TOLERANCE to
        one take that (the lowest number), continued.
        """
        triangle, weights = np.full(len(u), -1, np.int64), np.zeros((2, len(u)))
        for start in range(0, len(u), BLOCK):
            part = slice(start, start + BLOCK)
            some_u, some_v = u[part], v[part]
            for near in (False, True):
                missing = np.flatnonzero(triangle[part] < 0)
                found, where, share = self._search(some_u[missing], some_v[missing], near)
                triangle[start + missing[where]] = found
                weights[:, start + missing[where]] = share
        return CoveringTriangles(triangle, weights)

    def _search(self, u: Array, v: Array, near: bool) -> tuple[IndexArray, IndexArray, Array]:
        """Triangles found, the points (indices) that they cover, and their weights (2, ·)."""
        bins = self.bins
        within = (np.abs(u - 0.5) <= 0.5 + EDGE_TOLERANCE) & (np.abs(v - 0.5) <= 0.5 + EDGE_TOLERANCE)
        alive = np.flatnonzero(within)
        column, row = (
            np.clip(((a[alive] - low) * scale).astype(np.int64), 0, bins.side - 1)
            for a, low, scale in zip((u, v), bins.low, bins.scale, strict=True)
        )
        first = bins.offsets[row * bins.side + column]
        left = bins.offsets[row * bins.side + column + 1] - first
        triangles, points, weights = [], [], [np.zeros((2, 0))]
        while len(alive):
            kept = left > 0
            alive, first, left = alive[kept], first[kept], left[kept]
            if len(alive) == 0:
                break
            # As many candidates of each at once as the block allows.
            steps = int(min(max(BLOCK // len(alive), 1), left.max()))
            rank = np.minimum(np.arange(steps)[:, None], left - 1)
            candidate = bins.entries.take(first + rank)
            shares, inside = self._inside(candidate, u[alive], v[alive], near)
            hit = np.flatnonzero(inside.any(axis=0))
            chosen = inside[:, hit].argmax(axis=0)
            triangles.append(candidate[chosen, hit])
            points.append(alive[hit])
            weights.append(shares[:, chosen, hit])
            left = left - steps
            left[hit] = 0
            first = first + steps
        if not triangles:
            return np.zeros(0, np.int64), np.zeros(0, np.int64), weights[0]
        return np.concatenate(triangles), np.concatenate(points), np.concatenate(weights, axis=1)

    def _inside(self, triangle: IndexArray, u: Array, v: Array, near: bool) -> tuple[Array, BoolArray]:
        """Weights (2, K, N) of points (N,) in triangles (K, N), and whether those cover them, (K, N)."""
        corner = self._corners
        du, dv = u - corner[0].take(triangle), v - corner[1].take(triangle)
        second, third = (a.take(triangle) * du + b.take(triangle) * dv for a, b in self.slopes)
        first = 1.0 - second - third
        weights = np.stack([second, third])
        if not near:
            return weights, (second >= 0.0) & (third >= 0.0) & (first >= 0.0)
        inside = np.ones(triangle.shape, bool)
        for share, slack in zip((first, second, third), self._slack, strict=True):
            inside &= share >= -slack.take(triangle)
        # Beyond a sharp corner the lines of its two edges stay near for long.
        for a, low, high in zip((u, v), *self._boxes, strict=True):
            inside &= (a >= low.take(triangle)) & (a <= high.take(triangle))
        return weights, inside

    @cached_property
    def _corners(self) -> Array:
        """u and v of the first corners, (2, T)."""
        return np.ascontiguousarray(self.uv[:, 0].T, np.float64)

    @cached_property
    def _slack(self) -> Array:
        """The drop of each corner's weight below 0 at EDGE_TOLERANCE beyond the opposite edge, (3, T)."""
        height = np.abs(self.double_area) / np.maximum(self._sides, np.finfo(np.float64).tiny)
        return np.divide(EDGE_TOLERANCE, height, out=np.zeros(height.shape), where=self.used)

    @cached_property
    def _boxes(self) -> Array:
        """Lowest and highest u and v of each triangle, EDGE_TOLERANCE outside of it, (2, 2, T)."""
        return np.array(
            [self.uv.min(axis=1).T - EDGE_TOLERANCE, self.uv.max(axis=1).T + EDGE_TOLERANCE], np.float64
        )


def _numbered(vertex: IndexArray, uv: Array) -> IndexArray:
    """A number for each corner, the same for the same vertex (C,) at the same uv (C, 2)."""
    keys = np.stack([uv[:, 1], uv[:, 0], vertex.astype(np.float64)])
    order = np.lexsort(keys)
    new = (np.diff(keys[:, order], axis=1) != 0).any(axis=0)
    number = np.empty(len(vertex), np.int64)
    number[order] = np.concatenate([[0], np.cumsum(new)])
    return number


def _components(corners: IndexArray) -> IndexArray:
    """The lowest number that triangles connect each number in corners (T, 3) to."""
    label = np.arange(int(corners.max()) + 1)
    while True:
        own = label[corners]
        lowest = own.min(axis=1)
        if (own == lowest[:, None]).all():
            return label
        # Every tree's root moves below the lowest neighbour's; then all point at their root.
        np.minimum.at(label, own.ravel(), np.repeat(lowest, 3))
        while not np.array_equal(label, above := label[label]):
            label = above
