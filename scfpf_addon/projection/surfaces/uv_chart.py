# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles in the UV square: which of them covers a given (u, v).

The square's used part is cut into bins; every bin lists the triangles that
touch it, lowest number first, as one flat array with offsets. A look-up tests
the candidates of its bin in that order, many look-ups at a time.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..typing import Array, BoolArray, IndexArray

# A point this near to a triangle, as a share of the UV square's side, lies on its
# edge: some roundings of float32 UVs (6e-8), and a thousandth of a pixel at 2K.
EDGE_TOLERANCE = 4e-7
# A triangle that is thinner than this share of the UV square's side has no inside
# that float32 UVs could tell.
THINNEST = 1.2e-7
# Bins are made larger until their lists hold at most this many numbers a triangle;
# evenly sized triangles need about three.
ENTRIES_PER_TRIANGLE = 32
# Pairs of a point and a triangle that are tested at a time: what a core's cache holds.
BLOCK = 65536


class Found(NamedTuple):
    """What covers N points.

    triangle: (N,) int64, -1 where nothing does. weights: (2, N) barycentric
    weights of the triangle's second and third corner, 0 where nothing covers.
    """

    triangle: IndexArray
    weights: Array


class Bins(NamedTuple):
    """Lists of triangles by bin: those of bin b are entries[offsets[b]:offsets[b + 1]], ascending.

    low, scale: (2,) bin coordinates are (uv - low) · scale, of a square of ``side`` × ``side`` bins.
    """

    side: int
    low: Array
    scale: Array
    offsets: IndexArray
    entries: IndexArray


class Layout(NamedTuple):
    """The triangles that bins hold, (U,) numbers, and ``side`` × ``side`` bins over ``extent`` from ``low``.

    low, extent: (2,) UV. mean_overlaps: the triangles' areas by that of the part that the bins cover.
    """

    used: IndexArray
    side: int
    low: Array
    extent: Array
    mean_overlaps: float


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
        """From the first corner to the second and the third, (2, 2, T): edge, then u and v."""
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
        """Which triangles have an area and touch [0, 1]², (T,)."""
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
        """The bins that the used part of the square is cut into."""
        used = np.flatnonzero(self.used)
        uv = np.clip(self.uv[used], -EDGE_TOLERANCE, 1.0 + EDGE_TOLERANCE)
        if len(used) == 0:
            return Layout(used, 1, np.zeros(2), np.ones(2), 0.0)
        low = uv.min(axis=(0, 1)) - EDGE_TOLERANCE
        extent = uv.max(axis=(0, 1)) + EDGE_TOLERANCE - low
        boxes = np.ptp(uv, axis=1) / extent
        area = (np.abs(self.double_area[used]) / (2 * extent.prod())).clip(0.0, boxes.prod(axis=1))
        side = math.ceil(math.sqrt(len(used)))
        # A convex outline passes through one bin more than it crosses lines between bins.
        inside, along = area.sum() / len(used), 2 * boxes.sum() / len(used)
        while side > 1 and inside * side**2 + along * side + 4 > ENTRIES_PER_TRIANGLE:
            side = side * 3 // 4
        return Layout(used, side, low, extent, float(inside * len(used)))

    @property
    def mean_overlaps(self) -> float:
        """The mean number of triangles in one place of the used part; builds no bins."""
        return self._layout.mean_overlaps

    @property
    def most_overlaps(self) -> int:
        """The largest number of triangles that a look-up tests."""
        return int(np.diff(self.bins.offsets).max())

    @cached_property
    def bins(self) -> Bins:
        """The lists of used triangles by bin."""
        used, side, low, extent, _ = self._layout
        if len(used) == 0:
            return Bins(1, np.zeros(2), np.ones(2), np.zeros(2, np.int64), np.zeros(0, np.int64))
        scale = side / extent
        triangles, cells = [], []
        for start in range(0, len(used), BLOCK):
            some = used[start : start + BLOCK]
            # Unclipped corners: clipping would move the edges.
            triangle, row, column = _covered((self.uv[some] - low) * scale, side, EDGE_TOLERANCE * scale)
            triangles.append(some[triangle])
            cells.append((row * side + column).astype(np.int32))
        cell = np.concatenate(cells)
        order = np.argsort(cell, kind="stable")
        offsets = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=side * side))])
        return Bins(side, low, scale, offsets, np.concatenate(triangles)[order])

    def find(self, u: Array, v: Array) -> Found:
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
        return Found(triangle, weights)

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
        """How far below 0 each corner's weight is at EDGE_TOLERANCE beyond the opposite edge, (3, T)."""
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
    """For each number in corners (T, 3) the lowest number that triangles connect it to."""
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


def _repeated(first: IndexArray, last: IndexArray) -> tuple[IndexArray, IndexArray]:
    """Every integer of the ranges first..last (included), with the number of its range."""
    count = np.maximum(last - first + 1, 0)
    source = np.repeat(np.arange(len(count)), count)
    place = np.arange(len(source)) - np.repeat(np.cumsum(count) - count, count)
    return source, first[source] + place


def _covered(uv: Array, side: int, pad: Array) -> tuple[IndexArray, IndexArray, IndexArray]:
    """Triangle, row and column of every bin that a triangle touches, triangles ascending.

    uv: (T, 3, 2) in bins. pad: (2,) how far beyond its edges a triangle reaches, in bins.
    """

    def bin_of(place: Array) -> IndexArray:
        """The rows or columns of bins that places are in, any shape; the outermost hold what lies beyond."""
        return np.clip(np.floor(place), 0, side - 1).astype(np.int64)

    low, high = uv[..., 1].min(axis=1) - pad[1], uv[..., 1].max(axis=1) + pad[1]
    triangle, row = _repeated(bin_of(low), bin_of(high))
    bottom, top = row - pad[1], row + 1 + pad[1]
    # The outermost rows take in what lies beyond them.
    bottom, top = np.where(row == 0, -np.inf, bottom), np.where(row == side - 1, np.inf, top)
    lowest, highest = np.full(len(row), np.inf), np.full(len(row), -np.inf)
    for (start_u, start_v), (end_u, end_v) in _edges_of(uv, triangle):
        crossing = (np.minimum(start_v, end_v) <= top) & (np.maximum(start_v, end_v) >= bottom)
        rise = end_v - start_v
        flat = rise == 0
        rise[flat] = 1.0
        for border, other in ((bottom, 0.0), (top, 1.0)):
            along = np.where(flat, other, np.clip((border - start_v) / rise, 0.0, 1.0))
            place = start_u + along * (end_u - start_u)
            lowest = np.where(crossing, np.minimum(lowest, place), lowest)
            highest = np.where(crossing, np.maximum(highest, place), highest)
    # A row that rounding shows no edge in has no bins.
    met = lowest <= highest
    lowest, highest = np.where(met, lowest, 1.0), np.where(met, highest, 0.0)
    first = bin_of(lowest - pad[0])
    last = np.where(met, bin_of(highest + pad[0]), first - 1)
    pair, column = _repeated(first, last)
    return triangle[pair], row[pair], column


def _edges_of(uv: Array, triangle: IndexArray) -> Iterator[tuple[Array, Array]]:
    """The ends (2, P) of the three edges of triangles (P,)."""
    for k in range(3):
        yield uv[triangle, k].T, uv[triangle, (k + 1) % 3].T
