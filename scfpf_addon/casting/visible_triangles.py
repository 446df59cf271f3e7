# SPDX-License-Identifier: GPL-3.0-or-later
"""Which triangles straight projectors meet first, as Embree has it: neither t nor position.

That is all that a picture needs whose light comes from directions alone. Everything
here is float32; ``cast.cast`` solves the same hits in float64.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from ..projection.surfaces.surface import BilinearPatch, Plane, Point
from ..projection.typing import Array, BoolArray, Float32Array
from ..projection.volume.reparameterisation import Rectangle
from ..projection.volume.viewing_volume import Projection
from .cast import FAR, FARTHEST, usable_projectors
from .common.hits import CastCounts
from .curves.schedule import scene_reach
from .image_bounds import Window, window_round
from .scene.cast_scene import CastScene
from .straight import END_SLACK, OFF_VERTICES, float32_rays

# Corners this close to a parallelogram's, as a share of the largest coordinate, make one: it is
# far below what float32 tells apart.
PARALLELOGRAM = 1e-9

# Long volumes are clipped so often at most, each time to a sixty-fourth of their length at best.
CLIPPED = 2


class TrianglesSeen(NamedTuple):
    """What N straight projectors meet first, in cast space.

    triangle: (N,) int32, -1 for none. weights: of its second and third corner, each (N,), anything
    on a miss; None where they were not asked for. way: (3, N) along the projectors, of any length.
    mask: (N,) False where there is no projector; None where there is one everywhere.
    """

    triangle: NDArray[np.int32]
    weights: tuple[Float32Array, Float32Array] | None
    way: Float32Array
    mask: BoolArray | None

    def part(self, which: slice) -> TrianglesSeen:
        """Some of the projectors."""
        weights = None if self.weights is None else (self.weights[0][which], self.weights[1][which])
        mask = None if self.mask is None else self.mask[which]
        return TrianglesSeen(self.triangle[which], weights, self.way[:, which], mask)


@dataclass(frozen=True)
class FlatRays:
    """Rays between two flat control surfaces: sums of a part by row and a part by column.

    middle, across, up: (2, 3) float64 of where they begin and of their way: the value in the middle of
    the image's lower border, what is added across the image, and what is added up it.
    """

    middle: Array
    across: Array
    up: Array

    @classmethod
    def of(cls, projection: Projection, scene: CastScene) -> Self | None:
        """None for other volumes, and for those that reach far beyond the scene.

        Of those that only begin far before it or end far behind it: what lies about the scene.
        """
        volume = projection.volume
        if type(projection) is not Projection or type(projection.reparameterisation) is not Rectangle:
            return None
        if any(type(surface) not in (Point, Plane, BilinearPatch) for surface in volume.surfaces):
            return None
        points, _ = projection.projectors(np.array([0.0, 1, 0, 1]), np.array([0.0, 0, 1, 1]))
        if not np.abs(points).max() < FARTHEST:
            return None
        for _ in range(CLIPPED):
            found = scene_reach(volume.spans, points, scene)
            if np.abs(points).max() <= FAR or found is None:
                break
            first, last = found
            way = points[1] - points[0]
            points = np.stack([points[0] + first * way, points[0] + last * way])
        reach = np.abs(points).max()
        twist = points[:, :, 0] - points[:, :, 1] - points[:, :, 2] + points[:, :, 3]
        if reach > 2.0 * FAR or np.abs(twist).max() > PARALLELOGRAM * reach:
            return None
        points[1] -= points[0]
        left, right, above, _ = points.transpose(2, 0, 1)
        return cls(0.5 * (left + right), right - left, above - left)

    def window(self, scene: CastScene) -> Window:
        """Where in the picture these rays can meet anything."""
        corner = self.middle - 0.5 * self.across
        return window_round(corner, self.across, self.up, scene.lower, scene.upper)

    def made(self, x: Array, y: Array, upright: bool = False) -> tuple[Float32Array, Float32Array]:
        """Origins and directions (3, rows · columns); x: (columns,), y: (rows,) in [0, 1].

        Row by row; upright: column by column.
        """
        column = (self.across[:, :, None] * (x - 0.5)).astype(np.float32)
        height = self.up[:, :, None] * y
        height += self.middle[:, :, None]
        height[0] += OFF_VERTICES
        row = height.astype(np.float32)
        if upright:
            shape, column, row = (len(x), len(y)), column[..., None], row[..., None, :]
        else:
            shape, column, row = (len(y), len(x)), column[..., None, :], row[..., None]
        rays = np.empty((2, 3, *shape), np.float32)
        for each in np.ndindex(2, 3):
            if self.across[each]:
                np.add(row[each], column[each], out=rays[each])
            else:
                rays[each] = row[each]
        origins, directions = rays.reshape(2, 3, -1)
        return origins, directions


def see_rows(
    scene: CastScene, rays: FlatRays, x: Array, y: Array, counts: CastCounts, weighted: bool
) -> TrianglesSeen:
    """What is met through the image positions of all columns x (W,) in all rows y (R,), row by row."""
    origins, directions = rays.made(x, y)
    limits = np.full(origins.shape[1], 1.0 + END_SLACK, np.float32)
    return _seen(scene, (origins, directions, limits), None, counts, weighted)


def see(
    scene: CastScene, projection: Projection, x: Array, y: Array, counts: CastCounts, weighted: bool
) -> TrianglesSeen:
    """What is met through image positions x, y (N,) by a projection of two surfaces, in cast space."""
    points, mask, farthest = usable_projectors(projection, x, y)
    reach = None if farthest <= FAR else scene_reach(projection.volume.spans, points, scene)
    rays = float32_rays(points[0], points[1] - points[0], mask, reach or (0.0, 1.0))
    return _seen(scene, rays, None if mask.all() else mask, counts, weighted)


def _seen(
    scene: CastScene,
    rays: tuple[Float32Array, Float32Array, Float32Array],
    mask: BoolArray | None,
    counts: CastCounts,
    weighted: bool,
) -> TrianglesSeen:
    count = len(rays[2]) if mask is None else int(np.count_nonzero(mask))
    counts.projectors, counts.rays = counts.projectors + count, counts.rays + count
    counts.chords += count
    if not weighted:
        return TrianglesSeen(scene.trace(*rays), None, rays[1], mask)
    triangle, weights = scene.trace_weights(*rays)
    return TrianglesSeen(triangle, weights, rays[1], mask)
