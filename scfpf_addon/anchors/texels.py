# SPDX-License-Identifier: GPL-3.0-or-later
"""The pixels of an anchor around a point's place, and whether they show the point's surface."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..projection.arrays import product
from ..projection.typing import BoolArray, IndexArray
from ..shading.typing import Single
from .anchor_view import AnchorView, Placed, placed
from .shown_points import ShownPoints

# Weights fall to 0 within this share of the window's shorter side from its border.
BORDER, LEAST_FADE = 0.06, 1e-3
# A pixel of an anchor shows a point's surface if it is within so many of its sides from the point's plane, or
# within this share of the distance, for positions are rounded.
OFF_PLANE, ROUNDED = 0.35, 1e-5
# And not farther from the point than so many of its sides, seen at the surface's slope.
APART, STEEPEST = 2.5, 0.05
# Where no pixel does, those count that are so near to the point that they may show a neighbouring surface.
BESIDE = 1.5
# The nearest pixel counts even if it has no share left.
LEAST_SHARE = 1e-6
# The steps from the lower left one of four pixels to each, across and up.
FOUR = ((0, 0), (1, 0), (0, 1), (1, 1))


class Texels(NamedTuple):
    """Pixels of an anchor that show points (n,).

    first: (n,) int32, the flat index of the lower left one of the four around each. shares: (4, n) float32,
    with the sum 1, or 0 where none shows the point. fade: (n,), from 1 inside to nearly 0 at the border of
    the picture, or of the surface.
    """

    first: NDArray[np.int32]
    shares: Single
    fade: Single


def texels(points: ShownPoints, which: IndexArray, view: AnchorView, beside: bool) -> Texels:
    """Find the pixels of an anchor that show points ``which`` (n,), which are in its window.

    beside: whether pixels count that are near to a point, whatever surface they show.
    """
    anchor = view.anchor
    at = placed(anchor, points.position.take(which, 1))
    # Whole numbers in float32: with integers NumPy would go on in float64. Rounding may have put a place on
    # the border itself.
    column = np.clip(np.floor(at.across), np.float32(0.0), np.float32(anchor.size[0] - 2))
    row = np.clip(np.floor(at.up), np.float32(0.0), np.float32(anchor.size[1] - 2))
    first = row.astype(np.int32) * np.int32(anchor.size[0]) + column.astype(np.int32)
    shares = np.empty((4, len(which)), np.float32)
    surface = _Surface(points, which, view, at)
    right, upper = at.across - column, at.up - row
    for k, (step, step_up) in enumerate(FOUR):
        share = (right if step else 1.0 - right) * (upper if step_up else 1.0 - upper)
        pixel = first + np.int32(step + step_up * anchor.size[0])
        shows = surface.shown_by(pixel, column + np.float32(step), row + np.float32(step_up), beside)
        np.multiply(share + np.float32(LEAST_SHARE), shows, out=shares[k])
    total = shares.sum(axis=0)
    shares /= np.where(total > 0.0, total, np.float32(1.0))
    # Where fewer than four show the surface, its color comes from beside the point.
    return Texels(first, shares, fade_of(at, anchor.size) * np.maximum(total * total, np.float32(LEAST_FADE)))


class _Surface:
    """The planes of points in an anchor's picture."""

    def __init__(self, points: ShownPoints, which: IndexArray, view: AnchorView, at: Placed) -> None:
        self._view, self._at = view, at
        turned = view.anchor.matrix[:3, :3].T
        self._normal = product(turned, points.normal.take(which, 1)).astype(np.float32)
        x, y = at.slope
        cosine = np.abs(self._normal[0] * x + self._normal[1] * y - self._normal[2])
        cosine /= np.sqrt(x * x + y * y + np.float32(1.0))
        self._reach = np.float32(APART) / np.maximum(cosine, np.float32(STEEPEST))
        self._slack = np.float32(OFF_PLANE) + np.float32(ROUNDED) * np.abs(at.depth) / at.side
        self._depth = view.depth.ravel()

    def shown_by(self, pixel: NDArray[np.int32], column: Single, row: Single, beside: bool) -> BoolArray:
        """Return whether pixels show the surfaces of the points, or what is near to these, (n,)."""
        anchor, at = self._view.anchor, self._at
        with np.errstate(invalid="ignore", over="ignore"):
            # Where the pixel's ray meets something, from the point, in sides of a pixel.
            ahead = (self._depth.take(pixel) - at.depth) / at.side
            x, y = column - at.across, row - at.up
            if not anchor.is_parallel:
                texel = np.float32(anchor.texel)
                x += ahead * (np.float32(anchor.window.left) + (column + np.float32(0.5)) * texel)
                y += ahead * (np.float32(anchor.window.bottom) + (row + np.float32(0.5)) * texel)
            square = x * x + y * y + ahead * ahead
            if beside:
                near: BoolArray = square <= np.float32(BESIDE**2)
                return near
            height = np.abs(self._normal[0] * x + self._normal[1] * y - self._normal[2] * ahead)
            shows: BoolArray = (square <= self._reach * self._reach) & (height <= self._slack)
        return shows


def fade_of(at: Placed, size: tuple[int, int]) -> Single:
    """1 inside a window, falling to nearly 0 at its border, (n,)."""
    half = np.float32(0.5)
    inside = np.minimum(at.across + half, size[0] - half - at.across)
    np.minimum(inside, at.up + half, out=inside)
    np.minimum(inside, size[1] - half - at.up, out=inside)
    share = np.clip(inside / np.float32(BORDER * min(size)), 0.0, 1.0)
    fade: Single = np.maximum(share * share * (3.0 - 2.0 * share), np.float32(LEAST_FADE))
    return fade
