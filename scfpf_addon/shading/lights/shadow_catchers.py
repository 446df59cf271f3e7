# SPDX-License-Identifier: GPL-3.0-or-later
"""Shadow catchers: in place of a surface, what stands behind the picture, darker where others take light.

As in Cycles the surface's own colour does not count: what is left of the light is a share.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np

from ...casting.common.cancellation import raise_if_cancelled
from ...casting.common.ray_visibility import CATCHER, SHADOW, visible_to
from ...casting.continuation import Continuation
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, BoolArray, IndexArray
from ..passes.light_passes import LightParts
from ..scene.shading_scene import Scene
from ..scene.sky_map import COLUMNS, ROWS, WorldLight
from ..scene.surface import SurfacePoints
from ..scene.world import World
from ..settings.frame_settings import FrameSettings
from ..typing import Single
from ..vectors import dot
from .lamps import Lamp
from .ray_visibility import shadow_scene, with_occluders
from .shadow_rays import cut_shadows
from .sky_light import SkyLight

# Places on an area lamp that stand for the whole of it.
MOST_PLACES = 32
# Radiance of surfaces that send on all that arrives, times π.
ALL = np.ones((3, 1), np.float32)


@dataclass(frozen=True)
class Catchers:
    """What is caught, (T,) by triangle, and the light on it.

    lamps: each with all that stands in its way, and with catchers alone. sky: the same of the world's light,
    None without any. cast_scene: of everything. world, behind: what stands behind the picture, the latter a
    radiance (3,) where there is no world; None for both where the film is transparent. apart: the picture
    shows no shadows, as there is a pass of them.
    """

    caught: BoolArray
    lamps: tuple[tuple[Lamp, Lamp], ...]
    sky: tuple[SkyLight, SkyLight] | None
    cast_scene: CastScene
    world: World | None
    behind: Array | None
    apart: bool

    @classmethod
    def of(
        cls, scene: Scene, cast_scene: CastScene, lamps: tuple[Lamp, ...], settings: FrameSettings
    ) -> Catchers | None:
        """None where nothing catches shadows. lamps: of the frame, with all that stands in their way."""
        visibility = scene.geometry.visibility
        if visibility is None or not (visibility & CATCHER).any():
            return None
        caught: BoolArray = (visibility & CATCHER) != 0
        kept = visible_to(visibility, SHADOW)
        others = cast_scene.only(caught if kept is None else caught & kept)
        sky = None
        light = scene.world.light if scene.world else even_light(*np.asarray(scene.world_color, np.float64))
        if light is not None:
            made = SkyLight.of(light, settings.samples)
            full = replace(made, occluders=shadow_scene(scene.geometry, cast_scene))
            sky = full, replace(made, occluders=others)
        apart = "SHADOW_CATCHER" in settings.passes.names
        paper = settings.paper
        shown = not settings.transparent and not apart
        background, world = scene.backdrop
        return cls(
            caught,
            tuple((lamp, with_occluders(lamp, scene.geometry, cast_scene, caught)) for lamp in lamps),
            sky,
            cast_scene,
            world if shown and paper is None else None,
            (background if paper is None else paper) if shown else None,
            apart,
        )

    def meets(self, triangle: IndexArray) -> BoolArray:
        """Which of the triangles (n,) are caught."""
        met: BoolArray = self.caught.take(triangle)
        return met

    def left(self, points: SurfacePoints, sample: int | IndexArray) -> Single:
        """Share (3, n) of the light at points that others leave, by colour.

        What they take is counted, not what arrives: in the open all of it is left, without noise.
        """
        taken, full = np.zeros_like(points.normal), np.zeros_like(points.normal)
        for lamp, alone in self.lamps:
            if lamp.light.scattered:
                lost, usual = self._lamp(lamp, alone, points, sample)
                taken += lost * lamp.color[:, None]
                full += usual * lamp.color[:, None]
        if self.sky:
            open_sky = self.sky[1].scattered(points, ALL, sample)
            taken += open_sky - self.sky[0].scattered(points, ALL, sample)
            full += open_sky
        left: Single = 1 - np.divide(taken, full, out=np.zeros_like(taken), where=full > 0)
        return left

    def _lamp(
        self, lamp: Lamp, alone: Lamp, points: SurfacePoints, sample: int | IndexArray
    ) -> tuple[Single, Single]:
        """What others take of a lamp's light and what there is of it, (n,) each."""
        light = lamp.incidence(points.position, sample)
        received = np.maximum(dot(points.normal, light.direction), 0) * light.strength
        if lamp.light.receivers is not None and points.linked is not None:
            received *= lamp.light.receivers.take(points.linked)
        arrived, own = received.copy(), received.copy()
        for values, each in ((arrived, lamp), (own, alone)):
            if each.light.casts_shadow:
                cut_shadows(values, points, light, each.occluders or self.cast_scene)
        full = own
        if lamp.light.kind == "AREA":
            # Of places nearby comes more: each of them counts as it does in the whole.
            places = range(0, lamp.places.shape[1], -(-lamp.places.shape[1] // MOST_PLACES))
            full = np.zeros_like(own)
            for place in places:
                raise_if_cancelled()
                its = lamp.incidence(points.position, place)
                full += np.maximum(dot(points.normal, its.direction), 0) * its.strength
            full *= (received == 0) | (own > 0)
            full /= len(places)
            if lamp.light.receivers is not None and points.linked is not None:
                full *= lamp.light.receivers.take(points.linked)
        return own - arrived, full

    def over(
        self,
        color: Single,
        triangle: IndexArray,
        points: SurfacePoints,
        sample: int | IndexArray,
        continuation: Continuation,
        parts: LightParts | None,
    ) -> Single:
        """The colours (3, n) of hits on triangles (n,), or (4, n) with alpha where some of them are caught.

        continuation: of the hits' projectors. parts: of the colours.
        """
        caught = np.flatnonzero(self.meets(triangle))
        if not len(caught):
            return color
        left = self.left(points.take(caught), sample if isinstance(sample, int) else sample[caught])
        shown = self.picture(left, continuation.exit_tangents(caught) if self.looks_on else None)
        color = np.concatenate([color, np.ones_like(color[:1])])
        color[:, caught] = shown
        if parts:
            parts.rows[:, caught] = 0.0
            parts.catch(caught, np.ones((3, len(caught))), shown, left)
        return color

    def picture(self, left: Single, exits: Array | None) -> Single:
        """Colours and alpha (4, n) of what is caught.

        left: (3, n), see there. exits: (3, n) tangents where projectors leave the volume, see ``looks_on``.
        """
        share = (left[0] + left[1] + left[2]) / 3
        made = np.zeros((4, len(share)), np.float32)
        made[3] = 0.0 if self.apart else 1 - share
        if self.behind is not None:
            color = np.reshape(self.behind, (3, 1))
            if self.world and exits is not None:
                color = self.world.radiance(exits)
            made[:3], made[3] = color * share, 1.0
        return made

    @property
    def looks_on(self) -> bool:
        """Whether it matters where projectors leave the volume."""
        return self.world is not None


@lru_cache(maxsize=2)
def even_light(red: float, green: float, blue: float) -> WorldLight | None:
    """The light of a world that is the same all around; None of a black one."""
    color = np.array([red, green, blue])
    if not color.any():
        return None
    return WorldLight.of(np.broadcast_to(color[:, None, None], (3, ROWS, COLUMNS)).copy())
