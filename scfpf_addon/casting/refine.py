# SPDX-License-Identifier: GPL-3.0-or-later
"""Deciding doubtful hits: the curve against the triangle, then finer and finer chords."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..projection.typing import Array, IndexArray
from .curves import Bundle, Solutions
from .hits import CastCounts, Hits
from .scene import CastScene, Float32Array
from .schedule import Schedule

# Chords overlap by this share of their length, so that no hit falls between two.
OVERLAP = 1e-5

# A solution may lie this share of a chord before or after the chord that found it.
NEIGHBOURHOOD = 0.25

# How often a chord whose hit is in doubt is cut into finer ones.
LEVELS = 2


@dataclass(frozen=True)
class Work:
    """What every step of one tile's cast looks at and fills in.

    passed: (N,) t at which a projector passes the nearest thing that its chords hit
    and it does not, inf where there is none.
    """

    scene: CastScene
    bundle: Bundle
    schedule: Schedule
    hits: Hits
    passed: Array
    counts: CastCounts

    def store(self, projector: NDArray[np.intp], found: Solutions, which: IndexArray) -> None:
        """Write the solutions ``which`` of the projectors into the hits."""
        where = projector[which]
        self.hits.t[where] = found.t[which]
        self.hits.triangle[where] = found.triangle[which]
        self.hits.barycentric[:, where] = found.barycentric[:, which]

    def trace(self, start: NDArray[Any], way: NDArray[Any], limits: Float32Array) -> NDArray[np.int32]:
        """The first triangle on the segments from start to start + way, -1 where none is."""
        self.counts.rays += int(np.count_nonzero(limits > 0.0))
        start, way = start.astype(np.float32, copy=False), way.astype(np.float32, copy=False)
        return self.scene.trace(start, way, limits)


def solve(work: Work, curves: Bundle, low: Array, high: Array, triangle: NDArray[np.int32]) -> Solutions:
    """Meet the curves with the triangles around [low, high], then with their neighbours."""
    span = curves.spans.locate(0.5 * (low + high))[0]
    slack = NEIGHBOURHOOD * (high - low)
    low, high = low - slack, high + slack
    found = curves.solve(work.scene, triangle, span, low, high)
    work.counts.walked += curves.walk(work.scene, span, low, high, found)
    return found


def refine(
    work: Work, curves: Bundle, low: Array, high: Array, level: int = 1
) -> tuple[NDArray[np.intp], Solutions]:
    """Look at the stretches [low, high] again, with finer chords.

    Where the curve has no hit that bears out such a chord's, that chord is refined
    in turn; at the last level the curve is taken to hit what the chord hits.
    Returns the indices of the curves that are hit, and the hits.
    """
    finer = work.schedule.finer
    step = (high - low) / finer
    answer = Solutions(
        np.full(curves.count, np.nan),
        np.full(curves.count, -1, np.int32),
        np.zeros((2, curves.count)),
        np.zeros(curves.count, bool),
    )
    going, part = np.arange(curves.count), np.zeros(curves.count, np.int64)
    while len(going):
        some = curves.take(going)
        triangle, part[going] = _march_finely(work, some, low[going], step[going], part[going])
        hit = np.flatnonzero(triangle >= 0)
        going, some, triangle = going[hit], some.take(hit), triangle[hit]
        begin = low[going] + step[going] * part[going]
        found = solve(work, some, begin, begin + step[going], triangle)
        answer.put(going, found, np.flatnonzero(found.inside))
        open_ones = np.flatnonzero(~found.inside)
        going, begin, some = going[open_ones], begin[open_ones], some.take(open_ones)
        if level == LEVELS:
            work.counts.unresolved += len(going)
            kept = _chord_hits(work, some, found.take(open_ones), begin, step[going])
            answer.put(going, kept, np.arange(len(going)))
            break
        if len(going) == 0:
            break
        hit, found = refine(work, some, begin, begin + step[going], level + 1)
        answer.put(going[hit], found, np.arange(len(hit)))
        false = np.ones(len(going), bool)
        false[hit] = False
        part[going] += 1
        going = going[false & (part[going] < finer)]
    hit = np.flatnonzero(answer.triangle >= 0)
    return hit, answer.take(hit)


def _march_finely(
    work: Work, curves: Bundle, low: Array, step: Array, first: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """The first of the finer chords that hits, each curve from its chord ``first`` on.

    Returns the triangles, -1 where none is, and the chords.
    """
    triangle = np.full(curves.count, -1, np.int32)
    chord = first.copy()
    least = int(first.min())
    start = curves.place(low + step * least)
    for part in range(least, work.schedule.finer):
        end = curves.place(low + step * (part + 1))
        searching = (triangle < 0) & (first <= part)
        limits = np.where(searching, np.float32(1.0 + OVERLAP), np.float32(-1.0))
        found = work.trace(start, end - start, limits)
        hit = np.flatnonzero(found >= 0)
        triangle[hit], chord[hit] = found[hit], part
        start = end
    return triangle, chord


def _chord_hits(work: Work, curves: Bundle, found: Solutions, low: Array, step: Array) -> Solutions:
    """Hits of the chords over [low, low + step] themselves, for curves that pass a triangle.

    found: the curves' meetings with the triangles' planes, next to them: float32
    does not tell the difference. Where there is none, t is that of the chord.
    """
    start, end = curves.place(low), curves.place(low + step)
    limits = np.full(curves.count, 1.0 + OVERLAP, np.float32)
    origins, ways = start.astype(np.float32), (end - start).astype(np.float32)
    share = work.scene.trace_distance(origins, ways, limits)
    t = np.where(np.isnan(found.t), np.clip(low + share * step, 0.0, 1.0), found.t)
    weights = np.clip(work.scene.barycentric(curves.place(t), found.triangle), 0.0, 1.0)
    weights /= np.maximum(weights.sum(axis=0), 1.0)
    return Solutions(t, found.triangle, weights, np.ones(curves.count, bool))
