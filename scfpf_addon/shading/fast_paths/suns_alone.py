# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that are lit by suns without shadows alone, through straight projectors.

Such light asks for a direction and a normal, not for a place: neither t nor the position of a hit
has to be known, which are half of what a straight frame takes besides Embree. All other pictures are
made by ``Pipeline``'s general way; both give the same, within float32's rounding.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...casting.common.hits import CastCounts
from ...casting.image_bounds import Window
from ...casting.scene.cast_scene import CastScene
from ...casting.visible_triangles import FlatRays, see, see_rows
from ...projection.volume.viewing_volume import Projection
from ..sampling.samples import SamplePlaces
from ..typing import Single
from .sun_colors import SunColors


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
        if (lines, columns) == (slice(0, len(y)), slice(0, len(x))):
            seen = see_rows(self.scene, rays, x, y, counts, self.colors.surface.weighted)
            self.colors.write(seen, sample, into)
            return seen.triangle
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
        for shown, channel in zip(picture[:, lines, columns], color, strict=True):
            shown[:] = channel.reshape(held.shape)
        return triangle.reshape(-1)
