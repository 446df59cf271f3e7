# SPDX-License-Identifier: GPL-3.0-or-later
"""The median without np.median, whose first call imports masked arrays: that takes 17 ms."""

from __future__ import annotations

import numpy as np

from ..typing import Array


def median(values: Array) -> Array:
    """Of values (N, ...) along their first axis, (...), NaN where one is; N > 0."""
    low, high = (len(values) - 1) // 2, len(values) // 2
    # NaN comes last.
    ordered = np.partition(values, (low, high, -1), axis=0)
    return np.where(np.isnan(ordered[-1]), np.nan, 0.5 * (ordered[low] + ordered[high]))
