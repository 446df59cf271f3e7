# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps in Blender's units, straight shadow rays, and the sum of what they light (paper §4.3).

Everything happens in cast space. Lengths there are ``scale`` times the world's,
so a lamp whose light thins out with the square of the distance is made scale² stronger.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, BoolArray, IndexArray
from ..materials.microfacet import facets
from ..normals import dot
from ..passes.light_passes import DIFFUSE, SPECULAR, LightParts
from ..sampling.sample_sets import lamp_positions
from ..scene.shading_scene import Light
from ..scene.surface import TINY, SurfacePoints
from ..typing import Single
from .light_table import LightTable, by_material

# A blend of nothing would make the spot's edge a division by zero.
SMALLEST_BLEND = 1e-6
# Radians of a beam's half spread, at least: float32 tells narrower ones badly from parallel beams.
SMALLEST_SPREAD = 1e-3
# Half spreads up to this take the series of tan a - a, whose difference float32 would round away.
SERIES_SPREAD = 0.05
# Cosine of the light to a triangle below which shadow rays begin to start from the rounded
# surface. Facets of a convex solid shade each other at 0; the margin makes it gradual.
GRAZING = np.float32(0.1)
# Of light that arrives from all sides, what a white surface sends each way.
OVER_PI = np.float32(1.0 / np.pi)
# Strength and distance of a sun.
FROM_A_SUN = np.ones(1, np.float32), np.full(1, np.inf, np.float32)


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
class Lamp:
    """A light in cast space, with a place for each sample of the film.

    color: (3,) radiant intensity, or irradiance of a sun. places: (3, S); of a sun from the point that
    is lit, on a disc at the distance 1.
    axis: (3,) unit, where it shines. local: (3, 3) from directions in cast space to
    those in the light's own space, where a spot's cone is round. softness: the squared
    radius of a point or spot, which lights as a disc that faces whatever it lights, or as a sphere. beam: the
    places of an area lamp of limited spread, of a sphere too. occluders: what stands in its way, None for
    everything.
    """

    light: Light
    color: Single
    places: Single
    axis: Single
    local: Single
    softness: np.float32
    beam: Beam | None = None
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
        return cls(
            light,
            (np.asarray(light.color) * strength).astype(np.float32),
            (placed[:3, 3:] + offsets).astype(np.float32),
            (-axes[:, 2] / max(float(np.linalg.norm(axes[:, 2])), float(TINY))).astype(np.float32),
            np.linalg.pinv(axes / scale).astype(np.float32),
            np.float32((light.radius * scale) ** 2 if light.kind in ("POINT", "SPOT") else 0.0),
            Beam.of(light, placed, scale, samples),
        )

    @cached_property
    def towards(self) -> Single:
        """Directions to a sun's places, (3, S), unit."""
        return (self.places / np.sqrt(dot(self.places, self.places))).astype(np.float32)

    @cached_property
    def middle(self) -> Single:
        """The centre of a round lamp, (3, 1)."""
        middle: Single = self.places.mean(axis=1, keepdims=True, dtype=np.float64).astype(np.float32)
        return middle

    def incidence(self, position: Single, sample: int | IndexArray) -> Incidence:
        """What arrives at position (3, N) from the lamp's place of this sample, or from each point's own."""
        if self.light.kind == "SUN":
            return Incidence(self.towards.take(np.atleast_1d(sample), axis=1), *FROM_A_SUN)
        if self.beam:
            return self._of_beam(self.beam, position, sample)
        places: Single = self.places.take(np.atleast_1d(sample), axis=1)
        direction: Single = places - position
        facing: Single | None = None
        if self.softness:
            # On the disc that faces the point, which turns away from it towards its rim.
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

    def _of_beam(self, beam: Beam, position: Single, sample: int | IndexArray) -> Incidence:
        """As ``incidence``, from places that depend on the position."""
        if self.light.kind == "AREA":
            return beam.of_area(position, sample)
        light, outside = beam.of_sphere(position, sample, self.softness)
        if self.light.kind == "SPOT":
            # Within the sphere light comes from all sides.
            light.strength[outside] *= self.spot(light.direction[:, outside])
        return light

    def spot(self, direction: Single) -> Single:
        """Share of a spot's intensity that leaves it against direction (3, N), (N,).

        A smoothstep of the cosine to the axis, from the edge of the cone inwards over
        the share ``spot_blend`` of the way to the axis. Compared with Cycles' pictures.
        """
        local = np.einsum("ij,jn->in", self.local, direction)
        cosine = local[2] / np.maximum(np.sqrt(dot(local, local)), TINY)
        edge = np.cos(self.light.spot_angle / 2)
        width = max((1 - edge) * self.light.spot_blend, SMALLEST_BLEND)
        rise = np.clip((cosine - np.float32(edge)) * np.float32(1 / width), 0, 1)
        smooth: Single = rise * rise * (3 - 2 * rise)
        return smooth


@dataclass(frozen=True)
class Beam:
    """Lamps that are seen in other places from each point: area lamps of limited spread, and spheres.

    centre: (3, 1). axes: (3, 3), unit columns, the lamp's own. half: (2, 1) extents. ellipse: of the
    AREA. tangent: of the half spread; factor: makes its power independent of it. square, disc: (2, S),
    places of the samples, both in a square of side 1 around 0.
    """

    centre: Single
    axes: Single
    half: Single
    ellipse: bool
    tangent: np.float32
    factor: np.float32
    square: Single
    disc: Single

    @classmethod
    def of(cls, light: Light, placed: Array, scale: float, samples: int) -> Beam | None:
        """None for lamps that are seen in the same places from everywhere.

        placed: (4, 4), the lamp in cast space, where a metre is ``scale``. Normalisation as in Cycles
        (AreaLight::copy_to_kernel): tan a - a, a half the spread, its series where a is small.
        """
        wide = light.kind == "AREA" and light.spread < np.pi
        round_ = light.kind in ("POINT", "SPOT") and light.sphere and light.radius > 0.0
        if not wide and not round_:
            return None
        length = np.maximum(np.linalg.norm(placed[:3, :3], axis=0), float(TINY))
        angle = max(light.spread / 2, SMALLEST_SPREAD)
        tangent = np.tan(angle)
        factor = 1 / (tangent - angle) if angle > SERIES_SPREAD else 3 / angle**3
        return cls(
            placed[:3, 3:].astype(np.float32),
            (placed[:3, :3] / length).astype(np.float32),
            (length[:2] * light.size / 2).astype(np.float32)[:, None],
            light.ellipse,
            np.float32(tangent),
            np.float32(factor),
            lamp_positions(samples, "SQUARE").astype(np.float32),
            lamp_positions(samples, "DISC").astype(np.float32),
        )

    def of_area(self, position: Single, sample: int | IndexArray) -> Incidence:
        """Return the light that arrives at position (3, N) from an area lamp, in units of its power / π.

        A grid of slats before the lamp lets through the less the more light is inclined (Cycles,
        kernel/light/area.h). Samples are spread over the part of the lamp that is seen through it: a disc
        where all of that is on the lamp, otherwise the rectangle around.
        """
        away = position - self.centre
        x, y, z = (dot(away, axis[:, None]) for axis in self.axes.T)
        depth = np.maximum(-z, 0)
        here, reach = np.stack([x, y]), depth * self.tangent
        low, high = np.maximum(here - reach, -self.half), np.minimum(here + reach, self.half)
        side = np.maximum(high - low, 0)
        whole = ((low > -self.half) & (high < self.half)).all(axis=0)
        share = side[0] * side[1] / (4 * self.half[0] * self.half[1])
        if self.ellipse:
            off = np.sqrt(np.sum((here / self.half) ** 2, axis=0))
            whole &= off + reach / self.half.min() < 1
            whole |= ((low == -self.half) & (high == self.half)).all(axis=0)
            share *= np.float32(4 / np.pi)
        number = np.atleast_1d(sample)
        square, disc = self.square.take(number, axis=1), self.disc.take(number, axis=1)
        place = (low + high) / 2 + side * (square + (disc - square) * whole)
        share *= 1 + (np.float32(np.pi / 4) - 1) * whole
        if self.ellipse:
            share *= whole | (np.sum((place / self.half) ** 2, axis=0) <= 1)
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
        return Incidence(direction, share * passed * depth / (squared * distance), distance)

    def of_sphere(
        self, position: Single, sample: int | IndexArray, squared_radius: np.float32
    ) -> tuple[Incidence, BoolArray]:
        """Return the light at position (3, N) from a sphere, by its intensity, and which lie outside it.

        Samples are spread evenly over the solid angle that it fills (Cycles, kernel/light/point.h);
        from within that is everything.
        """
        ahead = self.centre - position
        squared = np.maximum(dot(ahead, ahead), TINY)
        distance = np.sqrt(squared)
        ahead /= distance
        outside = squared > squared_radius
        sine = np.minimum(squared_radius / squared, 1)
        # 1 - cos of the sphere's angular radius, of the sample's angle off its middle.
        cap = np.where(outside, sine / (1 + np.sqrt(1 - sine)), 2).astype(np.float32)
        disc = self.disc.take(np.atleast_1d(sample), axis=1)
        share = np.minimum(4 * dot(disc, disc), 1)
        lower = cap * share
        across, up = _perpendicular(ahead)
        aside = 2 * np.sqrt(cap * (2 - lower))
        direction = ahead * (1 - lower) + across * (aside * disc[0]) + up * (aside * disc[1])
        direction /= np.sqrt(dot(direction, direction))
        along = distance * (1 - lower)
        inside = np.sqrt(np.maximum(squared_radius - squared + along**2, 0))
        until = np.where(outside, along - inside, along + inside)
        return Incidence(direction, 2 * cap / squared_radius, until), outside


def _perpendicular(normal: Single) -> tuple[Single, Single]:
    """Two unit vectors (3, N) square to unit ones and to each other (Duff et al., JCGT 2017)."""
    x, y, z = normal
    sign = np.copysign(np.float32(1), z)
    a = -1 / (sign + z)
    b = x * y * a
    return np.stack([1 + sign * x * x * a, sign * b, -sign * x]), np.stack([b, sign + y * y * a, -y])


def radiance(
    points: SurfacePoints,
    table: LightTable,
    lamps: Sequence[Lamp],
    sample: int | IndexArray,
    cast_scene: CastScene,
    parts: LightParts | None = None,
) -> Single:
    """Radiance that leaves the points towards the viewer, (3, N), scene-linear.

    Emission and the world's or the sky's light, plus for every lamp Lambert's share of what arrives
    and that of GGX facets, towards V against the projector's tangent.
    parts: gets what it is the sum of, where that is asked for.
    """
    facing = dot(points.normal, points.view)
    seen = table.seen(points.material, facing)
    color = np.empty_like(points.normal)
    color[:] = table.unlit(points.material, seen)
    if parts:
        parts.shine(by_material(table.emission, points.material), color)
    alpha = by_material(table.alpha, points.material)
    for lamp in lamps:
        light = lamp.incidence(points.position, sample)
        cosine = dot(points.normal, light.direction)
        np.maximum(cosine, 0, out=cosine)
        received = cosine * light.strength
        if lamp.light.receivers is not None and points.linked is not None:
            received *= lamp.light.receivers.take(points.linked)
        full = received.copy() if parts else received
        if lamp.light.casts_shadow:
            cut_shadows(received, points, light, lamp.occluders or cast_scene)
        tint = lamp.color[:, None]
        if parts:
            parts.receive(full, received, lamp.color)
        if lamp.light.scattered:
            lit = by_material(table.diffuse * tint, points.material)
            lit = lit * (received if seen.under is None else received * seen.under)
            color += lit
            if parts:
                parts.rows[DIFFUSE] += lit
        if table.glossy and lamp.light.mirrored:
            density, cosine = facets(cosine, facing, dot(points.view, light.direction), alpha)
            received *= density
            received = table.shine(points.material, cosine, seen) * received
            lit = received * tint
            color += lit
            if parts:
                parts.rows[SPECULAR] += lit
    if table.sky and table.even:
        even = table.even
        reflectance = even.unlit(points.material, even.seen(points.material, facing)) * OVER_PI
        lit = table.sky.scattered(points, reflectance, sample, color)
        color += lit
        if parts:
            parts.rows[DIFFUSE] += lit
    return color


def cut_shadows(received: Single, points: SurfacePoints, light: Incidence, cast_scene: CastScene) -> None:
    """Set to zero, in place, what points in shadow receive: one straight ray from each lit point.

    Where light grazes a triangle or falls on its back, but on the front of the surface
    that smooth shading pretends, the ray starts on the latter: from the triangle it would
    meet the facets next door, and their edges would show as steps.
    """
    lit = np.flatnonzero(received)
    if points.shadow is None or not len(lit):
        return
    directions, distances = light.direction, light.distance
    if directions.shape[1] > 1:
        directions = directions.take(lit, axis=1)
    if len(distances) > 1:
        distances = distances.take(lit)
    origins = points.shadow.origin.take(lit, axis=1)
    if points.shadow.height is not None:
        grazing = 1 - dot(points.shadow.flat.take(lit, axis=1), directions) / GRAZING
        height = points.shadow.height.take(lit) * np.clip(grazing, 0, 1)
        origins += points.normal.take(lit, axis=1) * height
    hidden = cast_scene.occluded(origins, directions, distances)
    received[lit[hidden]] = 0
