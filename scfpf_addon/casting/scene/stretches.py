# SPDX-License-Identifier: GPL-3.0-or-later
"""Stretches of projectors, along t, that may meet something, from the occupancy grid.

Certain, not sampled: boxes around the control points of a block's pieces are looked up.
"""

from __future__ import annotations

import math
from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...projection.typing import Array, BoolArray, Float32Array, IndexArray
from ...projection.volume.basis import SpanBasis
from .occupancy import SLACK, Occupancy
from .projector_boxes import bounds_of_each, piece_bounds, piece_edges, piece_weights

# Groups of columns of blocks that are looked up together first.
GROUPS = 8

# Side in pixels, about, of the blocks of projectors that are looked up together.
BLOCK = 8

# Parts of a piece that are looked up in the finer cells where the piece meets something.
PARTS = 4


class Stretches(NamedTuple):
    """The stretches of t in which blocks of projectors may meet something.

    edges: (P+1,) in t. held: (P, B) bool. block: (N,) of each projector. grid: the answer of ``members``,
    if known. farthest: the largest coordinate of the control points.
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
        """The part of [0, 1] outside which nothing is met; None if nothing is met at all."""
        some = np.flatnonzero(self.held.any(axis=1))
        return (float(self.edges[some[0]]), float(self.edges[some[-1] + 1])) if len(some) else None

    def take(self, which: IndexArray) -> Stretches:
        """The stretches of the projectors ``which`` and of their blocks only."""
        blocks, block = np.unique(self.block[which], return_inverse=True)
        return self._replace(held=self.held.take(blocks, 1), block=block, grid=None)

    def within(self, low: Array, high: Array) -> BoolArray:
        """Return whether blocks may meet something in [low, high] (C,) of t, (C, B)."""
        first = np.clip(np.searchsorted(self.edges, low, side="right") - 1, 0, len(self.held))
        last = np.clip(np.searchsorted(self.edges, high, side="left"), 0, len(self.held))
        before = np.zeros((len(self.edges), self.held.shape[1]), np.int32)
        np.cumsum(self.held, axis=0, out=before[1:])
        some: BoolArray = before[last] > before[first]
        return some


@lru_cache(maxsize=8)
def _grid_of_blocks(rows: int, columns: int, height: int, width: int) -> tuple[IndexArray, IndexArray]:
    """The block of each pixel (rows · columns,), and the pixels of each block (B, height · width), read-only.

    -1 where a block extends beyond the border. Cached, since nearly all tiles of an image have one size.
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
    """The stretches of ``count`` projectors, in runs, that may meet something anywhere."""
    runs = -(-count // (BLOCK * BLOCK))
    return Stretches(np.array([0.0, 1.0]), np.ones((1, runs), bool), np.arange(count) // (BLOCK * BLOCK))


def stretches(
    occupancy: Occupancy, spans: SpanBasis, points: Float32Array, columns: int | None, apart: float = 0.0
) -> Stretches:
    """Look up projectors in the grid, by blocks.

    points: (K, 3, N) control points, finite, cast space. columns: given if the projectors are rows of so many
    pixels; they are divided into runs otherwise. apart: things nearer than this count as met.
    """
    if columns is None:
        rows, height, width = points[:, :, None], 1, BLOCK * BLOCK
    else:
        rows = points.reshape(*points.shape[:2], -1, columns)
        # Their height divides the rows evenly, so that no block is nearly empty.
        height, width = -(-rows.shape[2] // max(1, round(rows.shape[2] / BLOCK))), BLOCK
    lower, upper = (_reduced(_reduced(rows, f, 2, height), f, 3, width) for f in (np.minimum, np.maximum))
    farthest = max(float(upper.max()), -float(lower.min()))
    slack = np.float32(apart + SLACK * (1.0 + farthest))
    held = _held(occupancy, spans, lower, upper, slack)
    least, most = (a.reshape(*a.shape[:2], -1) for a in (lower, upper))
    fine = _parts(occupancy, spans, held.reshape(len(held), -1), least, most, slack)
    block, members = _grid_of_blocks(rows.shape[2], rows.shape[3], height, width)
    return Stretches(piece_edges(spans, PARTS), fine, block, members, farthest)


def _held(
    occupancy: Occupancy, spans: SpanBasis, lower: Float32Array, upper: Float32Array, slack: np.float32
) -> BoolArray:
    """Return whether pieces may meet something, (P, rows of blocks, columns of blocks).

    lower, upper: (K, 3, rows of blocks, columns of blocks), bounds of the blocks' control points.
    """
    weights = piece_weights(spans)
    held = np.zeros((len(weights), *lower.shape[2:]), bool)
    # Groups of blocks are looked up first: where they meet nothing, their blocks need not be.
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
    return held


def _parts(
    occupancy: Occupancy,
    spans: SpanBasis,
    held: BoolArray,
    lower: Float32Array,
    upper: Float32Array,
    slack: np.float32,
) -> BoolArray:
    """Return whether each of the PARTS of pieces meets something, where the pieces do, (PARTS·P, B).

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
    values = np.moveaxis(values, axis, -1)
    whole = values.shape[-1] // length * length
    runs = values[..., :whole].reshape(*values.shape[:-1], -1, length)
    parts = [least.reduce(runs, axis=-1)]
    if whole < values.shape[-1]:
        parts.append(least.reduce(values[..., whole:], axis=-1, keepdims=True))
    return np.moveaxis(np.concatenate(parts, axis=-1), -1, axis)
