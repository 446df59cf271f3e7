# SPDX-License-Identifier: GPL-3.0-or-later
"""Curved projectors: chords find candidates, float64 decides.

All projectors of a tile take the same steps in t, so a step is one batch of
rays. A chord's hit is only recorded; afterwards the curve itself is met with the
hit triangle's plane. Where that point lies outside the triangle the neighbours
are tried. Where these are not hit either the hit is in doubt: the projector is
followed again from its beginning by finer chords, and what they hit counts. To go
on behind a doubtful hit instead would lead through closed surfaces: the chords of a
projector are one line without a gap, and only their first hit is certainly outside.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import BoolArray, IndexArray
from ..common.hits import CastCounts, Hits
from ..scene.cast_scene import CastScene
from ..scene.occupancy import Stretches, everywhere
from .march import OVERLAP, Records, Traced, march
from .projector_batch import ProjectorBatch, Solutions
from .schedule import Schedule

# A solution may lie this share of a chord before or after the chord that found it.
NEIGHBOURHOOD = 0.25

# Fewer projectors than this are cast with all their chords at once, those behind a hit for
# nothing: to step through the chords costs more.
FEW = 1024

# float32 is good enough for chord ends while its rounding of the control points
# is a smaller share than this of the tolerance.
ROUNDING_SHARE = 0.1


class Work(NamedTuple):
    """What every step of one tile's cast looks at and fills in."""

    scene: CastScene
    batch: ProjectorBatch
    schedule: Schedule
    hits: Hits
    counts: CastCounts

    def store(self, projector: NDArray[np.intp], found: Solutions) -> None:
        """Write the solutions of the projectors into the hits."""
        self.hits.t[projector] = found.t
        self.hits.triangle[projector] = found.triangle
        # Row by row: indices along one axis alone are quick.
        for row, weights in zip(self.hits.barycentric, found.barycentric, strict=True):
            row[projector] = weights


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

    schedule: the tile's chords. Position and tangent of the answer are not filled
    in yet (``complete``). where: the stretches that are not empty, if known. last: keep
    hits that the curves do not bear out as the chords have them. Otherwise they are left
    out, and the second answer is the projectors that have one.
    """
    hits = Hits.unplaced(batch.count)._replace(mask=mask)
    work = Work(scene, batch, schedule, hits, counts)
    records = _march(work, mask, where)
    curves = batch.take(records.projector)
    begin, end = schedule.breaks[:-1], schedule.breaks[1:]
    slack = NEIGHBOURHOOD * (end - begin)
    span = batch.spans.locate(0.5 * (begin + end))[0].take(records.chord)
    low, high = (begin - slack).take(records.chord), (end + slack).take(records.chord)
    found = curves.solve(scene, records.triangle, span, low, high)
    counts.walked += curves.walk(scene, span, low, high, found)
    work.store(records.projector, found)
    doubtful = np.flatnonzero(~found.inside)
    some = records.take(doubtful)
    if last:
        counts.unresolved += len(doubtful)
        work.store(some.projector, _chord_hits(work, some))
    else:
        work.store(some.projector, _none(len(doubtful)))
    return hits, some.projector


def _none(count: int) -> Solutions:
    """Solutions that are none."""
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


def _march(work: Work, mask: BoolArray, where: Stretches | None) -> Records:
    """The first chord that hits, for every projector; chords through nothing are left out."""
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
        """``CastScene.trace`` as the march asks for it: triangles (N,), and no places along the rays."""
        single = np.float32
        found = work.scene.mesh.trace(
            start.astype(single, copy=False), way.astype(single, copy=False), limits
        )
        return found, None

    records, _, rays = march(source, schedule.ends, held, where.members(), mask, trace)
    work.counts.rays += rays
    work.counts.chords += rays
    return records


def _at_once(
    work: Work, projectors: IndexArray, source: NDArray[Any], held: BoolArray, block: IndexArray
) -> Records:
    """As _march for few projectors: all their chords in one batch, of which the first that hits counts."""
    schedule = work.schedule
    chord, which = np.nonzero(held.take(block.take(projectors), 1))
    controls = source.take(projectors.take(which), 2)
    start = np.einsum("kn,kcn->cn", schedule.ends.astype(source.dtype).T.take(chord, 1), controls)
    ways = np.diff(schedule.ends, axis=0).astype(source.dtype)
    way = np.einsum("kn,kcn->cn", ways.T.take(chord, 1), controls)
    work.counts.rays += len(chord)
    work.counts.chords += len(chord)
    found = work.scene.mesh.trace(
        start.astype(np.float32, copy=False),
        way.astype(np.float32, copy=False),
        np.full(len(chord), 1.0 + OVERLAP, np.float32),
    )
    # The chords come in order: of several hits of a projector the last to be written is the first.
    hit = np.flatnonzero(found >= 0)[::-1]
    first = np.full(len(projectors), -1)
    first[which[hit]] = hit
    of = np.flatnonzero(first >= 0)
    first = first[of]
    return Records(projectors[of], chord[first], found[first])


def _chord_hits(work: Work, records: Records) -> Solutions:
    """Hits as the chords have them: where on the chord, and the triangle's nearest point to it."""
    low, high = work.schedule.breaks[records.chord], work.schedule.breaks[records.chord + 1]
    controls = work.batch.points.take(records.projector, 2)
    start, end = (np.einsum("nk,kcn->cn", work.schedule.ends[records.chord + k], controls) for k in (0, 1))
    way, limits = end - start, np.full(len(low), 1.0 + OVERLAP, np.float32)
    share = work.scene.mesh.trace_distance(start.astype(np.float32), way.astype(np.float32), limits)
    share = np.minimum(share.astype(np.float64), 1.0)
    weights = np.clip(work.scene.barycentric(start + way * share, records.triangle), 0.0, 1.0)
    weights /= np.maximum(weights.sum(axis=0), 1.0)
    return Solutions(low + share * (high - low), records.triangle, weights, np.ones(len(low), bool))
