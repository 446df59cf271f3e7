# SPDX-License-Identifier: GPL-3.0-or-later
"""Integral images (Crow 1984) in three dimensions: how many cells of a box are set, in eight look-ups."""

from __future__ import annotations

from itertools import product
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

from ...projection.typing import BoolArray


def integral_image(cells: BoolArray, dtype: DTypeLike = np.int32) -> NDArray[Any]:
    """Return how many of ``cells`` (X, Y, Z) before (x, y, z) are set, (X+1, Y+1, Z+1)."""
    sums = np.zeros(np.array(cells.shape) + 1, dtype)
    sums[1:, 1:, 1:] = cells
    return running_sums(sums)


def running_sums(cells: NDArray[Any]) -> NDArray[Any]:
    """Running sums along all three axes, in place; slice by slice is four times as fast as cumsum."""
    for k in range(1, len(cells)):
        cells[k] += cells[k - 1]
    for k in range(1, cells.shape[1]):
        cells[:, k] += cells[:, k - 1]
    np.cumsum(cells, axis=2, out=cells)
    return cells


def count_in_boxes(sums: NDArray[Any], first: NDArray[np.int32], last: NDArray[np.int32]) -> NDArray[Any]:
    """The number of set cells in boxes, in the dtype of their integral image ``sums``.

    first, last: (3, …) the lowest cells and those after the highest.
    """
    row, plane = sums.shape[2], sums.shape[1] * sums.shape[2]
    across, up = (last[0] * plane, first[0] * plane), (last[1] * row, first[1] * row)
    corners = [(x + y, (i + j) % 2) for (i, x), (j, y) in product(enumerate(across), enumerate(up))]
    flat = sums.ravel()
    count = np.zeros(first.shape[1:], sums.dtype)
    for (k, z), (corner, odd) in product(enumerate((last[2], first[2])), corners):
        if k == odd:
            count += flat.take(corner + z)
        else:
            count -= flat.take(corner + z)
    return count
