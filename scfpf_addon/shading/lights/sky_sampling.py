# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions of rays that look for occluders of the sky, importance-sampled by the light from there."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.colors import LUMINANCE
from ...projection.typing import Array, IndexArray
from ..scene.sky_map import NORMAL_ROWS, Gathered, WorldLight, map_directions, map_places
from ..typing import Single

# Directions, each of which stands for an equal part of the soft light.
DIRECTIONS = 1024
# Equal parts of the irradiance of a normal, each from one of the directions.
QUANTILES = 512
# Normals whose parts are computed at once.
AT_ONCE = 512


class SkyDirections(NamedTuple):
    """Directions of equal parts of a sky's soft light, and a table that samples them by normal.

    towards: (3, DIRECTIONS) unit, along a curve that keeps neighbours together. tint: (3, DIRECTIONS)
    colours, of luminance 1. table: (2 NORMAL_ROWS² QUANTILES,) for each normal of a map and each part of its
    irradiance the number of a direction.
    """

    towards: Single
    tint: Single
    table: NDArray[np.uint16]

    @classmethod
    def of(cls, soft: Gathered) -> SkyDirections:
        """The directions of the soft light, given along its curve."""
        towards, color = equal_parts(soft, DIRECTIONS)
        luminance = LUMINANCE @ color
        normals = map_directions(2 * NORMAL_ROWS, NORMAL_ROWS)
        counts = np.empty((normals.shape[1], DIRECTIONS), np.intp)
        for first in range(0, len(counts), AT_ONCE):
            some = slice(first, first + AT_ONCE)
            arriving = np.maximum(normals[:, some].T @ towards, 0.0)
            until = np.cumsum(arriving, axis=1)
            total = until[:, -1:]
            # Normals without irradiance have no directions.
            until = np.divide(until, total, out=np.ones_like(until), where=total > 0.0)
            counts[some] = np.diff(np.rint(until * QUANTILES), axis=1, prepend=0.0)
        directions = np.tile(np.arange(DIRECTIONS, dtype=np.uint16), len(counts))
        return cls(
            towards.astype(np.float32),
            (color / np.where(luminance > 0.0, luminance, 1.0)).astype(np.float32),
            np.repeat(directions, counts.ravel()),
        )

    def rows(self, normal: Single, random: Array) -> IndexArray:
        """Begin of the rows of normals (3, N) in the table, (N,), at random one of the four around each.

        random: (2, N) in [0, 1). The probabilities are those of bilinear interpolation.
        """
        up, along = map_places(normal, NORMAL_ROWS)
        up += random[0] - 0.5
        along += random[1] - 0.5
        row, column = np.floor(up).astype(np.intp), np.floor(along).astype(np.intp)
        # Past a pole the map continues half way around.
        column += NORMAL_ROWS * ((row < 0) | (row >= NORMAL_ROWS))
        np.clip(row, 0, NORMAL_ROWS - 1, out=row)
        found: IndexArray = (row * (2 * NORMAL_ROWS) + column % (2 * NORMAL_ROWS)) * QUANTILES
        return found


@lru_cache(maxsize=2)
def directions_of(light: WorldLight) -> SkyDirections:
    """The directions of a world's soft light, which do not depend on the frame."""
    return SkyDirections.of(light.soft)


def equal_parts(along: Gathered, count: int) -> tuple[Array, Array]:
    """Directions (3, count) that stand for parts of a light with equal luminance, and the parts (3, count).

    along: the light's texels, on a curve that keeps neighbours together.
    """
    luminance = LUMINANCE @ along.light
    until = np.concatenate([[0.0], np.cumsum(luminance)])
    if until[-1] <= 0.0:
        return np.tile([[0.0], [0.0], [1.0]], count), np.zeros((3, count))
    ends = np.linspace(0.0, until[-1], count + 1)
    middle = np.searchsorted(until, 0.5 * (ends[1:] + ends[:-1])) - 1
    sums = np.concatenate([np.zeros((3, 1)), np.cumsum(along.light, axis=1)], axis=1)
    parts = np.diff(np.stack([np.interp(ends, until, channel) for channel in sums]), axis=1)
    return along.direction[:, middle], parts
