# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parts of space are empty, and which parts of projectors lie there.

Certain, not sampled: cells are marked by boxes around pieces of triangles, and
projectors are looked for by boxes around the control points of their pieces.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..projection.basis import SpanBasis
from ..projection.typing import Array, BoolArray, IndexArray
from .pieces import piece_bounds, piece_edges, piece_weights

Float32Array = NDArray[np.float32]

# Cells along an axis of the scene's bounds.
CELLS = 128

# Triangles whose boxes fill more than this many cells are cut in four, so often at most:
# a box around a large one that lies askew holds mostly nothing.
LARGE = 12.0
CUTS = 5

# No more pieces than this are made: what is still large then keeps its box.
MOST_PIECES = 4_000_000

# Boxes are wider than what they hold by this share of the scene: sixteen roundings of float32,
# for the boxes' own and for what Embree makes of both.
SLACK = 2.0**-20

# Groups of columns of blocks that are looked at together first.
GROUPS = 8

# Side in pixels, about, of the blocks of projectors that are looked at together.
BLOCK = 8


@dataclass(frozen=True)
class Occupancy:
    """A grid over the scene's bounds that can be asked whether boxes are empty.

    sums: (CELLS+1,) * 3 int32, how many cells before (x, y, z) hold something: an
    integral image (Crow 1984) in three dimensions. lower: (3,), scale: (3,), cells in
    a cast unit.
    """

    sums: IndexArray
    lower: Array
    scale: Array

    @classmethod
    def of(cls, corners: Array) -> Occupancy:
        """The grid of triangles (3 corners, 3, T) in cast space."""
        lower, upper = corners.min(axis=(0, 2)), corners.max(axis=(0, 2))
        size = np.maximum(upper - lower, SLACK)
        lower, size = lower - SLACK, size + 2.0 * SLACK
        scale = CELLS / size
        side = CELLS + 1
        changes = np.zeros(side**3, np.int32)
        slack = (SLACK * scale)[:, None]
        for piece in _small_pieces((corners - lower[:, None]) * scale[:, None]):
            first = np.clip(piece.min(axis=0) - slack, 0, CELLS - 1).astype(np.intp)
            last = np.clip(piece.max(axis=0) + slack, 0, CELLS - 1).astype(np.intp) + 1
            # A box is the running sum of +1 and -1 at its corners.
            for sign, x in ((1, first[0]), (-1, last[0])):
                for also, y in ((sign, first[1]), (-sign, last[1])):
                    for then, z in ((also, first[2]), (-also, last[2])):
                        np.add.at(changes, (x * side + y) * side + z, then)
        held = changes.reshape(side, side, side)
        for axis in range(3):
            np.cumsum(held, axis=axis, out=held)
        sums = np.zeros((CELLS + 1,) * 3, np.int32)
        sums[1:, 1:, 1:] = held[:CELLS, :CELLS, :CELLS] > 0
        for axis in range(3):
            np.cumsum(sums, axis=axis, out=sums)
        return cls(sums, lower, scale)

    def holds(self, lower: Array, upper: Array) -> BoolArray:
        """Whether boxes from lower to upper (3, …), cast space, meet a cell that holds something."""
        shape = (3,) + (1,) * (lower.ndim - 1)
        origin, scale = (a.reshape(shape).astype(lower.dtype) for a in (self.lower, self.scale))
        with np.errstate(invalid="ignore", over="ignore"):
            first = np.clip(np.floor((lower - origin) * scale), 0, CELLS).astype(np.int32)
            last = np.clip(np.floor((upper - origin) * scale) + 1, 0, CELLS).astype(np.int32)
        row, plane = CELLS + 1, (CELLS + 1) ** 2
        x0, x1 = first[0] * plane, last[0] * plane
        y0, y1 = first[1] * row, last[1] * row
        flat = self.sums.ravel()
        count = np.zeros(lower.shape[1:], np.int32)
        for z, sign in ((last[2], 1), (first[2], -1)):
            count += sign * (flat[x1 + y1 + z] - flat[x0 + y1 + z] - flat[x1 + y0 + z] + flat[x0 + y0 + z])
        held: BoolArray = count > 0
        return held


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

    edges: (P+1,) in t. held: (P, B) bool. block: (N,) of each projector.
    """

    edges: Array
    held: BoolArray
    block: IndexArray

    def members(self) -> IndexArray:
        """The projectors of each block, (B, most in one), -1 where there are fewer."""
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

    def take(self, which: slice | IndexArray) -> Stretches:
        """Those of the projectors ``which``."""
        return self._replace(block=self.block[which])

    def within(self, low: Array, high: Array) -> BoolArray:
        """Whether blocks may meet something in [low, high] (C,) of t, (C, B)."""
        before = np.zeros((len(self.edges), self.held.shape[1]), np.int32)
        np.cumsum(self.held, axis=0, out=before[1:])
        first = np.clip(np.searchsorted(self.edges, low, side="right") - 1, 0, len(self.held))
        last = np.clip(np.searchsorted(self.edges, high, side="left"), 0, len(self.held))
        held: BoolArray = before[last] > before[first]
        return held


def stretches(occupancy: Occupancy, spans: SpanBasis, points: Float32Array, columns: int | None) -> Stretches:
    """Look for blocks of projectors in the grid.

    points: (K, 3, N) finite control points, cast space, float32. columns: the projectors
    are rows of so many pixels; otherwise runs of them are blocks.
    """
    if columns is None:
        rows, height, width = points[:, :, None], 1, BLOCK * BLOCK
    else:
        rows = points.reshape(*points.shape[:2], -1, columns)
        # As high as makes them all of one height, so that none is left nearly empty.
        height, width = -(-rows.shape[2] // max(1, round(rows.shape[2] / BLOCK))), BLOCK
    lower, upper = (_reduced(_reduced(rows, f, 2, height), f, 3, width) for f in (np.minimum, np.maximum))
    row, column = np.arange(rows.shape[2]) // height, np.arange(rows.shape[3]) // width
    block = (row[:, None] * (column[-1] + 1) + column).ravel()
    weights = piece_weights(spans)
    slack = np.float32(SLACK * (1.0 + max(float(upper.max()), -float(lower.min()))))
    held = np.zeros((len(weights), *lower.shape[2:]), bool)
    # Groups of blocks are looked at first: where they meet nothing, their blocks need not be.
    starts = range(0, held.shape[2], -(-held.shape[2] // GROUPS))
    for start, end in pairwise((*starts, held.shape[2])):
        least, most = lower[..., start:end], upper[..., start:end]
        around = least.min(axis=(2, 3))[:, :, None], most.max(axis=(2, 3))[:, :, None]
        low, high = piece_bounds(weights, *around)
        some = np.flatnonzero(occupancy.holds(low - slack, high + slack))
        if len(some):
            boxes = (a.reshape(*a.shape[:2], -1) for a in (least, most))
            low, high = piece_bounds(weights[some], *boxes)
            inside = occupancy.holds(low - slack, high + slack)
            held[some, :, start:end] = inside.reshape(len(some), *least.shape[2:])
    return Stretches(piece_edges(spans), held.reshape(len(held), -1), block)


def _reduced(values: Float32Array, least: np.ufunc, axis: int, length: int) -> Float32Array:
    """Minima or maxima of runs of ``length`` along an axis (ufunc.reduceat takes ten times as long)."""
    values = np.moveaxis(values, axis, 0)
    result = values[::length].copy()
    for k in range(1, min(length, len(values))):
        part = values[k::length]
        least(result[: len(part)], part, out=result[: len(part)])
    return np.moveaxis(result, 0, axis)
