# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadow catchers: they show the image's background, darkened where other objects block their light.

As in Cycles the catcher's own material has no effect: the darkening is the share of its light that is left.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ...casting.common.cancellation import raise_if_cancelled
from ...casting.common.ray_visibility import CATCHER, SHADOW, visible_to
from ...casting.continuation import Continuation
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, BoolArray, IndexArray
from ..passes.light_passes import LightParts
from ..sampling.point_samples import PointSamples, Shares
from ..sampling.sample_sets import pixel_positions
from ..scene.shading_scene import Scene
from ..scene.surface import SurfacePoints
from ..scene.world import World, uniform_light
from ..settings.frame_settings import FrameSettings
from ..typing import Single
from ..vectors import dot
from .lamps import MIDDLE, Lamp
from .lighting import LAMPS
from .ray_visibility import has_catchers, shadow_scene, with_occluders
from .shadow_rays import cut_shadows
from .sky_light import SkyLight

# Random numbers of the places on an area lamp whose mean stands for the whole lamp.
WHOLE = pixel_positions(32).astype(np.float32)
# Albedo of a white surface.
WHITE = np.ones((3, 1), np.float32)


@dataclass(frozen=True)
class Catchers:
    """The catchers of a frame, and the light on them.

    caught: (T,) whether a triangle is of a catcher. lamps: each with all its occluders, and with catchers
    alone as occluders. sky: the same of the world's light, None if it is black. cast_scene: the whole scene.
    world, background: the image's background, the latter a radiance (3,) without a world; both None on a
    transparent film. in_pass: whether shadows are in a pass instead of the image.
    """

    caught: BoolArray
    lamps: tuple[tuple[Lamp, Lamp], ...]
    sky: tuple[SkyLight, SkyLight] | None
    cast_scene: CastScene
    world: World | None
    background: Array | None
    in_pass: bool

    @classmethod
    def of(
        cls, scene: Scene, cast_scene: CastScene, lamps: tuple[Lamp, ...], settings: FrameSettings
    ) -> Catchers | None:
        """The catchers of a frame; None without any. lamps: of the frame, with all their occluders."""
        visibility = scene.geometry.visibility
        if visibility is None or not has_catchers(scene.geometry):
            return None
        caught: BoolArray = (visibility & CATCHER) != 0
        kept = visible_to(visibility, SHADOW)
        others = cast_scene.only(caught if kept is None else caught & kept)
        sky = None
        if scene.world or np.any(scene.world_color):
            light = scene.world.light if scene.world else uniform_light(*map(float, scene.world_color))
            made = SkyLight.of(light, settings.samples)
            full = replace(made, occluders=shadow_scene(scene.geometry, cast_scene))
            sky = full, replace(made, occluders=others)
        in_pass = "SHADOW_CATCHER" in settings.passes.names
        paper = settings.paper
        shown = not settings.transparent and not in_pass
        background, world = scene.backdrop
        return cls(
            caught=caught,
            lamps=tuple((lamp, with_occluders(lamp, scene.geometry, cast_scene, caught)) for lamp in lamps),
            sky=sky,
            cast_scene=cast_scene,
            world=world if shown and paper is None else None,
            background=(background if paper is None else paper) if shown else None,
            in_pass=in_pass,
        )

    def meets(self, triangle: IndexArray) -> BoolArray:
        """Return whether each of the triangles (n,) is of a catcher."""
        met: BoolArray = self.caught.take(triangle)
        return met

    def left(self, points: SurfacePoints, samples: PointSamples) -> Single:
        """Share (3, n) of the light at points that other objects leave, by colour.

        It is computed from the light that they block, so that it is exactly 1 in the open, without noise.
        """
        blocked, full = np.zeros_like(points.normal), np.zeros_like(points.normal)
        shares = samples.shares(LAMPS) if any(lamp.random for lamp, _ in self.lamps) else None
        for lamp, alone in self.lamps:
            if lamp.light.diffuse:
                lost, usual = self._blocked(lamp, alone, points, shares)
                blocked += lost * lamp.color[:, None]
                full += usual * lamp.color[:, None]
        if self.sky:
            open_sky = self.sky[1].radiance(points, WHITE, samples)
            blocked += open_sky - self.sky[0].radiance(points, WHITE, samples)
            full += open_sky
        left: Single = 1 - np.divide(blocked, full, out=np.zeros_like(blocked), where=full > 0)
        return left

    def _blocked(
        self, lamp: Lamp, alone: Lamp, points: SurfacePoints, shares: Shares | None
    ) -> tuple[Single, Single]:
        """The irradiance of a lamp that other objects block, and that without them, (n,) each."""
        light = lamp.incidence(points.position, lamp.share(shares))
        received = np.maximum(dot(points.normal, light.direction), 0) * light.strength
        lamp.limit_to_receivers(received, points)
        arrived, own = received.copy(), received.copy()
        for values, each in ((arrived, lamp), (own, alone)):
            if each.light.casts_shadow:
                cut_shadows(values, points, light, each.occluders or self.cast_scene)
        if lamp.light.kind != "AREA":
            return own - arrived, own
        # Nearer places on the lamp are brighter, so the whole is the mean over places, not this sample's.
        places = WHOLE if lamp.random else MIDDLE
        full = np.zeros_like(own)
        for place in places.T:
            raise_if_cancelled()
            its = lamp.incidence(points.position, place[:, None])
            full += np.maximum(dot(points.normal, its.direction), 0) * its.strength
        full *= (received == 0) | (own > 0)
        full /= places.shape[1]
        lamp.limit_to_receivers(full, points)
        return own - arrived, full

    def over(
        self,
        color: Single,
        triangle: IndexArray,
        points: SurfacePoints,
        samples: PointSamples,
        continuation: Continuation,
        parts: LightParts | None,
    ) -> Single:
        """Colours (3, n) of hits on triangles (n,) with catchers shown, (4, n) with alpha if there are any.

        samples, continuation: of the hits. parts: of the colours.
        """
        caught = np.flatnonzero(self.meets(triangle))
        if not len(caught):
            return color
        left = self.left(points.take(caught), samples.take(caught))
        shown = self.shown(left, continuation, caught)
        color = np.concatenate([color, np.ones_like(color[:1])])
        color[:, caught] = shown
        if parts:
            parts.rows[:, caught] = 0.0
            parts.catch(caught, np.ones((3, len(caught))), shown, left)
        return color

    def shown(self, left: Single, continuation: Continuation, which: IndexArray) -> Single:
        """Colours and alpha (4, n) of catchers, where projectors ``which`` (n,) hit them. left: see there."""
        share = (left[0] + left[1] + left[2]) / 3
        shown = np.zeros((4, len(share)), np.float32)
        shown[3] = 0.0 if self.in_pass else 1 - share
        if self.background is not None:
            color = np.reshape(self.background, (3, 1))
            if self.world:
                color = self.world.radiance(continuation.exit_tangents(which))
            shown[:3], shown[3] = color * share, 1.0
        return shown
