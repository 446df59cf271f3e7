# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parts of space are empty, and which parts of projectors lie there.

Certain, not sampled: cells are marked by boxes around pieces of triangles, and
projectors are looked for by boxes around the control points of their pieces.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache
from itertools import pairwise, product
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, Float32Array, IndexArray
from ...projection.volume.basis import SpanBasis
from .projector_boxes import bounds_of_each, piece_bounds, piece_edges, piece_weights

# Cells of a scene's bounds, nearly cubes: so many a triangle, of any scene at least and at most, and
# the most along an axis. A million boxes have four times the cells of fewer, which takes half a second
# and saves a fifth to a third of the chords.
CELLS_EACH = 8
CELLS = 1 << 21
MOST_CELLS = 1 << 24
MOST_ALONG = 512

# Finer cells along an axis of a cell.
FINER = 2

# The finer cells are counted modulo this: boxes of fewer cells are told apart all the same.
MODULUS = 256

# Triangles whose boxes fill more than this many of the finer cells are cut in four, so often at
# most: a box around a large one that lies askew holds mostly nothing.
LARGE = 18.0
CUTS = 6

# Boxes of more cells than this are marked by their corners alone.
MOST_MARKED = 96

# Triangles that are marked at a time: what that takes on the way is ten times the triangles.
AT_ONCE = 1 << 18

# No more pieces than this are made of these: what is still large then keeps its box.
MOST_PIECES = 4_000_000

# Boxes are wider than what they hold by this share of the scene: sixteen roundings of float32,
# for the boxes' own and for what Embree makes of both.
SLACK = 2.0**-20

# Groups of columns of blocks that are looked at together first.
GROUPS = 8

# Side in pixels, about, of the blocks of projectors that are looked at together.
BLOCK = 8

# Parts of a piece that are looked at in the finer cells where the piece meets something.
PARTS = 4


@dataclass(frozen=True)
class Occupancy:
    """A grid over the scene's bounds that can be asked whether boxes are empty.

    sums: (X+1, Y+1, Z+1) int32, how many cells before (x, y, z) hold something: an
    integral image (Crow 1984) in three dimensions. finer: the same of FINER times as many
    cells along each axis, uint8, modulo MODULUS. lower: (3,), scale: (3,), cells in a cast unit.
    """

    sums: IndexArray
    finer: NDArray[np.uint8]
    lower: Array
    scale: Array

    @classmethod
    def of(cls, corners: Array, around: float = 0.0) -> Occupancy:
        """The grid of triangles (3 corners, 3, T) in cast space, with all that is as near as ``around``."""
        lower, upper = corners.min(axis=(0, 2)) - around, corners.max(axis=(0, 2)) + around
        size = np.maximum(upper - lower, SLACK)
        lower, size = lower - SLACK, size + 2.0 * SLACK
        count = min(max(CELLS, CELLS_EACH * corners.shape[2]), MOST_CELLS)
        cells = FINER * np.clip(size * np.cbrt(count / size.prod()), 1, MOST_ALONG).astype(np.intp)
        scale = cells / size
        held = np.zeros(cells, bool)
        slack = ((SLACK + around) * scale)[:, None]
        for start in range(0, corners.shape[2], AT_ONCE):
            some = corners[:, :, start : start + AT_ONCE]
            for piece in _small_pieces((some - lower[:, None]) * scale[:, None]):
                first = np.clip(piece.min(axis=0) - slack, 0, cells[:, None] - 1).astype(np.intp)
                last = np.clip(piece.max(axis=0) + slack, 0, cells[:, None] - 1).astype(np.intp)
                _mark(held, first, last - first + 1)
        coarse = held
        for axis in range(3):
            parts = np.moveaxis(coarse, axis, 0)
            coarse = np.moveaxis(np.logical_or.reduce([parts[k::FINER] for k in range(FINER)]), 0, axis)
        sums, finer = np.zeros(cells // FINER + 1, np.int32), np.zeros(cells + 1, np.uint8)
        sums[1:, 1:, 1:], finer[1:, 1:, 1:] = coarse, held
        return cls(_running_sums(sums), _running_sums(finer), lower, scale / FINER)

    def holds(self, lower: Array, upper: Array) -> BoolArray:
        """Whether boxes from lower to upper (3, …), cast space, meet a cell that holds something."""
        first, last = self._cells(lower, upper, 1)
        held: BoolArray = _counted(self.sums, first, last) != 0
        return held

    def holds_finely(self, lower: Array, upper: Array) -> BoolArray:
        """As ``holds``, by the finer cells; boxes over too many of these hold something."""
        first, last = self._cells(lower, upper, FINER)
        size = last - first
        held: BoolArray = _counted(self.finer, first, last) != 0
        held |= size[0] * size[1] * size[2] >= MODULUS
        return held

    def _cells(self, lower: Array, upper: Array, finer: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """The first cell of each box along each axis and the one after the last, (3, …) both."""
        shape = (3,) + (1,) * (lower.ndim - 1)
        origin, scale = (a.reshape(shape).astype(lower.dtype) for a in (self.lower, finer * self.scale))
        most = finer * (np.array(self.sums.shape) - 1).reshape(shape)
        with np.errstate(invalid="ignore", over="ignore"):
            least, past = lower - origin, upper - origin
            least *= scale
            past *= scale
            past += 1.0
            # Integers are what is left of the point; below 0 nothing is.
            first = np.clip(least, 0, most, out=least).astype(np.int32)
            last = np.clip(past, 0, most, out=past).astype(np.int32)
        return first, last


def _mark(held: BoolArray, first: IndexArray, size: IndexArray) -> None:
    """Set the cells of boxes; first: (3, M) lowest cells, size: (3, M) cells along each axis."""
    few = size.prod(axis=0) <= MOST_MARKED
    flat, (_, row, plane) = held.reshape(-1), held.shape
    number = (first[0] * row + first[1]) * plane + first[2]
    # Boxes of one shape together.
    shape = (size[0] * (MOST_MARKED + 1) + size[1]) * (MOST_MARKED + 1) + size[2]
    shape[~few] = 0
    order = np.argsort(shape.astype(np.int32))
    ends = np.flatnonzero(np.diff(shape[order], append=-1)) + 1
    for start, end in pairwise((0, *ends.tolist())):
        if shape[order[start]] == 0:
            _mark_large(held, first.take(order[start:end], 1), size.take(order[start:end], 1))
            continue
        base = number.take(order[start:end])
        for x, y, z in product(*(range(n) for n in size[:, order[start]].tolist())):
            flat[base + ((x * row + y) * plane + z)] = True


def _mark_large(held: BoolArray, first: IndexArray, size: IndexArray) -> None:
    """As _mark: a box is the running sum of +1 and -1 at its corners."""
    changes = np.zeros(np.array(held.shape) + 1, np.int32)
    for corner in product((0, 1), repeat=3):
        place = tuple(first + size * np.array(corner)[:, None])
        np.add.at(changes, place, 1 - 2 * (sum(corner) % 2))
    held |= _running_sums(changes)[:-1, :-1, :-1] > 0


def _running_sums(cells: NDArray[Any]) -> NDArray[Any]:
    """Running sums along all three axes, in place; slice by slice is four times as fast as cumsum."""
    for k in range(1, len(cells)):
        cells[k] += cells[k - 1]
    for k in range(1, cells.shape[1]):
        cells[:, k] += cells[:, k - 1]
    np.cumsum(cells, axis=2, out=cells)
    return cells


def _counted(sums: NDArray[Any], first: NDArray[np.int32], last: NDArray[np.int32]) -> NDArray[Any]:
    """The cells in boxes that hold something, from their running sums, in their precision."""
    row, plane = sums.shape[2], sums.shape[1] * sums.shape[2]
    x0, x1 = first[0] * plane, last[0] * plane
    y0, y1 = first[1] * row, last[1] * row
    flat = sums.ravel()
    corners = [x1 + y1, x0 + y1, x1 + y0, x0 + y0]
    count = np.zeros(first.shape[1:], sums.dtype)
    for z, far in ((last[2], True), (first[2], False)):
        for corner, adds in zip(corners, (True, False, False, True), strict=True):
            if adds == far:
                count += flat.take(corner + z)
            else:
                count -= flat.take(corner + z)
    return count


def _small_pieces(corners: Array) -> list[Array]:
    """Triangles (3 corners, 3, T), the large ones cut up, in units of cells."""
    pieces = []
    for cut in range(CUTS + 1):
        across = corners.max(axis=0) - corners.min(axis=0) + 1.0
        large = np.flatnonzero(across[0] * across[1] * across[2] > LARGE)
        if cut == CUTS or 4 * len(large) > MOST_PIECES:
            large = large[:0]
        small = np.ones(corners.shape[2], bool)
        small[large] = False
        pieces.append(corners[:, :, small])
        if len(large) == 0:
            break
        a, b, c = corners[:, :, large]
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        quarters = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        corners = np.concatenate([np.stack(quarter) for quarter in quarters], axis=2)
    return pieces


class Stretches(NamedTuple):
    """Where along t blocks of projectors may meet something.

    edges: (P+1,) in t. held: (P, B) bool. block: (N,) of each projector. grid: what ``members``
    answers, if that is known. farthest: no coordinate of the control points is larger.
    """

    edges: Array
    held: BoolArray
    block: IndexArray
    grid: IndexArray | None = None
    farthest: float = math.inf

    def members(self) -> IndexArray:
        """The projectors of each block, (B, most in one), -1 where there are fewer."""
        if self.grid is not None:
            return self.grid
        # NumPy sorts 16 bits by radix, in a tenth of the time.
        few = self.held.shape[1] <= np.iinfo(np.uint16).max
        order = np.argsort(self.block.astype(np.uint16) if few else self.block, kind="stable")
        counts = np.bincount(self.block, minlength=self.held.shape[1])
        most = int(counts.max(initial=1))
        if counts.min(initial=most) == most:
            return order.reshape(-1, most)
        members = np.full(len(counts) * most, -1)
        before = np.cumsum(counts) - counts
        members[np.arange(len(order)) + np.repeat(np.arange(len(counts)) * most - before, counts)] = order
        return members.reshape(-1, most)

    @property
    def reach(self) -> tuple[float, float] | None:
        """The part of [0, 1] outside which nothing is met; None if nothing is at all."""
        some = np.flatnonzero(self.held.any(axis=1))
        return (float(self.edges[some[0]]), float(self.edges[some[-1] + 1])) if len(some) else None

    def take(self, which: IndexArray) -> Stretches:
        """Those of the projectors ``which``, and of the blocks only theirs."""
        blocks, block = np.unique(self.block[which], return_inverse=True)
        return self._replace(held=self.held.take(blocks, 1), block=block, grid=None)

    def within(self, low: Array, high: Array) -> BoolArray:
        """Whether blocks may meet something in [low, high] (C,) of t, (C, B)."""
        first = np.clip(np.searchsorted(self.edges, low, side="right") - 1, 0, len(self.held))
        last = np.clip(np.searchsorted(self.edges, high, side="left"), 0, len(self.held))
        some: BoolArray = np.zeros((len(first), self.held.shape[1]), bool)
        if len(first) > len(self.held):
            before = np.zeros((len(self.edges), self.held.shape[1]), np.int32)
            np.cumsum(self.held, axis=0, out=before[1:])
            np.greater(before[last], before[first], out=some)
            return some
        for chord, (start, end) in enumerate(zip(first.tolist(), last.tolist(), strict=True)):
            np.logical_or.reduce(self.held[start:end], axis=0, out=some[chord])
        return some


@lru_cache(maxsize=8)
def _grid_of_blocks(rows: int, columns: int, height: int, width: int) -> tuple[IndexArray, IndexArray]:
    """The block of each pixel (rows · columns,), and the pixels of each block (B, height · width), read-only.

    -1 where a block reaches over the border. Nearly all tiles of a picture have one size.
    """
    row, column = np.arange(rows) // height, np.arange(columns) // width
    block = (row[:, None] * (column[-1] + 1) + column).ravel()
    members = np.full(((row[-1] + 1) * height, (column[-1] + 1) * width), -1)
    members[:rows, :columns] = np.arange(rows * columns).reshape(rows, columns)
    members = members.reshape(row[-1] + 1, height, column[-1] + 1, width).swapaxes(1, 2)
    members = np.ascontiguousarray(members).reshape(-1, height * width)
    for kept in (block, members):
        kept.setflags(write=False)
    return block, members


def everywhere(count: int) -> Stretches:
    """Stretches of ``count`` projectors in runs that may meet something anywhere."""
    runs = -(-count // (BLOCK * BLOCK))
    return Stretches(np.array([0.0, 1.0]), np.ones((1, runs), bool), np.arange(count) // (BLOCK * BLOCK))


class Boxes(NamedTuple):
    """The bounds of the control points of blocks of projectors.

    lower, upper: (K, 3, rows of blocks, columns of blocks). block: (N,) of each projector. members:
    (B, most in one), as ``Stretches.members`` has them.
    """

    lower: Float32Array
    upper: Float32Array
    block: IndexArray
    members: IndexArray

    @property
    def farthest(self) -> float:
        """The largest coordinate; NaN where some are."""
        return max(float(self.upper.max()), -float(self.lower.min()))


def boxes_of_blocks(points: Float32Array, columns: int | None) -> Boxes:
    """Bounds of blocks. points: (K, 3, N). columns: the projectors are rows of so many pixels, or runs."""
    if columns is None:
        rows, height, width = points[:, :, None], 1, BLOCK * BLOCK
    else:
        rows = points.reshape(*points.shape[:2], -1, columns)
        # As high as makes them all of one height, so that none is left nearly empty.
        height, width = -(-rows.shape[2] // max(1, round(rows.shape[2] / BLOCK))), BLOCK
    lower, upper = (_reduced(_reduced(rows, f, 2, height), f, 3, width) for f in (np.minimum, np.maximum))
    return Boxes(lower, upper, *_grid_of_blocks(rows.shape[2], rows.shape[3], height, width))


def stretches(occupancy: Occupancy, spans: SpanBasis, boxes: Boxes, apart: float = 0.0) -> Stretches:
    """Look for blocks of projectors in the grid.

    boxes: finite, cast space. apart: what is that near counts as met.
    """
    lower, upper, block, members = boxes
    farthest = boxes.farthest
    weights = piece_weights(spans)
    slack = np.float32(apart + SLACK * (1.0 + farthest))
    held = np.zeros((len(weights), *lower.shape[2:]), bool)
    # Groups of blocks are looked at first: where they meet nothing, their blocks need not be.
    starts = (*range(0, held.shape[2], -(-held.shape[2] // GROUPS)), held.shape[2])
    least = np.minimum.reduceat(lower.min(axis=2), starts[:-1], axis=2)
    most = np.maximum.reduceat(upper.max(axis=2), starts[:-1], axis=2)
    low, high = piece_bounds(weights, least, most)
    met = occupancy.holds(low - slack, high + slack)
    parts, bounds = [], []
    for (start, end), group in zip(pairwise(starts), met.T, strict=True):
        some = np.flatnonzero(group)
        if len(some):
            ends = (a[..., start:end].reshape(*a.shape[:2], -1) for a in (lower, upper))
            low, high = piece_bounds(weights[some], *ends)
            bounds.append((low.reshape(3, -1), high.reshape(3, -1)))
            parts.append((some, start, end))
    if parts:
        low, high = (np.concatenate(each, axis=1) for each in zip(*bounds, strict=True))
        low -= slack
        high += slack
        inside, done = occupancy.holds(low, high), 0
        for some, start, end in parts:
            shape = len(some), held.shape[1], end - start
            held[some, :, start:end] = inside[done : done + np.prod(shape)].reshape(shape)
            done += np.prod(shape)
    least, most = (a.reshape(*a.shape[:2], -1) for a in (lower, upper))
    fine = _parts(occupancy, spans, held.reshape(len(held), -1), least, most, slack)
    return Stretches(piece_edges(spans, PARTS), fine, block, members, farthest)


def _parts(
    occupancy: Occupancy,
    spans: SpanBasis,
    held: BoolArray,
    lower: Float32Array,
    upper: Float32Array,
    slack: np.float32,
) -> BoolArray:
    """Which of the PARTS of pieces meet something where the pieces do, (PARTS·P, B).

    held: (P, B). lower, upper: (K, 3, B) of the blocks' control points.
    """
    weights = piece_weights(spans, PARTS).reshape(len(held), PARTS, spans.degree + 1, -1)
    parts = np.zeros((len(held), PARTS, held.shape[1]), bool)
    piece, block = np.nonzero(held)
    if len(piece):
        low, high = bounds_of_each(weights, piece, lower.take(block, 2), upper.take(block, 2))
        parts[piece, :, block] = occupancy.holds_finely(low - slack, high + slack).T
    return parts.reshape(-1, held.shape[1])


def _reduced(values: Float32Array, least: np.ufunc, axis: int, length: int) -> Float32Array:
    """Minima or maxima of runs of ``length`` along an axis (ufunc.reduceat takes ten times as long)."""
    values = np.moveaxis(values, axis, 0)
    result = values[::length].copy()
    for k in range(1, min(length, len(values))):
        part = values[k::length]
        least(result[: len(part)], part, out=result[: len(part)])
    return np.moveaxis(result, 0, axis)
