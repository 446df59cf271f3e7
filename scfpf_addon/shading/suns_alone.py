# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that are lit by suns without shadows alone, through straight projectors.

Such light asks for a direction and a normal, not for a place: neither t nor the position of a hit
has to be known, which are half of what a straight frame takes besides Embree. All other pictures are
made by ``Pipeline``'s general way; both give the same, within float32's rounding.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..casting.hits import CastCounts
from ..casting.scene import CastScene
from ..casting.triangles_seen import FlatRays, see, see_rows
from ..casting.window import Window
from ..projection.typing import Array
from ..projection.volume import Projection
from .hit_colors import Shading
from .lighting import Lamp
from .samples import SamplePlaces
from .settings import FrameSettings
from .sun_colors import SunColors
from .typing import Single


@dataclass(frozen=True)
class SunsAlone:
    """What makes such a picture.

    projection: in cast space. rays: None where each projector's ray has to be made by itself. window: where
    rays can meet anything, if they are given.
    """

    projection: Projection
    places: SamplePlaces
    scene: CastScene
    colors: SunColors
    rays: FlatRays | None
    window: Window | None

    @classmethod
    def of(
        cls,
        projection: Projection,
        settings: FrameSettings,
        places: SamplePlaces,
        background: Array,
        scene: CastScene | None,
        shading: Shading | None,
    ) -> Self | None:
        """None where the picture has to be made in the general way; ``background``: (3,)."""
        if scene is None or type(shading) is not Shading:
            return None
        if shading.tracer is not None or shading.held_out is not None or shading.phong.sky is not None:
            return None
        if shading.catchers is not None:
            return None
        spans = projection.volume.spans
        straight = spans.direct and spans.degree == 1 and spans.point_weights is None
        if not straight or type(projection) is not Projection:
            return None
        if settings.pixel_error == 0.0 or settings.lens is not None:
            return None
        if not all(_is_alone(lamp, places.scrambled) for lamp in shading.lamps):
            return None
        empty = np.zeros(4, np.float32)
        if not settings.transparent:
            empty[:] = (*background, 1)
        rays = None if places.scrambled else FlatRays.of(projection)
        colors = SunColors(shading.surface, shading.phong, shading.lamps, empty)
        return cls(projection, places, scene, colors, rays, rays.window(scene) if rays else None)

    def sample(self, rows: slice, sample: int, counts: CastCounts, into: Single) -> NDArray[np.int32]:
        """A sample of each pixel of whole rows, written with alpha into (4, n), however that lies in memory.

        What comes back are the triangles (n,) that it sees, -1 for none.
        """
        if self.rays and self.window:
            return self._sample_window(self.rays, self.window, rows, sample, counts, into)
        x, y = self.places.of_rows(rows, sample)
        seen = see(self.scene, self.projection, x, y, counts, self.colors.surface.weighted)
        self.colors.write(seen, sample, into)
        if seen.mask is not None:
            into *= seen.mask
        return seen.triangle

    def _sample_window(
        self, rays: FlatRays, window: Window, rows: slice, sample: int, counts: CastCounts, into: Single
    ) -> NDArray[np.int32]:
        """As ``sample``: only what the window holds is cast at."""
        x, y = self.places.of_grid(rows, sample)
        columns, lines = window.held(x, y)
        triangle = np.full((len(y), len(x)), -1, np.int32)
        held = triangle[lines, columns]
        counts.projectors += triangle.size - held.size
        picture = into.reshape(4, *triangle.shape)
        behind = self.colors.background[:, None, None]
        if not held.size:
            picture[:] = behind
            return triangle.reshape(-1)
        picture[:, : lines.start], picture[:, lines.stop :] = behind, behind
        seen = see_rows(self.scene, rays, x[columns], y[lines], counts, self.colors.surface.weighted)
        held[:] = seen.triangle.reshape(held.shape)
        if held.shape[1] == len(x):
            self.colors.write(seen, sample, into[:, lines.start * len(x) : lines.stop * len(x)])
            return triangle.reshape(-1)
        color = np.empty((4, held.size), np.float32)
        self.colors.write(seen, sample, color)
        picture[:, lines, : columns.start], picture[:, lines, columns.stop :] = behind, behind
        picture[:, lines, columns] = color.reshape(4, *held.shape)
        return triangle.reshape(-1)


def _is_alone(lamp: Lamp, scrambled: bool) -> bool:
    """Whether a lamp lights all places alike that a sample sees, wherever they are."""
    alike = not scrambled or bool((lamp.places == lamp.places[:, :1]).all())
    return lamp.light.kind == "SUN" and not lamp.light.casts_shadow and alike
