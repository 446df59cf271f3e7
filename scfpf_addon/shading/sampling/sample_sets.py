# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixed sets of places in a pixel, and on a lamp for each sample of a pixel.

They are the same for every pixel, so that images have no noise: an edge has as many steps as there are
samples, and a soft shadow as many layers.
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from ...projection.typing import Array, IndexArray

LampShape = Literal["SQUARE", "DISC", "BALL"]

# Multiples of these irrational numbers, modulo 1, never cluster.
GOLDEN = (np.sqrt(5) - 1) / 2
SILVER = np.sqrt(2) - 1
THIRD = np.sqrt(3) - 1
# The largest distance from the centre of places in a unit ball after their mean is subtracted.
BALL_REACH = 1.05
# Nodes of the table that inverts a ball's distribution of radii, with an error below 1e-5.
RADIUS_NODES = 1025


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


def lamp_positions(count: int, shape: LampShape) -> Array:
    """The place on a lamp that lights each of ``count`` samples of a pixel, mean zero.

    SQUARE: (2, count) in a unit square. DISC: (2, count), evenly in a disc of diameter 1. BALL: (3, count),
    in a ball of BALL_REACH, denser towards its surface: it looks like an evenly filled disc from any side.
    The order differs from that in the pixel, so that both dimensions of the lamp are explored across a pixel.
    """
    order = shuffled(count, SILVER)
    a, b = pixel_positions(count).take(order, axis=1)
    if shape == "SQUARE":
        square: Array = np.stack([a, b]) - 0.5
        return square
    turn = 2 * np.pi * b
    places: Array
    if shape == "DISC":
        places = np.sqrt(a) / 2 * np.stack([np.cos(turn), np.sin(turn)])
    else:
        # An even disc is the projection of the density 1/√(1-ρ²); with ρ = sin θ the share of
        # the ball within ρ is 2/π (θ - sin θ cos θ).
        angle = np.linspace(0, np.pi / 2, RADIUS_NODES)
        share = 2 / np.pi * (angle - np.sin(angle) * np.cos(angle))
        radius = np.sin(np.interp((shuffled(count, THIRD) + 0.5) / count, share, angle))
        around = np.sqrt(1 - (1 - 2 * a) ** 2)
        places = radius * np.stack([around * np.cos(turn), around * np.sin(turn), 1 - 2 * a])
    centred: Array = places - places.mean(axis=1, keepdims=True)
    return centred
