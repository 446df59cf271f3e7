# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours of points that an image shows, looked up in the pictures of its anchors.

Of the four pixels around a point's place those count that show the same surface there, which their traced
depths tell. Anchors are weighted by the angle to the projector and by their pixels' size. Weights fall to 0
at the borders of windows and at the first anchor that is left out, as in Buehler et al. 2001, Unstructured
Lumigraph Rendering.

Where to look depends on depths alone, so one ``TexelShares`` serves all passes of the pictures.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..casting.common.cancellation import raise_if_cancelled
from ..projection.typing import BoolArray, IndexArray
from ..shading.typing import Single
from .anchor_view import AnchorView, ViewSet, placed
from .ranks import MOST_ANCHORS, NO_RANK, Ranks, penalties_of, ranked
from .shown_points import ShownPoints
from .texels import FOUR, LEAST_SHARE, Texels, fade_of, texels

# Anchors that share in a point's colour, at most. One more is looked for: the weights fall to 0 at it.
SHARERS = 3
PLACES = SHARERS + 1
# Anchors at one eye differ by rounding only: weights fall to 0 at this angle at the least, radians.
LEAST_BOUND = 1e-3
# A share that changes no pixel by more than a step of 255 is not seen.
LEAST_SEEN = 1.0 / 255.0
# The least weight of the best anchor, which may have no other to fade to.
LEAST_WEIGHT = 1e-4


@dataclass(frozen=True)
class TexelShares:
    """The pixels of anchors that show points (N,), and the shares of their colours.

    number: (PLACES, N) int16, the anchors of a point, -1 for none. first: (PLACES, N) int32, the flat index
    of the lower left one of the four pixels around its place. shares: (PLACES, 4, N) float32, those of the
    pixels in the order of FOUR; all of a point's have the sum 1.
    """

    number: NDArray[np.int16]
    first: NDArray[np.int32]
    shares: Single

    @property
    def is_hole(self) -> BoolArray:
        """Return whether no anchor shows each point, (N,)."""
        hole: BoolArray = self.number[0] < 0
        return hole

    def used(self, count: int) -> BoolArray:
        """Return which of so many anchors have a share in any point that could be seen, (count,)."""
        found = np.zeros(count, bool)
        found[self.number[self.shares.max(axis=1) > LEAST_SEEN]] = True
        return found

    def colors(self, pictures: Sequence[Single]) -> Single:
        """The colours (N, C) of the points in the pictures (H, W, C) of the anchors, 0 in holes."""
        channels = pictures[0].shape[2] if pictures else 4
        total = np.zeros((self.number.shape[1], channels), np.float32)
        for place in range(SHARERS):
            for number, which in _grouped(self.number[place]):
                picture, shares = pictures[number], self.shares[place].take(which, 1)
                flat, first = picture.reshape(-1, channels), self.first[place].take(which)
                color = np.zeros((len(which), channels), np.float32)
                for (across, up), share in zip(FOUR, shares, strict=True):
                    color += flat.take(first + (across + up * picture.shape[1]), 0) * share[:, None]
                total[which] += color
        return total


def find_texels(points: ShownPoints, views: Sequence[AnchorView]) -> TexelShares:
    """Find the pixels of anchors that show points (N,), all of them on things.

    views: at most MOST_ANCHORS.
    """
    assert len(views) <= MOST_ANCHORS
    search = _Search(points, views)
    left, after = np.arange(len(points.number)), np.zeros(len(points.number), np.uint32)
    while len(left) and views:
        raise_if_cancelled()
        own = points if len(left) == len(points.number) else points.take(left)
        ranks = ranked(own, views, after, PLACES)
        for rank in ranks:
            is_open = search.is_open(left, rank)
            search.ask(left[is_open], rank[is_open], beside=False)
        after = ranks[-1]
        goes_on = search.is_open(left, after)
        left, after = left[goes_on], after[goes_on]
    left = np.flatnonzero(search.taken == 0)
    if len(left) and views:
        for rank in ranked(points.take(left), views, np.zeros(len(left), np.uint32), PLACES):
            is_asked = (rank != NO_RANK) & (search.taken[left] == 0)
            search.ask(left[is_asked], rank[is_asked], beside=True)
    return search.weighed()


def asked(
    points: ShownPoints, views: Sequence[AnchorView], own: ViewSet
) -> Iterator[tuple[TexelShares, IndexArray, tuple[int, ...]]]:
    """Yield the pixels of a set's anchors, the numbers (n,) of the points, and those of the anchors asked."""
    which = np.arange(len(points.number))
    for numbers in (own.first, own.rest):
        if numbers and len(which):
            found = find_texels(points.take(which), [views[number] for number in numbers])
            yield found, which, numbers
            which = which[found.is_hole]


def join(
    points: ShownPoints,
    views: Sequence[AnchorView],
    sets: Sequence[ViewSet],
    pictures: Sequence[Single],
) -> tuple[Single, BoolArray]:
    """The colours (N, C) of points that are on things, and which no anchor shows, (N,).

    sets: of the views. pictures: (H, W, C) of each view.
    """
    count = len(points.number)
    channels = pictures[0].shape[2] if pictures else 4
    total, weight = np.zeros((count, channels), np.float32), np.zeros(count, np.float32)
    for own in sets:
        for found, which, numbers in asked(points, views, own):
            shown = which[~found.is_hole]
            total[which] += np.float32(own.share) * found.colors([pictures[number] for number in numbers])
            weight[shown] += np.float32(own.share)
    is_hole = weight <= 0.0
    total /= np.where(is_hole, np.float32(1.0), weight)[:, None]
    return total, is_hole


class _Search:
    """The anchors that were found to show points (N,), best first. taken: (N,), how many."""

    def __init__(self, points: ShownPoints, views: Sequence[AnchorView]) -> None:
        count = len(points.number)
        self._points, self._views = points, views
        self._found = TexelShares(
            np.full((PLACES, count), -1, np.int16),
            np.zeros((PLACES, count), np.int32),
            np.zeros((PLACES, 4, count), np.float32),
        )
        self._penalty = np.full((PLACES, count), np.inf, np.float32)
        self.taken = np.zeros(count, np.intp)
        # From which on an anchor counts least.
        self._angle = points.angle.astype(np.float32)

    def ask(self, which: IndexArray, ranks: Ranks, beside: bool) -> None:
        """Ask the anchors of ranks (n,) for points ``which`` (n,). beside: as for ``texels``."""
        numbers = (ranks & np.uint32(MOST_ANCHORS)).astype(np.int16)
        penalties = penalties_of(ranks)
        for number, group in _grouped(numbers):
            at = which.take(group)
            seen = texels(self._points, at, self._views[number], beside)
            shows = np.flatnonzero(seen.shares.any(axis=0))
            self._take(at.take(shows), number, seen, shows, penalties.take(group.take(shows)))

    def _take(self, at: IndexArray, number: int, seen: Texels, shows: IndexArray, penalties: Single) -> None:
        """Note that an anchor shows points ``at`` (n,)."""
        count, found = len(self.taken), self._found
        taken = self.taken.take(at)
        # Flat indices, which NumPy writes to in half the time.
        flat = taken * count + at
        found.number.reshape(-1)[flat] = number
        found.first.reshape(-1)[flat] = seen.first.take(shows)
        self._penalty.reshape(-1)[flat] = penalties
        shares = seen.shares.take(shows, 1) * seen.fade.take(shows)
        flat += 3 * taken * count
        for k in range(4):
            found.shares.reshape(-1)[flat] = shares[k]
            flat += count
        self.taken[at] = taken + 1

    def is_open(self, which: IndexArray, ranks: Ranks) -> BoolArray:
        """Return whether anchors of ranks (n,), or after them, may have a weight for points (n,)."""
        # Infinite as long as none is found, and NO_RANK is not below.
        bound = np.maximum(2.0 * self._penalty[0, which], self._angle[which])
        still: BoolArray = (self.taken[which] < PLACES) & (penalties_of(ranks) < bound)
        return still

    def _bound(self) -> Single:
        """The penalties at which weights are 0, (N,)."""
        bound = np.minimum(
            self._penalty[SHARERS], np.maximum(np.float32(2.0) * self._penalty[0], self._angle)
        )
        least: Single = np.maximum(bound, np.float32(LEAST_BOUND))
        return least

    def weighed(self) -> TexelShares:
        """The pixels found, with the weights of their anchors."""
        found = self._found
        with np.errstate(invalid="ignore"):
            weight = np.maximum(1.0 - self._penalty / self._bound(), np.float32(0.0))
        weight[0] = np.maximum(weight[0], np.float32(LEAST_WEIGHT))
        weight[found.number < 0] = 0.0
        weight[SHARERS] = 0.0
        shares = found.shares
        shares *= weight[:, None]
        total = shares.sum(axis=(0, 1))
        shares /= np.where(total > 0.0, total, np.float32(1.0))
        return found


def _grouped(number: NDArray[np.int16]) -> Iterator[tuple[int, IndexArray]]:
    """The numbers (N,) that are 0 or more, each with where it is, (n,)."""
    order = np.argsort(number, kind="stable")
    ordered = number[order]
    begin = int(np.searchsorted(ordered, 0))
    ends = [*(np.flatnonzero(np.diff(ordered[begin:])) + begin + 1).tolist(), len(ordered)]
    for end in ends:
        if end > begin:
            yield int(ordered[begin]), order[begin:end]
        begin = end


def join_sky(
    points: ShownPoints, views: Sequence[AnchorView], pictures: Sequence[Single]
) -> tuple[Single, BoolArray]:
    """The colours (N, C) of points that are on no thing, by direction alone, and which have none, (N,)."""
    count = len(points.number)
    channels = pictures[0].shape[2] if pictures else 4
    total, weight = np.zeros((count, channels), np.float32), np.zeros(count, np.float32)
    for view, picture in zip(views, pictures, strict=True):
        anchor = view.anchor
        if anchor.is_parallel:
            continue
        far = anchor.eye[:, None] + points.direction * (0.5 * (anchor.start + anchor.end))
        which = np.flatnonzero(anchor.holds(anchor.places(far)))
        at = placed(anchor, far.take(which, 1))
        column, row = at.across.astype(np.int32), at.up.astype(np.int32)
        right, upper = at.across - column, at.up - row
        fade = fade_of(at, anchor.size)
        for step, step_up in FOUR:
            share = (right if step else 1.0 - right) * (upper if step_up else 1.0 - upper)
            own = np.clip(row + step_up, 0, anchor.size[1] - 1), np.clip(column + step, 0, anchor.size[0] - 1)
            share = (share + LEAST_SHARE) * fade * np.isinf(view.depth[own])
            total[which] += picture[own] * share[:, None]
            weight[which] += share
    is_hole = weight <= 0.0
    total /= np.where(is_hole, np.float32(1.0), weight)[:, None]
    return total, is_hole
