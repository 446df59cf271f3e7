# SPDX-License-Identifier: GPL-3.0-or-later
"""A tree of boxes around convex bodies: triangles, moving triangles, bounding boxes of objects."""

from __future__ import annotations

from collections.abc import Iterator
from functools import reduce
from itertools import product
from typing import NamedTuple

import numpy as np

from ...projection.typing import Array, BoolArray, Float32Array, IndexArray
from ..common.space_order import KEY_BITS, space_keys
from .cut_triangles import cut_triangles

# Children of a node.
CHILDREN = 4

# Bodies in a tree at most, for its memory: 200 bytes a triangle, and twice that while it is made.
BODIES = 1 << 21

# Points of a triangle.
TRIANGLE = 3

# Bodies are sorted by size first, in classes that differ by this factor: one large triangle among small ones
# would widen the boxes of all nodes above it.
SIZE_CLASS = 4.0
SIZE_CLASSES = 16

# A ray may meet a triangle this far beside it, as a share of the triangle's largest coordinate: four
# roundings of float32. Where a triangle is far larger than a cell, this is more than the cell's own slack.
ROUNDING = 2.0**-22

# A row of a table of boxes: the lower corner, the upper one negated, and two that never decide.
ROW = 8


class BodyTree(NamedTuple):
    """Bodies and the boxes of their tree.

    points: (M, K, 3), the points of each body, sorted. room: (M,), how far beside each a ray may meet it.
    boxes: (N, ROW) float32 of ``facing``, of the M bodies, then of their parents and so on. The children of a
    node are CHILDREN neighbours; boxes that meet nothing fill up their number. child: (N,) the first child of
    each node, -1 for bodies. extent: (N,) float32, the longest side of each box. roots: (R,) the nodes that
    have no parents.
    """

    points: Array
    room: Array
    boxes: Float32Array
    child: IndexArray
    extent: Float32Array
    roots: IndexArray


def boxes_as_bodies(lower: Array, upper: Array) -> Array:
    """The eight corners of boxes from lower to upper (3, M), as a body's points (8, 3, M)."""
    both = np.stack([lower, upper])
    corners = [[both[side, axis] for axis, side in enumerate(sides)] for sides in product((0, 1), repeat=3)]
    return np.array(corners, np.float64)


def trees_of(points: Array, lower: Array, upper: Array) -> Iterator[BodyTree]:
    """Trees of the bodies ``points`` (K, 3, M), finite, that may meet a box (3,); BODIES in each, about."""
    for start in range(0, points.shape[2], BODIES):
        some = points[:, :, start : start + BODIES]
        least, most = some.min(axis=0), some.max(axis=0)
        room = ROUNDING * np.maximum(-least, most).max(axis=0)
        near = (least - room <= upper[:, None]).all(axis=0) & (most + room >= lower[:, None]).all(axis=0)
        some, room = some[:, :, near], room[near]
        if len(some) == TRIANGLE and len(room):
            some, owner = cut_triangles(some, lower - room.max(), upper + room.max())
            room = room[owner]
        if len(room):
            yield _tree_of(some, room)


def _tree_of(points: Array, room: Array) -> BodyTree:
    """The tree of bodies (K, 3, M), whose boxes are widened by room (M,)."""
    lower, upper = points.min(axis=0), points.max(axis=0)
    order = _order(lower, upper)
    lower, upper, room = lower[:, order], upper[:, order], room[order]
    low, high = rounded_out(lower - room, upper + room)
    levels: list[tuple[Float32Array, Float32Array]] = []
    starts, children = [0], []
    while True:
        count = -(-low.shape[1] // CHILDREN) * CHILDREN
        spare = ((0, 0), (0, count - low.shape[1]))
        low = np.pad(low, spare, constant_values=np.inf)
        high = np.pad(high, spare, constant_values=-np.inf)
        children.append(starts[-2] + CHILDREN * np.arange(count) if levels else np.full(count, -1))
        levels.append((low, high))
        starts.append(starts[-1] + count)
        if count == CHILDREN:
            break
        low, high = parents(low, high)
    low, high = (np.concatenate(side, axis=1) for side in zip(*levels, strict=True))
    extent = (high - low).max(axis=0)
    roots = np.arange(starts[-2], starts[-1])
    sorted_points = np.ascontiguousarray(points.take(order, axis=2).transpose(2, 0, 1))
    return BodyTree(sorted_points, room, facing(box_rows(low, high)), np.concatenate(children), extent, roots)


def parents(lower: Float32Array, upper: Float32Array) -> tuple[Float32Array, Float32Array]:
    """The boxes (3, M / CHILDREN) around each CHILDREN neighbours of boxes (3, M)."""
    # NumPy takes several times as long to reduce so short an axis.
    low, high = (
        reduce(f, (side[:, child::CHILDREN] for child in range(CHILDREN)))
        for f, side in ((np.minimum, lower), (np.maximum, upper))
    )
    return low, high


def rounded_out(lower: Array, upper: Array) -> tuple[Float32Array, Float32Array]:
    """Boxes (3, M) in float32 that contain the given ones."""
    with np.errstate(over="ignore"):
        low, high = lower.astype(np.float32), upper.astype(np.float32)
    np.nextafter(low, np.float32(-np.inf), out=low, where=low > lower)
    np.nextafter(high, np.float32(np.inf), out=high, where=high < upper)
    return low, high


def box_rows(lower: Float32Array, upper: Float32Array) -> Float32Array:
    """The rows (M, ROW) of boxes (3, M), for ``meet``."""
    rows = np.full((lower.shape[1], ROW), -np.inf, np.float32)
    rows[:, :3], rows[:, 3:6] = lower.T, -upper.T
    return rows


def facing(rows: Float32Array) -> Float32Array:
    """The rows of boxes (M, ROW) as the other side of ``meet`` needs them."""
    return rows[:, [3, 4, 5, 0, 1, 2, 6, 7]]


def meet(rows: Float32Array, others: Float32Array) -> BoolArray:
    """Return whether boxes meet, (M,). rows: (M, ROW). others: (M, ROW) of ``facing``."""
    # Each sum is a lower bound of one box less the upper bound of the other.
    with np.errstate(invalid="ignore"):
        apart = rows + others <= 0.0
    # Eight truth values at once.
    found: BoolArray = apart.view(np.uint64).ravel() == np.frombuffer(b"\1" * ROW, np.uint64)[0]
    return found


def _order(lower: Array, upper: Array) -> IndexArray:
    """An order of bodies in boxes (3, M) in which neighbours are of like size and near to each other."""
    size = (upper - lower).max(axis=0)
    largest = max(float(size.max()), np.finfo(np.float64).tiny)
    with np.errstate(divide="ignore"):
        kind = np.clip(-np.log(size / largest) / np.log(SIZE_CLASS), 0, SIZE_CLASSES - 1)
    key = kind.astype(np.int64) << KEY_BITS | space_keys(0.5 * lower + 0.5 * upper)
    return np.argsort(key, kind="stable")
