# SPDX-License-Identifier: GPL-3.0-or-later
"""The short way to pictures under suns with shadows, through straight projectors.

Rays are made as in ``suns_alone``; where one hits is solved in float64 on the triangle's plane, so that
shadow rays start as far off it as ever, for what is hit alone: half of the general way's arrays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...casting.common.hits import CastCounts
from ...casting.image_bounds import Window
from ...casting.scene.cast_scene import CastScene
from ...casting.straight import END_SLACK, plane_shares
from ...casting.visible_triangles import FlatRays
from ...projection.typing import Array, Float32Array, IndexArray
from ..lights.lighting import radiance
from ..sampling.samples import SamplePlaces
from ..tracing.hit_colors import Shading
from ..typing import Single


@dataclass(frozen=True)
class SunsShadowed:
    """What makes such a picture. window: where rays can meet anything. background: (4,) what hits nothing."""

    places: SamplePlaces
    scene: CastScene
    shading: Shading
    rays: FlatRays
    window: Window
    background: Single

    def sample(self, rows: slice, sample: int, counts: CastCounts, into: Single) -> NDArray[np.int32]:
        """A sample of each pixel of whole rows, written with alpha into (4, n), however that lies in memory.

        What comes back are the triangles (n,) that it sees, -1 for none.
        """
        x, y = self.places.of_grid(rows, sample)
        columns, lines = self.window.held(x, y)
        triangle = np.full((len(y), len(x)), -1, np.int32)
        picture = into.reshape(4, *triangle.shape)
        held = triangle[lines, columns]
        counts.projectors += triangle.size
        if held.size < triangle.size:
            picture[:] = self.background[:, None, None]
        if held.size:
            # Upright: tiles are wider than high, and rays find more of what their neighbours have touched.
            found, color = self._seen(x[columns], y[lines], sample, counts)
            held[:] = found.reshape(held.shape[::-1]).T
            for shown, channel in zip(picture[:, lines, columns], color, strict=True):
                shown[:] = channel.reshape(held.shape[::-1]).T
        return triangle.reshape(-1)

    def _seen(self, x: Array, y: Array, sample: int, counts: CastCounts) -> tuple[NDArray[np.int32], Single]:
        """Triangles (n,), -1 for none, and colours (4, n), column by column; x: of columns, y: of rows."""
        origins, ways = self.rays.made(x, y, upright=True)
        count = origins.shape[1]
        triangle = self.scene.trace(origins, ways, np.full(count, 1.0 + END_SLACK, np.float32))
        counts.rays, counts.chords = counts.rays + count, counts.chords + count
        color = np.empty((4, count), np.float32)
        where = np.flatnonzero(triangle >= 0)
        if len(where) == count:
            color[:3], color[3] = self._lit(triangle, origins, ways, sample, counts), 1
            return triangle, color
        color[:] = self.background[:, None]
        if len(where):
            origins, ways = origins.take(where, axis=1), ways.take(where, axis=1)
            lit = self._lit(triangle.take(where), origins, ways, sample, counts)
            for channel, values in zip(color, (*lit, np.float32(1)), strict=True):
                channel[where] = values
        return triangle, color

    def _lit(
        self, triangle: IndexArray, origins: Float32Array, ways: Float32Array, sample: int, counts: CastCounts
    ) -> Single:
        """The colours (3, n) of what rays from origins along ways (3, n) hit; both are used up."""
        position = self._places(triangle, origins, ways, counts)
        surface = self.shading.surface
        weights = surface.cast_scene.barycentric(position, triangle) if surface.weighted else None
        points = surface.points(triangle, weights, position, ways)
        return radiance(points, self.shading.coefficients, self.shading.lamps, sample, surface.cast_scene)

    def _places(
        self, triangle: IndexArray, origins: Float32Array, ways: Float32Array, counts: CastCounts
    ) -> Array:
        """Where the rays meet the triangles' planes, (3, n) float64."""
        t, lost = plane_shares(self.scene, triangle, origins, ways)
        if len(lost):
            limits = np.full(len(lost), 1.0 + END_SLACK, np.float32)
            t[lost] = self.scene.trace_distance(origins[:, lost], ways[:, lost], limits)
            counts.unresolved += len(lost)
        np.clip(t, 0.0, 1.0, out=t)
        position: Array = ways * t
        position += origins
        return position
