# SPDX-License-Identifier: GPL-3.0-or-later
"""Light through, off and into things: materials of nodes, and what lies behind and before them.

A wave is a set of places where light is gathered, each with its share of a pixel. What a place
sends on makes the next wave: projectors go on behind what is transparent; mirrors and glass send
straight rays, since the volume's distortion is not the scene's (paper §6.1).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...casting.common.cancellation import raise_if_cancelled
from ...casting.common.hits import Hits
from ...casting.common.ray_visibility import GLASS, HOLDOUT, MIRROR, visible_to
from ...casting.continuation import Behind, WaysOut, cast_rays
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, BoolArray, IndexArray
from ..lights.light_table import LightTable
from ..lights.lighting import Lamp, radiance
from ..lights.shadow_catchers import Catchers
from ..materials.lobes import Body, Sent, SentKind, lobes
from ..materials.reflection import EVEN, MIRROR_ROUGHNESS, reflected, sent_on_at_once
from ..nodes.context import ShadingContext, dot, unit
from ..passes.light_passes import LightParts
from ..sampling.samples import Bits, scramble
from ..scene.shading_scene import Materials, Scene
from ..scene.surface import SurfacePoints, SurfaceTable
from ..typing import Single

# What gets a smaller share of a pixel than this is not followed: a tenth of a step of 8 bits.
LEAST_SHARE = 1.0 / 2560.0

# Hits of which a material is reckoned at once: a large graph keeps a hundred arrays of them.
MOST_AT_ONCE = 1 << 14

# What scrambles the places at which rough reflections begin.
GLOSS = 6

# Rows of ``Wave.depth``.
TOTAL, GLOSSY, TRANSMISSION, TRANSPARENT = range(4)


class Wave(NamedTuple):
    """n places. hits: of them, tangents point where light is looked for. pixel: (n,) whose they are.

    share: (3, n) of the light that leaves them. straight: (n,) whether they are on a ray, not on a
    projector, glass: (n,) whether glass has sent them last. depth: (4, n) how often light was sent on till
    here.
    """

    hits: Hits
    pixel: IndexArray
    share: Array
    straight: BoolArray
    glass: BoolArray
    depth: NDArray[np.int16]

    def take(self, index: IndexArray) -> Wave:
        """The places at ``index``."""
        return Wave(
            self.hits.take(index),
            self.pixel[index],
            self.share[:, index],
            self.straight[index],
            self.glass[index],
            self.depth[:, index],
        )


class Chances(NamedTuple):
    """Where rough reflections of a sample look, by pixel: pixel (n,) of the image."""

    pixel: Bits
    sample: int

    def of(self, which: IndexArray, depth: IndexArray) -> Array:
        """(2, m) in [0, 1) for pixels by place in the list, where light was sent on ``depth`` times before.

        A pixel's samples fill the square evenly, those of each depth and pixel from another place on.
        """
        own = scramble(self.pixel[which] ^ scramble(depth.astype(np.uint32), GLOSS), GLOSS)
        start = np.stack([own & np.uint32(0xFFFF), own >> np.uint32(16)]) / 65536.0
        step = np.where(depth == 0, EVEN[:, None], EVEN[::-1, None])
        chance: Array = (start + self.sample * step) % 1.0
        return chance


def joined(waves: Sequence[Wave]) -> Wave:
    """One wave of several."""
    hits = Hits(*(np.concatenate(each, axis=-1) for each in zip(*(w.hits for w in waves), strict=True)))
    return Wave(hits, *(np.concatenate(each, axis=-1) for each in zip(*(w[1:] for w in waves), strict=True)))


@dataclass(frozen=True)
class Tracer:
    """What colours hits where some materials are graphs.

    has_graph: (M,) by material. transparent: what hits nothing is see-through. mirrors, glass: what
    mirrors and glass show, None for nothing at all. catchers: of what projectors see but shadows.
    """

    scene: Scene
    surface: SurfaceTable
    coefficients: LightTable
    lamps: tuple[Lamp, ...]
    has_graph: BoolArray
    transparent: bool
    mirrors: CastScene | None
    glass: CastScene | None
    catchers: Catchers | None = None

    @classmethod
    def of(
        cls,
        scene: Scene,
        surface: SurfaceTable,
        coefficients: LightTable,
        lamps: tuple[Lamp, ...],
        transparent: bool,
        catchers: Catchers | None = None,
    ) -> Tracer | None:
        """None where no material needs it."""
        graphs = scene.materials.graphs
        if not graphs:
            return None
        has_graph = np.zeros(len(scene.materials.metallic), bool)
        has_graph[list(graphs)] = True
        mirrors, glass = (
            surface.cast_scene.only(visible_to(scene.geometry.visibility, ray)) for ray in (MIRROR, GLASS)
        )
        return cls(scene, surface, coefficients, lamps, has_graph, transparent, mirrors, glass, catchers)

    def needed(self, triangle: IndexArray) -> bool:
        """Whether any of the triangles has a material of nodes."""
        return bool(self.has_graph.take(self.surface.material.take(triangle)).any())

    def color(
        self,
        hits: Hits,
        sample: int,
        pixel: IndexArray,
        behind: Behind,
        ways_out: WaysOut,
        parts: LightParts | None = None,
    ) -> Single:
        """Radiance towards the viewer and alpha of n hits, (4, n).

        pixel: (n,) of the image. behind, ways_out: of the hits by their place in the list. parts: gets what
        the colours are the sum of.
        """
        count = len(hits.t)
        film = np.zeros((4, count))
        film[3] = 1.0
        chances = Chances(pixel.astype(np.uint32), sample)
        # Many small shares are summed.
        split = LightParts(count, np.float64) if parts else None
        wave = Wave(
            hits,
            np.arange(count),
            np.ones((3, count)),
            np.zeros(count, bool),
            np.zeros(count, bool),
            np.zeros((4, count), np.int16),
        )
        while len(wave.pixel):
            wave = self._hold_out(wave, film)
            if self.catchers:
                wave = self._catch(wave, self.catchers, sample, film, ways_out, split)
            sent = []
            for some, last in self._by_limit(wave):
                continuation = self._gather(some, sample, film, split, last)
                sent += [self._send(some, each, film, behind, chances, split) for each in continuation]
            if not sent:
                break
            wave = joined(sent)
        if parts and split:
            parts.rows[:] = split.rows
        return film.astype(np.float32)

    @property
    def _limits(self) -> Array:
        """How often light may be sent on, (4, 1)."""
        limits = self.scene.bounces
        return np.array([[limits.total], [limits.glossy], [limits.transmission], [limits.transparent]])

    def _by_limit(self, wave: Wave) -> Iterator[tuple[Wave, bool]]:
        """The wave in parts, and whether they are beyond a limit: as in Cycles, what is there only shines."""
        last = (wave.depth > self._limits).any(axis=0)
        if not last.any():
            yield wave, False
            return
        yield wave.take(np.flatnonzero(~last)), False
        yield wave.take(np.flatnonzero(last)), True

    @cached_property
    def _shining(self) -> LightTable:
        """What materials make of no light."""
        return LightTable.of(self.scene.materials, np.zeros(3))

    def _hold_out(self, wave: Wave, film: Array) -> Wave:
        """The wave without what projectors meet of holdouts: there the picture has a hole."""
        visibility = self.scene.geometry.visibility
        if visibility is None:
            return wave
        held = ((visibility.take(wave.hits.triangle) & HOLDOUT) != 0) & ~wave.straight
        film[3] -= np.bincount(wave.pixel, wave.share.mean(axis=0) * held, film.shape[1])
        return wave.take(np.flatnonzero(~held))

    def _catch(
        self,
        wave: Wave,
        catchers: Catchers,
        sample: int,
        film: Array,
        ways_out: WaysOut,
        split: LightParts | None,
    ) -> Wave:
        """The wave without what projectors meet of shadow catchers: there is the picture's own background."""
        caught = catchers.meets(wave.hits.triangle) & ~wave.straight
        came = wave.take(np.flatnonzero(caught))
        if not len(came.pixel):
            return wave
        hits = came.hits
        points = self.surface.points(hits.triangle, hits.barycentric, hits.position, hits.tangent)
        left = catchers.left(points, sample)
        shown = catchers.picture(left, ways_out(came.pixel) if catchers.looks_on else None)
        add(film, came.pixel, came.share * shown[:3])
        film[3] -= np.bincount(came.pixel, came.share.mean(axis=0) * (1.0 - shown[3]), film.shape[1])
        if split:
            split.catch(came.pixel, came.share, shown, left)
        return wave.take(np.flatnonzero(~caught))

    def _gather(
        self, wave: Wave, sample: int, film: Array, split: LightParts | None, last: bool
    ) -> list[tuple[IndexArray, Sent]]:
        """Add the light of the wave's places to the film; what they send on, and which do.

        last: they only shine, and let through what is behind them.
        """
        hits = wave.hits
        points = self.surface.points(hits.triangle, hits.barycentric, hits.position, hits.tangent)
        plain = np.flatnonzero(~self.has_graph.take(points.material))
        cast_scene = self.surface.cast_scene
        if len(plain):
            parts = LightParts(len(plain)) if split else None
            table, lamps = (self._shining, ()) if last else (self.coefficients, self.lamps)
            color = radiance(points.take(plain), table, lamps, sample, cast_scene, parts)
            add(film, wave.pixel[plain], wave.share[:, plain] * color)
            if split and parts:
                split.gather(wave.pixel[plain], wave.share[:, plain], parts, wave.straight[plain])
        bodies: list[tuple[IndexArray, Body]] = []
        continuation: list[tuple[IndexArray, Sent]] = []
        for number in np.unique(points.material):
            if not self.has_graph[number]:
                continue
            everywhere = np.flatnonzero(points.material == number)
            for first in range(0, len(everywhere), MOST_AT_ONCE):
                raise_if_cancelled()
                which = everywhere[first : first + MOST_AT_ONCE]
                place = self.place(hits, points, which)
                for lobe in lobes(self.scene.materials.graphs[int(number)], place):
                    if isinstance(lobe, Body):
                        bodies.append((which, lobe))
                    elif lobe.kind == "THROUGH" or not last:
                        continuation.append((which, lobe))
        if bodies:
            self._light(wave, points, bodies, sample, film, split, last)
        return continuation

    def place(self, hits: Hits, points: SurfacePoints, which: IndexArray) -> ShadingContext:
        """Where the hits ``which`` are, as nodes ask for it."""
        cast_scene = self.surface.cast_scene
        triangle = hits.triangle.take(which).astype(np.intp)
        tangent, position = hits.tangent.take(which, 1), hits.position.take(which, 1)
        view = -unit(tangent)
        flat = self.surface.flat.take(triangle, 1).astype(np.float64)
        back = (dot(flat, view) < 0.0).astype(np.float64)
        return ShadingContext(
            self.scene.geometry,
            self.scene.images,
            triangle,
            cast_scene.barycentric(position, triangle),
            position / cast_scene.scale + np.reshape(cast_scene.centre, (3, 1)),
            points.normal.take(which, 1).astype(np.float64),
            flat * (1.0 - 2.0 * back),
            view,
            back,
        )

    def _light(
        self,
        wave: Wave,
        points: SurfacePoints,
        bodies: list[tuple[IndexArray, Body]],
        sample: int,
        film: Array,
        split: LightParts | None,
        last: bool,
    ) -> None:
        """Add what lamps and the world make of the bodies, all at once; last: what they shine alone."""
        which = np.concatenate([index for index, _ in bodies])
        weight = np.concatenate([body.weight[0] for _, body in bodies])
        some = np.flatnonzero(weight > 0.0)
        if not len(some):
            # Alpha cuts all of them away.
            return
        which, weight = which[some], weight[some]
        normal = np.concatenate([body.normal for _, body in bodies], axis=1)[:, some].astype(np.float32)
        materials = _stacked([body.materials for _, body in bodies], some)
        world = (np.zeros(3), None) if last else (self.scene.world_color, self.coefficients.sky)
        table = LightTable.of(materials, *world, per_hit=True)
        lit = points.take(which)._replace(normal=normal, material=np.arange(len(some)))
        parts = LightParts(len(some)) if split else None
        lamps = () if last else self.lamps
        color = radiance(lit, table, lamps, sample, self.surface.cast_scene, parts)
        share = wave.share[:, which] * weight
        add(film, wave.pixel[which], share * color)
        if split and parts:
            split.gather(wave.pixel[which], share, parts, wave.straight[which])

    def _send(
        self,
        wave: Wave,
        continuation: tuple[IndexArray, Sent],
        film: Array,
        behind: Behind,
        chances: Chances,
        split: LightParts | None,
    ) -> Wave:
        """What is met by what a lobe sends on; what meets nothing is added to the film."""
        which, lobe = continuation
        share = wave.share[:, which] * lobe.tint
        depth = wave.depth[:, which].copy()
        for row in DEPTHS[lobe.kind]:
            depth[row] += 1
        # Once beyond a limit, to see the world and what shines.
        within = (depth <= self._limits + 1).all(axis=0)
        going = np.flatnonzero((share.max(axis=0) >= LEAST_SHARE) & within)
        came = wave.take(which[going])
        lobe = lobe.take(going)
        straight = came.straight | (lobe.kind != "THROUGH")
        hits = Hits.empty(len(going))
        on = np.flatnonzero(~straight)
        if len(on):
            hits.put(on, behind(came.pixel[on], came.hits.t[on], came.hits.triangle[on]))
        off = np.flatnonzero(straight)
        if len(off):
            direction, passed = self._directions(came.take(off), lobe.take(off), chances)
            hits.put(off, self._rays(came.take(off), lobe.kind, direction))
            share[:, going[off]] *= passed
        glass = (came.glass & (lobe.kind != "MIRROR")) | (lobe.kind == "REFRACTED")
        sent = Wave(hits, came.pixel, share[:, going], straight, glass, depth[:, going])
        self._miss(sent.take(np.flatnonzero(hits.triangle < 0)), film, split)
        return sent.take(np.flatnonzero(hits.triangle >= 0))

    def _directions(self, came: Wave, lobe: Sent, chances: Chances) -> tuple[Array, Array]:
        """Where a lobe's light is looked for from places, (3, n), and the share of it that counts, (3, n)."""
        ahead = unit(came.hits.tangent)
        flat = self.surface.cast_scene.normals(came.hits.triangle)
        flat = flat * -np.copysign(1.0, dot(flat, ahead))
        if lobe.kind == "THROUGH":
            return ahead, np.ones_like(ahead)
        if lobe.kind == "REFRACTED":
            return refracted(ahead, lobe.normal, flat, lobe.ior), np.ones_like(ahead)
        direction = mirrored(ahead, lobe.normal, flat)
        if lobe.gloss is None:
            return direction, np.ones_like(ahead)
        cosine = np.clip(-dot(ahead, lobe.normal), 0.0, 1.0)[0]
        passed = np.ones_like(cosine)
        rough = np.flatnonzero(lobe.gloss.roughness[0] >= MIRROR_ROUGHNESS)
        once = np.ones_like(cosine)
        if len(rough):
            roughness = lobe.gloss.roughness[0, rough]
            once[rough] = sent_on_at_once(cosine[rough], roughness)
            share = chances.of(came.pixel[rough], came.depth[TOTAL, rough])
            direction[:, rough], passed[rough], cosine[rough] = reflected(
                ahead[:, rough], lobe.normal[:, rough], flat[:, rough], roughness, share
            )
        tint = lobe.gloss.reflectance(cosine)
        return direction, tint * passed * (1.0 + lobe.gloss.again * (1.0 - once) / once)

    def _rays(self, came: Wave, kind: SentKind, direction: Array) -> Hits:
        """What straight rays from places meet."""
        cast_scene = self.surface.cast_scene
        origin = cast_scene.offset_origins(came.hits.position, came.hits.triangle, direction)
        if self.mirrors is self.glass is cast_scene:
            return cast_rays(cast_scene, origin, direction)
        glass = came.glass if kind == "THROUGH" else np.full(len(came.pixel), kind == "REFRACTED")
        # Where nothing is met a ray goes on as cast_rays leaves it, to its end.
        met = Hits.empty(len(glass))._replace(position=origin + direction, tangent=direction.copy())
        for scene, which in ((self.mirrors, ~glass), (self.glass, glass)):
            some = np.flatnonzero(which)
            if scene and len(some):
                met.put(some, cast_rays(scene, origin[:, some], direction[:, some]))
        return met

    def _miss(self, wave: Wave, film: Array, split: LightParts | None) -> None:
        """Add what is seen where nothing is: the world, or through the film what lies behind the picture."""
        through = ~wave.straight if self.transparent else np.zeros(len(wave.pixel), bool)
        world = self._world(wave) * (wave.straight | self.scene.world_seen)
        add(film, wave.pixel, wave.share * world * ~through)
        if split:
            split.miss(wave.pixel, wave.share * world, wave.straight)
        film[3] -= np.bincount(wave.pixel, wave.share.mean(axis=0) * through, film.shape[1])

    def _world(self, wave: Wave) -> Array:
        """What places that are nowhere show of the world, (3, n) or (3, 1)."""
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


DEPTHS = {
    "THROUGH": (TRANSPARENT,),
    "MIRROR": (TOTAL, GLOSSY),
    "REFRACTED": (TOTAL, TRANSMISSION),
}


def add(film: Array, pixel: IndexArray, color: Array) -> None:
    """Add colours (3, n) to the pixels (n,), some of which may come more than once."""
    for channel, values in zip(film, color, strict=False):
        channel += np.bincount(pixel, values, film.shape[1])


def mirrored(ahead: Array, normal: Array, flat: Array) -> Array:
    """Directions (3, n) off a mirror: by the shading normal, or the triangle's where that leads inside."""
    direction = ahead - 2.0 * dot(ahead, normal) * normal
    inside = dot(direction, flat) <= 0.0
    return np.where(inside, ahead - 2.0 * dot(ahead, flat) * flat, direction)


def refracted(ahead: Array, normal: Array, flat: Array, ior: Array) -> Array:
    """Directions (3, n) behind a boundary (Snell); straight on where there is none."""
    cosine = -dot(ahead, normal)
    under = 1.0 - (1.0 - cosine**2) / ior**2
    direction = unit(ahead / ior + (cosine / ior - np.sqrt(np.maximum(under, 0.0))) * normal)
    return np.where((under > 0.0) & (dot(direction, flat) < 0.0), direction, ahead)


def _stacked(parts: list[Materials], some: IndexArray) -> Materials:
    """The rows ``some`` of several lists of materials."""

    def rows(name: str) -> Array:
        """One of their constants, of all lists, for ``some``."""
        return np.concatenate([getattr(part, name) for part in parts])[some]

    return Materials(
        base_color=rows("base_color"),
        metallic=rows("metallic"),
        roughness=rows("roughness"),
        specular_f0=rows("specular_f0"),
        emission=rows("emission"),
        ambient=rows("ambient"),
        layer=rows("layer"),
        over=rows("over"),
        edge=rows("edge"),
        multiple=rows("multiple"),
    )
