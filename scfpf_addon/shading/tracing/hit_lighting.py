# SPDX-License-Identifier: GPL-3.0-or-later
"""The light that leaves hits, of all materials of a wave at once, and the closures that send light on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...projection.typing import Array, BoolArray, IndexArray
from ..lights.lighting import Lighting
from ..materials.coefficients import MaterialCoefficients, by_material
from ..materials.lobes import bodies
from ..nodes.context import ShadingContext
from ..passes.light_passes import COLORS, EMISSION, LightParts
from ..scene.shading_scene import Scene
from ..scene.surface import SurfacePoints, SurfaceTable
from ..typing import Single
from ..vectors import dot_row, unit
from .closure_table import ClosureTable, HitClosures
from .path_samples import PathSamples
from .path_wave import TOTAL, PathFilm, PathWave


class _Bodies(NamedTuple):
    """Bodies at the places ``where`` (n,) of a wave.

    points: of surface, whose materials are columns of the coefficients. weight: (n,). far: (n,) whether they
    are beyond a limit of bounces.
    """

    where: IndexArray
    points: SurfacePoints
    coefficients: MaterialCoefficients
    weight: Array
    far: BoolArray

    def take(self, index: IndexArray) -> _Bodies:
        """The bodies at ``index``, in order."""
        if len(index) == len(self.where):
            return self
        return self._replace(
            where=self.where.take(index),
            points=self.points.take(index),
            weight=self.weight.take(index),
            far=self.far.take(index),
        )


@dataclass(frozen=True)
class HitLighting:
    """Tables that light hits. coefficients: of the rows of ``closures``."""

    scene: Scene
    surface: SurfaceTable
    closures: ClosureTable
    coefficients: MaterialCoefficients
    lighting: Lighting

    def gather(self, wave: PathWave, beyond: BoolArray, samples: PathSamples, film: PathFilm) -> HitClosures:
        """Add the light that leaves the wave's places to the film; return the closures that send light on.

        beyond: (n,) places beyond a limit of bounces, which as in Cycles emit, and let light through, but are
        not lit.
        """
        hits, table = wave.hits, self.closures
        points = self.surface.points(hits.triangle, hits.barycentric, hits.position, hits.tangent)
        sent: list[HitClosures] = []
        for where, row in table.constants_at(points.material):
            here = (points if len(where) == len(beyond) else points.take(where))._replace(material=row)
            weight = table.rows["body"][0].take(row)
            body = _Bodies(where, here, self.coefficients, weight, beyond.take(where))
            self._light(wave, body, samples, film)
            some = np.flatnonzero(table.scatters.take(row))
            normal = here.normal.take(some, axis=1).astype(np.float64)
            sent.append(HitClosures(where.take(some), table.rows.take(row.take(some)), normal))
        made = table.made_at(points.material, lambda which: self._context(wave, points, which))
        if made:
            self._light_made(wave, made, points, beyond, samples, film)
            sent.append(made.scattering())
        return HitClosures.joined(sent)

    def _context(self, wave: PathWave, points: SurfacePoints, which: IndexArray) -> ShadingContext:
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
            rays=wave.take(which).rays,
        )

    def _light_made(
        self,
        wave: PathWave,
        made: HitClosures,
        points: SurfacePoints,
        beyond: BoolArray,
        samples: PathSamples,
        film: PathFilm,
    ) -> None:
        """Add the light of closures that graphs make."""
        # Alpha may cut some away.
        made = made.take(np.flatnonzero(made.rows["body"][0] > 0.0))
        if not len(made.where):
            return
        coefficients = MaterialCoefficients.of(
            bodies(made.rows), self.scene.world_color, per_hit=True, with_unit=self.lighting.sky is not None
        )
        here = points.take(made.where)._replace(
            normal=made.normal.astype(np.float32), material=np.arange(len(made.where))
        )
        weight, far = made.rows["body"][0], beyond.take(made.where)
        self._light(wave, _Bodies(made.where, here, coefficients, weight, far), samples, film)

    def _light(self, wave: PathWave, bodies: _Bodies, samples: PathSamples, film: PathFilm) -> None:
        """Add the light of bodies: all of it, or emission beyond a limit of bounces."""
        shown = bodies.weight > 0.0
        for far in (False, True):
            some = bodies.take(np.flatnonzero(shown & (bodies.far == far)))
            if not len(some.where):
                continue
            parts = film.parts_of_hits(len(some.where))
            share = wave.throughput.take(some.where, axis=1) * some.weight
            if far:
                emission = by_material(some.coefficients.emission, some.points.material)
                color = np.broadcast_to(emission, some.points.normal.shape)
                if parts:
                    parts.rows[EMISSION] = color
            else:
                own = samples.at(wave, some.where)
                weight, spread = share.max(axis=0), wave.spread.take(some.where)
                color = self.lighting.radiance(some.points, some.coefficients, own, parts, weight, spread)
            color = self._clamped(color, some, share, wave.depth[TOTAL].take(some.where), parts)
            film.gather(wave.pixel.take(some.where), share, color, parts, wave.on_ray.take(some.where))

    def _clamped(
        self, color: Single, bodies: _Bodies, share: Array, bounce: Array, parts: LightParts | None
    ) -> Single:
        """Radiance (3, n) that is limited as Cycles limits indirect light; parts: of it.

        share: (3, n) of it that a pixel sees after bounces (n,). What a mirror shows of an emitter is direct.
        """
        limits = self.scene.bounces
        if limits.clamp <= 0.0 or not bounce.any():
            return color
        own = by_material(bodies.coefficients.emission, bodies.points.material)
        emission = np.broadcast_to(own, color.shape)
        lit = color - emission
        lamps, emitters = (
            limits.clamping(share * light, bounce > least).astype(np.float32)
            for light, least in ((lit, 0), (emission, 1))
        )
        if parts:
            parts.rows[:COLORS] *= lamps
            parts.rows[EMISSION] = emission * emitters
        clamped: Single = lit * lamps + emission * emitters
        return clamped
