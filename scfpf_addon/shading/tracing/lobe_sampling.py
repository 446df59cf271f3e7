# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions in which mirrors and glass send light on, and the hits of the straight rays along them.

Scattered rays are straight because the volume's distortion is not the scene's (paper §6.1).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...casting.common.hits import Hits
from ...casting.common.ray_visibility import GLASS, MIRROR, visible_to
from ...casting.continuation import cast_rays, first_triangles
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, BoolArray, IndexArray
from ..materials.ggx_sampling import MIRROR_ROUGHNESS, RoughLobe, single_scatter_albedo
from ..materials.lobes import RoughReflectance
from ..materials.parameters import ClosureRows
from ..nodes.inputs import fresnel_dielectric
from ..scene.shading_scene import Scene
from ..vectors import dot_row, unit
from .closure_table import HitClosures
from .glows import Aims, Glows
from .path_samples import PathSamples
from .path_wave import TOTAL, PathWave

# Kinds of lobes: straight through, into glass, off glass, off metal, off a dielectric layer.
CLEAR, REFRACTED, MIRRORED, METAL, LAYER = range(5)
# The least density of directions, as if all were alike.
LEAST_DENSITY = 0.25 / np.pi
# The least divisor.
LEAST_NUMBER = 1e-30


class ScatteredRays(NamedTuple):
    """The straight rays of n lobes.

    direction: (3, n) unit. share: (3, n) of light that counts. spread: (n,) solid angles that they stand for,
    0 of sharp ones. awaited: (n,) radiance of the glowing things that they are aimed at, 0 for none.
    """

    direction: Array
    share: Array
    spread: Array
    awaited: Array

    @classmethod
    def along(cls, direction: Array) -> ScatteredRays:
        """Sharp rays that keep all light."""
        nothing = np.zeros(direction.shape[1])
        return cls(direction, np.ones_like(direction), nothing, nothing.copy())


class SentLobes(NamedTuple):
    """Lobes that send light on, sorted by kind. closure: (n,) the closures that they are part of.

    kind: (n,) one of CLEAR … LAYER. tint: (3, n) share of light. ior: (n,) of the far side over the near one.
    """

    closure: IndexArray
    kind: IndexArray
    tint: Array
    ior: Array

    @classmethod
    def of(cls, closures: ClosureRows, facing: Array, back: BoolArray) -> SentLobes:
        """The lobes of closures. facing: (n,) cosines to the viewer. back: (n,) whether the back is seen."""
        clear = np.flatnonzero(closures["transparent"].any(axis=0))
        glass = np.flatnonzero(closures["glass"][0] > 0.0)
        inside = closures.take(glass)
        ior = np.where(back.take(glass), 1.0 / inside["ior"], inside["ior"])
        fresnel = fresnel_dielectric(facing.take(glass)[None], ior)
        # No light on total internal reflection.
        entering = np.where(inside["whole"] > 0.0, fresnel < 1.0, 1.0 - fresnel)
        metal, layer = (np.flatnonzero(closures[name][0] > 0.0) for name in ("metal", "dielectric"))
        parts = {
            CLEAR: (clear, closures["transparent"].take(clear, axis=1)),
            REFRACTED: (glass, inside["glass"] * entering * np.sqrt(inside["base_color"])),
            MIRRORED: (glass, inside["glass"] * fresnel * inside["mirrored"]),
            METAL: (metal, np.repeat(closures["metal"].take(metal, axis=1), 3, axis=0)),
            LAYER: (layer, np.repeat(closures["dielectric"].take(layer, axis=1), 3, axis=0)),
        }
        ones = {kind: np.ones(len(which)) for kind, (which, _) in parts.items()}
        return cls(
            np.concatenate([which for which, _ in parts.values()]),
            np.repeat(list(parts), [len(which) for which, _ in parts.values()]),
            np.concatenate([tint for _, tint in parts.values()], axis=1),
            np.concatenate([*(ones | {REFRACTED: ior[0]}).values()]),
        )

    def take(self, index: IndexArray) -> SentLobes:
        """The lobes at ``index``, in order."""
        return SentLobes._make(each.take(index, -1) for each in self)


@dataclass(frozen=True)
class LobeSampler:
    """Casts the rays of lobes.

    mirrors, glass: the scene that reflected and refracted rays can meet, None if that is empty. glows: what
    rough reflections look for, None for nothing.
    """

    cast_scene: CastScene
    mirrors: CastScene | None
    glass: CastScene | None
    glows: Glows | None = None

    @classmethod
    def of(cls, scene: Scene, cast_scene: CastScene) -> LobeSampler:
        """The sampler of a scene's ray visibility."""
        visibility = scene.geometry.visibility
        mirrors, glass = (cast_scene.only(visible_to(visibility, ray)) for ray in (MIRROR, GLASS))
        return cls(cast_scene, mirrors, glass, Glows.of(scene, cast_scene))

    def directions(
        self, lobes: SentLobes, closures: HitClosures, wave: PathWave, samples: PathSamples
    ) -> ScatteredRays:
        """The straight rays of lobes. closures: of each lobe. wave: the places of each."""
        rays, normal = ScatteredRays.along(unit(wave.hits.tangent)), closures.normal
        direction = rays.direction
        flat = self.cast_scene.normals(wave.hits.triangle)
        flat *= -np.copysign(1.0, dot_row(flat, direction))
        first, second, third, fourth = np.searchsorted(lobes.kind, (REFRACTED, MIRRORED, METAL, LAYER))
        some = slice(first, second)
        bent = direction[:, some], normal[:, some], flat[:, some]
        direction[:, some] = refracted(*bent, lobes.ior[None, some])
        some = slice(second, third)
        direction[:, some] = mirrored(direction[:, some], normal[:, some], flat[:, some])
        some = slice(third, None)
        place = samples.facets(wave.pixel[some], wave.depth[TOTAL, some])
        rows = closures.rows.take(np.arange(third, len(lobes.kind)))
        reflectance = RoughReflectance.of(rows, fourth - third)
        ahead = direction[:, some]
        position = wave.hits.position[:, some]

        def aims_of(which: IndexArray, lobe: RoughLobe) -> Aims | None:
            """Aims at bright things from the hits ``which`` (n,); None if nothing glows."""
            return self.glows and self.glows.aims(position.take(which, axis=1), lobe, samples.first.most)

        sent = _reflect(ahead, normal[:, some], flat[:, some], reflectance, place, aims_of)
        for whole, part in zip(rays, sent, strict=True):
            whole[..., some] = part
        return rays._replace(spread=rays.spread / samples.first.most)

    def cast(
        self,
        wave: PathWave,
        direction: Array,
        refracted: BoolArray,
        ends: BoolArray,
        shown: Callable[[IndexArray], BoolArray],
    ) -> tuple[Hits, BoolArray]:
        """The hits of straight rays from the wave's places, and which rays end in the dark, (n,).

        refracted: (n,) whether glass sends them. ends: (n,) rays that see only the world and triangles that
        are ``shown``; at any other they end in the dark, and have no hit.
        """
        origin = self.cast_scene.offset_origins(wave.hits.position, wave.hits.triangle, direction)
        # On a miss a ray goes on to its end, as ``cast_rays`` leaves it.
        met = Hits.empty(len(refracted))._replace(position=origin + direction, tangent=direction.copy())
        dark = np.zeros(len(refracted), bool)
        parts = [(self.mirrors, ~refracted), (self.glass, refracted)]
        for scene, which in [(self.mirrors, refracted | True)] if self.mirrors is self.glass else parts:
            if scene is None:
                continue
            last, going = np.flatnonzero(which & ends), which & ~ends
            if len(last):
                found = first_triangles(scene, origin.take(last, 1), direction.take(last, 1))
                seen = shown(found)
                dark[last] = (found >= 0) & ~seen
                going[last] = (found >= 0) & seen
            some = np.flatnonzero(going)
            if len(some) == len(dark):
                return cast_rays(scene, origin, direction), dark
            if len(some):
                met.put(some, cast_rays(scene, origin.take(some, 1), direction.take(some, 1)))
        return met, dark


def _reflect(
    ahead: Array,
    normal: Array,
    flat: Array,
    reflectance: RoughReflectance,
    place: Array,
    aims_of: Callable[[IndexArray, RoughLobe], Aims | None],
) -> ScatteredRays:
    """The rays of reflections at n hits, sharp or rough. aims_of: some of the hits."""
    cosine = np.clip(-dot_row(ahead, normal), 0.0, 1.0)[0]
    rays = ScatteredRays.along(np.empty_like(ahead))
    passed, once = np.ones_like(cosine), np.ones_like(cosine)
    is_rough = reflectance.roughness >= MIRROR_ROUGHNESS
    sharp, rough = np.flatnonzero(~is_rough), np.flatnonzero(is_rough)
    if len(sharp):
        rays.direction[:, sharp] = mirrored(*(each.take(sharp, 1) for each in (ahead, normal, flat)))
    if len(rough):
        roughness = reflectance.roughness.take(rough)
        once[rough] = single_scatter_albedo(cosine.take(rough), roughness)
        seen, own, face, share = (each.take(rough, 1) for each in (ahead, normal, flat, place))
        lobe = RoughLobe.of(seen, own, face, roughness)
        aims = aims_of(rough, lobe)
        sent = lobe.sampled(aims.remaining(share) if aims else share)
        density = sent.density
        if aims:
            sent = lobe.along(aims.aimed(sent.direction, share))
            density, rays.awaited[rough] = aims.density(sent.direction, sent.density)
            sent.passed[:] *= sent.density / np.maximum(density, LEAST_NUMBER)
        rays.direction[:, rough], passed[rough], cosine[rough] = sent.direction, sent.passed, sent.cosine
        rays.spread[rough] = 1.0 / np.maximum(density, LEAST_DENSITY)
    return rays._replace(share=reflectance.at(cosine, once) * passed)


def mirrored(ahead: Array, normal: Array, flat: Array) -> Array:
    """Directions (3, n) off a mirror: by the shading normal, or the triangle's where that leads inside."""
    direction = ahead - 2.0 * dot_row(ahead, normal) * normal
    inside = dot_row(direction, flat) <= 0.0
    return np.where(inside, ahead - 2.0 * dot_row(ahead, flat) * flat, direction)


def refracted(ahead: Array, normal: Array, flat: Array, ior: Array) -> Array:
    """Directions (3, n) behind a boundary (Snell); unchanged on total internal reflection."""
    cosine = -dot_row(ahead, normal)
    under = 1.0 - (1.0 - cosine**2) / ior**2
    direction = unit(ahead / ior + (cosine / ior - np.sqrt(np.maximum(under, 0.0))) * normal)
    return np.where((under > 0.0) & (dot_row(direction, flat) < 0.0), direction, ahead)
