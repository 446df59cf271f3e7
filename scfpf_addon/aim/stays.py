# SPDX-License-Identifier: GPL-3.0-or-later
"""Stays: points of the scene that shall remain where the old image shows them."""

from __future__ import annotations

import numpy as np

from ..projection.typing import Array, BoolArray
from ..projection.volume.viewing_volume import Projection
from .aim_scene import AimScene
from .solver.problem import AimPins, AimStays

# Positions along x and y of the image.
GRID = (64, 32)


def halo_weights(points: Array, pins: AimPins, halos: Array) -> Array:
    """Weights (N,) of world points (3, N): 0 at a pin, rising smoothly to 1 at its halo's radius.

    halos: (P,), radii in world units; 0 for pins without a halo.
    """
    weights = np.ones(points.shape[1])
    for pin in np.flatnonzero(halos > 0.0):
        share = np.linalg.norm(points - pins.points[:, pin, None], axis=0) / halos[pin]
        share = np.minimum(share, 1.0)
        weights = np.minimum(weights, share * share * (3.0 - 2.0 * share))
    return weights


def find_stays(
    projection: Projection,
    scene: AimScene,
    pins: AimPins,
    halos: Array,
    wanted: BoolArray,
    width: int,
    grid: tuple[int, int] = GRID,
) -> AimStays:
    """Cast the old image and keep what it shows, without the things that pins show.

    projection: of the start, in world space. halos: (P,), see ``halo_weights``. wanted: (T,), the
    triangles of these things. width: of the image in pixels.
    """
    x, y = (np.linspace(0.0, 1.0, count) for count in grid)
    hits = scene.hits(projection, np.repeat(x, len(y)), np.tile(y, len(x)), width)
    kept = np.flatnonzero((hits.triangle >= 0) & ~wanted[hits.triangle])
    points, t, weights = np.zeros((3, len(x) * len(y))), *np.zeros((2, len(x) * len(y)))
    points[:, kept] = scene.world(hits.position[:, kept])
    t[kept], weights[kept] = hits.t[kept], halo_weights(points[:, kept], pins, halos)
    return AimStays(x, y, points.reshape(3, *grid), t.reshape(grid), weights.reshape(grid))
