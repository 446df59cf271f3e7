# SPDX-License-Identifier: GPL-3.0-or-later
"""Maps of a blend: where in the image one of several blended projections counts, and how much.

A projection's weight at a position is its strength times the value of its map there, see ``normalised``.
Distances are shares of the image's width. A border of width w goes from 0 to 1 as the cubic 3p² - 2p³.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..typing import Array

MapKind = Literal["LINEAR", "RADIAL", "RECTANGLE", "IMAGE", "VIEWS"]


@dataclass(frozen=True)
class BlendMap:
    """The map of a blended projection: values in [0, 1] over an image.

    kind: LINEAR, 1 beyond a line through the centre; RADIAL, 1 within a circle; RECTANGLE, 1 within a turned
    rectangle; IMAGE, that of pixels; VIEWS, 1 within each of several circles. centre: (2,) shares of the
    image's width and height, from its lower left. size: (2,) shares of the image's width and height, of the
    rectangle; the first is the circle's diameter. angle: radians counterclockwise; that of the direction in
    which a linear map grows, or of the rectangle. border: width of the transition, half of it inside; with
    VIEWS all of it is outside. pixels: (H, W) in [0, 1], row 0 at the bottom. is_sharp: whether pixels count
    as 1 from a half on, and as 0 below. is_inverted: whether 0 and 1 change places. circles: at least one for
    VIEWS: the centre, as ``centre``, and the diameter.
    """

    kind: MapKind
    centre: tuple[float, float] = (0.5, 0.5)
    size: tuple[float, float] = (0.5, 0.5)
    angle: float = 0.0
    border: float = 0.2
    pixels: Array | None = None
    is_sharp: bool = False
    is_inverted: bool = False
    circles: tuple[tuple[float, float, float], ...] = ()

    def values(self, x: Array, y: Array, aspect: float) -> Array:
        """The values at image positions x, y in [0, 1], (N,). aspect: width over height of the image."""
        if self.kind == "IMAGE":
            found = self._painted(x, y)
            found = np.heaviside(found - 0.5, 0.5) if self.is_sharp else found
        else:
            found = self._smooth(self._inside(x, y, aspect))
        return 1.0 - found if self.is_inverted else found

    def _painted(self, x: Array, y: Array) -> Array:
        return np.zeros(np.shape(x)) if self.pixels is None else bilinear(self.pixels, x, y)

    def _smooth(self, inside: Array) -> Array:
        if self.border <= 0.0:
            step: Array = np.heaviside(inside, 0.5)
            return step
        share: Array = np.clip(0.5 + inside / self.border, 0.0, 1.0)
        return share * share * (3.0 - 2.0 * share)

    @property
    def has_seam(self) -> bool:
        """Return whether the map goes from 0 to 1 along a curve, without a border."""
        return self.is_sharp if self.kind == "IMAGE" else self.border <= 0.0

    def levels(self, x: Array, y: Array, aspect: float) -> Array:
        """Signed distances (K, N) of positions from the map's lines: all are positive where it is 1.

        x, y: (N,) image positions. aspect: width over height of the image. Of pixels the level is no
        distance, but their value less a half.
        """
        if self.kind == "IMAGE":
            return self._painted(x, y)[None] - 0.5
        if self.kind == "VIEWS":
            within = [
                0.5 * (wide + max(self.border, 0.0)) - np.hypot(x - left, (y - low) / aspect)
                for left, low, wide in self.circles
            ]
            nearest: Array = np.max(within, axis=0)
            return nearest[None]
        across, up = x - self.centre[0], (y - self.centre[1]) / aspect
        cosine, sine = np.cos(self.angle), np.sin(self.angle)
        along: Array = cosine * across + sine * up
        if self.kind == "LINEAR":
            return along[None]
        if self.kind == "RADIAL":
            inside: Array = 0.5 * self.size[0] - np.hypot(across, up)
            return inside[None]
        beside = cosine * up - sine * across
        wide, high = 0.5 * self.size[0], 0.5 * self.size[1] / aspect
        return np.stack([wide - along, wide + along, high - beside, high + beside])

    def _inside(self, x: Array, y: Array, aspect: float) -> Array:
        """The distances (N,) by which positions are inside."""
        levels = self.levels(x, y, aspect)
        if len(levels) == 1:
            only: Array = levels[0]
            return only
        # The signed distance of a rectangle: the length of what is beyond both sides, or the nearer side's.
        off = np.stack([-levels[:2].min(axis=0), -levels[2:].min(axis=0)])
        signed: Array = -np.hypot(*np.maximum(off, 0.0)) - np.minimum(off.max(axis=0), 0.0)
        return signed


def normalised(weights: Array) -> Array:
    """Weights (K, N) of projections blended with another one, divided by their sum where that is above 1.

    The other projection has the rest, so that all weights add up to 1.
    """
    shares: Array = weights / np.maximum(weights.sum(axis=0), 1.0)
    return shares


def bilinear(pixels: Array, x: Array, y: Array) -> Array:
    """Pixels (H, W) at image positions in [0, 1], (N,): bilinear between their middles, constant beyond."""
    height, width = pixels.shape
    column = np.clip(x * width - 0.5, 0.0, width - 1.0)
    row = np.clip(y * height - 0.5, 0.0, height - 1.0)
    left, low = np.floor(column).astype(np.int64), np.floor(row).astype(np.int64)
    right, high = np.minimum(left + 1, width - 1), np.minimum(low + 1, height - 1)
    a, b = column - left, row - low
    below = (1.0 - a) * pixels[low, left] + a * pixels[low, right]
    above = (1.0 - a) * pixels[high, left] + a * pixels[high, right]
    found: Array = (1.0 - b) * below + b * above
    return found
