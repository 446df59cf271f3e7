# SPDX-License-Identifier: GPL-3.0-or-later
"""What a world of nodes does to surfaces, by the parts that ``sky_map`` makes of its light."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, IndexArray
from ..interpolation import bilinear
from ..sampling.sample_positions import BITS, Bits, scramble
from ..sampling.sample_sets import SILVER, pixel_positions, shuffled
from ..scene.shading_scene import Light
from ..scene.sky_map import COLUMNS, NORMAL_ROWS, ROWS, WorldLight, brightness, map_places
from ..scene.surface import TINY, SurfacePoints
from ..typing import Single
from ..vectors import dot
from .beams import Incidence
from .lamps import Lamp
from .shadow_rays import cut_shadows
from .sky_sampling import QUANTILES, Picks, picks_of

# Directions in which a pixel looks for what hides the sky, at least, where nothing else lights it.
HIDING = 28
# The mean of n directions that are evenly spread errs by n to minus this.
CONVERGENCE = 0.75
FAR = np.full(1, np.inf, np.float32)


@dataclass(frozen=True)
class SkyLight:
    """A world's light as a frame sees it.

    lamps: in cast space, which is not turned. picks: the directions in which samples look for what hides
    the sky, ``each`` of them at most. order: (samples,) where among them. occluders: what hides it, None for
    nothing.
    """

    light: WorldLight
    lamps: tuple[Lamp, ...]
    picks: Picks
    each: int
    order: Array
    occluders: CastScene | None = None

    @classmethod
    def of(cls, light: WorldLight, samples: int) -> SkyLight:
        """For frames of so many samples a pixel."""
        return cls(
            light,
            tuple(world_lamp(*lamp, samples) for lamp in light.lamps),
            picks_of(light),
            -(-HIDING // samples),
            shuffled(samples, SILVER) / samples,
        )

    def scattered(
        self,
        points: SurfacePoints,
        reflectance: Single,
        sample: int | IndexArray,
        beside: Single | None = None,
    ) -> Single:
        """What points send on of the even light, (3, N). reflectance: (3, N) or (3, 1), over π.

        A ray looks for what hides a part that is chosen by how much of the light comes from there, so that
        rays in the open change nothing. Each point looks by a chance of its own place: the
        shadows of fixed directions would be seen one by one. beside: (3, N) what they send on of other
        light: where it is much less is seen of the sky's noise, and fewer rays do.
        """
        arriving = self.irradiance(points.normal)
        if self.occluders is not None:
            own = brightness(reflectance * arriving)
            share = np.ones(len(own)) if beside is None else own / np.maximum(own + brightness(beside), TINY)
            self._hide(arriving, points, sample, self.occluders, self._looks(share * (own > 0.0)))
        scattered: Single = reflectance * arriving
        return scattered

    def _looks(self, share: Array) -> IndexArray:
        """Rays for points where the sky is a share (N,) of all light, (N,): a power of 2, or all."""
        powers = 2 ** np.arange(self.each.bit_length())
        steps = np.unique(np.concatenate([[0], powers, [self.each]]))
        enough = (steps[:-1] / self.each) ** CONVERGENCE
        looks: IndexArray = steps[np.searchsorted(enough, share)]
        return looks

    def _hide(
        self,
        arriving: Single,
        points: SurfacePoints,
        sample: int | IndexArray,
        occluders: CastScene,
        looks: IndexArray,
    ) -> None:
        """Take from what arrives at points, (3, N), what others hide. looks: (N,) with how many rays."""
        begin = np.broadcast_to(self.order[np.atleast_1d(sample)], len(looks))
        for count in np.unique(looks[looks > 0]):
            some = np.flatnonzero(looks == count)
            there, light = points.take(some), arriving.take(some, axis=1)
            lost = (brightness(light) / count).astype(np.float32)
            mark = place_marks(there.position)
            row = self.picks.rows(there.normal, halves(scramble(mark, 0)))
            for number in range(count):
                chance = scramble(mark, number + 1) * 2.0**-BITS / len(self.order)
                place = (number + begin[some] + chance) / count
                picked = self.picks.table.take(row + (place * QUANTILES).astype(np.intp))
                direction = self.picks.towards.take(picked, axis=1)
                facing = np.maximum(dot(there.normal, direction), 0)
                seen = facing.copy()
                cut_shadows(seen, there, Incidence(direction, facing, FAR), occluders)
                hidden = np.flatnonzero(seen < facing)
                light[:, hidden] -= self.picks.tint.take(picked[hidden], axis=1) * lost[hidden]
            arriving[:, some] = light

    def irradiance(self, normal: Single) -> Single:
        """On surfaces of unit normals (3, N) without anything in the way, (3, N)."""
        row, column = map_places(normal, NORMAL_ROWS)
        return bilinear(self.light.irradiance, row + 0.5, column + 0.5)


def place_marks(position: Single) -> Bits:
    """A number by place (3, N), (N,): whatever ray came there."""
    x, y, z = np.ascontiguousarray(position).view(np.uint32)
    marks: Bits = x * np.uint32(73856093) ^ y * np.uint32(19349663) ^ z * np.uint32(83492791)
    return marks


def halves(bits: Bits) -> Array:
    """Two numbers in [0, 1) of each of (N,), (2, N)."""
    made: Array = np.stack([bits & np.uint32(0xFFFF), bits >> np.uint32(16)]) * 2.0**-16
    return made


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
