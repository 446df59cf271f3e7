# SPDX-License-Identifier: GPL-3.0-or-later
"""Which triangles meet at an edge."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


def edge_neighbours(triangles: NDArray[np.int32]) -> NDArray[np.int32]:
    """The triangle across each edge.

    triangles: (T, 3) int32 vertex indices. Returns (3, T) int32: row k holds the
    neighbour across the edge opposite corner k, -1 at a border. Where more than
    two triangles share an edge they are paired in order of their index.
    """
    count, corners = len(triangles), triangles.T
    stride = np.int64(triangles.max(initial=0)) + 1
    keys = np.empty((3, count), np.int64)
    for key, one, other in zip(keys, corners[[1, 2, 0]], corners[[2, 0, 1]], strict=True):
        np.multiply(np.minimum(one, other), stride, out=key)
        key += np.maximum(one, other)
    order = np.argsort(keys.reshape(-1), kind="stable")
    # There may be tens of millions of them: what is not needed any more goes at once.
    keys = keys.reshape(-1).take(order)
    first = np.flatnonzero(keys[1:] == keys[:-1])
    del keys
    # Of a run of equal keys the 1st meets the 2nd, the 3rd the 4th and so on.
    goes_on = np.diff(first, prepend=-2) == 1
    if goes_on.any():
        number = np.arange(len(first))
        start = np.maximum.accumulate(np.where(goes_on, 0, number))
        first = first[(number - start) % 2 == 0]
    one, other = order.take(first), order.take(first + 1)
    result = np.full(3 * count, -1, np.int32)
    result[one] = other % count
    result[other] = one % count
    return result.reshape(3, count)
