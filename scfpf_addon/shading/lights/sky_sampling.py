# SPDX-License-Identifier: GPL-3.0-or-later
"""Where a surface looks for what hides the sky: in proportion to the light that it gets from there."""

from __future__ import annotations

from functools import lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.colors import LUMINANCE
from ...projection.typing import Array
from ..scene.sky_map import NORMAL_ROWS, Gathered, WorldLight, map_directions, map_places
from ..typing import Single

# Directions of equal parts of the even light that are told apart.
DIRECTIONS = 1024
# Equal parts of what a surface of one normal gets, each from one of the directions.
QUANTILES = 512
# Normals of which they are reckoned at once.
AT_ONCE = 512


class Picks(NamedTuple):
    """towards: (3, DIRECTIONS) unit, along a curve that keeps neighbours together. tint: (3, DIRECTIONS)
    colours, of luminance 1. table: (2 NORMAL_ROWS² QUANTILES,) for each normal of a map and each part of what
    arrives there the direction that it comes from.
    """

    towards: Single
    tint: Single
    table: NDArray[np.uint16]

    @classmethod
    def of(cls, even: Gathered) -> Picks:
        """Of the even light on its curve."""
        towards, color = equal_parts(even, DIRECTIONS)
        luminance = LUMINANCE @ color
        normals = map_directions(2 * NORMAL_ROWS, NORMAL_ROWS)
        counts = np.empty((normals.shape[1], DIRECTIONS), np.intp)
        for first in range(0, len(counts), AT_ONCE):
            some = slice(first, first + AT_ONCE)
            arriving = np.maximum(normals[:, some].T @ towards, 0.0)
            until = np.cumsum(arriving, axis=1)
            total = until[:, -1:]
            # Where nothing arrives nothing is looked for.
            until = np.divide(until, total, out=np.ones_like(until), where=total > 0.0)
            counts[some] = np.diff(np.rint(until * QUANTILES), axis=1, prepend=0.0)
        directions = np.tile(np.arange(DIRECTIONS, dtype=np.uint16), len(counts))
        return cls(
            towards.astype(np.float32),
            (color / np.where(luminance > 0.0, luminance, 1.0)).astype(np.float32),
            np.repeat(directions, counts.ravel()),
        )

    def rows(self, normal: Single, chance: Array) -> Array:
        """Where in the table normals (3, N) are, (N,): at one of the four around each, by chance (2, N).

        As often as it is near, so that the mean over many is what lies between them.
        """
        row, column = map_places(normal, NORMAL_ROWS)
        row += chance[0] - 0.5
        column += chance[1] - 0.5
        row, column = np.floor(row).astype(np.intp), np.floor(column).astype(np.intp)
        # Beyond a pole the map goes on half way around.
        column += NORMAL_ROWS * ((row < 0) | (row >= NORMAL_ROWS))
        np.clip(row, 0, NORMAL_ROWS - 1, out=row)
        found: Array = (row * (2 * NORMAL_ROWS) + column % (2 * NORMAL_ROWS)) * QUANTILES
        return found


@lru_cache(maxsize=2)
def picks_of(light: WorldLight) -> Picks:
    """Of a world's even light: it does not depend on the frame."""
    return Picks.of(light.hiding)


def equal_parts(along: Gathered, count: int) -> tuple[Array, Array]:
    """Directions (3, count) with equal shares of a light, and the shares (3, count).

    along: its texels on a curve that keeps neighbours together.
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
