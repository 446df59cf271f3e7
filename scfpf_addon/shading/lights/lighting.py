# SPDX-License-Identifier: GPL-3.0-or-later
"""The lamps and the sky of a frame, and the sum of the light that they send to the viewer (paper §4.3)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array
from ..materials.coefficients import MaterialCoefficients, ViewTerms, by_material, metal_terms
from ..materials.microfacet import ggx_reflection
from ..passes.light_passes import DIFFUSE, SPECULAR, LightParts
from ..sampling.point_samples import PointSamples, Shares
from ..sampling.sample_positions import BITS, Bits, scramble
from ..scene.shading_scene import Scene
from ..scene.surface import TINY, SurfacePoints
from ..typing import Single
from ..vectors import dot
from .lamps import Lamp, blur_of
from .light_culling import cull_lights
from .ray_visibility import shadow_scene, with_occluders
from .shadow_rays import cut_shadows
from .sky_light import SkyLight, position_seeds

# The radiance of a white diffuse surface, by irradiance.
OVER_PI = np.float32(1.0 / np.pi)
# Lamps whose light is a smaller share of that of all lamps at a point get their shadow rays at random.
FAINT = 1.0 / 8.0
# The seed of places on lamps.
LAMPS = 8


class _ShadedPoints(NamedTuple):
    """N points as the viewer sees them.

    facing: (N,) cosines to the viewer. diffuse: (3, N) or (3, 1) radiance by irradiance. alpha: (N,) or (1,).
    """

    points: SurfacePoints
    coefficients: MaterialCoefficients
    facing: Single
    view: ViewTerms
    diffuse: Single
    alpha: Single

    @classmethod
    def of(
        cls, points: SurfacePoints, coefficients: MaterialCoefficients, facing: Single, view: ViewTerms
    ) -> _ShadedPoints:
        """Look up what the light of all lamps is multiplied with."""
        material = points.material
        diffuse = by_material(coefficients.diffuse, material)
        if view.layer_transmittance is not None:
            diffuse = diffuse * view.layer_transmittance
        if coefficients.metal:
            view = view._replace(metal=metal_terms(coefficients, material, view))
        return cls(points, coefficients, facing, view, diffuse, by_material(coefficients.alpha, material))


@dataclass(frozen=True)
class Lighting:
    """The lights of a frame: all that lights it.

    lamps: in cast space, those of the sky included. cast_scene: casts the shadows of lamps without occluders
    of their own. sky: None under a uniform environment, which the coefficients of materials include.
    """

    lamps: tuple[Lamp, ...]
    cast_scene: CastScene
    sky: SkyLight | None = None

    @classmethod
    def of(cls, scene: Scene, cast_scene: CastScene, samples: int) -> Lighting:
        """The lighting of frames of ``samples`` samples. Lights without power or reach are left out."""
        sky = None
        if scene.world is not None:
            occluders = shadow_scene(scene.geometry, cast_scene)
            sky = replace(SkyLight.of(scene.world.light, samples), occluders=occluders)
        lights = cull_lights(scene.lights, scene.geometry.vertices)
        lamps = tuple(Lamp.of(light, cast_scene.matrix, samples) for light in lights)
        lamps += sky.lamps if sky else ()
        # Faint lamps last: the light so far tells where they hardly show.
        lamps = tuple(sorted(lamps, key=lambda lamp: lamp.power, reverse=True))
        return cls(tuple(with_occluders(lamp, scene.geometry, cast_scene) for lamp in lamps), cast_scene, sky)

    @property
    def casts_shadows(self) -> bool:
        """Return whether any light casts shadows."""
        return self.sky is not None or any(lamp.light.casts_shadow for lamp in self.lamps)

    def dark(self) -> Lighting:
        """The lighting without light."""
        return replace(self, lamps=(), sky=None)

    def radiance(
        self,
        points: SurfacePoints,
        coefficients: MaterialCoefficients,
        samples: PointSamples,
        parts: LightParts | None = None,
        weight: Array | None = None,
        spread: Array | None = None,
    ) -> Single:
        """Radiance that leaves the points towards the viewer, (3, N), scene-linear.

        Emission and the environment's light, plus for every lamp Lambert's share of the light that arrives
        and that of GGX facets, towards V against the projector's tangent.
        samples: of the points. parts: of them, to be filled in. weight: (N,), see ``SkyLight.radiance``.
        spread: (N,) as in ``PathWave``, None for 0.
        """
        facing = dot(points.normal, points.view)
        unit = coefficients.unit if self.sky else None
        view = (unit or coefficients).view_terms(points.material, facing)
        color, unlit = np.zeros_like(points.normal), coefficients.unlit(points.material, view)
        if parts:
            parts.shine(by_material(coefficients.emission, points.material), unlit)
        if self.lamps:
            seen = _ShadedPoints.of(points, coefficients, facing, view)
            if spread is not None:
                seen = seen._replace(alpha=seen.alpha + blur_of(spread.astype(np.float32)))
            seeds = position_seeds(points.position)
            shares = samples.shares(LAMPS) if any(lamp.random for lamp in self.lamps) else None
            for lamp in self.lamps:
                self._add_lamp(color, seen, lamp, shares, parts, scramble(seeds ^ lamp.seed, 0), weight)
        color += unlit
        if self.sky and unit:
            reflectance = unit.unlit(points.material, view) * OVER_PI
            lit = self.sky.radiance(points, reflectance, samples, color, weight)
            color += lit
            if parts:
                parts.rows[DIFFUSE] += lit
        return color

    def _add_lamp(
        self,
        color: Single,
        seen: _ShadedPoints,
        lamp: Lamp,
        shares: Shares | None,
        parts: LightParts | None,
        seeds: Bits,
        weight: Array | None,
    ) -> None:
        """Add the light of a lamp to colours (3, N), in place.

        shares: None if no lamp needs them. seeds: (N,) of random choices.
        """
        points, coefficients = seen.points, seen.coefficients
        light = lamp.incidence(points.position, lamp.share(shares))
        cosine = np.maximum(dot(points.normal, light.direction), 0)
        received = cosine * light.strength
        lamp.limit_to_receivers(received, points)
        tint = lamp.color[:, None]
        lit: list[tuple[slice, Single]] = []
        if lamp.light.diffuse:
            lit.append((DIFFUSE, seen.diffuse * received * tint))
        if coefficients.glossy and lamp.light.specular:
            between = dot(points.view, light.direction)
            alpha = np.minimum(seen.alpha + lamp.blur(light), 1)
            density, cosine = ggx_reflection(cosine, seen.facing, between, alpha)
            density *= received
            reflectance = coefficients.reflectance(points.material, cosine, seen.view)
            lit.append((SPECULAR, reflectance * density * tint))
        shown = np.ones_like(received)
        if lamp.light.casts_shadow and lit:
            whole = lit[0][1] + lit[1][1] if len(lit) == 2 else lit[0][1]
            chance = ray_chances(whole, color, weight)
            left = received * (seeds * np.float32(2.0**-BITS) < chance)
            sent = left != 0
            cut_shadows(left, points, light, lamp.occluders or self.cast_scene)
            shown -= (sent & (left == 0)) / chance
        if parts:
            parts.receive(received, received * shown, lamp.color)
        for rows, each in lit:
            each *= shown
            color += each
            if parts:
                parts.rows[rows] += each


def ray_chances(lit: Single, color: Single, weight: Array | None) -> Single:
    """The chances (N,) that a lamp's light ``lit`` (3, N) gets a shadow ray.

    A ray that is hidden takes away the light over its chance, so that the mean stays and what no shadow meets
    has no noise. No channel can lose more than it has. color: (3, N), of the lamps so far. weight: (N,) of
    the points in their pixels, None for 1.
    """
    share = (lit / np.maximum(lit + color, TINY)).max(axis=0)
    chance: Single = share * np.float32(1 / FAINT)
    if weight is not None:
        chance = np.maximum(share, chance * weight.astype(np.float32))
    # Points without light get none.
    return np.clip(chance, TINY, 1, out=chance)
