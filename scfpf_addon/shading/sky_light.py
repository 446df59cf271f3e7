# SPDX-License-Identifier: GPL-3.0-or-later
"""What a world of nodes does to surfaces, by the parts that ``sky_map`` makes of its light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..casting.scene import CastScene
from ..projection.typing import Array, IndexArray
from .film import SILVER, pixel_positions, shuffled
from .lighting import Incidence, Lamp, by_material, cut_shadows
from .scene import Light
from .sky_map import COLUMNS, LUMINANCE, NORMAL_ROWS, ROWS, Gathered, WorldLight, map_places
from .surface import SurfacePoints, dot
from .typing import Single

# Directions in which a pixel looks for what hides the sky, at least.
HIDING = 32

@dataclass(frozen=True)
class SkyLight:
    """A world's light as a frame sees it.

    lamps: in cast space, which is not turned. towards: (3, samples * each) directions
    in which the even light may be hidden, and lost: (3, samples * each) the irradiance that is missing
    then; those of sample s are s, s + samples, …
    """

    light: WorldLight
    lamps: tuple[Lamp, ...]
    towards: Single
    lost: Single
    samples: int

    @classmethod
    def of(cls, light: WorldLight, samples: int) -> SkyLight:
        """For frames of so many samples a pixel."""
        each = -(-HIDING // samples)
        towards, lost = equal_parts(light.hiding, samples * each)
        order = shuffled(samples, SILVER)
        order = (order + samples * np.arange(each)[:, None]).ravel()
        return cls(
            light,
            tuple(world_lamp(*lamp, samples) for lamp in light.lamps),
            towards[:, order].astype(np.float32),
            (lost[:, order] * samples).astype(np.float32),
            samples,
        )

    def scattered(
        self, points: SurfacePoints, albedo: Single, sample: int | IndexArray, cast_scene: CastScene
    ) -> Single:
        """What points send on of the even light, (3, N). albedo: (3, M) of M materials, over π."""
        arriving = self.irradiance(points.normal)
        for first in range(0, self.towards.shape[1], self.samples):
            mine = np.atleast_1d(sample) + first
            direction = self.towards.take(mine, axis=1)
            facing = np.maximum(dot(points.normal, direction), 0)
            seen = facing.copy()
            away = Incidence(direction, facing, np.full(1, np.inf, np.float32))
            cut_shadows(seen, points, away, cast_scene)
            arriving -= self.lost.take(mine, axis=1) * (facing - seen)
        scattered: Single = by_material(albedo, points.material) * np.maximum(arriving, 0)
        return scattered

    def irradiance(self, normal: Single) -> Single:
        """On surfaces of unit normals (3, N) without anything in the way, (3, N)."""
        row, column = map_places(normal, NORMAL_ROWS)
        row += 0.5
        column += 0.5
        low, left = np.floor(row).astype(np.intp), np.floor(column).astype(np.intp)
        np.clip(low, 0, NORMAL_ROWS, out=low)
        np.clip(left, 0, 2 * NORMAL_ROWS, out=left)
        up, along = (row - low).astype(np.float32), (column - left).astype(np.float32)
        wide = self.light.irradiance.shape[2]
        table = self.light.irradiance.reshape(3, -1)
        corner = low * wide + left
        below, above = (
            table.take(at, axis=1) * (1 - along) + table.take(at + 1, axis=1) * along
            for at in (corner, corner + wide)
        )
        found: Single = below * (1 - up) + above * up
        return found


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


def world_lamp(luminance: Array, color: Array, samples: int) -> Lamp:
    """A lamp of light at infinity: a place for each sample where a map (ROWS, COLUMNS) is bright."""
    across, up = pixel_positions(samples).take(shuffled(samples, SILVER), axis=1)
    rows = np.concatenate([[0.0], np.cumsum(luminance.sum(axis=1))])
    row = np.interp(up * rows[-1], rows, np.arange(ROWS + 1))
    column = np.empty(samples)
    for number, line in enumerate(np.minimum(row, ROWS - 1).astype(np.intp)):
        until = np.concatenate([[0.0], np.cumsum(luminance[line])])
        column[number] = np.interp(across[number] * until[-1], until, np.arange(COLUMNS + 1))
    height, turn = (row / ROWS - 0.5) * np.pi, np.pi - column * (2 * np.pi / COLUMNS)
    flat = np.cos(height)
    places = np.stack([flat * np.cos(turn), flat * np.sin(turn), np.sin(height)])
    middle = places.mean(axis=1)
    light = Light("SUN", color, np.eye(4))
    return Lamp(
        light,
        color.astype(np.float32),
        places.astype(np.float32),
        (-middle / np.linalg.norm(middle)).astype(np.float32),
        np.eye(3, dtype=np.float32),
        np.float32(0.0),
    )
