# SPDX-License-Identifier: GPL-3.0-or-later
"""The light of a world that differs by direction: lamps for its bright spots, and the soft rest."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, IndexArray
from ..interpolation import bilinear
from ..sampling.point_samples import PointSamples
from ..sampling.sample_positions import BITS, Bits, scramble
from ..sampling.sample_sets import SILVER, shuffled
from ..scene.shading_scene import Light
from ..scene.sky_map import COLUMNS, NORMAL_ROWS, ROWS, WorldLight, luminance_of, map_places
from ..scene.surface import TINY, SurfacePoints
from ..typing import Single
from ..vectors import dot
from .beams import Incidence
from .lamps import SKY_STEPS, Lamp
from .shadow_rays import cut_shadows
from .sky_sampling import QUANTILES, SkyDirections, directions_of

# The least number of a pixel's rays towards the sky, where nothing else lights it.
HIDING = 20
# The error of the mean of n evenly spread directions is n to the power of minus this.
CONVERGENCE = 0.75
FAR = np.full(1, np.inf, np.float32)


@dataclass(frozen=True)
class SkyLight:
    """A world's light in a frame.

    lamps: in cast space, which has the world's axes. directions: of the rays that look for occluders of the
    soft light, at most ``rays`` in each sample. order: (samples,) where in the sequence a sample begins.
    occluders: None if nothing hides the sky.
    """

    light: WorldLight
    lamps: tuple[Lamp, ...]
    directions: SkyDirections
    rays: int
    order: Array
    occluders: CastScene | None = None

    @classmethod
    def of(cls, light: WorldLight, samples: int) -> SkyLight:
        """The light in frames of ``samples`` samples a pixel."""
        return cls(
            light,
            tuple(world_lamp(*lamp, samples) for lamp in light.lamps),
            directions_of(light),
            -(-HIDING // samples),
            shuffled(samples, SILVER) / samples,
        )

    def radiance(
        self,
        points: SurfacePoints,
        reflectance: Single,
        samples: PointSamples,
        beside: Single | None = None,
        weight: Array | None = None,
    ) -> Single:
        """Radiance of points from the soft light, (3, N). reflectance: (3, N) or (3, 1), over π.

        Each ray stands for an equal share of the irradiance, and takes it away where it is occluded: in the
        open there is no noise. Random numbers depend on the point's position; with fixed directions single
        shadows would be visible. beside: (3, N) radiance from other light, which hides noise: the more of it,
        the fewer rays. weight: (N,) of points in their pixels: less of it, too, takes fewer rays.
        """
        arriving = self.irradiance(points.normal)
        if self.occluders is not None:
            own = luminance_of(reflectance * arriving)
            share = (
                np.ones(len(own)) if beside is None else own / np.maximum(own + luminance_of(beside), TINY)
            )
            share = share if weight is None else share * np.minimum(weight, 1.0)
            self._hide(
                arriving, points, samples.number, self.occluders, self._ray_counts(share * (own > 0.0))
            )
        radiance: Single = reflectance * arriving
        return radiance

    def _ray_counts(self, share: Array) -> IndexArray:
        """Numbers of rays (N,) where the sky is a share (N,) of all light: a power of 2, or all."""
        powers = 2 ** np.arange(self.rays.bit_length())
        steps = np.unique(np.concatenate([[0], powers, [self.rays]]))
        enough = (steps[:-1] / self.rays) ** CONVERGENCE
        counts: IndexArray = steps[np.searchsorted(enough, share)]
        return counts

    def _hide(
        self,
        arriving: Single,
        points: SurfacePoints,
        sample: int | IndexArray,
        occluders: CastScene,
        counts: IndexArray,
    ) -> None:
        """Take the occluded share from the light that arrives at points, (3, N). counts: (N,) of rays."""
        some = np.flatnonzero(counts)
        there, count = points.take(some), counts.take(some)
        begin: Array = np.broadcast_to(self.order[np.atleast_1d(sample)], len(counts)).take(some)
        lost = (luminance_of(arriving.take(some, axis=1)) / count).astype(np.float32)
        seed = position_seeds(there.position)
        row: IndexArray = self.directions.rows(there.normal, random_pairs(scramble(seed, 0)))
        for number in range(int(count.max(initial=0))):
            left = np.flatnonzero(count > number)
            if len(left) < len(count):
                there, some, seed, row = there.take(left), some.take(left), seed.take(left), row.take(left)
                begin, lost, count = begin.take(left), lost.take(left), count.take(left)
            jitter = scramble(seed, number + 1) * 2.0**-BITS / len(self.order)
            place = (number + begin + jitter) / count
            quantile = (place * QUANTILES).astype(np.intp)
            chosen = self.directions.table.take(row + quantile)
            direction = self.directions.towards.take(chosen, axis=1)
            facing = np.maximum(dot(there.normal, direction), 0)
            seen = facing.copy()
            cut_shadows(seen, there, Incidence(direction, facing, FAR), occluders)
            hidden = np.flatnonzero(seen < facing)
            arriving[:, some.take(hidden)] -= self.directions.tint.take(chosen[hidden], axis=1) * lost[hidden]

    def irradiance(self, normal: Single) -> Single:
        """Irradiance (3, N) by unit normals (3, N), without occluders."""
        row, column = map_places(normal, NORMAL_ROWS)
        return bilinear(self.light.irradiance, row + 0.5, column + 0.5)


def position_seeds(position: Single) -> Bits:
    """Seeds (N,) that depend on positions (3, N) alone."""
    x, y, z = np.ascontiguousarray(position).view(np.uint32)
    seeds: Bits = x * np.uint32(73856093) ^ y * np.uint32(19349663) ^ z * np.uint32(83492791)
    return seeds


def random_pairs(bits: Bits) -> Array:
    """Two numbers in [0, 1) from the halves of each word (N,), (2, N)."""
    made: Array = np.stack([bits & np.uint32(0xFFFF), bits >> np.uint32(16)]) * 2.0**-16
    return made


def world_lamp(luminance: Array, color: Array, samples: int) -> Lamp:
    """A lamp at infinity, whose places are distributed like the luminance of a map (ROWS, COLUMNS)."""
    steps = 1 if samples == 1 else SKY_STEPS
    middles = (np.arange(steps) + 0.5) / steps
    rows = np.concatenate([[0.0], np.cumsum(luminance.sum(axis=1))])
    row = np.interp(middles * rows[-1], rows, np.arange(ROWS + 1))
    column = np.empty((steps, steps))
    for own, line in zip(column, np.minimum(row, ROWS - 1).astype(np.intp), strict=True):
        until = np.concatenate([[0.0], np.cumsum(luminance[line])])
        own[:] = np.interp(middles * until[-1], until, np.arange(COLUMNS + 1))
    height, turn = (row[:, None] / ROWS - 0.5) * np.pi, np.pi - column * (2 * np.pi / COLUMNS)
    flat = np.cos(height)
    places = np.stack([flat * np.cos(turn), flat * np.sin(turn), np.sin(height) + 0 * turn]).reshape(3, -1)
    middle = places.mean(axis=1, keepdims=True)
    middle /= np.linalg.norm(middle)
    return Lamp(
        light=Light("SUN", color, np.eye(4)),
        color=color.astype(np.float32),
        middle=middle.astype(np.float32),
        sides=np.zeros((3, 2), np.float32),
        axis=-middle[:, 0].astype(np.float32),
        local=np.eye(3, dtype=np.float32),
        softness=np.float32(0.0),
        shape="POINT" if samples == 1 else "SQUARE",
        sky=places.astype(np.float32) if samples > 1 else None,
    )
