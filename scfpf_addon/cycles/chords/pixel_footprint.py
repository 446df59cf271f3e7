# SPDX-License-Identifier: GPL-3.0-or-later
"""By how many pixels what a projector sees moves when the projector moves across itself.

A pixel may be far wider than high, there in space: what counts is the way that the projector strays, where
the caster's tiles, for speed, take all ways for the narrow one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...casting.curves.schedule import FINEST, MOST_SQUEEZE, Curves, pixel_widths
from ...projection.typing import Array
from ...projection.volume.basis import SpanBasis

# Smaller pixel errors than this are beyond the float32 of Cycles and count as this.
SMALLEST_ERROR = 0.01

# The least length that is still above nought when it is squared.
LEAST_LENGTH = float(np.sqrt(np.finfo(np.float64).tiny))


class Pixels(NamedTuple):
    """Pixels in space at G places of S projectors.

    position, tangent, bend: (3, G, S), Q and its derivatives in the span. across: (3, G, S), the direction in
    which pixels are widest, across the projector. wide, narrow: (G, S), how wide they are that way and the
    other.
    """

    position: Array
    tangent: Array
    bend: Array
    across: Array
    wide: Array
    narrow: Array

    def moved(self, offset: Array) -> Array:
        """How many pixels ways in space (3, G, S) are: (G, S). What is along the projector is none."""
        offset = without(offset, self.tangent)
        along = (offset * self.across).sum(axis=0)
        rest = np.maximum((offset**2).sum(axis=0) - along**2, 0.0)
        moved: Array = np.sqrt((along / self.wide) ** 2 + rest / self.narrow**2)
        return moved


def blend(weights: Array, points: Array) -> Array:
    """Sums of points (K, 3, S) by weights (G, K): (3, G, S)."""
    sums: Array = (weights @ points.reshape(len(points), -1)).reshape(-1, *points.shape[1:])
    return sums.swapaxes(0, 1)


def without(vector: Array, tangent: Array) -> Array:
    """What of vectors is across tangents; where a tangent vanishes there is no across, and all counts."""
    squared = (tangent**2).sum(axis=0)
    inverse = np.divide(1.0, squared, out=np.zeros_like(squared), where=squared > 0.0)
    across: Array = vector - tangent * ((vector * tangent).sum(axis=0) * inverse)
    return across


def pixels(curves: Curves, spans: SpanBasis, span: int, local: Array) -> Pixels:
    """The pixels of projectors ``curves`` at ``local`` (G,) in a span."""
    here, slope, second = spans.within(span, local)
    position, dx, dy = (blend(here, c) for c in curves)
    tangent, bend = (blend(weights, curves.points) for weights in (slope, second))
    dx, dy = without(dx, tangent), without(dy, tangent)
    xx, yy, xy = (dx * dx).sum(axis=0), (dy * dy).sum(axis=0), (dx * dy).sum(axis=0)
    wide, narrow = pixel_widths(xx, yy, xy)
    # The way on the picture that is widest in space, from the larger of two equal expressions.
    flat = xx >= yy
    a, b = np.where(flat, wide - yy, xy), np.where(flat, xy, wide - xx)
    across = dx * a + dy * b
    length = np.sqrt((across**2).sum(axis=0))
    across = np.divide(across, length, out=np.zeros_like(across), where=length > 0.0)
    # Less than float32 can tell counts as nothing, and where pixels are squeezed the narrow way counts less.
    least = (FINEST * np.abs(position).max(axis=0) + LEAST_LENGTH) / SMALLEST_ERROR
    wide = np.sqrt(wide)
    narrow = np.maximum(np.maximum(np.sqrt(narrow), wide / MOST_SQUEEZE), least)
    return Pixels(position, tangent, bend, across, np.maximum(wide, least), narrow)
