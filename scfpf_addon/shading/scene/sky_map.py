# SPDX-License-Identifier: GPL-3.0-or-later
"""A map of the light from all directions, taken apart: lamps for what is small, even light for the rest.

A sun in a picture of the sky holds most of its light in a few texels. That part is lamps, with shadows
and highlights as of other lamps. What is left has no peaks: its irradiance is known in advance for each
normal, and what is hidden of it is looked for in directions that hold equal shares of it.
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
# Blocks of the map, 11° wide, and the share of a block that is not brighter than its measure: what
# fills less of it is small. Small things are lamps as far as they shine so many times more.
BLOCK, MEASURE, BRIGHT = 32, 75.0, 10.0
# Lamps that a world becomes, at most, the cone about its brightest texel that each holds, and the share of
# the world's light below which there is none.
MOST_LAMPS, CONE, LEAST_LAMP = 4, np.cos(np.radians(10.0)), 0.01
# The map that irradiance is gathered from, and the one of normals: between these it is read with an
# error below 0.2 %.
SOURCE_ROWS, NORMAL_ROWS = 32, 32
# The map whose directions are looked along for what hides the sky.
HIDING_ROWS = 128


class Gathered(NamedTuple):
    """A map brought together in larger texels. light: (3, n) times solid angle. direction: (3, n)
    unit, where the middle of each texel's light is.
    """

    light: Array
    direction: Array


@dataclass(frozen=True, eq=False)
class WorldLight:
    """What of a world's light is asked again and again; nothing of it depends on the frame.

    limit: (ROWS / BLOCK, COLUMNS / BLOCK), luminance beyond which a direction's light is
    left to lamps. lamps: (ROWS, COLUMNS) luminance times solid angle and (3,) irradiance of
    each. irradiance: (3, NORMAL_ROWS + 2, 2 NORMAL_ROWS + 2), with a margin all around.
    hiding: the even light along a curve that fills the sky.
    """

    limit: Array
    lamps: tuple[tuple[Array, Array], ...]
    irradiance: Single
    hiding: Gathered

    @classmethod
    def of(cls, panorama: Array) -> WorldLight:
        """Of radiance (3, ROWS, COLUMNS), see ``map_directions``."""
        raise_if_cancelled()
        luminance = np.tensordot(LUMINANCE, panorama, 1)
        areas = map_areas(COLUMNS, ROWS)[:, None]
        limit = brightness_limit(luminance, areas)
        ceiling = limit.repeat(BLOCK, axis=0).repeat(BLOCK, axis=1)
        small = 1.0 - np.divide(ceiling, luminance, out=np.ones_like(luminance), where=luminance > ceiling)
        total = float((luminance * areas).sum())
        lamps: tuple[tuple[Array, Array], ...] = ()
        if (luminance * small * areas).sum() >= LEAST_LAMP * total:
            lamps = tuple(_lamps(panorama * (small * areas), LEAST_LAMP * total))
            even = panorama * (1.0 - small)
        else:
            limit, even = np.full_like(limit, np.inf), panorama
        raise_if_cancelled()
        even *= areas
        hiding = gathered(even, HIDING_ROWS)
        order = np.argsort(curve_places(HIDING_ROWS))
        return cls(
            limit,
            lamps,
            irradiance_map(gathered(even, SOURCE_ROWS)),
            Gathered(hiding.light[:, order], hiding.direction[:, order]),
        )

    def without_lamps(self, direction: Array, light: Array) -> Array:
        """Light (3, n) from unit directions (3, n) as far as lamps do not stand for it."""
        if not self.lamps:
            return light
        row, column = map_places(direction, len(self.limit))
        last = len(self.limit) - 1
        block = np.clip(np.floor(row), 0, last).astype(np.intp), np.floor(column).astype(np.intp)
        ceiling = self.limit[block[0], block[1] % (2 * (last + 1))]
        luminance = brightness(light)
        return light * np.divide(ceiling, luminance, out=np.ones_like(ceiling), where=luminance > ceiling)


def brightness(light: Array | Single) -> Array:
    """Luminance of colours (3, n), rounded the same whatever stands beside them."""
    red, green, blue = (channel * share for channel, share in zip(light, LUMINANCE, strict=True))
    return np.asarray(red + green + blue, np.float64)


def brightness_limit(luminance: Array, areas: Array) -> Array:
    """How bright each block of a map may be before it counts as a lamp, (ROWS / BLOCK, COLUMNS / BLOCK)."""
    blocks = luminance.reshape(ROWS // BLOCK, BLOCK, COLUMNS // BLOCK, BLOCK).swapaxes(1, 2)
    usual = np.percentile(blocks.reshape(*blocks.shape[:2], -1), MEASURE, axis=2)
    share = areas.reshape(-1, BLOCK).sum(axis=1)[:, None]
    floor = float((usual * share).sum() / (share.sum() * usual.shape[1]))
    # What is large may end just within the next block.
    wide = np.maximum(usual, np.maximum(np.roll(usual, 1, axis=1), np.roll(usual, -1, axis=1)))
    tall = wide.copy()
    tall[1:] = np.maximum(tall[1:], wide[:-1])
    tall[:-1] = np.maximum(tall[:-1], wide[1:])
    limit: Array = BRIGHT * np.maximum(tall, floor)
    return limit


def _lamps(light: Array, least: float) -> Iterator[tuple[Array, Array]]:
    """The lamps of what is bright, (3, ROWS, COLUMNS): luminance over the map, and colour."""
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


def gathered(light: Array, rows: int) -> Gathered:
    """A map (3, ROWS, COLUMNS) of light times solid angle, as one of rows × 2 rows texels."""
    step = ROWS // rows
    shape = rows, step, 2 * rows, step
    sums = light.reshape(3, *shape).sum(axis=(2, 4)).reshape(3, -1)
    # Half a millionth of the brightest keeps the middle of a dark texel where it is.
    luminance = np.tensordot(LUMINANCE, light, 1)
    luminance = (luminance + 1e-6 * luminance.max() + 1e-30).reshape(-1)
    weighted = map_directions(COLUMNS, ROWS) * luminance
    middle = weighted.reshape(3, *shape).sum(axis=(2, 4)).reshape(3, -1)
    return Gathered(sums, middle / np.linalg.norm(middle, axis=0))


def irradiance_map(source: Gathered) -> Single:
    """Irradiance by normal, (3, NORMAL_ROWS + 2, 2 NORMAL_ROWS + 2): nothing in its way."""
    normals = map_directions(2 * NORMAL_ROWS, NORMAL_ROWS).astype(np.float32)
    towards, light = source.direction.astype(np.float32), source.light.astype(np.float32)
    made = np.empty((3, normals.shape[1]), np.float32)
    for first in range(0, normals.shape[1], 1024):
        cosine = normals[:, first : first + 1024].T @ towards
        made[:, first : first + 1024] = light @ np.maximum(cosine, 0, out=cosine).T
    inner = made.reshape(3, NORMAL_ROWS, 2 * NORMAL_ROWS)
    # Beyond a pole the map goes on half way around.
    over = np.roll(inner, NORMAL_ROWS, axis=2)
    tall = np.concatenate([over[:, :1], inner, over[:, -1:]], axis=1)
    wrapped: Single = np.concatenate([tall[:, :, -1:], tall, tall[:, :, :1]], axis=2)
    return wrapped


def map_places(direction: Array | Single, rows: int) -> tuple[Array, Array]:
    """Where unit directions (3, n) are on a map, in texels from its corner: row and column, (n,) each."""
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

    From straight below up; the middle column looks along +X, the first one past it along -Y, as
    Cycles has them.
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
