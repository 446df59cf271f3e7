# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of triangles: the two on either side of an edge, and alternate pairs of longer runs."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import BoolArray, IndexArray


def edge_neighbours(triangles: NDArray[np.int32]) -> NDArray[np.int32]:
    """Return the triangle across each edge.

    triangles: (T, 3) int32 vertex indices. Returns (3, T) int32: row k holds the
    neighbour across the edge opposite corner k, -1 at a border. More than two
    triangles at an edge are paired in order of their index.
    """
    count, corners = len(triangles), triangles.T
    stride = np.int64(triangles.max(initial=0)) + 1
    keys = np.empty((3, count), np.int64)
    for key, one, other in zip(keys, corners[[1, 2, 0]], corners[[2, 0, 1]], strict=True):
        np.multiply(np.minimum(one, other), stride, out=key)
        key += np.maximum(one, other)
    order = np.argsort(keys.reshape(-1), kind="stable")
    # There may be tens of millions of keys: they are freed as soon as possible.
    keys = keys.reshape(-1).take(order)
    first = np.flatnonzero(keys[1:] == keys[:-1])
    del keys
    first = first[alternate(first)]
    one, other = order.take(first), order.take(first + 1)
    result = np.full(3 * count, -1, np.int32)
    result[one] = other % count
    result[other] = one % count
    return result.reshape(3, count)


def alternate(numbers: IndexArray) -> BoolArray:
    """Return whether each number is 1st, 3rd, 5th … in its run of consecutive ones; numbers: (N,) ascending.

    If number n stands for the pair (n, n + 1), the pairs so chosen do not overlap.
    """
    continues: BoolArray = np.diff(numbers, prepend=-2) == 1
    if not continues.any():
        return np.ones(len(numbers), bool)
    place = np.arange(len(numbers))
    start = np.maximum.accumulate(np.where(continues, 0, place))
    chosen: BoolArray = (place - start) % 2 == 0
    return chosen
