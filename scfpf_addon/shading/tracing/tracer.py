# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths of light through transparent, mirroring and refracting materials, for scenes with node graphs.

All paths advance together, as a wave of path states. Past a transparent hit a path continues on its
projector; mirrors and glass send it on along straight rays.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...casting.common.hits import Hits
from ...casting.common.ray_visibility import HOLDOUT
from ...casting.continuation import Continuation
from ...projection.typing import Array, BoolArray, IndexArray
from ..lights.lighting import Lighting
from ..lights.shadow_catchers import Catchers
from ..materials.coefficients import MaterialCoefficients
from ..materials.ggx_sampling import MIRROR_ROUGHNESS
from ..nodes.light_path import DEPTH
from ..passes.light_passes import LightParts
from ..sampling.point_samples import PointSamples
from ..scene.shading_scene import Scene
from ..scene.surface import SurfaceTable
from ..typing import Single
from ..vectors import dot, unit
from .closure_table import ClosureTable, HitClosures
from .hit_lighting import HitLighting
from .lobe_sampling import CLEAR, LAYER, METAL, MIRRORED, REFRACTED, LobeSampler, SentLobes
from .path_samples import PathSamples
from .path_wave import GLOSSY, TOTAL, TRANSMISSION, TRANSPARENT, PathFilm, PathWave

# Paths with less throughput than this end: a tenth of a step of 8 bits.
LEAST_SHARE = 1.0 / 2560.0

# What each kind of lobe adds to the rows of ``PathWave.depth``, (4, 5).
DEEPER = np.zeros((4, 5), np.int16)
DEEPER[TRANSPARENT, CLEAR] = 1
DEEPER[TOTAL, [REFRACTED, MIRRORED, METAL, LAYER]] = 1
DEEPER[TRANSMISSION, REFRACTED] = 1
DEEPER[GLOSSY, [MIRRORED, METAL, LAYER]] = 1


class Tally:
    """Counts the surfaces that paths meet, and those whose nodes are evaluated there, by several threads."""

    def __init__(self) -> None:
        self._counts: list[tuple[int, int]] = []

    def add(self, met: int, evaluated: int) -> None:
        """Add the counts of a wave."""
        self._counts.append((met, evaluated))

    @property
    def shaded(self) -> int:
        """The surfaces, twice those whose nodes are evaluated."""
        return sum(map(sum, self._counts))


@dataclass(frozen=True)
class Tracer:
    """Traces the paths of a scene with node graphs.

    transparent: whether paths that leave the scene on their projector make the image transparent.
    catchers: None without shadow catchers. tally: of all paths.
    """

    scene: Scene
    lighting: HitLighting
    sampler: LobeSampler
    transparent: bool
    catchers: Catchers | None = None
    tally: Tally = field(default_factory=Tally)

    @classmethod
    def of(
        cls,
        scene: Scene,
        surface: SurfaceTable,
        closures: ClosureTable,
        coefficients: MaterialCoefficients,
        lighting: Lighting,
        transparent: bool,
        catchers: Catchers | None = None,
    ) -> Tracer | None:
        """The tracer of a frame; None where no material is a graph."""
        if not scene.materials.graphs:
            return None
        hit_lighting = HitLighting(scene, surface, closures, coefficients, lighting)
        return cls(scene, hit_lighting, LobeSampler.of(scene, surface.cast_scene), transparent, catchers)

    def needed(self, triangle: IndexArray) -> bool:
        """Return whether the material of any of the triangles is a graph."""
        return bool(self._has_graph.take(self._material(triangle)).any())

    def color(
        self,
        hits: Hits,
        samples: PointSamples,
        continuation: Continuation,
        parts: LightParts | None = None,
    ) -> Single:
        """Radiance towards the viewer and alpha of n hits, (4, n).

        samples, continuation: of the hits. parts: of n hits, to be filled in.
        """
        film = PathFilm(len(hits.t), parts is not None)
        choices = PathSamples(samples)
        wave = PathWave.first(hits)
        while len(wave.pixel):
            wave = self._hold_out(wave, film)
            if self.catchers:
                wave = self._catch(wave, self.catchers, choices, film, continuation)
            beyond = (wave.depth > self._limits).any(axis=0)
            if beyond.any():
                kept = np.flatnonzero(self._shown_beyond(wave.hits.triangle) | ~beyond)
                wave, beyond = wave.take(kept), beyond.take(kept)
            if not len(wave.pixel):
                break
            kind = self.lighting.closures.kind.take(self._material(wave.hits.triangle))
            self.tally.add(len(kind), int(np.count_nonzero(kind >= 0)))
            closures = self.lighting.gather(wave, beyond, choices, film)
            wave = self._send(wave, closures, beyond, film, continuation, choices)
        if parts and film.parts:
            parts.rows[:] = film.parts.rows
        return film.image()

    @cached_property
    def _has_graph(self) -> BoolArray:
        """Return whether each material is a graph, (M,)."""
        found = np.zeros(len(self.scene.materials.metallic), bool)
        found[list(self.scene.materials.graphs)] = True
        return found

    def _material(self, triangle: IndexArray) -> IndexArray:
        """The materials of triangles (n,)."""
        material: IndexArray = self.lighting.surface.material.take(triangle)
        return material

    def _shown_beyond(self, triangle: IndexArray) -> BoolArray:
        """Return whether triangles (n,) shine or let light through beyond the limits of bounces."""
        return self.lighting.closures.shown_beyond.take(self._material(triangle))

    @property
    def _limits(self) -> Array:
        """Limits of the depth of paths, (4, 1)."""
        limits = self.scene.bounces
        return np.array([[limits.total], [limits.glossy], [limits.transmission], [limits.transparent]])

    def _hold_out(self, wave: PathWave, film: PathFilm) -> PathWave:
        """The paths that no holdout ends; the others make holes in the image."""
        visibility = self.scene.geometry.visibility
        if visibility is None:
            return wave
        held = ((visibility.take(wave.hits.triangle) & HOLDOUT) != 0) & ~wave.on_ray
        film.cut(wave.pixel, wave.weight * held)
        return wave.take(np.flatnonzero(~held))

    def _catch(
        self,
        wave: PathWave,
        catchers: Catchers,
        samples: PathSamples,
        film: PathFilm,
        continuation: Continuation,
    ) -> PathWave:
        """The paths that no shadow catcher ends; the others show the image's own background."""
        caught = catchers.meets(wave.hits.triangle) & ~wave.on_ray
        came = wave.take(np.flatnonzero(caught))
        if not len(came.pixel):
            return wave
        hits = came.hits
        surface = self.lighting.surface
        points = surface.points(hits.triangle, hits.barycentric, hits.position, hits.tangent)
        left = catchers.left(points, samples.at(came, np.arange(len(came.pixel))))
        film.catch(came, catchers.shown(left, continuation, came.pixel), left)
        return wave.take(np.flatnonzero(~caught))

    def _send(
        self,
        wave: PathWave,
        closures: HitClosures,
        beyond: BoolArray,
        film: PathFilm,
        continuation: Continuation,
        samples: PathSamples,
    ) -> PathWave:
        """Send paths along the lobes of closures; return those that hit, and add the others to the film."""
        lobes = self._lobes(wave, closures)
        place = closures.where.take(lobes.closure)
        throughput = wave.throughput.take(place, axis=1) * lobes.tint
        depth = wave.depth.take(place, axis=1) + DEEPER.take(lobes.kind, axis=1)
        # One step beyond a limit is followed: it may see the world or a light.
        within = (depth <= self._limits + 1).all(axis=0) & ((lobes.kind == CLEAR) | ~beyond.take(place))
        going = np.flatnonzero((throughput.max(axis=0) >= LEAST_SHARE) & within)
        lobes, came = lobes.take(going), wave.take(place.take(going))
        throughput, depth = throughput.take(going, axis=1), depth.take(going, axis=1)
        on_ray = came.on_ray | (lobes.kind != CLEAR)
        on, off = np.flatnonzero(~on_ray), np.flatnonzero(on_ray)
        parts: list[PathWave] = []
        if len(on):
            some = came.take(on)
            hits = continuation.next_hits(some.pixel, some.hits.t, some.hits.triangle)
            parts.append(some._replace(hits=hits, throughput=throughput.take(on, 1), depth=depth.take(on, 1)))
            lobes, came = lobes.take(off), came.take(off)
            throughput, depth = throughput.take(off, axis=1), depth.take(off, axis=1)
        if len(off):
            parts.append(self._scatter(lobes, closures, came, throughput, depth, samples))
        sent = PathWave.joined(parts) if parts else came
        missed = sent.hits.triangle < 0
        self._miss(sent.take(np.flatnonzero(missed & sent.throughput.any(axis=0))), film)
        return sent.take(np.flatnonzero(~missed))

    def _scatter(
        self,
        lobes: SentLobes,
        closures: HitClosures,
        came: PathWave,
        throughput: Array,
        depth: NDArray[np.int16],
        samples: PathSamples,
    ) -> PathWave:
        """Send paths (n,) along straight rays; those of them that carry light.

        came: their last states. throughput: (3, n), but for directions and chance. depth: (4, n) after it.
        """
        sending = closures.take(lobes.closure)
        rays = self.sampler.directions(lobes, sending, came, samples)
        direction, throughput = rays.direction, throughput * rays.share
        growth = samples.survival(came, lobes.kind, throughput * np.maximum(rays.awaited, 1.0))
        throughput *= growth
        # What survives stands for what does not.
        spread = came.spread + rays.spread * growth
        is_clear, roughness = lobes.kind == CLEAR, sending.rows["roughness"][0]
        is_sharp = (roughness < MIRROR_ROUGHNESS) | (lobes.kind == REFRACTED) | (lobes.kind == MIRRORED)
        from_glass = np.where(is_clear, came.from_glass, lobes.kind == REFRACTED)
        singular = np.where(is_clear, came.singular, is_sharp)
        left = np.flatnonzero(throughput.any(axis=0))
        if len(left) < len(came.pixel):
            came, direction, from_glass = came.take(left), direction.take(left, 1), from_glass.take(left)
            throughput, depth, singular = throughput.take(left, 1), depth.take(left, 1), singular.take(left)
            spread = spread.take(left)
        ends = (depth > self._limits).any(axis=0)
        hits, dark = self.sampler.cast(came, direction, from_glass, ends, self._shown_beyond)
        throughput[:, dark] = 0.0
        on_ray = np.ones(len(left), bool)
        return PathWave(hits, came.pixel, throughput, on_ray, from_glass, singular, spread, depth)

    def _lobes(self, wave: PathWave, closures: HitClosures) -> SentLobes:
        """The lobes of closures at the wave's places."""
        view = -unit(wave.hits.tangent.take(closures.where, axis=1))
        flat = self.lighting.surface.flat.take(wave.hits.triangle.take(closures.where), axis=1)
        facing = np.clip(dot(closures.normal, view), 0.0, 1.0)
        return SentLobes.of(closures.rows, facing, dot(flat.astype(np.float64), view) < 0.0)

    def _miss(self, wave: PathWave, film: PathFilm) -> None:
        """Add the world's light to paths that leave the scene."""
        clear = ~wave.on_ray if self.transparent else np.zeros(len(wave.pixel), bool)
        light = self._world(wave) * (wave.on_ray | self.scene.world_seen)
        light *= self.scene.bounces.clamping(wave.throughput * light, wave.depth[TOTAL] > 1)
        film.miss(wave, light, clear)

    def _world(self, wave: PathWave) -> Array:
        """Radiance of the world along paths that leave the scene, (3, n) or (3, 1)."""
        world = self.scene.world
        if world is None:
            return np.reshape(self.scene.world_color, (3, 1))
        rays = wave.rays
        # The world is one step further than the last surface.
        rays[DEPTH] += 1.0
        light = world.radiance(wave.hits.tangent, rays)
        mirrored = np.flatnonzero(wave.depth[GLOSSY] > 0)
        if len(mirrored):
            light[:, mirrored] = world.light.without_lamps(
                unit(wave.hits.tangent[:, mirrored]), light[:, mirrored]
            )
        return light
