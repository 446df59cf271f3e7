# SPDX-License-Identifier: GPL-3.0-or-later
"""An order of points in which neighbours are near to each other."""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array, IndexArray

# Bits of each coordinate in a key.
PLACE_BITS = 10
KEY_BITS = 3 * PLACE_BITS


def space_keys(points: Array) -> IndexArray:
    """Keys (N,) of KEY_BITS bits by which points that are near to each other are sorted together.

    points: (2, N) or (3, N), finite, N > 0. Morton: A Computer Oriented Geodetic Data Base (1966).
    """
    off = points - points.min(axis=1, keepdims=True)
    across = np.maximum(off.max(), np.finfo(np.float64).tiny)
    keys = np.zeros(points.shape[1], np.int64)
    for axis, place in enumerate((off / across * (2**PLACE_BITS - 1)).astype(np.int64)):
        keys |= _spread(place) << axis
    return keys


def _spread(bits: IndexArray) -> IndexArray:
    """Numbers of PLACE_BITS bits with two zeros between their bits."""
    bits = (bits | bits << 16) & 0x030000FF
    bits = (bits | bits << 8) & 0x0300F00F
    bits = (bits | bits << 4) & 0x030C30C3
    return (bits | bits << 2) & 0x09249249
