# SPDX-License-Identifier: GPL-3.0-or-later
"""Light through, off and into things: materials of nodes, and what lies behind and before them.

A wave is a set of places where light is gathered, each with its share of a pixel. What a place
sends on makes the next wave: projectors go on behind what is transparent; mirrors and glass send
straight rays, since the volume's distortion is not the scene's (paper §6.1).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..casting.behind import Behind, cast_rays
from ..casting.hits import Hits
from ..casting.scene import CastScene
from ..casting.stopping import stop_here
from ..casting.visibility import GLASS, HOLDOUT, MIRROR, visible_to
from ..projection.typing import Array, BoolArray, IndexArray
from .light_passes import LightParts
from .lighting import Lamp, radiance
from .materials.lobes import Body, Sent, lobes
from .materials.place import Place, dot, unit
from .scene import Materials, Scene
from .surface import PhongTable, SurfacePoints, SurfaceTable
from .typing import Single

# What gets a smaller share of a pixel than this is not followed: a tenth of a step of 8 bits.
LEAST_SHARE = 1.0 / 2560.0

# Hits of which a material is reckoned at once: a large graph keeps a hundred arrays of them.
MOST_AT_ONCE = 1 << 14

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


def joined(waves: Sequence[Wave]) -> Wave:
    """One wave of several."""
    hits = Hits(*(np.concatenate(each, axis=-1) for each in zip(*(w.hits for w in waves), strict=True)))
    return Wave(hits, *(np.concatenate(each, axis=-1) for each in zip(*(w[1:] for w in waves), strict=True)))


@dataclass(frozen=True)
class Tracer:
    """What colours hits where some materials are graphs.

    has_graph: (M,) by material. transparent: what hits nothing is see-through. mirrors, glass: what
    mirrors and glass show, None for nothing at all.
    """

    scene: Scene
    surface: SurfaceTable
    phong: PhongTable
    lamps: tuple[Lamp, ...]
    has_graph: BoolArray
    transparent: bool
    mirrors: CastScene | None
    glass: CastScene | None

    @classmethod
    def of(
        cls,
        scene: Scene,
        surface: SurfaceTable,
        phong: PhongTable,
        lamps: tuple[Lamp, ...],
        transparent: bool,
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
        return cls(scene, surface, phong, lamps, has_graph, transparent, mirrors, glass)

    def needed(self, triangle: IndexArray) -> bool:
        """Whether any of the triangles has a material of nodes."""
        return bool(self.has_graph.take(self.surface.material.take(triangle)).any())

    def color(self, hits: Hits, sample: int, behind: Behind, parts: LightParts | None = None) -> Single:
        """Radiance towards the viewer and alpha of n hits, (4, n).

        behind: of the hits by their place in the list. parts: gets what the colours are the sum of.
        """
        count = len(hits.t)
        film = np.zeros((4, count))
        film[3] = 1.0
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
            onward = self._gather(wave, sample, film, split)
            sent = [self._send(wave, each, film, behind, split) for each in onward]
            if not sent:
                break
            wave = joined(sent)
        if parts and split:
            parts.rows[:] = split.rows
        return film.astype(np.float32)

    def _hold_out(self, wave: Wave, film: Array) -> Wave:
        """The wave without what projectors meet of holdouts: there the picture has a hole."""
        visibility = self.scene.geometry.visibility
        if visibility is None:
            return wave
        held = ((visibility.take(wave.hits.triangle) & HOLDOUT) != 0) & ~wave.straight
        film[3] -= np.bincount(wave.pixel, wave.share.mean(axis=0) * held, film.shape[1])
        return wave.take(np.flatnonzero(~held))

    def _gather(
        self, wave: Wave, sample: int, film: Array, split: LightParts | None
    ) -> list[tuple[IndexArray, Sent]]:
        """Add the light of the wave's places to the film; what they send on, and which do."""
        hits = wave.hits
        points = self.surface.points(hits.triangle, hits.barycentric, hits.position, hits.tangent)
        plain = np.flatnonzero(~self.has_graph.take(points.material))
        cast_scene = self.surface.cast_scene
        if len(plain):
            parts = LightParts(len(plain)) if split else None
            color = radiance(points.take(plain), self.phong, self.lamps, sample, cast_scene, parts)
            add(film, wave.pixel[plain], wave.share[:, plain] * color)
            if split and parts:
                split.gather(wave.pixel[plain], wave.share[:, plain], parts, wave.straight[plain])
        bodies: list[tuple[IndexArray, Body]] = []
        onward: list[tuple[IndexArray, Sent]] = []
        for number in np.unique(points.material):
            if not self.has_graph[number]:
                continue
            everywhere = np.flatnonzero(points.material == number)
            for first in range(0, len(everywhere), MOST_AT_ONCE):
                stop_here()
                which = everywhere[first : first + MOST_AT_ONCE]
                place = self.place(hits, points, which)
                for lobe in lobes(self.scene.materials.graphs[int(number)], place):
                    if isinstance(lobe, Body):
                        bodies.append((which, lobe))
                    else:
                        onward.append((which, lobe))
        if bodies:
            self._light(wave, points, bodies, sample, film, split)
        return onward

    def place(self, hits: Hits, points: SurfacePoints, which: IndexArray) -> Place:
        """Where the hits ``which`` are, as nodes ask for it."""
        cast_scene = self.surface.cast_scene
        triangle = hits.triangle.take(which).astype(np.intp)
        tangent, position = hits.tangent.take(which, 1), hits.position.take(which, 1)
        view = -unit(tangent)
        flat = self.surface.flat.take(triangle, 1).astype(np.float64)
        back = (dot(flat, view) < 0.0).astype(np.float64)
        return Place(
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
    ) -> None:
        """Add what lamps and the world make of the bodies, all at once."""
        which = np.concatenate([index for index, _ in bodies])
        weight = np.concatenate([body.weight[0] for _, body in bodies])
        some = np.flatnonzero(weight > 0.0)
        which, weight = which[some], weight[some]
        normal = np.concatenate([body.normal for _, body in bodies], axis=1)[:, some].astype(np.float32)
        table = PhongTable.of(_stacked([body.materials for _, body in bodies], some), self.scene.world_color)
        lit = points.take(which)._replace(normal=normal, material=np.arange(len(some)))
        parts = LightParts(len(some)) if split else None
        color = radiance(lit, table, self.lamps, sample, self.surface.cast_scene, parts)
        share = wave.share[:, which] * weight
        add(film, wave.pixel[which], share * color)
        if split and parts:
            split.gather(wave.pixel[which], share, parts, wave.straight[which])

    def _send(
        self,
        wave: Wave,
        onward: tuple[IndexArray, Sent],
        film: Array,
        behind: Behind,
        split: LightParts | None,
    ) -> Wave:
        """What is met by what a lobe sends on; what meets nothing is added to the film."""
        which, lobe = onward
        share = wave.share[:, which] * lobe.tint
        depth = wave.depth[:, which].copy()
        for row in DEPTHS[lobe.kind]:
            depth[row] += 1
        limits = self.scene.bounces
        most = np.array([limits.total, limits.glossy, limits.transmission, limits.transparent])
        going = np.flatnonzero((share.max(axis=0) >= LEAST_SHARE) & (depth <= most[:, None]).all(axis=0))
        came = wave.take(which[going])
        lobe = replace(lobe, normal=lobe.normal[:, going], ior=lobe.ior[:, going])
        straight = came.straight | (lobe.kind != "THROUGH")
        hits = Hits.empty(len(going))
        on = np.flatnonzero(~straight)
        if len(on):
            hits.put(on, behind(came.pixel[on], came.hits.t[on], came.hits.triangle[on]))
        off = np.flatnonzero(straight)
        if len(off):
            hits.put(off, self._rays(came.take(off), lobe, off))
        glass = (came.glass & (lobe.kind != "MIRROR")) | (lobe.kind == "REFRACTED")
        sent = Wave(hits, came.pixel, share[:, going], straight, glass, depth[:, going])
        self._miss(sent.take(np.flatnonzero(hits.triangle < 0)), film, split)
        return sent.take(np.flatnonzero(hits.triangle >= 0))

    def _rays(self, came: Wave, lobe: Sent, index: IndexArray) -> Hits:
        """What straight rays from places meet. index: of the places in the lobe."""
        hits, cast_scene = came.hits, self.surface.cast_scene
        ahead = unit(hits.tangent)
        flat = cast_scene.normals(hits.triangle)
        flat = flat * -np.copysign(1.0, dot(flat, ahead))
        if lobe.kind == "THROUGH":
            direction = ahead
        elif lobe.kind == "MIRROR":
            direction = mirrored(ahead, lobe.normal[:, index], flat)
        else:
            direction = refracted(ahead, lobe.normal[:, index], flat, lobe.ior[:, index])
        origin = cast_scene.offset_origins(hits.position, hits.triangle, direction)
        if self.mirrors is self.glass is cast_scene:
            return cast_rays(cast_scene, origin, direction)
        glass = came.glass if lobe.kind == "THROUGH" else np.full(len(came.pixel), lobe.kind == "REFRACTED")
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
        world = np.reshape(self.scene.world_color, (3, 1))
        add(film, wave.pixel, wave.share * world * ~through)
        if split:
            split.miss(wave.pixel, wave.share * world, wave.straight)
        film[3] -= np.bincount(wave.pixel, wave.share.mean(axis=0) * through, film.shape[1])


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
        return np.concatenate([getattr(part, name) for part in parts])[some]

    return Materials(
        base_color=rows("base_color"),
        metallic=rows("metallic"),
        roughness=rows("roughness"),
        specular_f0=rows("specular_f0"),
        emission=rows("emission"),
        ambient=rows("ambient"),
    )
