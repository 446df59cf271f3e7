# SPDX-License-Identifier: GPL-3.0-or-later
"""What a world of nodes does to surfaces, by the parts that ``sky_map`` makes of its light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..casting.scene import CastScene
from ..projection.typing import Array, IndexArray
from .lighting import Incidence, Lamp, by_material, cut_shadows
from .normals import dot
from .sample_sets import SILVER, pixel_positions, shuffled
from .samples import BITS, Bits, scramble
from .scene import Light
from .sky_map import COLUMNS, LUMINANCE, NORMAL_ROWS, ROWS, Gathered, WorldLight, brightness, map_places
from .surface import SurfacePoints
from .tables import between
from .typing import Single

# Directions in which a pixel looks for what hides the sky, at least.
HIDING = 32
# Equal parts of the even light, and directions in each.
PARTS, CHOICES = 64, 16
FAR = np.full(1, np.inf, np.float32)


@dataclass(frozen=True)
class SkyLight:
    """A world's light as a frame sees it.

    lamps: in cast space, which is not turned. parts: (3, PARTS) directions of equal parts of the even light.
    towards: (3, PARTS * CHOICES) directions in each, one part after the other. tint: (3, PARTS) colours
    of the parts, of luminance 1. share: (samples, n) where each sample looks for what hides the sky.
    occluders: what does, None for nothing.
    """

    light: WorldLight
    lamps: tuple[Lamp, ...]
    parts: Single
    towards: Single
    tint: Single
    share: Array
    occluders: CastScene | None = None

    @classmethod
    def of(cls, light: WorldLight, samples: int) -> SkyLight:
        """For frames of so many samples a pixel."""
        each = -(-HIDING // samples)
        middles, tint = equal_parts(light.hiding, PARTS)
        luminance = LUMINANCE @ tint
        return cls(
            light,
            tuple(world_lamp(*lamp, samples) for lamp in light.lamps),
            middles.astype(np.float32),
            equal_parts(light.hiding, PARTS * CHOICES)[0].astype(np.float32),
            (tint / np.where(luminance > 0.0, luminance, 1.0)).astype(np.float32),
            (shuffled(samples, SILVER)[:, None] + samples * np.arange(each)).astype(np.float64),
        )

    def scattered(self, points: SurfacePoints, albedo: Single, sample: int | IndexArray) -> Single:
        """What points send on of the even light, (3, N). albedo: (3, M) of M materials, over π.

        A ray looks for what hides a part that is chosen by how much of the light comes from there, so that
        rays in the open change nothing. Each point looks by a chance of its own place: the
        shadows of fixed directions would be seen one by one.
        """
        arriving = self.irradiance(points.normal)
        if self.occluders is not None:
            self._hide(arriving, points, sample, self.occluders)
        scattered: Single = by_material(albedo, points.material) * arriving
        return scattered

    def _hide(
        self, arriving: Single, points: SurfacePoints, sample: int | IndexArray, occluders: CastScene
    ) -> None:
        """Take from what arrives at points, (3, N), what others hide."""
        each = self.share.shape[1]
        lost = (brightness(arriving) / each).astype(np.float32)
        # Sums of products in a fixed order: a choice must not depend on how many points there are.
        x, y, z = (part[:, None] * normal for part, normal in zip(self.parts, points.normal, strict=True))
        until = x + y + z
        np.cumsum(np.maximum(until, 0, out=until), axis=0, out=until)
        mark = place_marks(points.position)
        for number in range(each):
            chance = scramble(mark, 2 * number).astype(np.float32) * np.float32(2.0**-BITS)
            place = (self.share[np.atleast_1d(sample), number] + chance) / self.share.size
            part = np.minimum((until < place * until[-1]).sum(axis=0), PARTS - 1)
            choice = scramble(mark, 2 * number + 1).astype(np.intp) % CHOICES
            direction = self.towards.take(part * CHOICES + choice, axis=1)
            facing = np.maximum(dot(points.normal, direction), 0)
            seen = facing.copy()
            cut_shadows(seen, points, Incidence(direction, facing, FAR), occluders)
            hidden = np.flatnonzero(seen < facing)
            arriving[:, hidden] -= self.tint.take(part[hidden], axis=1) * lost[hidden]

    def irradiance(self, normal: Single) -> Single:
        """On surfaces of unit normals (3, N) without anything in the way, (3, N)."""
        row, column = map_places(normal, NORMAL_ROWS)
        return between(self.light.irradiance, row + 0.5, column + 0.5)


def place_marks(position: Single) -> Bits:
    """A number by place (3, N), (N,): whatever ray came there."""
    x, y, z = np.ascontiguousarray(position).view(np.uint32)
    marks: Bits = x * np.uint32(73856093) ^ y * np.uint32(19349663) ^ z * np.uint32(83492791)
    return marks


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
