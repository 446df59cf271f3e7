# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of a viewport: a thread refines one until the next is requested."""

from __future__ import annotations

from typing import NamedTuple

from ...shading.frame import render_frame
from ...shading.typing import Single
from ..tasks.painter import Painter
from .coarse_image import coarse_inputs
from .render_inputs import RenderInputs
from .scene_preparation import SceneCache


class Rectangle(NamedTuple):
    """A rectangle in a viewport, in pixels of its region: left bottom corner and size."""

    left: float
    bottom: float
    width: float
    height: float


class Painting(NamedTuple):
    """An image and where it is drawn. pixels: (H, W, 4) as in Frame. is_final: whether it gets no finer."""

    pixels: Single
    rectangle: Rectangle
    is_final: bool


class Commission(NamedTuple):
    """A request for an image. The border of the inputs is drawn in the rectangle."""

    inputs: RenderInputs
    rectangle: Rectangle


class ViewPainter(Painter[Commission, Painting]):
    """Paints the latest commission, from coarse to final."""

    def __init__(self) -> None:
        super().__init__("SCFPF viewport")
        self._cache: SceneCache | None = None

    def _paint(self, commission: Commission) -> None:
        inputs = commission.inputs
        self._cache = SceneCache.of(inputs.scene.geometry, self._cache)
        for step in (*coarse_inputs(inputs), inputs):
            frame = render_frame(
                step.projection,
                step.scene,
                step.settings,
                self._cache.cast_scene,
                cancelled=self.is_set,
            )
            if frame is None:
                return
            self._show(Painting(frame.pixels, commission.rectangle, step is inputs))
