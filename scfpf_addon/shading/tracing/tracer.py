# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of light through transparent, mirroring and refracting materials, for scenes with node graphs.

All paths advance together, as a wave of path states. Past a transparent hit a path continues on its
projector; mirrors and glass send it on along straight rays.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...casting.common.hits import Hits
from ...casting.common.ray_visibility import HOLDOUT
from ...casting.continuation import Continuation
from ...projection.typing import Array, IndexArray
from ..lights.lighting import Lighting
from ..lights.shadow_catchers import Catchers
from ..materials.coefficients import MaterialCoefficients
from ..materials.lobes import ScatteredLobe
from ..passes.light_passes import LightParts
from ..scene.shading_scene import Scene
from ..scene.surface import SurfaceTable
from ..typing import Single
from ..vectors import unit
from .hit_lighting import HitLighting
from .lobe_sampling import LobeSampler, ReflectionSamples
from .path_wave import GLOSSY, TOTAL, TRANSMISSION, TRANSPARENT, PathFilm, PathWave

# Paths with less throughput than this end: a tenth of a step of 8 bits.
LEAST_SHARE = 1.0 / 2560.0

# The rows of ``PathWave.depth`` in which each kind of lobe counts.
DEPTHS = {
    "TRANSPARENT": (TRANSPARENT,),
    "GLOSSY": (TOTAL, GLOSSY),
    "TRANSMISSION": (TOTAL, TRANSMISSION),
}


@dataclass(frozen=True)
class Tracer:
    """Traces the paths of a scene with node graphs.

    transparent: whether paths that leave the scene on their projector make the image transparent.
    catchers: None without shadow catchers.
    """

    scene: Scene
    lighting: HitLighting
    sampler: LobeSampler
    transparent: bool
    catchers: Catchers | None = None

    @classmethod
    def of(
        cls,
        scene: Scene,
        surface: SurfaceTable,
        coefficients: MaterialCoefficients,
        lighting: Lighting,
        transparent: bool,
        catchers: Catchers | None = None,
    ) -> Tracer | None:
        """The tracer of a frame; None where no material is a graph."""
        graphs = scene.materials.graphs
        if not graphs:
            return None
        has_graph = np.zeros(len(scene.materials.metallic), bool)
        has_graph[list(graphs)] = True
        hit_lighting = HitLighting(scene, surface, coefficients, lighting, has_graph)
        return cls(scene, hit_lighting, LobeSampler.of(scene, surface.cast_scene), transparent, catchers)

    def needed(self, triangle: IndexArray) -> bool:
        """Whether the material of any of the triangles is a graph."""
        material = self.lighting.surface.material.take(triangle)
        return bool(self.lighting.has_graph.take(material).any())

    def color(
        self,
        hits: Hits,
        sample: int,
        continuation: Continuation,
        parts: LightParts | None = None,
    ) -> Single:
        """Radiance towards the viewer and alpha of n hits, (4, n).

        continuation: of their projectors. parts: of n hits, to be filled in.
        """
        film = PathFilm(len(hits.t), parts is not None)
        samples = ReflectionSamples(continuation.pixel.astype(np.uint32), sample)
        wave = PathWave.first(hits)
        while len(wave.pixel):
            wave = self._hold_out(wave, film)
            if self.catchers:
                wave = self._catch(wave, self.catchers, sample, film, continuation)
            sent = []
            for some, last in self._by_limit(wave):
                for which, lobe in self.lighting.gather(some, sample, film, last):
                    sent.append(self._send(some, which, lobe, film, continuation, samples))
            if not sent:
                break
            wave = PathWave.joined(sent)
        if parts and film.parts:
            parts.rows[:] = film.parts.rows
        return film.image()

    @property
    def _limits(self) -> Array:
        """Limits of the depth of paths, (4, 1)."""
        limits = self.scene.bounces
        return np.array([[limits.total], [limits.glossy], [limits.transmission], [limits.transparent]])

    def _by_limit(self, wave: PathWave) -> Iterator[tuple[PathWave, bool]]:
        """The paths within all limits, then those beyond one with True, which as in Cycles see emission."""
        last = (wave.depth > self._limits).any(axis=0)
        if not last.any():
            yield wave, False
            return
        yield wave.take(np.flatnonzero(~last)), False
        yield wave.take(np.flatnonzero(last)), True

    def _hold_out(self, wave: PathWave, film: PathFilm) -> PathWave:
        """The paths that no holdout ends; the others make holes in the image."""
        visibility = self.scene.geometry.visibility
        if visibility is None:
            return wave
        held = ((visibility.take(wave.hits.triangle) & HOLDOUT) != 0) & ~wave.on_ray
        film.cut(wave.pixel, wave.weight * held)
        return wave.take(np.flatnonzero(~held))

    def _catch(
        self, wave: PathWave, catchers: Catchers, sample: int, film: PathFilm, continuation: Continuation
    ) -> PathWave:
        """The paths that no shadow catcher ends; the others show the image's own background."""
        caught = catchers.meets(wave.hits.triangle) & ~wave.on_ray
        came = wave.take(np.flatnonzero(caught))
        if not len(came.pixel):
            return wave
        hits = came.hits
        surface = self.lighting.surface
        points = surface.points(hits.triangle, hits.barycentric, hits.position, hits.tangent)
        left = catchers.left(points, sample)
        film.catch(came, catchers.shown(left, continuation, came.pixel), left)
        return wave.take(np.flatnonzero(~caught))

    def _send(
        self,
        wave: PathWave,
        which: IndexArray,
        lobe: ScatteredLobe,
        film: PathFilm,
        continuation: Continuation,
        samples: ReflectionSamples,
    ) -> PathWave:
        """Send the paths ``which`` along a lobe; return those that hit, and add the others to the film."""
        throughput = wave.throughput[:, which] * lobe.tint
        depth = wave.depth[:, which].copy()
        for row in DEPTHS[lobe.kind]:
            depth[row] += 1
        # One step beyond a limit is followed: it may see the world or a light.
        within = (depth <= self._limits + 1).all(axis=0)
        going = np.flatnonzero((throughput.max(axis=0) >= LEAST_SHARE) & within)
        came, lobe, throughput = wave.take(which[going]), lobe.take(going), throughput[:, going]
        on_ray = came.on_ray | (lobe.kind != "TRANSPARENT")
        hits = Hits.empty(len(going))
        on = np.flatnonzero(~on_ray)
        if len(on):
            hits.put(on, continuation.next_hits(came.pixel[on], came.hits.t[on], came.hits.triangle[on]))
        off = np.flatnonzero(on_ray)
        if len(off):
            met, passed = self.sampler.scatter(came.take(off), lobe.take(off), samples)
            hits.put(off, met)
            throughput[:, off] *= passed
        from_glass = (came.from_glass & (lobe.kind != "GLOSSY")) | (lobe.kind == "TRANSMISSION")
        sent = PathWave(
            hits,
            pixel=came.pixel,
            throughput=throughput,
            on_ray=on_ray,
            from_glass=from_glass,
            depth=depth[:, going],
        )
        self._miss(sent.take(np.flatnonzero(hits.triangle < 0)), film)
        return sent.take(np.flatnonzero(hits.triangle >= 0))

    def _miss(self, wave: PathWave, film: PathFilm) -> None:
        """Add the world's light to paths that leave the scene."""
        clear = ~wave.on_ray if self.transparent else np.zeros(len(wave.pixel), bool)
        film.miss(wave, self._world(wave) * (wave.on_ray | self.scene.world_seen), clear)

    def _world(self, wave: PathWave) -> Array:
        """Radiance of the world along paths that leave the scene, (3, n) or (3, 1)."""
        world = self.scene.world
        if world is None:
            return np.reshape(self.scene.world_color, (3, 1))
        light = world.radiance(wave.hits.tangent)
        mirrored = np.flatnonzero(wave.depth[GLOSSY] > 0)
        if len(mirrored):
            light[:, mirrored] = world.light.without_lamps(
                unit(wave.hits.tangent[:, mirrored]), light[:, mirrored]
            )
        return light
