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
    count = len(triangles)
    corners = triangles.T.astype(np.int64)
    ends = np.stack([corners[[1, 2]], corners[[2, 0]], corners[[0, 1]]])
    low, high = ends.min(axis=1).ravel(), ends.max(axis=1).ravel()
    key = low * (int(triangles.max(initial=0)) + 1) + high
    order = np.argsort(key, kind="stable")
    same = key[order[1:]] == key[order[:-1]]
    # Of a run of equal keys the 1st meets the 2nd, the 3rd the 4th and so on.
    starts = np.flatnonzero(np.concatenate([[True], ~same]))
    place = np.arange(len(order)) - np.repeat(starts, np.diff(np.append(starts, len(order))))
    first = np.flatnonzero(same & (place[:-1] % 2 == 0))
    one, other = order[first], order[first + 1]
    result = np.full(3 * count, -1, np.int32)
    result[one], result[other] = other % count, one % count
    return result.reshape(3, count)
