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

from ..projection.typing import BoolArray, IndexArray
from .curves import Bundle, Solutions
from .hits import CastCounts, Hits
from .occupancy import Stretches
from .records import Records
from .scene import CastScene
from .schedule import Schedule

# Chords overlap by this share of their length, so that no hit falls between two.
OVERLAP = 1e-5

# A solution may lie this share of a chord before or after the chord that found it.
NEIGHBOURHOOD = 0.25

# Rays that have hit stay in their block's batch, switched off, until they are more than
# this share of it: picking out single ones costs as much as casting some for nothing.
MOST_DEAD = 0.5

# Projectors that lie in memory one after the other, where no blocks are known.
RUN = 64

# float32 is good enough for chord ends while its rounding of the control points
# is a smaller share than this of the tolerance.
ROUNDING_SHARE = 0.1


class Work(NamedTuple):
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


def cast_chords(
    scene: CastScene,
    bundle: Bundle,
    mask: BoolArray,
    schedule: Schedule,
    counts: CastCounts,
    where: Stretches | None = None,
    last: bool = True,
) -> tuple[Hits, NDArray[np.intp]]:
    """Cast the projectors of ``bundle``, cast space; mask: (N,) says which exist.

    schedule: the tile's chords. Position and tangent of the answer are not filled
    in yet (``complete``). where: the stretches that are not empty, if known. last: keep
    hits that the curves do not bear out as the chords have them. Otherwise they are left
    out, and the second answer is the projectors that have one.
    """
    hits = Hits.empty(bundle.count)._replace(mask=mask)
    work = Work(scene, bundle, schedule, hits, counts)
    records = _march(work, mask, where)
    low, high = schedule.breaks[records.chord], schedule.breaks[records.chord + 1]
    curves = bundle.take(records.projector)
    span = bundle.spans.locate(0.5 * (low + high))[0]
    slack = NEIGHBOURHOOD * (high - low)
    low, high = low - slack, high + slack
    found = curves.solve(scene, records.triangle, span, low, high)
    counts.walked += curves.walk(scene, span, low, high, found)
    work.store(records.projector, found, np.flatnonzero(found.inside))
    doubtful = np.flatnonzero(~found.inside)
    if last:
        counts.unresolved += len(doubtful)
        some = records.take(doubtful)
        work.store(some.projector, _chord_hits(work, some), np.arange(len(doubtful)))
    return hits, records.projector[doubtful]


def complete(hits: Hits, bundle: Bundle) -> Hits:
    """The hits of ``bundle`` with their positions and tangents."""
    t = np.where(hits.triangle >= 0, hits.t, 1.0)
    position, tangent = bundle.at(t)
    bundle.steer(t, tangent)
    if not hits.mask.all():
        position[:, ~hits.mask] = 0.0
        tangent[:, ~hits.mask] = 0.0
    return hits._replace(position=position, tangent=tangent)


def _march(work: Work, mask: BoolArray, where: Stretches | None) -> Records:
    """The first chord that hits, for every projector, all in step; chords through nothing are left out.

    Projectors lie block by block: what is taken of them at a chord are whole blocks, in
    one piece of memory each, and their rays are near each other.
    """
    bundle, schedule = work.bundle, work.schedule
    reach = np.abs(bundle.single).max(initial=0.0)
    narrow = reach * np.finfo(np.float32).eps < ROUNDING_SHARE * schedule.finest
    source: NDArray[Any] = bundle.single if narrow else bundle.points
    if where is None:
        everything = np.ones((1, -(-bundle.count // RUN)), bool)
        where = Stretches(np.array([0.0, 1.0]), everything, np.arange(bundle.count) // RUN)
    members = where.members()
    size = members.shape[1]
    controls = source.take(members.ravel(), 2)
    searching = mask[members] & (members >= 0)
    # Of each ray, negative where none is cast, and how many of a block are.
    limits = np.where(searching, np.float32(1.0 + OVERLAP), np.float32(-1.0))
    left = searching.sum(axis=1)
    slack = NEIGHBOURHOOD * np.diff(schedule.breaks)
    held = where.within(schedule.breaks[:-1] - slack, schedule.breaks[1:] + slack)
    weights = schedule.ends.astype(source.dtype)
    ways = np.diff(schedule.ends, axis=0).astype(source.dtype)
    triangle = np.full(members.size, -1, np.int32)
    chords = np.zeros(members.size, np.intp)
    for chord in range(schedule.count):
        blocks = np.flatnonzero(held[chord] & (left > 0))
        count = int(left[blocks].sum())
        if count == 0:
            continue
        work.counts.chords += count
        now = limits.take(blocks, 0).ravel()
        sparse = count < (1.0 - MOST_DEAD) * len(now)
        if sparse:
            rays = np.flatnonzero(now > 0.0)
            slots = blocks[rays // size] * size + rays % size
            some, now = controls.take(slots, 2), now.take(rays)
        elif len(blocks) < len(members):
            some = controls.reshape(*source.shape[:2], *members.shape).take(blocks, 2)
            some = some.reshape(*source.shape[:2], -1)
        else:
            some = controls
        start = np.einsum("k,kcn->cn", weights[chord], some)
        way = np.einsum("k,kcn->cn", ways[chord], some)
        work.counts.rays += count
        found = work.scene.trace(
            start.astype(np.float32, copy=False), way.astype(np.float32, copy=False), now
        )
        hit = np.flatnonzero(found >= 0)
        if len(hit) == 0:
            continue
        slot = slots[hit] if sparse else blocks[hit // size] * size + hit % size
        triangle[slot], chords[slot] = found[hit], chord
        limits.ravel()[slot] = -1.0
        left -= np.bincount(slot // size, minlength=len(left))
    slot = np.flatnonzero(triangle >= 0)
    return Records(members.ravel()[slot], chords[slot], triangle[slot])


def _chord_hits(work: Work, records: Records) -> Solutions:
    """Hits as the chords have them: where on the chord, and the triangle's nearest point to it."""
    low, high = work.schedule.breaks[records.chord], work.schedule.breaks[records.chord + 1]
    controls = work.bundle.points.take(records.projector, 2)
    start, end = (np.einsum("nk,kcn->cn", work.schedule.ends[records.chord + k], controls) for k in (0, 1))
    way, limits = end - start, np.full(len(low), 1.0 + OVERLAP, np.float32)
    share = work.scene.trace_distance(start.astype(np.float32), way.astype(np.float32), limits)
    share = np.minimum(share.astype(np.float64), 1.0)
    weights = np.clip(work.scene.barycentric(start + way * share, records.triangle), 0.0, 1.0)
    weights /= np.maximum(weights.sum(axis=0), 1.0)
    return Solutions(low + share * (high - low), records.triangle, weights, np.ones(len(low), bool))
