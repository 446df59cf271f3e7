# SPDX-License-Identifier: GPL-3.0-or-later
"""Interpolation in tables."""

from __future__ import annotations

from typing import TypeVar

import numpy as np

from ..projection.typing import Array
from .typing import Single

Values = TypeVar("Values", Array, Single)


def bilinear(table: Values, row: Array, column: Array) -> Values:
    """The values (K, n) of a table (K, R, C) at rows and columns (n,), in the table's precision."""
    low = np.clip(row.astype(np.intp), 0, table.shape[1] - 2)
    left = np.clip(column.astype(np.intp), 0, table.shape[2] - 2)
    up, along = (row - low).astype(table.dtype), (column - left).astype(table.dtype)
    flat, wide = table.reshape(len(table), -1), table.shape[2]
    corner = low * wide + left
    below, above = (
        flat.take(at, axis=1) * (1 - along) + flat.take(at + 1, axis=1) * along
        for at in (corner, corner + wide)
    )
    found: Values = below * (1 - up) + above * up
    return found
