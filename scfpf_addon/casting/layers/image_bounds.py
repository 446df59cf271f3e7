# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of an image in which straight projectors can meet some things, found once for all of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np

from ...projection.surfaces.surface import Plane, Point
from ...projection.typing import Array, BoolArray
from ...projection.volume.reparameterisation import Framed, Reparameterisation, Unrolled
from ...projection.volume.viewing_volume import Projection
from ..scene.occupancy import SLACK

# Parameters of a surface's corner and of the two beside it.
CORNERS = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
# Both ends of a volume count as alike if they differ by less than this share of the larger one: control
# surfaces are often float32.
ALIKE = 2.0**-18


@dataclass(frozen=True)
class ImageBounds:
    """An octagon of the image: slabs low <= DIRECTIONS @ (x, y) <= high, (4,) each.

    directions: (4, 2), of which the first two are the axes of the image.
    """

    directions: Array
    low: Array
    high: Array

    @classmethod
    def around(cls, projection: Projection, points: Array) -> Self | None:
        """The bounds of the image positions whose projectors can meet the hull of points (3, N), N > 0.

        None if they are not known: for projectors that are curved, or neither parallel nor through one point,
        for a mapping of the image, and for points beside or behind the point of view. All is in cast space.
        """
        mappings = _frames(projection.reparameterisation)
        found = None if mappings is None else _parameters(projection, points)
        if mappings is None or found is None:
            return None
        place, margin = found
        low, extent = (np.array(each)[:, None] for each in zip(*_ranges(projection), strict=True))
        ends = [(place + side * margin - low) / extent for side in (-1.0, 1.0)]
        for mapping in reversed(mappings):
            ends = [np.stack(mapping.image_positions(end[0], end[1], projection.aspect)) for end in ends]
        middle, half = (ends[0] + ends[1]) / 2.0, np.abs(ends[1] - ends[0]) / 2.0
        size = (middle + half).max(axis=1) - (middle - half).min(axis=1) + SLACK
        if not np.isfinite(size).all():
            return None
        across, up = 1.0 / size
        directions = np.array([[1.0, 0.0], [0.0, 1.0], [across, up], [across, -up]])
        heights, reach = directions @ middle, np.abs(directions) @ half
        slack = SLACK * np.abs(directions).sum(axis=1)
        return cls(directions, (heights - reach).min(axis=1) - slack, (heights + reach).max(axis=1) + slack)

    def hold(self, x: Array, y: Array) -> BoolArray:
        """Return whether image positions (N,) are inside, (N,)."""
        inside: BoolArray = (
            (x >= self.low[0]) & (x <= self.high[0]) & (y >= self.low[1]) & (y <= self.high[1])
        )
        which = np.flatnonzero(inside)
        if len(which):
            sloped = self.directions[2:] @ np.stack([x.take(which), y.take(which)])
            kept = (sloped >= self.low[2:, None]) & (sloped <= self.high[2:, None])
            inside[which] = kept.all(axis=0)
        return inside


def _frames(image: Reparameterisation) -> tuple[Framed, ...] | None:
    """The frames in which an image shows the rectangle of its volume; None if it is not one."""
    mappings, base = getattr(image, "mappings", ()), getattr(image, "base", image)
    if type(base) is not Unrolled or any(type(each) is not Framed for each in mappings):
        return None
    return tuple(mappings)


def _parameters(projection: Projection, points: Array) -> tuple[Array, Array] | None:
    """The parameters (2, N) of projectors through points (3, N), and how far they may be off, (2, N)."""
    volume = projection.volume
    if not volume.spans.is_straight or any(type(each) not in (Plane, Point) for each in volume.surfaces):
        return None
    near, far = (surface.positions(*CORNERS).position for surface in volume.surfaces)
    first, last = near[:, 1:] - near[:, :1], far[:, 1:] - far[:, :1]
    # The larger end's sides are those of both, the other's are ``share`` times as long.
    is_far = bool((last**2).sum() >= (first**2).sum())
    sides, others = (last, first) if is_far else (first, last)
    square = float((sides**2).sum())
    if not 0.0 < square < np.inf:
        return None
    share = float((sides * others).sum()) / square
    off = np.abs(others - share * sides).max()
    normal, way = np.cross(*sides.T), far[:, 0] - near[:, 0]
    depth = float(normal @ way)
    if off > ALIKE * np.sqrt(square) or share < 0.0 or depth == 0.0:
        return None
    t = (normal @ (points - near[:, :1])) / depth
    scale = (1.0 - t) * (share if is_far else 1.0) + t * (1.0 if is_far else share)
    if not scale.min() > 0.0:
        return None
    inverse = np.linalg.pinv(sides)
    place = inverse @ (points - near[:, :1] - way[:, None] * t) / scale
    farthest = max(np.abs(near).max(), np.abs(far).max())
    # Rays are off by roundings of float32, and ends that are not quite alike by ``off``, also along t.
    shift = SLACK * (1.0 + farthest) + 2.0 * off
    along = (np.linalg.norm(way) + np.abs(sides).sum()) * np.linalg.norm(normal) / abs(depth)
    return place, np.abs(inverse).sum(axis=1)[:, None] * (2.0 * shift * (1.0 + along)) / scale


def _ranges(projection: Projection) -> tuple[tuple[float, float], ...]:
    """The start and the length of the range of u, and of that of v, in the image."""
    return tuple((low, high - low) for low, high in (projection.u_range, projection.v_range))
