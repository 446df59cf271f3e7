# SPDX-License-Identifier: GPL-3.0-or-later
"""All that colours a hit: tables that are prepared once a frame, and the colour of what was hit."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...casting.common.hits import Hits
from ...casting.continuation import Continuation
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import BoolArray, IndexArray
from ..lights.lighting import Lighting
from ..lights.ray_visibility import has_catchers, holdouts
from ..lights.shadow_catchers import Catchers
from ..materials.coefficients import MaterialCoefficients
from ..passes.light_passes import LightParts
from ..scene.shading_scene import Scene
from ..scene.surface import SurfaceTable
from ..settings.frame_settings import FrameSettings
from ..typing import Single
from .tracer import Tracer


@dataclass(frozen=True)
class Shading:
    """All that colours a hit: lookup tables, and lights in cast space.

    held_out: (T,) the triangles that leave a hole in the picture, None for none. catchers: those of which
    but shadows are seen.
    """

    surface: SurfaceTable
    coefficients: MaterialCoefficients
    lighting: Lighting
    tracer: Tracer | None
    held_out: BoolArray | None = None
    catchers: Catchers | None = None

    @classmethod
    def of(cls, scene: Scene, cast_scene: CastScene, settings: FrameSettings) -> Shading:
        """Prepared for frames of these settings. Lights without power or reach are left out."""
        lighting = Lighting.of(scene, cast_scene, settings.samples)
        shadows = lighting.casts_shadows or has_catchers(scene.geometry)
        surface = SurfaceTable.of(scene.geometry, cast_scene, shadows, settings.threads)
        with_unit = lighting.sky is not None
        coefficients = MaterialCoefficients.of(scene.materials, scene.world_color, with_unit=with_unit)
        catchers = Catchers.of(scene, cast_scene, lighting.lamps, settings)
        tracer = Tracer.of(scene, surface, coefficients, lighting, settings.transparent, catchers)
        return cls(surface, coefficients, lighting, tracer, holdouts(scene.geometry), catchers)

    def color(
        self,
        hits: Hits,
        where: IndexArray,
        sample: int | IndexArray,
        continuation: Continuation,
        parts: LightParts | None = None,
    ) -> Single:
        """Radiance towards the viewer of the hits at ``where`` (n,), (3, n), and alpha if not 1, (4, n).

        sample: a number, or with no tracer one for each hit. continuation: follows the projectors of ``hits``
        on. parts: of n hits, gets what the colours are the sum of.
        """
        tracer = self.tracer
        if tracer and isinstance(sample, int) and tracer.needed(hits.triangle.take(where)):
            pixel, following = continuation.pixels_of(where), continuation.next_hits_of(where)
            exits = continuation.exit_tangents_of(where)
            return tracer.color(hits.take(where), sample, pixel, following, exits, parts)
        triangle, barycentric, position, tangent = hits[1:5]
        if len(where) < len(triangle):
            triangle, barycentric = triangle.take(where), barycentric.take(where, axis=1)
            position, tangent = position.take(where, axis=1), tangent.take(where, axis=1)
        points = self.surface.points(triangle, barycentric, position, tangent)
        color = self.lighting.radiance(points, self.coefficients, sample, parts)
        if self.catchers:
            exits = continuation.exit_tangents_of(where)
            color = self.catchers.over(color, triangle, points, sample, exits, parts)
        if self.held_out is None:
            return color
        held = self.held_out.take(triangle)
        if parts:
            parts.rows[:, held] = 0.0
        if len(color) == 3:
            color = np.concatenate([color, np.ones_like(color[:1])])
        color *= ~held
        return color
