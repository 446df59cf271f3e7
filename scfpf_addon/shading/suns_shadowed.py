# SPDX-License-Identifier: GPL-3.0-or-later
"""The short way to pictures under suns with shadows, through straight projectors.

Rays are made as in ``suns_alone``; where one hits is solved in float64 on the triangle's plane, so that
shadow rays start as far off it as ever, for what is hit alone: half of the general way's arrays.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..casting.cast import FAR, FARTHEST
from ..casting.hits import CastCounts
from ..casting.scene import CastScene, Float32Array
from ..casting.schedule import scene_reach
from ..casting.straight import EDGE_ON, END_SLACK
from ..casting.triangles_seen import PARALLELOGRAM, FlatRays
from ..projection.reparameterisation import Rectangle
from ..projection.surfaces import BilinearPatch, Plane, Point
from ..projection.typing import Array, IndexArray
from ..projection.volume import Projection
from .hit_colors import Shading
from .lighting import radiance
from .samples import SamplePlaces
from .settings import FrameSettings
from .suns_alone import SunsAlone
from .typing import Single


@dataclass(frozen=True)
class SunsShadowed:
    """What makes such a picture. background: (4,) what hits nothing."""

    places: SamplePlaces
    scene: CastScene
    shading: Shading
    rays: FlatRays
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
        if scene is None or shading is None or any(lamp.light.kind != "SUN" for lamp in shading.lamps):
            return None
        dark = replace(shading, lamps=())
        alone = SunsAlone.of(projection, settings, places, background, scene, dark)
        rays = None if alone is None or places.scrambled else _rays(projection, scene)
        if alone is None or rays is None:
            return None
        return cls(places, scene, shading, rays, alone.colors.background)

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
        plane = self.scene.planes.take(triangle, 1)
        height = np.einsum("cn,cn->n", plane[:3], origins)
        height += plane[3]
        slope = np.einsum("cn,cn->n", plane[:3], ways)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            t = np.divide(height, slope, out=height)
            np.negative(t, out=t)
            lost = np.flatnonzero(~((t > -EDGE_ON) & (t < 1.0 + EDGE_ON)))
        if len(lost):
            limits = np.full(len(lost), 1.0 + END_SLACK, np.float32)
            t[lost] = self.scene.trace_distance(origins[:, lost], ways[:, lost], limits)
            counts.unresolved += len(lost)
        np.clip(t, 0.0, 1.0, out=t)
        position: Array = ways * t
        position += origins
        return position


def _rays(projection: Projection, scene: CastScene) -> FlatRays | None:
    """The rays of the part of a flat volume that the scene is in; None for other volumes."""
    surfaces = projection.volume.surfaces
    if type(projection.reparameterisation) is not Rectangle:
        return None
    if any(type(surface) not in (Point, Plane, BilinearPatch) for surface in surfaces):
        return None
    points, _ = projection.projectors(np.array([0.0, 1, 0, 1]), np.array([0.0, 0, 1, 1]))
    if not np.abs(points).max() < FARTHEST:
        return None
    first, last = scene_reach(projection.volume.spans, points, scene) or (0.0, 1.0)
    way = points[1] - points[0]
    points = np.stack([points[0] + first * way, (last - first) * way])
    twist = points[:, :, 0] - points[:, :, 1] - points[:, :, 2] + points[:, :, 3]
    reach = np.abs(points).max()
    if reach > 2.0 * FAR or np.abs(twist).max() > PARALLELOGRAM * reach:
        return None
    left, right, above, _ = points.transpose(2, 0, 1)
    return FlatRays(0.5 * (left + right), right - left, above - left)
