# SPDX-License-Identifier: GPL-3.0-or-later
"""Bins over the used part of the UV square: the triangles that touch each, for look-ups of single places."""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from ..typing import Array, IndexArray

# A point this near to a triangle, as a share of the UV square's side, lies on its
# edge: some roundings of float32 UVs (6e-8), and a thousandth of a pixel at 2K.
EDGE_TOLERANCE = 4e-7
# Bins are made larger until their lists hold at most this many numbers a triangle;
# evenly sized triangles need about three.
ENTRIES_PER_TRIANGLE = 32
# Pairs of a point and a triangle that are tested together: they fit into a core's cache.
BLOCK = 65536


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


def layout(uv: Array, used: IndexArray, double_area: Array) -> Layout:
    """The bins over the used triangles of (T, 3, 2) corners. double_area: (T,), twice their areas, signed."""
    uv = np.clip(uv[used], -EDGE_TOLERANCE, 1.0 + EDGE_TOLERANCE)
    if len(used) == 0:
        return Layout(used, 1, np.zeros(2), np.ones(2), 0.0)
    low = uv.min(axis=(0, 1)) - EDGE_TOLERANCE
    extent = uv.max(axis=(0, 1)) + EDGE_TOLERANCE - low
    boxes = np.ptp(uv, axis=1) / extent
    area = (np.abs(double_area[used]) / (2 * extent.prod())).clip(0.0, boxes.prod(axis=1))
    side = math.ceil(math.sqrt(len(used)))
    # A convex outline passes through one bin more than it crosses lines between bins.
    inside, along = area.sum() / len(used), 2 * boxes.sum() / len(used)
    while side > 1 and inside * side**2 + along * side + 4 > ENTRIES_PER_TRIANGLE:
        side = side * 3 // 4
    return Layout(used, side, low, extent, float(inside * len(used)))


def fill(uv: Array, bins: Layout) -> Bins:
    """The lists of used triangles by bin. uv: (T, 3, 2)."""
    used, side, low, extent, _ = bins
    if len(used) == 0:
        return Bins(1, np.zeros(2), np.ones(2), np.zeros(2, np.int64), np.zeros(0, np.int64))
    scale = side / extent
    triangles, cells = [], []
    for start in range(0, len(used), BLOCK):
        some = used[start : start + BLOCK]
        # Unclipped corners: clipping would move the edges.
        triangle, row, column = _covered((uv[some] - low) * scale, side, EDGE_TOLERANCE * scale)
        triangles.append(some[triangle])
        cells.append((row * side + column).astype(np.int32))
    cell = np.concatenate(cells)
    order = np.argsort(cell, kind="stable")
    offsets = np.concatenate([[0], np.cumsum(np.bincount(cell, minlength=side * side))])
    return Bins(side, low, scale, offsets, np.concatenate(triangles)[order])


def _repeated(first: IndexArray, last: IndexArray) -> tuple[IndexArray, IndexArray]:
    """The integers of the ranges first..last (included), and the number of the range of each."""
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
