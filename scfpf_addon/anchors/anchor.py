# SPDX-License-Identifier: GPL-3.0-or-later
"""An anchor: an ordinary camera, as numbers."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..projection.arrays import transform
from ..projection.typing import Array, BoolArray, IndexArray

# A near plane is this share of the distance before a box.
STEP_BACK = 0.01


class Window(NamedTuple):
    """A rectangle across an anchor's view: at distance 1 before the eye, or in world units if rays are
    parallel."""

    left: float
    bottom: float
    right: float
    top: float

    @property
    def extent(self) -> Array:
        """Width and height, (2,)."""
        return np.array([self.right - self.left, self.top - self.bottom])


class AnchorPlaces(NamedTuple):
    """The places of N points in an anchor's picture.

    across, up: (N,), in pixels from the lower left corner of its picture; the first pixel's centre is at 0.5.
    depth: (N,), distances along the axis.
    """

    across: Array
    up: Array
    depth: Array


@dataclass(frozen=True)
class Anchor:
    """A camera that sees a part of what an image shows.

    matrix: (4, 4), its axes (right, up, back) and its place in the world, without scale. size: of its
    picture in pixels, which are square. start, end: the distances along the axis between which things are
    rendered.
    """

    matrix: Array
    window: Window
    size: tuple[int, int]
    start: float
    end: float
    is_parallel: bool = False

    @property
    def eye(self) -> Array:
        """The place of the camera, (3,)."""
        place: Array = self.matrix[:3, 3]
        return place

    @property
    def texel(self) -> float:
        """The side of a pixel in the window."""
        return float(self.window.extent[0] / self.size[0])

    @property
    def count(self) -> int:
        """The number of pixels."""
        return self.size[0] * self.size[1]

    def places(self, points: Array) -> AnchorPlaces:
        """Return the places of world points (3, N); points at or behind the eye have a depth of 0 or less."""
        turned = self.matrix[:3, :3].T
        across, up, back = transform(turned, points, -turned @ self.eye)
        depth = -back
        if not self.is_parallel:
            ahead = np.where(depth > 0.0, depth, np.inf)
            across, up = across / ahead, up / ahead
        return AnchorPlaces(
            (across - self.window.left) / self.texel, (up - self.window.bottom) / self.texel, depth
        )

    def holds(self, places: AnchorPlaces) -> BoolArray:
        """Return whether places are in the picture, with all four pixels around them, (N,)."""
        width, height = self.size
        inside: BoolArray = (places.across >= 0.5) & (places.across < width - 0.5)
        inside &= (places.up >= 0.5) & (places.up < height - 0.5)
        return inside & (places.depth > self.start) & (places.depth < self.end)

    def directions(self, points: Array) -> Array:
        """Unit directions (3, N) in which the anchor sees world points (3, N)."""
        if self.is_parallel:
            return np.broadcast_to(-self.matrix[:3, 2:3], points.shape)
        way = points - self.eye[:, None]
        directions: Array = way / np.maximum(np.linalg.norm(way, axis=0), np.finfo(np.float64).tiny)
        return directions

    def lengths(self, depth: Array) -> Array:
        """The lengths (N,) of a pixel's side at distances (N,) along the axis, in world units."""
        return np.full(len(depth), self.texel) if self.is_parallel else self.texel * depth

    def rays(self, column: Array | IndexArray, row: Array | IndexArray) -> tuple[Array, Array]:
        """Rays through the centres of pixels (N,) each: points (3, N) at ``start``, and ways (3, N) by which
        the distance along the axis grows by 1."""
        across = self.window.left + (column + 0.5) * self.texel
        up = self.window.bottom + (row + 0.5) * self.texel
        axes, ones = self.matrix[:3, :3], np.ones(len(across))
        if self.is_parallel:
            way = np.broadcast_to(-axes[:, 2:3], (3, len(across)))
            begin = transform(axes, np.stack([across, up, -self.start * ones]), self.eye)
            return begin, way
        way = transform(axes, np.stack([across, up, -ones]))
        return self.eye[:, None] + way * self.start, way

    def cuts(self, boxes: Array) -> BoolArray:
        """Return which boxes, corners (K, 8, 3), the near plane cuts that reach into the view, (K,)."""
        places = self.places(boxes.reshape(-1, 3).T)
        across, up, depth = (each.reshape(-1, 8) for each in places)
        within: BoolArray = (depth.min(axis=1) < self.start) & (depth.max(axis=1) > self.start)
        if self.is_parallel:
            for place, side in ((across, self.size[0]), (up, self.size[1])):
                within &= (place.max(axis=1) > 0.0) & (place.min(axis=1) < side)
        return within

    def before(self, boxes: Array) -> Anchor:
        """The anchor with a near plane before boxes (K, 8, 3) that it cuts, as far as its eye is."""
        anchor = self
        for _ in boxes:
            which = anchor.cuts(boxes)
            depth = anchor.places(boxes[which].reshape(-1, 3).T).depth
            if anchor.is_parallel and len(depth):
                # The camera stands farther back.
                step = (anchor.start - float(depth.min())) * (1.0 + STEP_BACK)
                matrix = anchor.matrix.copy()
                matrix[:3, 3] += step * matrix[:3, 2]
                anchor = replace(anchor, matrix=matrix, end=anchor.end + step)
                continue
            depth = depth.reshape(-1, 8).min(axis=1)
            depth = depth[depth > 0.0]
            if not len(depth):
                break
            anchor = replace(anchor, start=float(depth.min()) * (1.0 - STEP_BACK))
        return anchor
