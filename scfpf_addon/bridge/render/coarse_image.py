# SPDX-License-Identifier: GPL-3.0-or-later
"""Coarse images, in squares of pixels, that a window shows before the image itself."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np

from ...casting.scene.cast_scene import CastScene
from ...shading.frame import render_frame
from ...shading.passes.data_passes import DataPasses
from ...shading.settings.frame_settings import Border, FrameSettings
from ...shading.typing import Single
from .render_inputs import RenderInputs

# Pixels across a square of the image that a window shows at first: it costs a sixty-fourth of one sample.
COARSE = 8
# Pixels across the squares of the images that a viewport shows before the final one.
VIEWPORT_STEPS = (8, 2)
# Smallest pixel error of a coarse image.
COARSE_ERROR = 1.0


def coarse_settings(whole: FrameSettings, step: int, size: tuple[int, int], border: Border | None):
    """Settings of an image in squares of ``step`` pixels: one sample each, everything sharp and no passes.

    size, border: of the coarse image in its own pixels.
    """
    width, height = size
    return replace(
        whole,
        width=width,
        height=height,
        samples=1,
        pixel_error=max(whole.pixel_error, COARSE_ERROR),
        border=border,
        passes=DataPasses(),
        scrambled=False,
        adaptive=None,
        depth_of_field=None,
        stylised=whole.stylised and replace(whole.stylised.scaled(1 / step), detail=1),
    )


def coarse_image(
    inputs: RenderInputs, cast_scene: CastScene | None, cancelled: Callable[[], bool]
) -> Single | None:
    """The border of an image, (H, W, 4), in squares of COARSE pixels; None when cancelled."""
    whole = inputs.settings
    width, height = -(-whole.width // COARSE), -(-whole.height // COARSE)
    settings = coarse_settings(whole, COARSE, (width, height), None)
    frame = render_frame(inputs.projection, inputs.scene, settings, cast_scene, cancelled=cancelled)
    if frame is None:
        return None
    left, bottom, right, top = whole.region
    rows = np.arange(bottom, top) * height // whole.height
    columns = np.arange(left, right) * width // whole.width
    return frame.pixels[rows[:, None], columns]


def coarse_inputs(inputs: RenderInputs) -> Iterator[RenderInputs]:
    """Inputs of the coarse images of a viewport, from the coarsest on."""
    whole = inputs.settings
    region = whole.region
    for step in VIEWPORT_STEPS:
        width, height = max(whole.width // step, 1), max(whole.height // step, 1)
        # Stretched to the same rectangle, which it covers but for a part of a coarse pixel.
        left, right = (round(x * width / whole.width) for x in (region.left, region.right))
        bottom, top = (round(y * height / whole.height) for y in (region.bottom, region.top))
        left, bottom = min(left, width - 1), min(bottom, height - 1)
        border = Border(left, bottom, max(right, left + 1), max(top, bottom + 1))
        yield replace(inputs, settings=coarse_settings(whole, step, (width, height), border))
