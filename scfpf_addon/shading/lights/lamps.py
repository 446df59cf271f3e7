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
from ...projection.typing import Array
from ..sampling.point_samples import Shares
from ..sampling.sample_sets import LampShape, lamp_places
from ..scene.shading_scene import Light
from ..scene.surface import TINY, SurfacePoints
from ..typing import Single
from ..vectors import dot, perpendicular
from .beams import AreaBeam, Incidence, SphereBeam

# The least width of a spot's edge, as its cosine: no division by 0 without a blend.
SMALLEST_BLEND = 1e-6
# Strength and distance of a sun.
FROM_A_SUN = np.ones(1, np.float32), np.full(1, np.inf, np.float32)
# What the solid angle of a part of a lamp adds to GGX's α squared: about four samples fall into a highlight.
BLUR = np.float32(1.0 / np.pi)
# Rows and columns of the table of a sky's lamp.
SKY_STEPS = 64
# The random numbers of lamps that need none.
MIDDLE = np.full((2, 1), 0.5, np.float32)


def blur_of(solid_angle: Single) -> Single:
    """The increase of GGX's α squared of highlights, (n,), that makes them as wide as solid angles (n,)."""
    blur: Single = np.minimum(solid_angle * BLUR, 1)
    return blur


@dataclass(frozen=True)
class Lamp:
    """A light in cast space.

    color: (3,) radiant intensity, or irradiance of a sun. middle: (3, 1); of a sun from the lit point, at
    the distance 1. sides: (3, 2) width and height of an area lamp, or of a sun's disc at that distance.
    axis: (3,) unit, where it shines. local: (3, 3) from directions in cast space to those in the light's own
    space, where a spot's cone is round. softness: the squared radius of a point or spot, which lights as a
    disc that faces the lit point, or as a sphere. shape: over which light comes from random places. part: the
    area that one sample of a pixel stands for; of a sun at the distance 1. beam: of an area lamp of limited
    spread, or of a sphere. sky: (3, SKY_STEPS²) directions of a sky's lamp instead, with equal light from
    each. occluders: the part of the scene that casts its shadows, None for all of it.
    """

    light: Light
    color: Single
    middle: Single
    sides: Single
    axis: Single
    local: Single
    softness: np.float32
    shape: LampShape
    part: float = 0.0
    beam: AreaBeam | SphereBeam | None = None
    sky: Single | None = None
    occluders: CastScene | None = None

    @classmethod
    def of(cls, light: Light, matrix: Array, samples: int) -> Lamp:
        """A light in frames of ``samples`` samples; one sample sees its middle, so that shadows are sharp.

        matrix: (4, 4), world to cast space: a uniform scale and a shift. Blender's units: a
        point of P watts has the intensity P/4π whatever its size, a spot the same within
        its cone; an area lamp has the radiance P/πA on its front, so that each of its
        points stands for the intensity P/π times the cosine; a sun is W/m².
        """
        placed = matrix @ np.asarray(light.matrix, np.float64)
        scale = float(np.linalg.norm(matrix[:3, 0]))
        axes, sharp = placed[:3, :3], samples == 1
        sides = np.zeros((3, 2))
        shape: LampShape = "DISC"
        if light.kind == "SUN":
            strength, placed[:3, 3] = 1.0, axes[:, 2] / scale
            sides = axes[:, :2] / scale * (2 * np.tan(light.angle / 2))
        elif light.kind == "AREA":
            strength = scale**2 / np.pi
            shape, sides = "DISC" if light.ellipse else "SQUARE", axes[:, :2] * np.reshape(light.size, 2)
        else:
            strength = scale**2 / (4 * np.pi)
        area = np.prod(np.linalg.norm(sides, axis=0)) * (np.pi / 4 if shape == "DISC" else 1.0)
        softness = np.float32((light.radius * scale) ** 2 if light.kind in ("POINT", "SPOT") else 0.0)
        area += np.pi * softness
        beam: AreaBeam | SphereBeam | None = None
        if light.kind == "AREA" and light.spread < np.pi:
            beam = AreaBeam.of(light, placed, sharp)
        elif light.kind in ("POINT", "SPOT") and light.sphere and light.radius > 0.0:
            beam = SphereBeam(placed[:3, 3:].astype(np.float32), softness, sharp)
        return cls(
            light=light,
            color=(np.asarray(light.color) * strength).astype(np.float32),
            middle=placed[:3, 3:].astype(np.float32),
            sides=sides.astype(np.float32),
            axis=(-axes[:, 2] / max(float(np.linalg.norm(axes[:, 2])), float(TINY))).astype(np.float32),
            local=np.linalg.pinv(axes / scale).astype(np.float32),
            softness=softness,
            shape="POINT" if sharp or not (sides.any() or softness) else shape,
            part=0.0 if sharp else float(area) / samples,
            beam=beam,
        )

    @property
    def random(self) -> bool:
        """Return whether the light comes from random places."""
        return self.shape != "POINT"

    def share(self, shares: Shares | None) -> Single:
        """The lamp's own random numbers (2, N), or (2, 1) if it needs none. shares: of N points."""
        return shares.of(self.seed) if shares and self.random else MIDDLE

    @cached_property
    def seed(self) -> np.uint32:
        """The seed of random choices, which other lamps do not change."""
        parts = self.middle, self.sides, self.axis[:, None], self.color[:, None]
        return np.uint32(crc32(np.concatenate(parts, axis=1).tobytes()))

    @property
    def power(self) -> float:
        """About the irradiance in the middle of the scene, which cast space has at its origin."""
        power = float(self.color.max(initial=0.0))
        if self.light.kind == "SUN":
            return power
        return power / max(float((self.middle**2).sum()), float(TINY))

    def incidence(self, position: Single, share: Single) -> Incidence:
        """The light that arrives at position (3, N). share: see ``share``."""
        if self.light.kind == "SUN":
            return Incidence(self._towards_sun(share), *FROM_A_SUN)
        if isinstance(self.beam, AreaBeam):
            return self.beam.incidence(position, share)
        if self.beam:
            return self._from_sphere(self.beam, position, share)
        facing: Single | None = None
        if self.light.kind == "AREA":
            direction: Single = self._on_sides(share) - position
        else:
            direction = self.middle - position
            if self.random:
                # On the disc that faces the point: seen from there its rim is foreshortened.
                facing = np.maximum(dot(direction, direction), TINY)
                across, up = perpendicular(direction / np.sqrt(facing))
                place = lamp_places(share, self.shape) * (2 * np.sqrt(self.softness))
                direction += across * place[0]
                direction += up * place[1]
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

    def _towards_sun(self, share: Single) -> Single:
        """Directions to places on a sun, or on a sky's lamp, (3, N) or (3, 1), unit."""
        if self.sky is not None:
            row, column = (share * np.float32(SKY_STEPS)).astype(np.intp)
            towards: Single = self.sky.take(row * SKY_STEPS + column, axis=1)
            return towards
        place = self._on_sides(share)
        place /= np.sqrt(dot(place, place))
        return place

    def _on_sides(self, share: Single) -> Single:
        """Random places on a lamp's plane, (3, N) or (3, 1)."""
        if not self.random:
            return self.middle.copy()
        along, up = lamp_places(share, self.shape)
        places: Single = self.middle + self.sides[:, :1] * along
        places += self.sides[:, 1:] * up
        return places

    def blur(self, light: Incidence) -> Single:
        """The increase of GGX's α squared of highlights, (N,) or (1,), for light that a sample stands for.

        Facets that reflect less than that part of a lamp would be bright in few samples only: white speckles.
        The more samples, the smaller the part.
        """
        return blur_of(light.strength * np.float32(self.part))

    def _from_sphere(self, beam: SphereBeam, position: Single, share: Single) -> Incidence:
        """``incidence`` of a spherical point or spot."""
        light, outside = beam.incidence(position, share)
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
