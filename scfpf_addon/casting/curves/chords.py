# SPDX-License-Identifier: GPL-3.0-or-later
"""Casting curved projectors: chords find candidates, float64 decides.

All projectors of a tile take the same steps in t, so a step is one batch of
rays. The hit of a chord is only recorded; afterwards the curve itself is intersected with the
plane of the triangle. If that point lies outside the triangle, the neighbours
are tried. If these are not hit either, the hit is in doubt. Such a projector is
followed again from its beginning by finer chords, whose hit counts. Continuing
past a doubtful hit instead would lead through closed surfaces: the chords of a
projector are one line without a gap, and only their first hit is certainly outside.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import BoolArray, IndexArray
from ..common.hits import CastCounts, Hits
from ..scene.cast_scene import CastScene
from ..scene.stretches import Stretches, everywhere
from ..straight import turn_off_vertices
from .march import OVERLAP, Records, Traced, first_hits, march
from .plane_hits import Solutions, move_to_neighbours, solve
from .projector_batch import ProjectorBatch
from .schedule import Schedule

# A solution may lie this share of a chord before or after the chord that found it.
NEIGHBOURHOOD = 0.25

# Fewer projectors than this are cast with all their chords at once, those after a hit in
# vain: to step through the chords costs more.
FEW = 1024

# float32 is good enough for chord ends while its rounding of the control points
# is a smaller share than this of the tolerance.
ROUNDING_SHARE = 0.1


class TileCast(NamedTuple):
    """The data of one tile's cast."""

    scene: CastScene
    batch: ProjectorBatch
    schedule: Schedule
    counts: CastCounts


def cast_chords(
    scene: CastScene,
    batch: ProjectorBatch,
    mask: BoolArray,
    schedule: Schedule,
    counts: CastCounts,
    where: Stretches | None = None,
    last: bool = True,
) -> tuple[Hits, NDArray[np.intp]]:
    """Cast the projectors of ``batch``, cast space; mask: (N,) says which exist.

    schedule: the tile's chords. where: the stretches that are not empty, if known. last: keep
    hits of chords that the curves do not confirm; otherwise these are misses.
    Returns the hits, whose position and tangent are undefined (see ``complete``), and the
    projectors with an unconfirmed hit.
    """
    hits = Hits.empty(batch.count)._replace(mask=mask)
    work = TileCast(scene, batch, schedule, counts)
    records = _march(work, mask, where)
    curves = batch.take(records.projector)
    begin, end = schedule.breaks[:-1], schedule.breaks[1:]
    slack = NEIGHBOURHOOD * (end - begin)
    span = schedule.span.take(records.chord)
    low, high = (begin - slack).take(records.chord), (end + slack).take(records.chord)
    found = solve(curves, scene, records.triangle, span, low, high)
    counts.on_neighbours += move_to_neighbours(curves, scene, span, low, high, found)
    found.store(hits, records.projector)
    doubtful = np.flatnonzero(~found.inside)
    some = records.take(doubtful)
    if last:
        counts.unresolved += len(doubtful)
        _chord_hits(work, some).store(hits, some.projector)
    else:
        _misses(len(doubtful)).store(hits, some.projector)
    return hits, some.projector


def _misses(count: int) -> Solutions:
    return Solutions(
        np.full(count, np.inf), np.full(count, -1, np.int32), np.zeros((2, count)), np.zeros(count, bool)
    )


def complete(hits: Hits, batch: ProjectorBatch) -> Hits:
    """The hits of ``batch`` with their positions and tangents."""
    t = np.where(hits.triangle >= 0, hits.t, 1.0)
    position, tangent = batch.at(t)
    batch.steer(t, tangent)
    if not hits.mask.all():
        position[:, ~hits.mask] = 0.0
        tangent[:, ~hits.mask] = 0.0
    return hits._replace(position=position, tangent=tangent)


def _march(work: TileCast, mask: BoolArray, where: Stretches | None) -> Records:
    """The first chord that hits, for every projector; chords through empty space are left out."""
    batch, schedule = work.batch, work.schedule
    if where is None:
        reach, where = float(np.abs(batch.single).max(initial=0.0)), everywhere(batch.count)
    else:
        reach = where.farthest
    narrow = reach * np.finfo(np.float32).eps < ROUNDING_SHARE * schedule.finest
    source: NDArray[Any] = batch.single if narrow else batch.points
    slack = NEIGHBOURHOOD * np.diff(schedule.breaks)
    held = where.within(schedule.breaks[:-1] - slack, schedule.breaks[1:] + slack)
    if np.count_nonzero(mask) < FEW:
        return _at_once(work, np.flatnonzero(mask), source, held, where.block)

    def trace(start: NDArray[Any], way: NDArray[Any], limits: NDArray[np.float32]) -> Traced:
        """The first triangles on the chords, (N,), without where on the chords."""
        origins, ways = (ends.astype(np.float32, copy=False) for ends in (start, way))
        if batch.spans.is_polyline:
            turn_off_vertices(ways)
        return work.scene.mesh.trace(origins, ways, limits), None

    records, _, rays = march(source, schedule.ends, held, where.members(), mask, trace)
    work.counts.rays += rays
    work.counts.chords += rays
    return records


def _at_once(
    work: TileCast, projectors: IndexArray, source: NDArray[Any], held: BoolArray, block: IndexArray
) -> Records:
    """Cast all chords of few projectors in one batch; the first that hits counts."""
    schedule = work.schedule
    chord, which = np.nonzero(held.take(block.take(projectors), 1))
    controls = source.take(projectors.take(which), 2)
    start = np.einsum("kn,kcn->cn", schedule.ends.astype(source.dtype).T.take(chord, 1), controls)
    ways = np.diff(schedule.ends, axis=0).astype(source.dtype)
    way = np.einsum("kn,kcn->cn", ways.T.take(chord, 1), controls)
    work.counts.rays += len(chord)
    work.counts.chords += len(chord)
    ways = way.astype(np.float32, copy=False)
    if work.batch.spans.is_polyline:
        turn_off_vertices(ways)
    found = work.scene.mesh.trace(
        start.astype(np.float32, copy=False),
        ways,
        np.full(len(chord), 1.0 + OVERLAP, np.float32),
    )
    first = first_hits(found, which, len(projectors))
    return Records(projectors[which[first]], chord[first], found[first])


def _chord_hits(work: TileCast, records: Records) -> Solutions:
    """Hits of the chords themselves: where on the chord, and the point of the triangle nearest to it."""
    low, high = work.schedule.breaks[records.chord], work.schedule.breaks[records.chord + 1]
    start, end = work.schedule.ends_of(work.batch.points.take(records.projector, 2), records.chord)
    way, limits = end - start, np.full(len(low), 1.0 + OVERLAP, np.float32)
    share = work.scene.mesh.trace_distance(start.astype(np.float32), way.astype(np.float32), limits)
    share = np.minimum(share.astype(np.float64), 1.0)
    weights = work.scene.clipped_barycentric(start + way * share, records.triangle)
    return Solutions(low + share * (high - low), records.triangle, weights, np.ones(len(low), bool))
