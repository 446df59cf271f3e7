# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps in Blender's units, in cast space.

Lengths there are ``scale`` times the world's, so a lamp whose light thins out with the square of the distance
is made scale² stronger.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from zlib import crc32

import numpy as np

from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, IndexArray
from ..sampling.sample_sets import lamp_positions
from ..scene.shading_scene import Light
from ..scene.surface import TINY, SurfacePoints
from ..typing import Single
from ..vectors import dot
from .beams import AreaBeam, Incidence, SphereBeam

# The least width of a spot's edge, as its cosine: no division by 0 without a blend.
SMALLEST_BLEND = 1e-6
# Strength and distance of a sun.
FROM_A_SUN = np.ones(1, np.float32), np.full(1, np.inf, np.float32)


@dataclass(frozen=True)
class Lamp:
    """A light in cast space, with a place for each sample of the film.

    color: (3,) radiant intensity, or irradiance of a sun. places: (3, S); of a sun from the lit point, on a
    disc at the distance 1.
    axis: (3,) unit, where it shines. local: (3, 3) from directions in cast space to
    those in the light's own space, where a spot's cone is round. softness: the squared
    radius of a point or spot, which lights as a disc that faces the lit point, or as a sphere. beam: of an
    area lamp of limited spread, or of a sphere. occluders: the part of the scene that casts its shadows, None
    for all of it.
    """

    light: Light
    color: Single
    places: Single
    axis: Single
    local: Single
    softness: np.float32
    beam: AreaBeam | SphereBeam | None = None
    occluders: CastScene | None = None

    @classmethod
    def of(cls, light: Light, matrix: Array, samples: int) -> Lamp:
        """A light as a frame of ``samples`` samples sees it.

        matrix: (4, 4), world to cast space: a uniform scale and a shift. Blender's units: a
        point of P watts has the intensity P/4π whatever its size, a spot the same within
        its cone; an area lamp has the radiance P/πA on its front, so that each of its
        points stands for the intensity P/π times the cosine; a sun is W/m².
        """
        placed = matrix @ np.asarray(light.matrix, np.float64)
        scale = float(np.linalg.norm(matrix[:3, 0]))
        axes = placed[:3, :3]
        if light.kind == "SUN":
            strength, placed[:3, 3] = 1.0, axes[:, 2] / scale
            offsets = axes[:, :2] / scale @ (lamp_positions(samples, "DISC") * (2 * np.tan(light.angle / 2)))
        elif light.kind == "AREA":
            strength = scale**2 / np.pi
            plane = lamp_positions(samples, "DISC" if light.ellipse else "SQUARE")
            offsets = axes[:, :2] @ (plane * np.reshape(light.size, (2, 1)))
        else:
            strength = scale**2 / (4 * np.pi)
            offsets = lamp_positions(samples, "BALL") * (light.radius * scale)
        softness = np.float32((light.radius * scale) ** 2 if light.kind in ("POINT", "SPOT") else 0.0)
        beam: AreaBeam | SphereBeam | None = None
        if light.kind == "AREA" and light.spread < np.pi:
            beam = AreaBeam.of(light, placed, samples)
        elif light.kind in ("POINT", "SPOT") and light.sphere and light.radius > 0.0:
            beam = SphereBeam.of(placed, softness, samples)
        return cls(
            light=light,
            color=(np.asarray(light.color) * strength).astype(np.float32),
            places=(placed[:3, 3:] + offsets).astype(np.float32),
            axis=(-axes[:, 2] / max(float(np.linalg.norm(axes[:, 2])), float(TINY))).astype(np.float32),
            local=np.linalg.pinv(axes / scale).astype(np.float32),
            softness=softness,
            beam=beam,
        )

    @cached_property
    def towards(self) -> Single:
        """Directions to a sun's places, (3, S), unit."""
        return (self.places / np.sqrt(dot(self.places, self.places))).astype(np.float32)

    @cached_property
    def seed(self) -> np.uint32:
        """The seed of random choices, which other lamps do not change."""
        return np.uint32(crc32(np.concatenate([self.places, self.color[:, None]], axis=1).tobytes()))

    @property
    def power(self) -> float:
        """About the irradiance in the middle of the scene, which cast space has at its origin."""
        power = float(self.color.max(initial=0.0))
        if self.light.kind == "SUN":
            return power
        return power / max(float((self.middle**2).sum()), float(TINY))

    @cached_property
    def middle(self) -> Single:
        """The centre of a round lamp, (3, 1)."""
        middle: Single = self.places.mean(axis=1, keepdims=True, dtype=np.float64).astype(np.float32)
        return middle

    def incidence(self, position: Single, sample: int | IndexArray) -> Incidence:
        """The light that arrives at position (3, N). sample: one of all points, or one of each (N,)."""
        if self.light.kind == "SUN":
            return Incidence(self.towards.take(np.atleast_1d(sample), axis=1), *FROM_A_SUN)
        if isinstance(self.beam, AreaBeam):
            return self.beam.incidence(position, sample)
        if self.beam:
            return self._from_sphere(self.beam, position, sample)
        places: Single = self.places.take(np.atleast_1d(sample), axis=1)
        direction: Single = places - position
        facing: Single | None = None
        if self.softness:
            # On the disc that faces the point: seen from there its rim is foreshortened.
            ahead = self.middle - position
            facing = np.maximum(dot(ahead, ahead), TINY)
            direction -= ahead * (dot(places - self.middle, ahead) / facing)
        squared = np.maximum(dot(direction, direction), TINY)
        distance = np.sqrt(squared)
        direction /= distance
        strength = np.reciprocal(squared, out=squared)
        if facing is not None:
            strength *= np.sqrt(facing) / distance
        if self.light.kind == "AREA":
            strength *= np.maximum(-dot(direction, self.axis[:, None]), 0)
        elif self.light.kind == "SPOT":
            strength *= self.spot(direction)
        return Incidence(direction, strength, distance)

    def _from_sphere(self, beam: SphereBeam, position: Single, sample: int | IndexArray) -> Incidence:
        """``incidence`` of a spherical point or spot."""
        light, outside = beam.incidence(position, sample)
        if self.light.kind == "SPOT":
            # Inside the sphere light comes from all sides.
            light.strength[outside] *= self.spot(light.direction[:, outside])
        return light

    def spot(self, direction: Single) -> Single:
        """Share of a spot's intensity that leaves it against direction (3, N), (N,).

        A smoothstep of the cosine to the axis, from the edge of the cone inwards over
        the share ``spot_blend`` of the way to the axis. Compared with images of Cycles.
        """
        local = np.einsum("ij,jn->in", self.local, direction)
        cosine = local[2] / np.maximum(np.sqrt(dot(local, local)), TINY)
        edge = np.cos(self.light.spot_angle / 2)
        width = max((1 - edge) * self.light.spot_blend, SMALLEST_BLEND)
        rise = np.clip((cosine - np.float32(edge)) * np.float32(1 / width), 0, 1)
        smooth: Single = rise * rise * (3 - 2 * rise)
        return smooth

    def limit_to_receivers(self, received: Single, points: SurfacePoints) -> None:
        """Take the light that points (N,) receive from those that the lamp is not linked to, in place."""
        if self.light.receivers is not None and points.linked is not None:
            received *= self.light.receivers.take(points.linked)
