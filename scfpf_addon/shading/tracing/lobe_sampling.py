# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions in which mirrors and glass send light on, and the hits of the straight rays along them.

Scattered rays are straight because the volume's distortion is not the scene's (paper §6.1).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...casting.common.hits import Hits
from ...casting.common.ray_visibility import GLASS, MIRROR, visible_to
from ...casting.continuation import cast_rays
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, IndexArray
from ..materials.ggx_sampling import MIRROR_ROUGHNESS, R2_STEP, reflected, single_scatter_albedo
from ..materials.lobes import ScatteredLobe
from ..sampling.sample_positions import Bits, scramble
from ..scene.shading_scene import Scene
from ..vectors import dot_row, unit
from .path_wave import TOTAL, PathWave

# The dimension of the scramble that begins a pixel's sequence of rough reflections.
REFLECTION = 6


class ReflectionSamples(NamedTuple):
    """The random choices of rough reflections in one sample of each pixel.

    pixel: (n,) number in the image, by the pixel's place in the list.
    """

    pixel: Bits
    sample: int

    def at_depth(self, which: IndexArray, depth: IndexArray) -> Array:
        """(2, m) in [0, 1) for pixels by place in the list, after ``depth`` (m,) scattering events.

        A pixel's samples fill the square evenly; each pixel and depth begins its sequence elsewhere.
        """
        own = scramble(self.pixel[which] ^ scramble(depth.astype(np.uint32), REFLECTION), REFLECTION)
        start = np.stack([own & np.uint32(0xFFFF), own >> np.uint32(16)]) / 65536.0
        step = np.where(depth == 0, R2_STEP[:, None], R2_STEP[::-1, None])
        share: Array = (start + self.sample * step) % 1.0
        return share


@dataclass(frozen=True)
class LobeSampler:
    """Casts the rays of lobes.

    mirrors, glass: the scene that reflected and refracted rays can meet, None if that is empty.
    """

    cast_scene: CastScene
    mirrors: CastScene | None
    glass: CastScene | None

    @classmethod
    def of(cls, scene: Scene, cast_scene: CastScene) -> LobeSampler:
        """The sampler of a scene's ray visibility."""
        visibility = scene.geometry.visibility
        mirrors, glass = (cast_scene.only(visible_to(visibility, ray)) for ray in (MIRROR, GLASS))
        return cls(cast_scene, mirrors, glass)

    def scatter(self, wave: PathWave, lobe: ScatteredLobe, samples: ReflectionSamples) -> tuple[Hits, Array]:
        """The next hits of paths that follow a lobe by straight rays, and the share (3, n) that counts."""
        ahead = unit(wave.hits.tangent)
        if lobe.kind == "TRANSPARENT":
            direction, share = ahead, np.ones_like(ahead)
        elif lobe.kind == "TRANSMISSION":
            direction = refracted(ahead, lobe.normal, self._facing(wave, ahead), lobe.ior)
            share = np.ones_like(ahead)
        else:
            direction, share = self._reflect(wave, lobe, ahead, samples)
        return self._cast(wave, lobe, direction), share

    def _facing(self, wave: PathWave, ahead: Array) -> Array:
        """Unit normals of the triangles, on the side that is seen, (3, n)."""
        flat = self.cast_scene.normals(wave.hits.triangle)
        return flat * -np.copysign(1.0, dot_row(flat, ahead))

    def _reflect(
        self, wave: PathWave, lobe: ScatteredLobe, ahead: Array, samples: ReflectionSamples
    ) -> tuple[Array, Array]:
        """Directions (3, n) of reflections, sharp or rough, and the share (3, n) of light that counts."""
        flat = self._facing(wave, ahead)
        direction = mirrored(ahead, lobe.normal, flat)
        if lobe.rough is None:
            return direction, np.ones_like(ahead)
        cosine = np.clip(-dot_row(ahead, lobe.normal), 0.0, 1.0)[0]
        passed, once = np.ones_like(cosine), np.ones_like(cosine)
        rough = np.flatnonzero(lobe.rough.roughness[0] >= MIRROR_ROUGHNESS)
        if len(rough):
            roughness = lobe.rough.roughness[0, rough]
            once[rough] = single_scatter_albedo(cosine[rough], roughness)
            place = samples.at_depth(wave.pixel[rough], wave.depth[TOTAL, rough])
            direction[:, rough], passed[rough], cosine[rough] = reflected(
                ahead[:, rough], lobe.normal[:, rough], flat[:, rough], roughness, place
            )
        # Light that facets send to each other leaves in the same direction.
        share = lobe.rough.reflectance(cosine) * passed
        return direction, share * (1.0 + lobe.rough.multiscatter * (1.0 - once) / once)

    def _cast(self, wave: PathWave, lobe: ScatteredLobe, direction: Array) -> Hits:
        """The hits of straight rays from the wave's places."""
        origin = self.cast_scene.offset_origins(wave.hits.position, wave.hits.triangle, direction)
        if self.mirrors is self.glass is self.cast_scene:
            return cast_rays(self.cast_scene, origin, direction)
        refracting = np.full(len(wave.pixel), lobe.kind == "TRANSMISSION")
        glass = wave.from_glass if lobe.kind == "TRANSPARENT" else refracting
        # On a miss a ray goes on to its end, as ``cast_rays`` leaves it.
        met = Hits.empty(len(glass))._replace(position=origin + direction, tangent=direction.copy())
        for scene, which in ((self.mirrors, ~glass), (self.glass, glass)):
            some = np.flatnonzero(which)
            if scene and len(some):
                met.put(some, cast_rays(scene, origin[:, some], direction[:, some]))
        return met


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
