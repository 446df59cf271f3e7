# SPDX-License-Identifier: GPL-3.0-or-later
"""The colours of hits, by tables that are prepared once a frame."""

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
from ..sampling.point_samples import PointSamples
from ..scene.shading_scene import Scene
from ..scene.surface import SurfaceTable
from ..settings.frame_settings import FrameSettings
from ..typing import Single
from .closure_table import ClosureTable
from .tracer import Tracer


@dataclass(frozen=True)
class Shading:
    """Lookup tables of materials, and lights in cast space.

    tracer: None where no material is a node graph. held_out: (T,) whether triangles leave holes in the
    image, None for none. catchers: None without shadow catchers.
    """

    surface: SurfaceTable
    coefficients: MaterialCoefficients
    lighting: Lighting
    tracer: Tracer | None
    held_out: BoolArray | None = None
    catchers: Catchers | None = None

    @classmethod
    def of(cls, scene: Scene, cast_scene: CastScene, settings: FrameSettings) -> Shading:
        """The tables for frames of these settings. Lights without power or reach are left out."""
        lighting = Lighting.of(scene, cast_scene, settings.samples)
        shadows = lighting.casts_shadows or has_catchers(scene.geometry)
        surface = SurfaceTable.of(scene.geometry, cast_scene, shadows, settings.threads)
        with_unit = lighting.sky is not None
        closures = ClosureTable.of(scene.materials)
        constants = closures.all_constants(scene.materials)
        coefficients = MaterialCoefficients.of(constants, scene.world_color, with_unit=with_unit)
        catchers = Catchers.of(scene, cast_scene, lighting.lamps, settings)
        tracer = Tracer.of(scene, surface, closures, coefficients, lighting, settings.transparent, catchers)
        return cls(
            surface=surface,
            coefficients=coefficients,
            lighting=lighting,
            tracer=tracer,
            held_out=holdouts(scene.geometry),
            catchers=catchers,
        )

    def color(
        self,
        hits: Hits,
        where: IndexArray,
        samples: PointSamples,
        continuation: Continuation,
        parts: LightParts | None = None,
    ) -> Single:
        """Radiance towards the viewer of the hits at ``where`` (n,), (3, n), and alpha if not 1, (4, n).

        samples: of the n hits. continuation: of the projectors of ``hits``.
        parts: of n hits, to be filled in.
        """
        tracer = self.tracer
        if tracer and tracer.needed(hits.triangle.take(where)):
            return tracer.color(hits.take(where), samples, continuation.take(where), parts)
        triangle, barycentric, position, tangent = hits[1:5]
        if len(where) < len(triangle):
            triangle, barycentric = triangle.take(where), barycentric.take(where, axis=1)
            position, tangent = position.take(where, axis=1), tangent.take(where, axis=1)
        points = self.surface.points(triangle, barycentric, position, tangent)
        color = self.lighting.radiance(points, self.coefficients, samples, parts)
        if self.catchers:
            color = self.catchers.over(color, triangle, points, samples, continuation.take(where), parts)
        if self.held_out is None:
            return color
        held = self.held_out.take(triangle)
        if parts:
            parts.rows[:, held] = 0.0
        if len(color) == 3:
            color = np.concatenate([color, np.ones_like(color[:1])])
        color *= ~held
        return color
