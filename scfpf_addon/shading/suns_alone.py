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
from ..casting.triangles_seen import FlatRays, TrianglesSeen, see, see_rows
from ..projection.typing import Array, BoolArray
from ..projection.volume import Projection
from .hit_colors import Shading
from .lighting import Lamp
from .samples import SamplePlaces
from .settings import FrameSettings
from .typing import Single


@dataclass(frozen=True)
class SunsAlone:
    """What makes such a picture.

    projection: in cast space. rays: None where each projector's ray has to be made by itself.
    background: (4,) what hits nothing.
    """

    projection: Projection
    places: SamplePlaces
    scene: CastScene
    shading: Shading
    rays: FlatRays | None
    background: Single

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
        return cls(projection, places, scene, shading, rays, empty)

    def sample(self, rows: slice, sample: int, counts: CastCounts) -> tuple[Single, NDArray[np.int32]]:
        """A sample of each pixel of whole rows, (4, n), and the triangles (n,) that it sees, -1 for none."""
        weighted = self.shading.surface.weighted
        if self.rays:
            x, y = self.places.of_grid(rows, sample)
            seen = see_rows(self.scene, self.rays, x, y, counts, weighted)
        else:
            x, y = self.places.of_rows(rows, sample)
            seen = see(self.scene, self.projection, x, y, counts, weighted)
        hit = seen.triangle >= 0
        color = np.empty((4, len(hit)), np.float32)
        # Often there are rows of sky without any hit, above or below the others.
        lines = np.flatnonzero(hit.reshape(-1, self.places.width).any(axis=1))
        first, last = (lines[0], lines[-1] + 1) if len(lines) else (0, 0)
        some = slice(first * self.places.width, last * self.places.width)
        color[:, : some.start], color[:, some.stop :] = self.background[:, None], self.background[:, None]
        if len(lines):
            self._fill(color[:, some], seen.part(some), hit[some], sample)
        if seen.mask is not None:
            color *= seen.mask
        return color, seen.triangle

    def _fill(self, color: Single, seen: TrianglesSeen, hit: BoolArray, sample: int) -> None:
        """Write the colours of what is seen into color (4, n)."""
        lit = self.shading.under_suns(seen.triangle, seen.weights, seen.way, sample)
        if hit.all():
            color[:3], color[3] = lit, 1
            return
        np.multiply(lit, hit, out=color[:3])
        color[3] = hit
        for channel in np.flatnonzero(self.background):
            color[channel] += self.background[channel] * ~hit


def _is_alone(lamp: Lamp, scrambled: bool) -> bool:
    """Whether a lamp lights all places alike that a sample sees, wherever they are."""
    alike = not scrambled or bool((lamp.places == lamp.places[:, :1]).all())
    return lamp.light.kind == "SUN" and not lamp.light.casts_shadow and alike
