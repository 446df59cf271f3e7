# SPDX-License-Identifier: GPL-3.0-or-later
"""Curved projectors: chords find candidates, float64 decides.

All projectors of a tile take the same steps in t, so a step is one batch of
rays. A chord's hit is only recorded; afterwards the curve itself is met with the
hit triangle's plane. Where that point lies outside the triangle the neighbours
are tried, then finer chords over the same stretch; and where these find nothing
the hit was false and the projector goes on behind it.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..projection.typing import BoolArray
from .compare import compare, thin_things
from .curves import Bundle
from .hits import CastCounts, Hits
from .occupancy import Stretches
from .records import Records
from .refine import NEIGHBOURHOOD, OVERLAP, Work, refine, solve
from .scene import CastScene
from .schedule import Schedule

# Rays that have hit stay in their block's batch, switched off, until they are more than
# this share of it: picking out single ones costs as much as casting some for nothing.
MOST_DEAD = 0.5

# Projectors that lie in memory one after the other, where no blocks are known.
RUN = 64

# float32 is good enough for chord ends while its rounding of the control points
# is a smaller share than this of the tolerance.
ROUNDING_SHARE = 0.1


def cast_chords(
    scene: CastScene,
    bundle: Bundle,
    mask: BoolArray,
    schedule: Schedule | None,
    columns: int | None,
    counts: CastCounts,
    where: Stretches | None = None,
) -> tuple[Hits, NDArray[np.intp]]:
    """Cast the projectors of ``bundle``, cast space; mask: (N,) says which exist.

    schedule: the tile's chords, None where nothing of the scene is in reach.
    columns: when given, the projectors are rows of this many pixels, and each is
    compared with its neighbours. Position and tangent of the answer are not filled
    in yet (``complete``). where: the stretches that are not empty, if known. Returns
    the pixels, too, around which there may be things too thin for that
    (``compare.thin_things``).
    """
    hits, thin = Hits.empty(bundle.count), np.empty(0, np.intp)
    if schedule is not None:
        counts.error_bound = max(counts.error_bound, schedule.error / schedule.finer**2)
        work = Work(scene, bundle, schedule, hits, np.full(bundle.count, np.inf), counts)
        records = _march(work, mask, where)
        while len(records.projector):
            records = _settle(work, records)
        if columns:
            compare(work, mask, columns)
            thin = thin_things(work, columns)
    hits.mask[:] = mask
    return hits, thin


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
        found = work.trace(start, way, now)
        hit = np.flatnonzero(found >= 0)
        if len(hit) == 0:
            continue
        slot = slots[hit] if sparse else blocks[hit // size] * size + hit % size
        triangle[slot], chords[slot] = found[hit], chord
        limits.ravel()[slot] = -1.0
        left -= np.bincount(slot // size, minlength=len(left))
    slot = np.flatnonzero(triangle >= 0)
    return Records(members.ravel()[slot], chords[slot], triangle[slot])


def _settle(work: Work, records: Records) -> Records:
    """Solve recorded hits and store them; returns the hits found behind false ones."""
    schedule = work.schedule
    low, high = schedule.breaks[records.chord], schedule.breaks[records.chord + 1]
    curves = work.bundle.take(records.projector)
    found = solve(work, curves, low, high, records.triangle)
    work.store(records.projector, found, np.flatnonzero(found.inside))
    rest = np.flatnonzero(~found.inside)
    if len(rest) == 0:
        return records.take(rest)
    work.counts.refined += len(rest)
    again = records.take(rest)
    hit, fine = refine(work, curves.take(rest), low[rest], high[rest])
    work.store(again.projector[hit], fine, np.arange(len(hit)))
    missed = np.ones(len(rest), bool)
    missed[hit] = False
    false = np.flatnonzero(missed)
    t = found.t[rest[false]]
    t = np.where(np.isnan(t), 0.5 * (low + high)[rest[false]], t)
    projector = again.projector[false]
    work.passed[projector] = np.minimum(work.passed[projector], t)
    return _continue(work, again.take(false))


def _continue(work: Work, records: Records) -> Records:
    """The next hits of projectors whose recorded ones were false, each from its own chord on."""
    work.counts.false_hits += len(records.chord)
    ends, count = work.schedule.ends, work.schedule.count
    projector, chord = records.projector, records.chord + 1
    going = np.flatnonzero(chord < count)
    projector, chord = projector[going], chord[going]
    controls = work.bundle.points.take(projector, 2)
    start = np.einsum("nk,kcn->cn", ends[chord], controls)
    parts = [records.take(np.empty(0, np.intp))]
    while len(chord):
        end = np.einsum("nk,kcn->cn", ends[chord + 1], controls)
        found = work.trace(start, end - start, np.full(len(chord), 1.0 + OVERLAP, np.float32))
        hit = np.flatnonzero(found >= 0)
        parts.append(Records(projector[hit], chord[hit], found[hit]))
        going = np.flatnonzero((found < 0) & (chord + 1 < count))
        projector, chord = projector[going], chord[going] + 1
        controls, start = controls.take(going, 2), end.take(going, 1)
    return Records.joined(parts)
