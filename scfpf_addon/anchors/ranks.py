# SPDX-License-Identifier: GPL-3.0-or-later
"""The order in which anchors are asked for a point's colour.

A rank is a whole number: the penalty of an anchor in steps of STEP radians, and the anchor's number in the
last bits. Penalties are the angle between ray and projector, and more where the anchor's pixels are large.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..casting.common.cancellation import raise_if_cancelled
from ..projection.typing import Array, BoolArray, IndexArray
from ..shading.typing import Single
from .anchor import Anchor
from .anchor_view import AnchorView, placed
from .shown_points import ShownPoints

# An anchor whose pixels are as large as the image's counts as much worse as one whose ray is so far off.
COARSE_ANGLE = float(np.radians(10.0))
# The least cosine between an anchor's ray and a normal.
LEAST_COSINE = 0.02
# Points that are tested against an anchor's window at once, by the sphere around them.
RUN = 64
NUMBER_BITS = 10
MOST_ANCHORS = (1 << NUMBER_BITS) - 1
STEP = 64.0 / (1 << (32 - NUMBER_BITS))
ONE = np.uint32(1)
NO_RANK = np.uint32(0xFFFFFFFF)

Ranks = NDArray[np.uint32]


def penalties_of(ranks: Ranks) -> Single:
    """The penalties of ranks, radians, inf for none."""
    found = (ranks >> np.uint32(NUMBER_BITS)).astype(np.float32) * np.float32(STEP)
    found[ranks == NO_RANK] = np.inf
    return found


def ranked(points: ShownPoints, views: Sequence[AnchorView], after: Ranks, places: int) -> list[Ranks]:
    """The ranks (N,) of the best anchors, as many as ``places``, that may show points (N,).

    after: (N,), ranks up to which anchors have been asked.
    """
    count = len(points.number)
    found = [np.full(count, NO_RANK) for _ in range(places)]
    runs = _Runs(points.position)
    direction, normal = points.direction.astype(np.float32), points.normal.astype(np.float32)
    least = np.minimum(np.float32(LEAST_COSINE), -0.5 * (normal * direction).sum(axis=0))
    length = np.maximum(points.length, np.finfo(np.float64).tiny).astype(np.float32)
    for number, view in enumerate(views):
        raise_if_cancelled()
        anchor = view.anchor
        which = runs.met_by(anchor)
        if not len(which):
            continue
        position = points.position.take(which, 1)
        at = placed(anchor, position)
        inside = np.flatnonzero(_holds(anchor, at.across, at.up, at.depth))
        which = which.take(inside)
        if not len(which):
            continue
        if anchor.is_parallel:
            ray = np.broadcast_to(-anchor.matrix[:3, 2:3], (3, len(which))).astype(np.float32)
        else:
            ray = (position.take(inside, 1) - anchor.matrix[:3, 3:]).astype(np.float32)
            ray /= np.sqrt((ray * ray).sum(axis=0))
        facing = -(normal.take(which, 1) * ray).sum(axis=0)
        ray -= direction.take(which, 1)
        # The chord of the angle, which no rounding spoils where it is small.
        penalty = np.sqrt((ray * ray).sum(axis=0))
        coarse = at.side.take(inside) / length.take(which) - np.float32(1.0)
        penalty += np.float32(COARSE_ANGLE) * np.maximum(coarse, np.float32(0.0))
        # No rank is 0, after which all come.
        rank = np.minimum(penalty * np.float32(1.0 / STEP), np.float32(1 << 21)).astype(np.uint32) + ONE
        rank = (rank << np.uint32(NUMBER_BITS)) | np.uint32(number)
        rank[(facing < least.take(which)) | (rank <= after.take(which))] = NO_RANK
        for best in found:
            own = best.take(which)
            best[which] = np.minimum(own, rank)
            rank = np.maximum(own, rank)
    return found


def _holds(anchor: Anchor, across: Single, up: Single, depth: Single) -> BoolArray:
    """Return whether places are in the picture, with all four pixels around them, (n,)."""
    inside: BoolArray = (across >= 0.0) & (across < anchor.size[0] - 1) & (up >= 0.0)
    inside &= (up < anchor.size[1] - 1) & (depth > anchor.start) & (depth < anchor.end)
    return inside


class _Runs:
    """Spheres around each RUN consecutive points (3, N), by which most are known to be out of a window."""

    def __init__(self, position: Array) -> None:
        self._count = position.shape[1]
        begins = np.arange(0, self._count, RUN)
        low = np.minimum.reduceat(position, begins, axis=1) if len(begins) else position
        high = np.maximum.reduceat(position, begins, axis=1) if len(begins) else position
        self._middle = 0.5 * (low + high)
        self._radius = 0.5 * np.linalg.norm(high - low, axis=0)

    def met_by(self, anchor: Anchor) -> IndexArray:
        """The numbers (n,) of points in runs that an anchor's window may hold."""
        across, up, back = anchor.matrix[:3, :3].T @ (self._middle - anchor.matrix[:3, 3:])
        depth, window, radius = -back, anchor.window, self._radius
        met = (depth > anchor.start - radius) & (depth < anchor.end + radius)
        sides = [(across, window.left, 1), (across, window.right, -1)]
        sides += [(up, window.bottom, 1), (up, window.top, -1)]
        for place, edge, sign in sides:
            if anchor.is_parallel:
                met &= sign * (place - edge) > -radius
            else:
                met &= sign * (place - edge * depth) > -radius * np.hypot(1.0, edge)
        runs = np.flatnonzero(met)
        which: IndexArray = (runs[:, None] * RUN + np.arange(RUN)).ravel()
        return which[: np.searchsorted(which, self._count)]
