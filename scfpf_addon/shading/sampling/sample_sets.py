# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixed sets of places in a pixel, the same for every pixel, and places on lamps by random numbers."""

from __future__ import annotations

from typing import Literal

import numpy as np

from ...projection.typing import Array, IndexArray
from ..typing import Single

LampShape = Literal["SQUARE", "DISC", "POINT"]

# Multiples of these irrational numbers, modulo 1, never cluster.
GOLDEN = (np.sqrt(5) - 1) / 2
SILVER = np.sqrt(2) - 1
THIRD = np.sqrt(3) - 1


def shuffled(count: int, ratio: float) -> IndexArray:
    """A permutation of 0 … count-1 without clusters: the ranks of ratio, 2 ratio, … modulo 1."""
    ranks: IndexArray = np.argsort(np.argsort(np.arange(1, count + 1) * ratio % 1.0))
    return ranks


def pixel_positions(count: int) -> Array:
    """Positions of ``count`` samples in a pixel, (2, count) in (0, 1).

    Each row and each column of a count × count raster holds one sample, in the
    middle of its cell. One sample is the pixel's centre, four are the rotated
    grid, a Fibonacci number of them is the Fibonacci lattice.
    """
    positions: Array = (np.stack([np.arange(count), shuffled(count, GOLDEN)]) + 0.5) / count
    return positions


def lamp_places(share: Single, shape: LampShape) -> Single:
    """Places (2, n) on a lamp for random numbers (2, n) in [0, 1), evenly.

    SQUARE: in a unit square. DISC: in a disc of diameter 1. POINT: in the middle. The mean is 0.
    """
    if shape == "POINT":
        return np.zeros_like(share)
    if shape == "SQUARE":
        return share - np.float32(0.5)
    turn = share[1] * np.float32(2 * np.pi)
    places: Single = np.stack([np.cos(turn), np.sin(turn)])
    places *= np.sqrt(share[0]) * np.float32(0.5)
    return places
