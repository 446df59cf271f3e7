# SPDX-License-Identifier: GPL-3.0-or-later
"""A map of the light from all directions, split into lamps for small bright spots and the soft rest.

A sun in an image of the sky holds most of its light in a few texels. That part becomes lamps, with shadows
and highlights like other lamps. The soft rest has no peaks: its irradiance is tabulated by normal, and rays
in directions of equal shares of it look for occluders.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...casting.common.cancellation import raise_if_cancelled
from ...projection.colors import LUMINANCE
from ...projection.typing import Array, IndexArray
from ..typing import Single

# Columns and rows of the map: a texel is a third of a degree across, less than the sun.
COLUMNS, ROWS = 1024, 512
# Blocks of the map, 11° wide; the percentile of a block's luminance that is its usual luminance, so that
# small spots fill less than the rest; and the multiple of it beyond which a spot's light becomes lamps.
BLOCK, PERCENTILE, BRIGHT = 32, 75.0, 10.0
# The most lamps of a world, the cone about its brightest texel that each holds, and the least share of
# the world's light in a lamp.
MOST_LAMPS, CONE, LEAST_LAMP = 4, np.cos(np.radians(10.0)), 0.01
# Bright parts of the soft light, which rough reflections look for: the most of them, the cone about its
# brightest texel that each is in, and the least multiple of the mean.
MOST_SPOTS, SPOT_CONE, SPOT_BRIGHT = 8, np.cos(np.radians(12.0)), 4.0
# Rows of the map that irradiance is summed from and spots are found in, and of the map of normals, which
# interpolation reads with an error below 0.2 %.
SOURCE_ROWS, NORMAL_ROWS = 32, 32
# Rows of the map of directions towards the soft light.
SOFT_ROWS = 128


class Gathered(NamedTuple):
    """A map summed into larger texels.

    light: (3, n) times solid angle. direction: (3, n) unit, the mean direction of each texel's light.
    """

    light: Array
    direction: Array


class Spot(NamedTuple):
    """A bright part of the soft light. direction: (3,) unit. cosine: of half the angle of a cone around it.

    radiance: mean luminance there, beyond that of the whole sky.
    """

    direction: Array
    cosine: float
    radiance: float


@dataclass(frozen=True, eq=False)
class WorldLight:
    """A world's light, independent of the frame.

    limit: (ROWS / BLOCK, COLUMNS / BLOCK), luminance beyond which lamps hold a direction's light.
    lamps: (ROWS, COLUMNS) luminance times solid angle, and (3,) irradiance of each.
    irradiance: (3, NORMAL_ROWS + 2, 2 NORMAL_ROWS + 2) of the soft light, with a margin all around.
    soft: the soft light along a curve that fills the sky. spots: its bright parts.
    """

    limit: Array
    lamps: tuple[tuple[Array, Array], ...]
    irradiance: Single
    soft: Gathered
    spots: tuple[Spot, ...] = ()

    @classmethod
    def of(cls, panorama: Array) -> WorldLight:
        """The light of a map of radiance (3, ROWS, COLUMNS), see ``map_directions``."""
        raise_if_cancelled()
        luminance = np.tensordot(LUMINANCE, panorama, 1)
        areas = map_areas(COLUMNS, ROWS)[:, None]
        limit = brightness_limit(luminance, areas)
        ceiling = limit.repeat(BLOCK, axis=0).repeat(BLOCK, axis=1)
        small = 1.0 - np.divide(ceiling, luminance, out=np.ones_like(luminance), where=luminance > ceiling)
        total = float((luminance * areas).sum())
        lamps: tuple[tuple[Array, Array], ...] = ()
        # A black world has no lamps, though rays of mirrors may see another one.
        if total > 0.0 and (luminance * small * areas).sum() >= LEAST_LAMP * total:
            lamps = tuple(_lamps(panorama * (small * areas), LEAST_LAMP * total))
            rest = panorama * (1.0 - small)
        else:
            limit, rest = np.full_like(limit, np.inf), panorama
        raise_if_cancelled()
        rest *= areas
        soft, source = gathered(rest, SOFT_ROWS), gathered(rest, SOURCE_ROWS)
        order = np.argsort(curve_places(SOFT_ROWS))
        return cls(
            limit,
            lamps,
            irradiance_map(source),
            Gathered(soft.light[:, order], soft.direction[:, order]),
            tuple(_spots(source)),
        )

    def without_lamps(self, direction: Array, light: Array) -> Array:
        """The part of the light (3, n) from unit directions (3, n) that lamps do not hold."""
        if not self.lamps:
            return light
        row, column = map_places(direction, len(self.limit))
        last = len(self.limit) - 1
        block = np.clip(np.floor(row), 0, last).astype(np.intp), np.floor(column).astype(np.intp)
        ceiling = self.limit[block[0], block[1] % (2 * (last + 1))]
        luminance = luminance_of(light)
        return light * np.divide(ceiling, luminance, out=np.ones_like(ceiling), where=luminance > ceiling)


def luminance_of(light: Array | Single) -> Array:
    """Luminance of colours (3, n), (n,), whose rounding does not depend on n."""
    red, green, blue = (channel * share for channel, share in zip(light, LUMINANCE, strict=True))
    return np.asarray(red + green + blue, np.float64)


def brightness_limit(luminance: Array, areas: Array) -> Array:
    """The luminance beyond which lamps hold the light, by block, (ROWS / BLOCK, COLUMNS / BLOCK)."""
    blocks = luminance.reshape(ROWS // BLOCK, BLOCK, COLUMNS // BLOCK, BLOCK).swapaxes(1, 2)
    usual = np.percentile(blocks.reshape(*blocks.shape[:2], -1), PERCENTILE, axis=2)
    share = areas.reshape(-1, BLOCK).sum(axis=1)[:, None]
    floor = float((usual * share).sum() / (share.sum() * usual.shape[1]))
    # A large bright area may end just inside the next block.
    wide = np.maximum(usual, np.maximum(np.roll(usual, 1, axis=1), np.roll(usual, -1, axis=1)))
    tall = wide.copy()
    tall[1:] = np.maximum(tall[1:], wide[:-1])
    tall[:-1] = np.maximum(tall[:-1], wide[1:])
    limit: Array = BRIGHT * np.maximum(tall, floor)
    return limit


def _lamps(light: Array, least: float) -> Iterator[tuple[Array, Array]]:
    """The luminance over the map and the colour of each lamp of the bright light (3, ROWS, COLUMNS)."""
    direction = map_directions(COLUMNS, ROWS)
    luminance = np.tensordot(LUMINANCE, light, 1).reshape(-1)
    colors = light.reshape(3, -1)
    for number in range(MOST_LAMPS):
        if luminance.sum() < least:
            return
        near = direction[:, luminance.argmax()] @ direction > CONE
        if number == MOST_LAMPS - 1:
            near[:] = True
        yield np.where(near, luminance, 0.0).reshape(ROWS, COLUMNS), colors[:, near].sum(axis=1)
        luminance = np.where(near, 0.0, luminance)


def _spots(along: Gathered) -> Iterator[Spot]:
    """The bright parts of a light of SOURCE_ROWS rows, brightest first."""
    areas = np.repeat(map_areas(2 * SOURCE_ROWS, SOURCE_ROWS), 2 * SOURCE_ROWS)
    power = LUMINANCE @ along.light
    mean = power.sum() / areas.sum()
    luminance = power / areas
    left = luminance > SPOT_BRIGHT * mean
    for _ in range(MOST_SPOTS):
        if not left.any():
            return
        best = np.where(left, luminance, 0.0).argmax()
        near = left & (along.direction[:, best] @ along.direction > SPOT_CONE)
        middle = along.direction[:, near] @ power[near]
        middle /= np.linalg.norm(middle)
        # Half a texel's diagonal more than to the middle of the farthest.
        angle = np.arccos(np.clip((middle @ along.direction[:, near]).min(), -1.0, 1.0))
        cosine = float(np.cos(angle + np.sqrt(0.5) * np.pi / SOURCE_ROWS))
        yield Spot(middle, cosine, float(power[near].sum() / (2.0 * np.pi * (1.0 - cosine)) - mean))
        left &= ~near


def gathered(light: Array, rows: int) -> Gathered:
    """A map (3, ROWS, COLUMNS) of light times solid angle, as one of rows × 2 rows texels."""
    step = ROWS // rows
    shape = rows, step, 2 * rows, step
    sums = light.reshape(3, *shape).sum(axis=(2, 4)).reshape(3, -1)
    # A millionth of the brightest keeps the mean direction of a dark texel at its middle.
    luminance = np.tensordot(LUMINANCE, light, 1)
    luminance = (luminance + 1e-6 * luminance.max() + 1e-30).reshape(-1)
    weighted = map_directions(COLUMNS, ROWS) * luminance
    middle = weighted.reshape(3, *shape).sum(axis=(2, 4)).reshape(3, -1)
    return Gathered(sums, middle / np.linalg.norm(middle, axis=0))


def irradiance_map(source: Gathered) -> Single:
    """Irradiance by normal without occluders, (3, NORMAL_ROWS + 2, 2 NORMAL_ROWS + 2)."""
    normals = map_directions(2 * NORMAL_ROWS, NORMAL_ROWS).astype(np.float32)
    towards, light = source.direction.astype(np.float32), source.light.astype(np.float32)
    made = np.empty((3, normals.shape[1]), np.float32)
    for first in range(0, normals.shape[1], 1024):
        cosine = normals[:, first : first + 1024].T @ towards
        made[:, first : first + 1024] = light @ np.maximum(cosine, 0, out=cosine).T
    inner = made.reshape(3, NORMAL_ROWS, 2 * NORMAL_ROWS)
    # Past a pole the map continues half way around.
    over = np.roll(inner, NORMAL_ROWS, axis=2)
    tall = np.concatenate([over[:, :1], inner, over[:, -1:]], axis=1)
    wrapped: Single = np.concatenate([tall[:, :, -1:], tall, tall[:, :, :1]], axis=2)
    return wrapped


def map_places(direction: Array | Single, rows: int) -> tuple[Array, Array]:
    """Row and column of unit directions (3, n) on a map, (n,) each, in texels from its corner."""
    x, y, z = direction
    row = (np.arcsin(np.clip(z, -1, 1)) / np.pi + 0.5) * rows
    column = (0.5 - np.arctan2(y, x) / (2 * np.pi)) * (2 * rows)
    return row, column


def curve_places(rows: int) -> IndexArray:
    """The place of each texel of a map (rows, 2 rows) on Hilbert's curve through one half and the other."""
    y, x = (each.ravel() for each in np.mgrid[:rows, : 2 * rows])
    half, x = x // rows, x % rows
    place = np.zeros_like(x)
    size = rows // 2
    while size:
        right, upper = (x & size) > 0, (y & size) > 0
        place += size * size * np.where(upper, np.where(right, 2, 1), np.where(right, 3, 0))
        flip = ~upper & right
        x, y = np.where(flip, size - 1 - (x & (size - 1)), x), np.where(flip, size - 1 - (y & (size - 1)), y)
        x, y = np.where(upper, x, y), np.where(upper, y, x)
        size //= 2
    found: IndexArray = half * rows * rows + place
    return found


def map_directions(columns: int, rows: int) -> Array:
    """The directions of the texels of an equirectangular map, (3, rows * columns), row after row.

    From straight down to straight up; the middle column looks along +X, the first one past it along -Y, as
    in Cycles.
    """
    up = (np.arange(rows) + 0.5) * (np.pi / rows) - 0.5 * np.pi
    around = np.pi - (np.arange(columns) + 0.5) * (2.0 * np.pi / columns)
    flat = np.cos(up)[:, None]
    direction = np.stack(
        np.broadcast_arrays(flat * np.cos(around), flat * np.sin(around), np.sin(up)[:, None])
    )
    return direction.reshape(3, -1)


def map_areas(columns: int, rows: int) -> Array:
    """Solid angle of a texel of each row, (rows,)."""
    edges = np.sin((np.arange(rows + 1) / rows - 0.5) * np.pi)
    areas: Array = np.diff(edges) * (2.0 * np.pi / columns)
    return areas
