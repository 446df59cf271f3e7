# SPDX-License-Identifier: GPL-3.0-or-later
"""Light that arrives from lamps whose sampled place depends on the lit point: limited spread, and spheres."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...projection.typing import Array, BoolArray
from ..sampling.sample_sets import LampShape, lamp_places
from ..scene.shading_scene import Light
from ..scene.surface import TINY
from ..typing import Single
from ..vectors import dot, perpendicular

# The least half spread, in radians: in float32 a narrower beam is nearly parallel.
SMALLEST_SPREAD = 1e-3
# Half spreads up to this use the series of tan a - a, whose difference float32 would round away.
SERIES_SPREAD = 0.05


class Incidence(NamedTuple):
    """Light that arrives at N points.

    direction: (3, N), or (3, 1) from a sun, unit, towards the lamp. strength: (N,) or
    (1,), irradiance on a surface that faces the lamp, per unit of the lamp's colour.
    distance: (N,) or (1,), infinite for a sun.
    """

    direction: Single
    strength: Single
    distance: Single


@dataclass(frozen=True)
class AreaBeam:
    """An area lamp of limited spread.

    centre: (3, 1). axes: (3, 3), unit columns, the lamp's own. half: (2, 1) half extents. ellipse: its shape.
    tangent: of the half spread. factor: normalises the power. sharp: whether light
    comes from the middle alone of what is seen.
    """

    centre: Single
    axes: Single
    half: Single
    ellipse: bool
    tangent: np.float32
    factor: np.float32
    sharp: bool

    @classmethod
    def of(cls, light: Light, placed: Array, sharp: bool) -> AreaBeam:
        """The beam of a lamp at ``placed`` (4, 4) in cast space.

        Normalisation as in Cycles (AreaLight::copy_to_kernel): tan a - a for the half spread a, by its
        series where a is small.
        """
        length = np.maximum(np.linalg.norm(placed[:3, :3], axis=0), float(TINY))
        angle = max(light.spread / 2, SMALLEST_SPREAD)
        tangent = np.tan(angle)
        factor = 1 / (tangent - angle) if angle > SERIES_SPREAD else 3 / angle**3
        return cls(
            centre=placed[:3, 3:].astype(np.float32),
            axes=(placed[:3, :3] / length).astype(np.float32),
            half=(length[:2] * light.size / 2).astype(np.float32)[:, None],
            ellipse=light.ellipse,
            tangent=np.float32(tangent),
            factor=np.float32(factor),
            sharp=sharp,
        )

    def incidence(self, position: Single, share: Single) -> Incidence:
        """Return the light that arrives at position (3, N), in units of the lamp's power / π.

        share: (2, N) or (2, 1) random numbers.

        A grid of slats before the lamp lets through the less the more light is inclined (Cycles,
        kernel/light/area.h). Samples are spread over the part of the lamp that is seen through it: a disc
        where all of that is on the lamp, otherwise the rectangle around.
        """
        away = position - self.centre
        x, y, z = (dot(away, axis[:, None]) for axis in self.axes.T)
        depth = np.maximum(-z, 0)
        here, reach = np.stack([x, y]), depth * self.tangent
        place, seen = self._places(here, reach, share)
        place -= here
        flat = np.sum(place**2, axis=0)
        squared = np.maximum(flat + depth**2, TINY)
        distance = np.sqrt(squared)
        passed = np.maximum(self.tangent - np.sqrt(flat) / np.maximum(depth, TINY), 0) * self.factor
        # NumPy is quicker at this than at the product of matrices.
        direction = sum(
            axis[:, None] * along for axis, along in zip(self.axes.T, (*place, depth), strict=True)
        )
        direction /= distance
        return Incidence(direction, seen * passed * depth / (squared * distance), distance)

    def _places(self, here: Single, reach: Single, share: Single) -> tuple[Single, Single]:
        """Places (2, N) on the lamp's plane, and the share of the lamp that they stand for, (N,).

        here: (2, N) where the points are on the plane. reach: (N,) radius of the disc that they see.
        """
        low, high = np.maximum(here - reach, -self.half), np.minimum(here + reach, self.half)
        side = np.maximum(high - low, 0)
        whole = ((low > -self.half) & (high < self.half)).all(axis=0)
        part = side[0] * side[1] / (4 * self.half[0] * self.half[1])
        if self.ellipse:
            off = np.sqrt(np.sum((here / self.half) ** 2, axis=0))
            whole &= off + reach / self.half.min() < 1
            whole |= ((low == -self.half) & (high == self.half)).all(axis=0)
            part *= np.float32(4 / np.pi)
        shapes: tuple[LampShape, LampShape] = ("POINT", "POINT") if self.sharp else ("SQUARE", "DISC")
        square, disc = (lamp_places(share, shape) for shape in shapes)
        place = (low + high) / 2 + side * (square + (disc - square) * whole)
        part *= 1 + (np.float32(np.pi / 4) - 1) * whole
        if self.ellipse:
            part *= whole | (np.sum((place / self.half) ** 2, axis=0) <= 1)
        return place, part


@dataclass(frozen=True)
class SphereBeam:
    """A spherical lamp. centre: (3, 1). squared_radius: the sphere's. sharp: light from its middle alone."""

    centre: Single
    squared_radius: np.float32
    sharp: bool

    def incidence(self, position: Single, share: Single) -> tuple[Incidence, BoolArray]:
        """Return the light at position (3, N), by the lamp's intensity, and which positions lie outside it.

        Samples are spread evenly over the solid angle of the sphere (Cycles, kernel/light/point.h);
        inside it that is all directions.
        """
        ahead = self.centre - position
        squared = np.maximum(dot(ahead, ahead), TINY)
        distance = np.sqrt(squared)
        ahead /= distance
        outside = squared > self.squared_radius
        sine = np.minimum(self.squared_radius / squared, 1)
        # 1 - cos of the sphere's angular radius, and of the sample's angle to its middle.
        cap = np.where(outside, sine / (1 + np.sqrt(1 - sine)), 2).astype(np.float32)
        disc = lamp_places(share, "POINT" if self.sharp else "DISC")
        lower = cap * np.minimum(4 * dot(disc, disc), 1)
        across, up = perpendicular(ahead)
        aside = 2 * np.sqrt(cap * (2 - lower))
        direction = ahead * (1 - lower) + across * (aside * disc[0]) + up * (aside * disc[1])
        direction /= np.sqrt(dot(direction, direction))
        along = distance * (1 - lower)
        inside = np.sqrt(np.maximum(self.squared_radius - squared + along**2, 0))
        until = np.where(outside, along - inside, along + inside)
        return Incidence(direction, 2 * cap / self.squared_radius, until), outside
