# SPDX-License-Identifier: GPL-3.0-or-later
"""The fill between lines: materials' colours in steps of light, without light, or paper."""

from __future__ import annotations

from dataclasses import dataclass, fields, replace

import numpy as np

from ...casting.common.hits import Hits
from ...casting.continuation import Continuation
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import IndexArray
from ..lights.ray_visibility import without_catchers
from ..materials.constants import Materials
from ..passes.light_passes import LightParts
from ..sampling.point_samples import PointSamples
from ..scene.shading_scene import Scene
from ..settings.frame_settings import FrameSettings
from ..settings.stylised_settings import Stylised
from ..tracing.hit_colors import Shading
from ..typing import Single
from .strokes import tone_of


def of_clay(scene: Scene) -> Scene:
    """The scene with one white, matt material."""
    white = Materials(np.ones((1, 3)), np.zeros(1), np.ones(1), np.zeros(1), np.zeros((1, 3)))
    return replace(scene, materials=white)


def without_light(scene: Scene) -> Scene:
    """The scene in uniform white light, which shows the colours of materials."""
    return replace(scene, lights=(), world_color=np.ones(3), world=None)


def stepped(tone: Single, style: Stylised) -> Single:
    """Round tones (n,) in [0, 1] to the style's steps, from ``darkest`` to 1."""
    if style.steps == 1:
        return np.ones_like(tone)
    place = tone * np.float32(style.steps)
    half = np.float32(max(style.softness, 1e-6) / 2)
    level = np.zeros_like(tone)
    for step in range(1, style.steps):
        if style.softness > 0.0:
            rise = np.clip((place - step + half) / (2 * half), 0, 1)
            level += rise * rise * (3 - 2 * rise)
        else:
            level += place >= step
    level *= np.float32((1 - style.darkest) / (style.steps - 1))
    level += np.float32(style.darkest)
    return level


@dataclass(frozen=True, kw_only=True)
class StylisedShading(Shading):
    """The shading of a scene and of its stylised image: colours in uniform light, times steps of light.

    flat: in uniform light, None where the style shows no colours. light: of white clay, None where the style
    does not depend on light.
    """

    style: Stylised
    flat: Shading | None
    light: Shading | None

    @classmethod
    def of(cls, scene: Scene, cast_scene: CastScene, settings: FrameSettings) -> StylisedShading:
        """The tables of frames of these settings, which must be stylised."""
        style = settings.stylised
        if style is None:
            raise ValueError("the settings have no style")
        plain = Shading.of(scene, cast_scene, settings)
        parts = {each.name: getattr(plain, each.name) for each in fields(Shading)}
        scene = replace(scene, geometry=without_catchers(scene.geometry))
        flat = light = None
        if style.fill in ("TOON", "FLAT"):
            flat = Shading.of(without_light(scene), cast_scene, settings)
        if style.lit:
            # One sample sees the middle of lamps, so that shadows have sharp edges.
            alone = replace(settings, samples=1, transparent=False)
            light = replace(Shading.of(of_clay(scene), cast_scene, alone), surface=plain.surface)
        return cls(**parts, style=style, flat=flat, light=light)

    def color(
        self,
        hits: Hits,
        where: IndexArray,
        samples: PointSamples,
        continuation: Continuation,
        parts: LightParts | None = None,
    ) -> Single:
        """The colours of hits, filled as the style says. parts: of the image as rendered without style."""
        if self.style.fill == "RENDERED":
            return super().color(hits, where, samples, continuation, parts)
        if parts:
            super().color(hits, where, samples, continuation, parts)
        color = self._filled(hits, where, samples, continuation)
        caught = np.zeros(0, np.intp)
        if self.catchers:
            caught = np.flatnonzero(self.catchers.meets(hits.triangle.take(where)))
        if len(caught):
            if len(color) == 3:
                color = np.concatenate([color, np.ones_like(color[:1])])
            color[:, caught] = super().color(hits, where[caught], samples.take(caught), continuation)
        return color

    def _filled(
        self, hits: Hits, where: IndexArray, samples: PointSamples, continuation: Continuation
    ) -> Single:
        """The fill of hits: shadow catchers, which have none in the image, are filled like other surfaces."""
        if self.flat is None:
            paper = np.ones((4, len(where)), np.float32)
            paper[:3] = self.style.paper.astype(np.float32)[:, None]
            if self.held_out is not None:
                paper *= ~self.held_out.take(hits.triangle.take(where))
            return paper
        color = self.flat.color(hits, where, samples, continuation)
        if self.style.fill == "FLAT" or self.light is None:
            return color
        # ``light`` is for one sample, whichever of the pixel's this is.
        light = self.light.color(hits, where, PointSamples.alone(len(where)), continuation)[:3]
        brightest = np.maximum(np.maximum(light[0], light[1]), light[2])
        # Darkness has no colour.
        tint = np.divide(light, brightest, out=np.ones_like(light), where=brightest > 0)
        color[:3] *= tint * stepped(tone_of(light, self.style.exposure), self.style)
        return color


def on_paper(pixels: Single, style: Stylised, transparent: bool) -> None:
    """Fade pixels (n, 4), premultiplied, and put them on paper if the style has any, in place."""
    color = style.paper.astype(np.float32)
    if style.fade > 0.0:
        pixels[:, :3] *= np.float32(1 - style.fade)
        pixels[:, :3] += pixels[:, 3:] * (color * np.float32(style.fade))
    if style.on_paper and not transparent:
        pixels[:, :3] += (1 - pixels[:, 3:]) * color
        pixels[:, 3] = 1
