# SPDX-License-Identifier: GPL-3.0-or-later
"""Projection mapping: for each pixel of a video projector the place in a viewer's image that it must show.

A video projector's pixel lights a point of the surfaces. If the viewer sees that point, the pixel shows what
the viewer's image has there.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from ...casting.cast import cast
from ...casting.common.parallel import parallel_map
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, BoolArray, IndexArray
from ...projection.volume.inverse import follow, invert
from ...projection.volume.viewing_volume import Projection
from .find import HIDING_STEP
from .pick import PIXEL_ERROR

# Pixels along a side of the tiles that are worked on together, and between the samples whose points are
# looked for in the viewer's whole volume. Those of the other pixels are near to samples at most a tile away.
TILE, STRIDE = 64, 8
# Places this far outside of an image count as in it: rounding errors.
BORDER = 1e-9


class SeenPlaces(NamedTuple):
    """Places of N points in an image. x, y: (N,) in [0, 1], 0 where shown (N,) bool is False."""

    x: Array
    y: Array
    shown: BoolArray


def video_projector_map(
    scene: CastScene,
    device: Projection,
    viewer: Projection,
    size: tuple[int, int],
    pixel: tuple[float, float],
) -> tuple[Array, BoolArray]:
    """The places in the viewer's image, (H, W, 2), of a video projector's pixels, and which have one, (H, W).

    Row 0 is at the bottom. scene: the surfaces that are lit, in world space. device: the video projector as a
    camera. Both projections are in world space. size: the device's width and height in pixels. pixel: width
    and height of a pixel of the viewer's image, as shares of it. Raises CastError.
    """
    width, height = size
    places, shown = np.zeros((height, width, 2)), np.zeros((height, width), bool)
    lighting = device.transformed(scene.matrix)

    def lit(rows: IndexArray, columns: IndexArray) -> tuple[IndexArray, Array]:
        """Which of N pixels light a surface, (n,), and the points that they light, (3, n)."""
        x, y = (columns + 0.5) / width, (rows + 0.5) / height
        hits = cast(scene, lighting, x, y, (1 / width, 1 / height), PIXEL_ERROR)
        which = np.flatnonzero(hits.mask & (hits.triangle >= 0))
        return which, hits.position.take(which, 1) / scene.scale + scene.centre[:, None]

    samples = _samples(viewer, lit, size)
    corners = [(row, column) for row in range(0, height, TILE) for column in range(0, width, TILE)]

    def work(part: slice) -> None:
        for row, column in corners[part]:
            block = np.s_[row : min(row + TILE, height), column : min(column + TILE, width)]
            rows, columns = (axis.ravel() for axis in np.mgrid[block])
            near = samples.about(row, column)
            if not near.points.size:
                continue
            which, points = lit(rows, columns)
            if not len(which):
                continue
            found = seen_places(scene, viewer, points, pixel, near)
            places[rows[which], columns[which]] = np.stack([found.x, found.y], axis=1)
            shown[rows[which], columns[which]] = found.shown

    parallel_map(work, [slice(number, number + 1) for number in range(len(corners))])
    return places, shown


class Samples(NamedTuple):
    """Points in a viewer's volume.

    pixel: (2, K), row and column of the video projector's pixel. points: (3, K). parameters: (3, K), u, v, t.
    """

    pixel: IndexArray
    points: Array
    parameters: Array

    def about(self, row: int, column: int) -> Samples:
        """The samples at most a tile away from the tile that begins at a row and column."""
        first = np.array([[row], [column]])
        inside = ((self.pixel >= first - TILE) & (self.pixel < first + 2 * TILE)).all(axis=0)
        return Samples._make(each[:, inside] for each in self)


def _samples(
    viewer: Projection,
    lit: Callable[[IndexArray, IndexArray], tuple[IndexArray, Array]],
    size: tuple[int, int],
) -> Samples:
    """The points that every so many of a video projector's pixels light in a viewer's volume."""
    parts = [Samples(np.zeros((2, 0), np.int64), np.zeros((3, 0)), np.zeros((3, 0)))]
    for row in range(0, size[1], STRIDE):
        columns = np.arange(0, size[0], STRIDE)
        which, points = lit(np.full_like(columns, row), columns)
        parameters = _parameters(viewer, points, None)
        found = np.isfinite(parameters[2])
        pixel = np.stack([np.full(len(which), row), columns[which]])
        parts.append(Samples(pixel[:, found], points[:, found], parameters[:, found]))
    return Samples._make(np.concatenate(each, axis=1) for each in zip(*parts, strict=True))


def seen_places(
    scene: CastScene,
    viewer: Projection,
    points: Array,
    pixel: tuple[float, float],
    near: Samples | None = None,
    visible_only: bool = True,
) -> SeenPlaces:
    """The places in a viewer's image of points (3, N) on a scene's surfaces, without hidden ones.

    pixel: see ``video_projector_map``. near: samples of which one is near each point; None to look in the
    whole volume. visible_only: False for hidden points as well. Raises CastError.
    """
    u, v, t = _parameters(viewer, points, near)
    found = np.isfinite(t)
    (u0, u1), (v0, v1) = viewer.u_range, viewer.v_range
    x, y = viewer.reparameterisation.image_positions(
        (u - u0) / (u1 - u0), (v - v0) / (v1 - v0), viewer.aspect
    )
    with np.errstate(invalid="ignore"):
        found &= (np.abs(x - 0.5) <= 0.5 + BORDER) & (np.abs(y - 0.5) <= 0.5 + BORDER)
    which = np.flatnonzero(found)
    if visible_only and len(which):
        across, up = (np.clip(axis[which], 0.0, 1.0) for axis in (x, y))
        hits = cast(scene, viewer.transformed(scene.matrix), across, up, pixel, PIXEL_ERROR)
        found[which] = hits.mask & (hits.t >= t[which] - HIDING_STEP)
    return SeenPlaces(np.where(found, x, 0.0), np.where(found, y, 0.0), found)


def _parameters(viewer: Projection, points: Array, near: Samples | None) -> Array:
    """The parameters (u, v, t) of points in a volume, (3, N), NaN for those outside; see ``seen_places``."""
    ranges = viewer.u_range, viewer.v_range
    if near is None:
        return np.stack(invert(viewer.volume, points, *ranges)[:3])
    start = near.parameters[:, _nearest(near.points, points)]
    found = follow(viewer.volume, points, start, *ranges)
    inside = found.found & (found.t >= 0.0) & (found.t <= 1.0)
    return np.where(inside, np.stack(found[:3]), np.nan)


def _nearest(known: Array, points: Array) -> IndexArray:
    """The number of the nearest of a few known points (3, K) for each of points (3, N)."""
    off = np.square(known).sum(axis=0)[:, None] - 2 * known.T @ points
    return np.argmin(off, axis=0)


def sampled(image: Array, places: Array, shown: BoolArray) -> Array:
    """An image (h, w, C) at places (H, W, 2) in [0, 1], bilinear, (H, W, C); 0 where nothing is shown."""
    height, width = image.shape[:2]
    across, up = places[..., 0] * width - 0.5, places[..., 1] * height - 0.5
    column = np.clip(np.floor(across).astype(np.int64), 0, max(width - 2, 0))
    row = np.clip(np.floor(up).astype(np.int64), 0, max(height - 2, 0))
    a = np.clip(across - column, 0.0, 1.0)[..., None]
    b = np.clip(up - row, 0.0, 1.0)[..., None]
    right, above = np.minimum(column + 1, width - 1), np.minimum(row + 1, height - 1)
    below = image[row, column] * (1 - a) + image[row, right] * a
    over = image[above, column] * (1 - a) + image[above, right] * a
    return np.where(shown[..., None], below * (1 - b) + over * b, 0.0)
