# SPDX-License-Identifier: GPL-3.0-or-later
"""Preparation of F12 and the Render button: the scene for casting, and a coarse picture."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from time import perf_counter
from typing import Any, NamedTuple

import numpy as np

from ...casting.scene.cast_scene import CastScene
from ...shading.frame import Frame, render_frame
from ...shading.lights.scene_culling import cull_scene
from ...shading.passes.data_passes import DataPasses
from ...shading.typing import Single
from .scene_cache import SceneCache

# What a window's header says meanwhile.
BUILDING = "Building the acceleration structure, which cannot be canceled"
# Pixels across a square of the coarse picture that a window shows at first: it costs a
# sixty-fourth of one sample.
COARSE = 8


class Built(NamedTuple):
    """inputs: with no more of the scene than ``cast_scene`` was made of. kept: for the next picture.

    triangles: of the whole scene. seconds: that it took.
    """

    inputs: Any
    cast_scene: CastScene | None
    kept: SceneCache | None
    triangles: int
    seconds: float

    def reported(self, frame: Frame) -> Frame:
        """The frame with a report that counts what was done here."""
        report = frame.report
        seconds, building = report.seconds + self.seconds, report.build_seconds + self.seconds
        return frame._replace(
            report=replace(report, seconds=seconds, build_seconds=building, triangles=self.triangles)
        )


def build(inputs, kept: SceneCache | None, keep: bool) -> Built:
    """The scene that projectors are cast at.

    inputs: RenderInputs. keep: with persistent data all of the scene is built, and kept for the next picture:
    a camera that moves would ask for another part of it. kept: of the picture before.
    """
    started, triangles = perf_counter(), len(inputs.scene.geometry.triangles)
    if keep:
        made = SceneCache.of(inputs.scene.geometry, kept)
        _build_the_rest(inputs, made.cast_scene)
        return Built(inputs, made.cast_scene, made, triangles, perf_counter() - started)
    settings = inputs.settings
    alone = not inputs.moments and settings.passes.neighbours is None and settings.depth_of_field is None
    scene, cast_scene = cull_scene(inputs.scene, inputs.projection, alone, settings.pixel_error == 0.0)
    part = replace(inputs, scene=scene)
    _build_the_rest(inputs, cast_scene)
    return Built(part, cast_scene, None, triangles, perf_counter() - started)


def _build_the_rest(inputs, cast_scene: CastScene | None) -> None:
    """What would be built at its first use, in the middle of a picture, where nothing says that it is.

    Raises CastError where there is not enough memory for it.
    """
    if cast_scene is None or inputs.moments:
        return
    spans = inputs.projection.volume.spans
    if inputs.settings.pixel_error == 0.0:
        _ = cast_scene.prisms
    elif not spans.is_polyline:
        _ = cast_scene.occupancy
    if any(light.casts_shadow for light in inputs.scene.lights):
        # What stands beyond the volume is built when the first shadow is asked for.
        cast_scene.occluded(np.zeros((3, 1)), np.zeros((3, 1)), np.zeros(1))


def coarse_picture(inputs, cast_scene: CastScene | None, cancelled: Callable[[], bool]) -> Single | None:
    """What a picture will be, (H, W, 4), in squares of COARSE pixels; None when cancelled.

    inputs: RenderInputs.
    """
    whole = inputs.settings
    width, height = -(-whole.width // COARSE), -(-whole.height // COARSE)
    settings = replace(
        whole,
        width=width,
        height=height,
        samples=1,
        pixel_error=max(whole.pixel_error, 1.0),
        border=None,
        passes=DataPasses(),
        scrambled=False,
        adaptive=None,
        depth_of_field=None,
        stylised=whole.stylised and replace(whole.stylised.scaled(1 / COARSE), detail=1),
    )
    frame = render_frame(inputs.projection, inputs.scene, settings, cast_scene, cancelled=cancelled)
    if frame is None:
        return None
    left, bottom, right, top = whole.region
    rows = np.arange(bottom, top) * height // whole.height
    columns = np.arange(left, right) * width // whole.width
    return frame.pixels[rows[:, None], columns]
