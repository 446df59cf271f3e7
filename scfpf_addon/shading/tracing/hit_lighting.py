# SPDX-License-Identifier: GPL-3.0-or-later
"""The light that leaves hits: constants of materials, and the lobes of materials that are node graphs."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ...casting.common.cancellation import raise_if_cancelled
from ...projection.typing import BoolArray, IndexArray
from ..lights.lighting import Lighting
from ..materials.coefficients import MaterialCoefficients
from ..materials.constants import Materials
from ..materials.lobes import Body, ScatteredLobe, lobes
from ..nodes.context import ShadingContext
from ..scene.shading_scene import Scene
from ..scene.surface import SurfacePoints, SurfaceTable
from ..vectors import dot_row, unit
from .path_wave import PathFilm, PathWave

# Hits whose graph is evaluated at once: a large graph keeps a hundred arrays of them.
MOST_AT_ONCE = 1 << 14

# A lobe that scatters light on, at the places (n,) of a wave.
Scattered = tuple[IndexArray, ScatteredLobe]
# A body that lamps light, at the places (n,) of a wave.
LitBody = tuple[IndexArray, Body]


@dataclass(frozen=True)
class HitLighting:
    """Tables that light hits.

    coefficients: of materials that are constants. has_graph: (M,) whether a material is a node graph.
    """

    scene: Scene
    surface: SurfaceTable
    coefficients: MaterialCoefficients
    lighting: Lighting
    has_graph: BoolArray

    @cached_property
    def _emission(self) -> MaterialCoefficients:
        """The coefficients of materials in the dark: emission alone."""
        return MaterialCoefficients.of(self.scene.materials, np.zeros(3))

    @cached_property
    def _dark(self) -> Lighting:
        """The lighting without lights."""
        return self.lighting.dark()

    def gather(self, wave: PathWave, sample: int, film: PathFilm, last: bool) -> list[Scattered]:
        """Add the light that leaves the wave's places to the film; return the lobes that scatter light on.

        last: places beyond a limit of bounces, which emit, and let light through, but are not lit.
        """
        hits = wave.hits
        points = self.surface.points(hits.triangle, hits.barycentric, hits.position, hits.tangent)
        self._gather_constants(wave, points, sample, film, last)
        bodies: list[LitBody] = []
        scattered: list[Scattered] = []
        for number in np.unique(points.material):
            if not self.has_graph[number]:
                continue
            everywhere = np.flatnonzero(points.material == number)
            for first in range(0, len(everywhere), MOST_AT_ONCE):
                raise_if_cancelled()
                which = everywhere[first : first + MOST_AT_ONCE]
                context = self.shading_context(wave, points, which)
                for lobe in lobes(self.scene.materials.graphs[int(number)], context):
                    if isinstance(lobe, Body):
                        bodies.append((which, lobe))
                    elif lobe.kind == "TRANSPARENT" or not last:
                        scattered.append((which, lobe))
        if bodies:
            self._gather_bodies(wave, points, bodies, sample, film, last)
        return scattered

    def shading_context(self, wave: PathWave, points: SurfacePoints, which: IndexArray) -> ShadingContext:
        """The inputs of node graphs at the wave's places ``which``."""
        cast_scene, hits = self.surface.cast_scene, wave.hits
        triangle = hits.triangle.take(which).astype(np.intp)
        tangent, position = hits.tangent.take(which, 1), hits.position.take(which, 1)
        view = -unit(tangent)
        flat = self.surface.flat.take(triangle, 1).astype(np.float64)
        back = (dot_row(flat, view) < 0.0).astype(np.float64)
        return ShadingContext(
            geometry=self.scene.geometry,
            images=self.scene.images,
            triangle=triangle,
            barycentric=cast_scene.barycentric(position, triangle),
            position=position / cast_scene.scale + np.reshape(cast_scene.centre, (3, 1)),
            normal=points.normal.take(which, 1).astype(np.float64),
            flat=flat * (1.0 - 2.0 * back),
            view=view,
            back=back,
        )

    def _gather_constants(
        self, wave: PathWave, points: SurfacePoints, sample: int, film: PathFilm, last: bool
    ) -> None:
        """Add the light of places whose materials are constants."""
        plain = np.flatnonzero(~self.has_graph.take(points.material))
        if not len(plain):
            return
        lighting, coefficients = self.lighting, self.coefficients
        if last:
            lighting, coefficients = self._dark, self._emission
        parts = film.parts_of_hits(len(plain))
        color = lighting.radiance(points.take(plain), coefficients, sample, parts)
        film.gather(wave.pixel[plain], wave.throughput[:, plain], color, parts, wave.on_ray[plain])

    def _gather_bodies(
        self,
        wave: PathWave,
        points: SurfacePoints,
        bodies: list[LitBody],
        sample: int,
        film: PathFilm,
        last: bool,
    ) -> None:
        """Add the light of the bodies of node graphs, all at once."""
        which = np.concatenate([index for index, _ in bodies])
        weight = np.concatenate([body.weight[0] for _, body in bodies])
        some = np.flatnonzero(weight > 0.0)
        if not len(some):
            # Alpha cuts all of them away.
            return
        which, weight = which[some], weight[some]
        normal = np.concatenate([body.normal for _, body in bodies], axis=1)[:, some].astype(np.float32)
        materials = Materials.stacked([body.materials for _, body in bodies], some)
        lighting = self._dark if last else self.lighting
        environment = np.zeros(3) if last else self.scene.world_color
        with_unit = lighting.sky is not None
        table = MaterialCoefficients.of(materials, environment, per_hit=True, with_unit=with_unit)
        lit = points.take(which)._replace(normal=normal, material=np.arange(len(some)))
        parts = film.parts_of_hits(len(some))
        color = lighting.radiance(lit, table, sample, parts)
        throughput = wave.throughput[:, which] * weight
        film.gather(wave.pixel[which], throughput, color, parts, wave.on_ray[which])
