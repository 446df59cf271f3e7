# SPDX-License-Identifier: GPL-3.0-or-later
"""The background of a live image: one colour, or the theme's gradient across the viewport.

The gradient's formula is Blender's (Blender's source, ``overlay_background_frag.glsl``): display colours are
mixed as powers of 1/2.2 of linear ones. Blender also shows backgrounds and overlays by that power, not by the
curve of sRGB (``gpu_shader_display_transform.glsl``, "Blend with overlay").
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...projection.colors import linear_from_srgb
from ..typing import Single

# Exponent of the space in which Blender mixes and shows backgrounds.
OVERLAY_POWER = 2.2
# Factor of the background outside of an image that is not a rectangle.
OUTSIDE = 0.5


@dataclass(frozen=True)
class Background:
    """The background, shown where projectors miss; colours in sRGB, as themes have them.

    color: the only one, or at the top of a linear gradient and in the middle of a radial one. other: at the
    gradient's other end. area: left, bottom, right and top of the image in the viewport, as shares of it.
    outside: factor of the colour where the image has no projectors.
    """

    color: tuple[float, float, float]
    other: tuple[float, float, float] = (0.0, 0.0, 0.0)
    gradient: Literal["SINGLE_COLOR", "LINEAR", "RADIAL"] = "SINGLE_COLOR"
    area: tuple[float, float, float, float] = (0.0, 0.0, 1.0, 1.0)
    outside: float = OUTSIDE

    def rows(self, height: int, width: int) -> Single:
        """The display values (3,) or (H · W, 3) of an image's pixels, float32."""
        if self.gradient == "SINGLE_COLOR":
            return shown_as_overlay(self.color)
        left, bottom, right, upper = self.area
        x = left + (np.arange(width) + 0.5) / width * (right - left)
        y = bottom + (np.arange(height) + 0.5) / height * (upper - bottom)
        if self.gradient == "LINEAR":
            share = np.broadcast_to(y[:, None], (height, width))
        else:
            share = 1 - np.hypot(x[None] - 0.5, y[:, None] - 0.5) * np.sqrt(2.0)
        ends = shown_as_overlay(self.other), shown_as_overlay(self.color)
        mixed: Single = ends[0] + (ends[1] - ends[0]) * np.clip(share, 0, 1).reshape(-1, 1).astype(np.float32)
        return mixed


def shown_as_overlay(color: tuple[float, ...]) -> Single:
    """The display values (3,) float32 by which Blender shows a theme's colour in a viewport."""
    linear = linear_from_srgb(np.array(color[:3]))
    return (linear ** (1 / OVERLAY_POWER)).astype(np.float32)
