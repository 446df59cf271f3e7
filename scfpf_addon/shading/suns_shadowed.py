# SPDX-License-Identifier: GPL-3.0-or-later
"""The short way to pictures under suns with shadows, through straight projectors.

Rays are made as in ``suns_alone``; where one hits is solved in float64 on the triangle's plane, so that
shadow rays start as far off it as ever, for what is hit alone: half of the general way's arrays.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..casting.hits import CastCounts
from ..casting.scene import CastScene, Float32Array
from ..casting.straight import END_SLACK, plane_shares
from ..casting.triangles_seen import FlatRays
from ..projection.typing import Array, IndexArray
from .hit_colors import Shading
from .lighting import radiance
from .samples import SamplePlaces
from .typing import Single


@dataclass(frozen=True)
class SunsShadowed:
    """What makes such a picture. background: (4,) what hits nothing."""

    places: SamplePlaces
    scene: CastScene
    shading: Shading
    rays: FlatRays
    background: Single

    def sample(self, rows: slice, sample: int, counts: CastCounts, into: Single) -> NDArray[np.int32]:
        """A sample of each pixel of whole rows, written with alpha into (4, n), however that lies in memory.

        What comes back are the triangles (n,) that it sees, -1 for none.
        """
        origins, ways = self.rays.made(*self.places.of_grid(rows, sample))
        count = origins.shape[1]
        triangle = self.scene.trace(origins, ways, np.full(count, 1.0 + END_SLACK, np.float32))
        counts.projectors, counts.rays = counts.projectors + count, counts.rays + count
        counts.chords += count
        into[:] = self.background[:, None]
        where = np.flatnonzero(triangle >= 0)
        if len(where):
            origins, ways = origins.take(where, axis=1), ways.take(where, axis=1)
            lit = self._lit(triangle.take(where), origins, ways, sample, counts)
            for channel, values in zip(into, (*lit, np.float32(1)), strict=True):
                channel[where] = values
        return triangle

    def _lit(
        self, triangle: IndexArray, origins: Float32Array, ways: Float32Array, sample: int, counts: CastCounts
    ) -> Single:
        """The colours (3, n) of what rays from origins along ways (3, n) hit; both are used up."""
        position = self._places(triangle, origins, ways, counts)
        surface = self.shading.surface
        weights = surface.cast_scene.barycentric(position, triangle) if surface.weighted else None
        points = surface.points(triangle, weights, position, ways)
        return radiance(points, self.shading.phong, self.shading.lamps, sample, surface.cast_scene)

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
