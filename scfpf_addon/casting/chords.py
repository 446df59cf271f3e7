# SPDX-License-Identifier: GPL-3.0-or-later
"""Curved projectors: chords find candidates, float64 decides.

All projectors of a tile take the same steps in t, so a step is one batch of
rays. A chord's hit is only recorded; afterwards the curve itself is met with the
hit triangle's plane. Where that point lies outside the triangle the neighbours
are tried, then finer chords over the same stretch; and where these find nothing
the hit was false and the projector goes on behind it.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..projection.typing import Array, BoolArray, IndexArray
from .curves import Bundle, Solutions
from .hits import CastCounts, Hits
from .scene import CastScene, Float32Array
from .schedule import Schedule

# Chords overlap by this share of their length, so that no hit falls between two.
OVERLAP = 1e-5

# Rays that have hit stay in the batch, switched off, until they are this share.
MOST_DEAD = 0.15

# A solution may lie this share of a chord before or after the chord that found it.
NEIGHBOURHOOD = 0.25

# The t of a pixel that saw nothing: beyond all others.
NOTHING = 2.0

# A surface that slopes on beyond a pixel by a step that differs from the one before
# it by less than this share is smooth there.
SMOOTH = 0.5

# How often a chord whose hit is in doubt is cut into finer ones.
LEVELS = 2

# Nearer things of neighbouring pixels that are looked for one behind the other.
LAYERS = 3

# float32 is good enough for chord ends while its rounding of the control points
# is a smaller share than this of the tolerance.
ROUNDING_SHARE = 0.1


class Records(NamedTuple):
    """Hits of chords: projector, chord and triangle, each (M,)."""

    projector: NDArray[np.intp]
    chord: NDArray[np.intp]
    triangle: NDArray[np.int32]

    def take(self, index: IndexArray) -> Records:
        """The records at ``index``."""
        return Records(self.projector[index], self.chord[index], self.triangle[index])


@dataclass(frozen=True)
class _Cast:
    """What every step of one tile's cast looks at and fills in."""

    scene: CastScene
    bundle: Bundle
    schedule: Schedule
    hits: Hits
    counts: CastCounts

    def store(self, projector: NDArray[np.intp], found: Solutions, which: IndexArray) -> None:
        """Write the solutions ``which`` of the projectors into the hits."""
        where = projector[which]
        self.hits.t[where] = found.t[which]
        self.hits.triangle[where] = found.triangle[which]
        self.hits.barycentric[:, where] = found.barycentric[:, which]

    def trace(self, start: Array, end: Array, limits: Float32Array) -> NDArray[np.int32]:
        """The first triangle on the segments, -1 where none is."""
        self.counts.rays += int(np.count_nonzero(limits > 0.0))
        way = (end - start).astype(np.float32, copy=False)
        return self.scene.trace(start.astype(np.float32, copy=False), way, limits)


def cast_chords(
    scene: CastScene,
    bundle: Bundle,
    mask: BoolArray,
    schedule: Schedule | None,
    columns: int | None,
    counts: CastCounts,
) -> Hits:
    """Cast the projectors of ``bundle``, cast space; mask: (N,) says which exist.

    schedule: the tile's chords, None where nothing of the scene is in reach.
    columns: when given, the projectors are rows of this many pixels, and the first
    and the last row are there only to be looked at by their neighbours: the
    answer leaves them out.
    """
    hits = Hits.empty(bundle.count)
    border = columns or 0
    inner = slice(border, bundle.count - border)
    counts.projectors += int(np.count_nonzero(mask[inner]))
    if schedule is not None:
        counts.error_bound = max(counts.error_bound, schedule.error / schedule.finer**2)
        work = _Cast(scene, bundle, schedule, hits, counts)
        records = first = _march(work, mask)
        while len(records.projector):
            records = _settle(work, records)
        if columns:
            _compare(work, first, mask, columns)
    return _finish(hits, bundle, mask, inner)


def _finish(hits: Hits, bundle: Bundle, mask: BoolArray, inner: slice) -> Hits:
    """Positions and tangents of the hits, for the projectors in ``inner``."""
    hits = Hits(*(a[..., inner] for a in hits))
    mask, bundle = mask[inner], Bundle(bundle.spans, bundle.points[:, :, inner])
    t = np.where(hits.triangle >= 0, hits.t, 1.0)
    position, tangent = bundle.at(t)
    bundle.steer(t, tangent)
    if not mask.all():
        position[:, ~mask] = 0.0
        tangent[:, ~mask] = 0.0
    return hits._replace(position=position, tangent=tangent, mask=mask)


def _march(work: _Cast, mask: BoolArray) -> Records:
    """The first chord that hits, for every projector, all in step."""
    bundle, schedule = work.bundle, work.schedule
    reach = np.abs(bundle.points).max(initial=0.0)
    narrow = reach * np.finfo(np.float32).eps < ROUNDING_SHARE * schedule.finest
    kind = np.float32 if narrow else np.float64
    weights = schedule.ends.astype(kind)
    alive = np.flatnonzero(mask)
    controls = bundle.points.astype(kind, copy=False)
    if len(alive) < bundle.count:
        controls = controls.take(alive, 2)
    limits = np.full(len(alive), 1.0 + OVERLAP, np.float32)
    start = np.einsum("k,kcn->cn", weights[0], controls)
    parts = [Records(np.empty(0, np.intp), np.empty(0, np.intp), np.empty(0, np.int32))]
    dead = 0
    for chord in range(len(schedule.span)):
        end = np.einsum("k,kcn->cn", weights[chord + 1], controls)
        found = work.trace(start, end, limits)
        work.counts.chords += len(alive) - dead
        index = np.flatnonzero(found >= 0)
        if len(index):
            parts.append(Records(alive[index], np.full(len(index), chord), found[index]))
            limits[index] = -1.0
            dead += len(index)
            if dead == len(alive):
                break
            if dead > MOST_DEAD * len(alive):
                kept = np.flatnonzero(limits > 0.0)
                alive, limits, dead = alive[kept], limits[kept], 0
                controls, end = controls.take(kept, 2), end.take(kept, 1)
        start = end
    return _joined(parts)


def _joined(parts: list[Records]) -> Records:
    return Records(
        np.concatenate([p.projector for p in parts]),
        np.concatenate([p.chord for p in parts]),
        np.concatenate([p.triangle for p in parts]),
    )


def _settle(work: _Cast, records: Records) -> Records:
    """Solve recorded hits and store them; returns the hits found behind false ones."""
    schedule = work.schedule
    low, high = schedule.breaks[records.chord], schedule.breaks[records.chord + 1]
    curves = work.bundle.take(records.projector)
    found = _solve(work, curves, schedule.span[records.chord], low, high, records.triangle)
    work.store(records.projector, found, np.flatnonzero(found.inside))
    rest = np.flatnonzero(~found.inside)
    if len(rest) == 0:
        return records.take(rest)
    work.counts.refined += len(rest)
    again = records.take(rest)
    hit, fine = _refine(work, curves.take(rest), schedule.span[again.chord], low[rest], high[rest])
    work.store(again.projector[hit], fine, np.arange(len(hit)))
    false = np.ones(len(rest), bool)
    false[hit] = False
    return _continue(work, again.take(np.flatnonzero(false)))


def _solve(
    work: _Cast, curves: Bundle, span: IndexArray, low: Array, high: Array, triangle: NDArray[np.int32]
) -> Solutions:
    """Meet the curves with the triangles around [low, high], then with their neighbours."""
    slack = NEIGHBOURHOOD * (high - low)
    low, high = low - slack, high + slack
    found = curves.solve(work.scene, triangle, span, low, high)
    work.counts.walked += curves.walk(work.scene, span, low, high, found)
    return found


def _refine(
    work: _Cast, curves: Bundle, span: IndexArray, low: Array, high: Array, level: int = 1
) -> tuple[NDArray[np.intp], Solutions]:
    """Look at the stretches [low, high] again, with finer chords.

    Where the curve has no hit that bears out such a chord's, that chord is refined
    in turn; at the last level the chord's hit is taken as it is.
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
        found = _solve(work, some, span[going], begin, begin + step[going], triangle)
        answer.put(going, found, np.flatnonzero(found.inside))
        open_ones = np.flatnonzero(~found.inside)
        going, begin, some = going[open_ones], begin[open_ones], some.take(open_ones)
        if level == LEVELS:
            work.counts.unresolved += len(going)
            answer.put(going, _chord_hits(work, some, begin, step[going]), np.arange(len(going)))
            break
        if len(going) == 0:
            break
        hit, found = _refine(work, some, span[going], begin, begin + step[going], level + 1)
        answer.put(going[hit], found, np.arange(len(hit)))
        false = np.ones(len(going), bool)
        false[hit] = False
        part[going] += 1
        going = going[false & (part[going] < finer)]
    hit = np.flatnonzero(answer.triangle >= 0)
    return hit, answer.take(hit)


def _march_finely(
    work: _Cast, curves: Bundle, low: Array, step: Array, first: NDArray[np.int64]
) -> tuple[NDArray[np.int32], NDArray[np.int64]]:
    """The first of the finer chords that hits, each curve from its chord ``first`` on.

    Returns the triangles, -1 where none is, and the chords.
    """
    triangle = np.full(curves.count, -1, np.int32)
    chord = first.copy()
    least = int(first.min())
    start = curves.at(low + step * least)[0]
    for part in range(least, work.schedule.finer):
        end = curves.at(low + step * (part + 1))[0]
        searching = (triangle < 0) & (first <= part)
        limits = np.where(searching, np.float32(1.0 + OVERLAP), np.float32(-1.0))
        found = work.trace(start, end, limits)
        hit = np.flatnonzero(found >= 0)
        triangle[hit], chord[hit] = found[hit], part
        start = end
    return triangle, chord


def _chord_hits(work: _Cast, curves: Bundle, low: Array, step: Array) -> Solutions:
    """Hits of the chords over [low, low + step] themselves, for curves that have none."""
    start, end = curves.at(low)[0], curves.at(low + step)[0]
    limits = np.full(curves.count, 1.0 + OVERLAP, np.float32)
    origins, ways = start.astype(np.float32), (end - start).astype(np.float32)
    triangle = work.scene.trace(origins, ways, limits)
    t = np.clip(low + work.scene.trace_distance(origins, ways, limits) * step, 0.0, 1.0)
    weights = np.clip(work.scene.barycentric(curves.at(t)[0], triangle), 0.0, 1.0)
    weights /= np.maximum(weights.sum(axis=0), 1.0)
    return Solutions(t, triangle, weights, np.ones(curves.count, bool))


def _continue(work: _Cast, records: Records) -> Records:
    """The next hits of projectors whose recorded ones were false, each from its own chord on."""
    work.counts.false_hits += len(records.chord)
    ends, count = work.schedule.ends, len(work.schedule.span)
    projector, chord = records.projector, records.chord + 1
    going = np.flatnonzero(chord < count)
    projector, chord = projector[going], chord[going]
    controls = work.bundle.points.take(projector, 2)
    start = np.einsum("nk,kcn->cn", ends[chord], controls)
    parts = [records.take(np.empty(0, np.intp))]
    while len(chord):
        end = np.einsum("nk,kcn->cn", ends[chord + 1], controls)
        found = work.trace(start, end, np.full(len(chord), 1.0 + OVERLAP, np.float32))
        hit = np.flatnonzero(found >= 0)
        parts.append(Records(projector[hit], chord[hit], found[hit]))
        going = np.flatnonzero((found < 0) & (chord + 1 < count))
        projector, chord = projector[going], chord[going] + 1
        controls, start = controls.take(going, 2), end.take(going, 1)
    return _joined(parts)


def _compare(work: _Cast, first: Records, mask: BoolArray, columns: int) -> None:
    """Look again where a neighbouring pixel saw something nearer.

    A chord strays by up to a pixel, so it can pass something that its curve hits;
    but then a neighbour's chord has hit it. There the curve is followed finely, at
    most LAYERS times, from the nearest of the neighbours' hits on.
    """
    hits, breaks = work.hits, work.schedule.breaks
    seen = np.where(hits.triangle >= 0, hits.t, NOTHING)
    # A first hit that turned out false for its own curve may be true for another.
    low, high = breaks[first.chord], breaks[first.chord + 1]
    false = np.flatnonzero(seen[first.projector] > high + NEIGHBOURHOOD * (high - low))
    seen[first.projector[false]] = 0.5 * (low + high)[false]
    projector, layers = _jumps(seen, hits.t, mask, columns, work.schedule)
    passed = np.full(len(projector), -np.inf)
    for _ in range(LAYERS):
        ahead = (layers > passed) & (layers < hits.t[projector])
        nearest = np.where(ahead, layers, np.inf).min(axis=0, initial=np.inf)
        going = np.flatnonzero(np.isfinite(nearest))
        if len(going) == 0:
            break
        projector, layers, middle = projector[going], layers[:, going], nearest[going]
        chord = np.clip(np.searchsorted(breaks, middle, side="right") - 1, 0, len(breaks) - 2)
        half = 0.5 * (breaks[chord + 1] - breaks[chord])
        low, high = np.maximum(middle - half, breaks[0]), np.minimum(middle + half, breaks[-1])
        work.counts.compared += len(going)
        hit, found = _refine(work, work.bundle.take(projector), work.schedule.span[chord], low, high)
        nearer = np.flatnonzero(found.t < hits.t[projector[hit]])
        work.store(projector[hit], found, nearer)
        passed = high


def _jumps(
    seen: Array, own: Array, mask: BoolArray, columns: int, schedule: Schedule
) -> tuple[NDArray[np.intp], Array]:
    """Pixels next to which the picture jumps to something nearer.

    seen: (N,) t that each pixel saw, NOTHING for nothing; own: (N,) t of its hit.
    Returns the pixels (M,), border rows left out, and (8, M) the nearer neighbours'
    t, inf for the others. A sloping surface is no jump: it goes on beyond the pixel
    as it came.
    """
    rows = seen.reshape(-1, columns)
    least = np.minimum(np.minimum(rows[:-2], rows[2:]), rows[1:-1])
    around = least.copy()
    np.minimum(around[:, 1:], least[:, :-1], out=around[:, 1:])
    np.minimum(around[:, :-1], least[:, 1:], out=around[:, :-1])
    own = np.where(np.isfinite(own), own, NOTHING)
    pixels = np.flatnonzero(
        (around.ravel() + schedule.pixel.min() < own[columns:-columns]) & mask[columns:-columns]
    )
    pixels += columns
    here = own[pixels]
    column = pixels % columns
    left, right = -(column > 0).astype(np.int64), (column < columns - 1).astype(np.int64)
    steps = [left, right, -columns, columns, left - columns, right + columns, right - columns, left + columns]
    beside = np.stack([seen[pixels + step] for step in steps])
    opposite = beside[[1, 0, 3, 2, 5, 4, 7, 6]]
    gap = here - beside
    size = np.interp(beside, 0.5 * (schedule.breaks[:-1] + schedule.breaks[1:]), schedule.pixel)
    bend = np.abs(opposite - here - gap)
    jump = (gap > size) & (bend > SMOOTH * gap)
    some = np.flatnonzero(jump.any(axis=0))
    return pixels[some], np.where(jump, beside, np.inf)[:, some]
