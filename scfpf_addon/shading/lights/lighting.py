# SPDX-License-Identifier: GPL-3.0-or-later
"""The lamps and the sky of a frame, and the sum of the light that they send to the viewer (paper §4.3)."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, IndexArray
from ..materials.coefficients import MaterialCoefficients, ViewTerms, by_material
from ..materials.microfacet import ggx_reflection
from ..passes.light_passes import DIFFUSE, SPECULAR, LightParts
from ..scene.shading_scene import Scene
from ..scene.surface import SurfacePoints
from ..typing import Single
from ..vectors import dot
from .lamps import Lamp
from .light_culling import cull_lights
from .ray_visibility import shadow_scene, with_occluders
from .shadow_rays import cut_shadows
from .sky_light import SkyLight

# The radiance of a white diffuse surface, by irradiance.
OVER_PI = np.float32(1.0 / np.pi)


class _Seen(NamedTuple):
    """N points as the viewer sees them. facing: (N,) cosines to the viewer. alpha: (N,) or (1,)."""

    points: SurfacePoints
    coefficients: MaterialCoefficients
    facing: Single
    view: ViewTerms
    alpha: Single


@dataclass(frozen=True)
class Lighting:
    """Everything that lights a frame.

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
        return cls(tuple(with_occluders(lamp, scene.geometry, cast_scene) for lamp in lamps), cast_scene, sky)

    @property
    def casts_shadows(self) -> bool:
        """Whether any light casts shadows."""
        return self.sky is not None or any(lamp.light.casts_shadow for lamp in self.lamps)

    def dark(self) -> Lighting:
        """The lighting without light."""
        return replace(self, lamps=(), sky=None)

    def radiance(
        self,
        points: SurfacePoints,
        coefficients: MaterialCoefficients,
        sample: int | IndexArray,
        parts: LightParts | None = None,
        weight: Array | None = None,
    ) -> Single:
        """Radiance that leaves the points towards the viewer, (3, N), scene-linear.

        Emission and the environment's light, plus for every lamp Lambert's share of the light that arrives
        and that of GGX facets, towards V against the projector's tangent.
        parts: of the points, to be filled in. weight: (N,), see ``SkyLight.radiance``.
        """
        facing = dot(points.normal, points.view)
        view = coefficients.view_terms(points.material, facing)
        color = np.empty_like(points.normal)
        color[:] = coefficients.unlit(points.material, view)
        if parts:
            parts.shine(by_material(coefficients.emission, points.material), color)
        seen = _Seen(points, coefficients, facing, view, by_material(coefficients.alpha, points.material))
        for lamp in self.lamps:
            self._add_lamp(color, seen, lamp, sample, parts)
        if self.sky and coefficients.unit:
            unit = coefficients.unit
            reflectance = unit.unlit(points.material, unit.view_terms(points.material, facing)) * OVER_PI
            lit = self.sky.radiance(points, reflectance, sample, color, weight)
            color += lit
            if parts:
                parts.rows[DIFFUSE] += lit
        return color

    def _add_lamp(
        self, color: Single, seen: _Seen, lamp: Lamp, sample: int | IndexArray, parts: LightParts | None
    ) -> None:
        """Add the light of a lamp to colours (3, N), in place."""
        points, coefficients = seen.points, seen.coefficients
        light = lamp.incidence(points.position, sample)
        cosine = dot(points.normal, light.direction)
        np.maximum(cosine, 0, out=cosine)
        received = cosine * light.strength
        lamp.limit_to_receivers(received, points)
        full = received.copy() if parts else received
        if lamp.light.casts_shadow:
            cut_shadows(received, points, light, lamp.occluders or self.cast_scene)
        tint = lamp.color[:, None]
        if parts:
            parts.receive(full, received, lamp.color)
        if lamp.light.diffuse:
            lit = by_material(coefficients.diffuse * tint, points.material)
            transmittance = seen.view.layer_transmittance
            lit = lit * (received if transmittance is None else received * transmittance)
            color += lit
            if parts:
                parts.rows[DIFFUSE] += lit
        if coefficients.glossy and lamp.light.specular:
            between = dot(points.view, light.direction)
            density, cosine = ggx_reflection(cosine, seen.facing, between, seen.alpha)
            received *= density
            received = coefficients.reflectance(points.material, cosine, seen.view) * received
            lit = received * tint
            color += lit
            if parts:
                parts.rows[SPECULAR] += lit
