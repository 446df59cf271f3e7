# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact casting: the first hit in float64, certified by traversal of prisms.

Chords within ε of the projectors (``chord_bounds``) are cast at prisms that enclose all
points within ε of each triangle (``prisms``). Where a chord enters or leaves a prism,
the curve itself is intersected with that triangle in float64. A hit bounds the traversal, which
continues until every prism before the hit has been entered. Embree cannot separate prisms that are
entered at one place, so rays are also traced against the triangles themselves, as far as the
thickness of a prism. If the first prism contains a hit well within its triangle, one such ray
certifies it (``direct_hits``); only the other projectors are traversed.
Chords through space that certainly contains no prism (``occupancy``) are not cast.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...projection.arrays import put_columns
from ...projection.typing import Array, BoolArray, IndexArray
from ..common.hits import CastCounts, CastError, Hits
from ..curves.chord_rules import MOST_CERTAIN
from ..curves.march import march
from ..curves.projector_batch import ProjectorBatch
from ..scene.cast_scene import CastScene
from ..scene.stretches import stretches
from .chord_bounds import certain_chords
from .direct_hits import certify
from .traversal import (
    RESTART,
    Rays,
    Traversal,
    advance,
    chord_ends,
    crossing_time,
    length_of,
    meet,
    meet_prisms,
    next_chords,
    past_faces,
    time_of,
)

# Prisms that a step back finds are separate if they begin this share of a step apart.
SLIGHT = np.float32(0.1)

# Chord ends are computed in float32 where their rounding is less than this, in cast units.
LARGEST_ROUNDING = 1e-6

# A traversal that meets more faces than this, as only one along a prism's face does, takes
# steps that grow by this factor from then on, so that it ends.
MOST_FACES = 4096
GROWTH = 1.05

# The way of projectors out of a prism in which they begin is checked in so many straight pieces.
FIRST_LOOKS = 16

# So few projectors are not divided into halves any further.
FEWEST = 64

# Things before a hit that are examined one after the other.
LAYERS = 4


def cast_exact(
    scene: CastScene, batch: ProjectorBatch, mask: BoolArray, columns: int | None, counts: CastCounts
) -> Hits:
    """The first hits of the projectors of ``batch``, cast space; mask: (N,) says which exist.

    columns: given if the projectors are whole rows of that many neighbouring pixels; empty
    space is then skipped for blocks of them. Positions and tangents are undefined (see
    ``chords.complete``). t is exact to float64's rounding. Candidates are found in float32:
    hits less than RESTART apart, in cast units, may be exchanged, and a triangle
    seen at a slant may be missed if its prism is entered together with another and something
    else follows at once (docs/accuracy.md has the figures).
    Raises CastError if the memory does not hold the prisms, and if projectors far larger
    than the scene would need more than MOST_CERTAIN chords.
    """
    if scene.shells:
        return _cast_shells(scene, batch, mask, columns, counts)
    prisms = scene.prisms
    hits = Hits.empty(batch.count)._replace(mask=mask)
    present = np.flatnonzero(mask)
    if len(present) == 0:
        return hits
    if len(present) < batch.count:
        # The others take part in bounds, which they would widen anywhere else.
        points = batch.points.copy()
        points[:, :, ~mask] = points[:, :, present[:1]]
        batch = ProjectorBatch(batch.spans, points)
    chords, bound = certain_chords(batch.spans, batch.points, prisms.lower, prisms.upper, prisms.epsilon)
    if chords is None:
        return hits
    if bound > prisms.epsilon:
        return _in_halves(scene, batch, mask, counts)
    # Rounding of a sum of that many terms.
    farthest = max(float(batch.points.max()), -float(batch.points.min()))
    rounding = (len(batch.points) + 1) * farthest * 2.0**-24
    where = stretches(prisms.occupancy, batch.spans, batch.single, columns, prisms.epsilon)
    held = where.within(chords.breaks[:-1], chords.breaks[1:])
    traversal = Traversal(
        scene=scene,
        prisms=prisms,
        batch=batch,
        chords=chords,
        hits=hits,
        looked=np.full(batch.count, np.inf),
        block=where.block,
        following=next_chords(held),
        counts=counts,
        far=rounding > LARGEST_ROUNDING,
    )
    if chords.breaks[0] == 0.0:
        _meet_at_start(traversal, present[where.held[0].take(where.block.take(present))])
    rays, found = _first_wave(traversal, held, where.members(), mask)
    # A bound on rational chords says nothing of ‖q''‖.
    rational = batch.spans.point_weights is not None
    doubtful = np.arange(len(found)) if rational else certify(traversal, rays, found)
    _traverse(traversal, rays.take(doubtful), found[doubtful])
    return hits


def _cast_shells(
    scene: CastScene, batch: ProjectorBatch, mask: BoolArray, columns: int | None, counts: CastCounts
) -> Hits:
    """Cast at one part of the scene after the other."""
    hits = Hits.empty(batch.count)._replace(mask=mask)
    for part, numbers in scene.shells:
        points = (batch.points - part.centre[:, None]) * part.scale
        found = cast_exact(part, ProjectorBatch(batch.spans, points), mask, columns, counts)
        nearer = np.flatnonzero(found.t < hits.t)
        hits.t[nearer] = found.t[nearer]
        hits.triangle[nearer] = numbers[found.triangle[nearer]]
        put_columns(hits.barycentric, nearer, found.barycentric.take(nearer, 1))
    return hits


def _traverse(traversal: Traversal, rays: Rays, found: NDArray[np.int32]) -> None:
    """Follow rays at faces of the prisms of triangles ``found`` (M,) until all first hits are certain."""
    step, faces = RESTART, 0
    while len(rays.projector):
        faces += 1
        if faces > MOST_FACES:
            step *= GROWTH
            traversal.counts.unresolved += len(rays.projector)
        fresh = np.flatnonzero((found != rays.last).all(axis=0))
        tested = rays.take(fresh)
        also, others = _skipped_prisms(traversal, rays, found, step)
        pairs = np.concatenate([fresh, also])
        meet_prisms(traversal, rays.take(pairs), np.concatenate([found[fresh], others]), step)
        _meet_passed_over(traversal, tested, found[fresh], crossing_time(traversal, tested, found[fresh]))
        rays.last[1], rays.last[0] = rays.last[0], found
        rays, found = advance(traversal, past_faces(traversal, rays, step))


def _in_halves(scene: CastScene, batch: ProjectorBatch, mask: BoolArray, counts: CastCounts) -> Hits:
    """Cast the projectors in two halves, which need fewer chords than all together."""
    if batch.count <= FEWEST:
        raise CastError(
            "exact casting would need more than {0:,} chords a projector, so much larger than the scene is "
            "the viewing volume: set the pixel error above 0, or bring the control surfaces nearer",
            MOST_CERTAIN,
        )
    hits = Hits.empty(batch.count)
    for part in np.array_split(np.arange(batch.count), 2):
        hits.put(part, cast_exact(scene, batch.take(part), mask[part], None, counts))
    return hits


def _meet_at_start(traversal: Traversal, alive: NDArray[np.intp]) -> None:
    """Intersect curves with the triangles whose prisms they begin in: chords never enter these.

    A line along one of the three axes leaves the two caps of any prism within √3 times
    the distance between them.
    """
    at = np.einsum("k,kcn->cn", traversal.chords.ends[0], traversal.batch.points.take(alive, 2))
    held = np.flatnonzero(traversal.prisms.occupancy.holds_finely(at - RESTART, at + RESTART))
    alive, at = alive.take(held), at.take(held, 1)
    if len(alive) == 0:
        return
    length = 2.0 * np.sqrt(3.0) * (traversal.prisms.thickness + RESTART)
    for axis in np.eye(3):
        projector = alive
        start, gone = at, np.zeros(len(alive))
        while len(projector):
            way = np.repeat(axis[:, None] * length, len(projector), axis=1)
            origin = start + axis[:, None] * gone
            found, far = traversal.trace(origin, way, (1.0 - gone / length).astype(np.float32))
            met = np.flatnonzero(found >= 0)
            projector, start = projector[met], start.take(met, 1)
            meet(traversal, projector, np.zeros(len(met), np.intp), found[met])
            gone = gone[met] + far[met] * length + RESTART
    # Among many small triangles a way out of one prism skips others.
    first = traversal.batch.points.take(alive, 2)
    way = np.einsum("k,kcn->cn", traversal.chords.ends[1] - traversal.chords.ends[0], first)
    share = np.minimum(length / length_of(way), 1.0) / FIRST_LOOKS
    none, zero = np.full((2, len(alive)), -1, np.int32), np.zeros(len(alive), np.intp)
    for step in range(FIRST_LOOKS):
        _meet_passed_over(
            traversal, Rays(alive, zero, step * share, none), none[0], share * traversal.chords.breaks[1]
        )


def _first_wave(
    traversal: Traversal, held: BoolArray, members: IndexArray, mask: BoolArray
) -> tuple[Rays, NDArray[np.int32]]:
    """Follow the chords of all projectors, all in step, until each enters a prism."""
    source: NDArray[Any] = traversal.batch.points if traversal.far else traversal.batch.single
    before = traversal.counts.rays
    records, share, cast = march(source, traversal.chords.ends, held, members, mask, traversal.trace)
    traversal.counts.chords += cast
    traversal.counts.rays = before + cast
    last = np.full((2, len(share)), -1, np.int32)
    return Rays(records.projector, records.chord, np.minimum(share, 1.0), last), records.triangle


def _skipped_prisms(
    traversal: Traversal, rays: Rays, triangle: NDArray[np.int32], step: float
) -> tuple[IndexArray, NDArray[np.int32]]:
    """The triangles whose prisms begin in the ``step`` past a face, which traversal skips.

    Short rays back from where traversal continues find the last of them first.
    triangle: (M,) whose prisms' faces were met. Returns numbers of rays, and a triangle for each.
    """
    start, end = chord_ends(traversal, rays)
    way = end - start
    start += way * rays.share
    way *= step / length_of(way)
    start += way
    limits = np.full(len(triangle), 1.5, np.float32)
    numbers, triangles, ray = [], [], np.arange(len(triangle))
    for _ in range(LAYERS):
        found, far = traversal.trace(start, -way, limits)
        other = np.flatnonzero((found >= 0) & (found != triangle))
        if len(other) == 0:
            break
        ray, triangle = ray[other], found[other]
        numbers.append(ray)
        triangles.append(triangle)
        far = far[other] + SLIGHT
        way, limits = way.take(other, 1), limits[other] - far
        start = start.take(other, 1) - way * far
    if not numbers:
        return np.empty(0, np.intp), np.empty(0, np.int32)
    return np.concatenate(numbers), np.concatenate(triangles)


def _meet_passed_over(traversal: Traversal, rays: Rays, triangle: NDArray[np.int32], length: Array) -> None:
    """Trace rays against the triangles, from where prisms were met to the hit or the prisms' other side.

    Traversal skips prisms that are entered less than RESTART past another: those of neighbours in one
    plane, of sheets that nearly coincide. Their hits lie before the prism's other side or the next test,
    so near that the straight ray does not leave the curve.
    triangle: (M,) whose prisms were met, and which have been intersected already. length: (M,) in t.
    """
    projector, met_t = rays.projector, time_of(traversal, rays)
    end_t = np.minimum(met_t + length, traversal.chords.breaks[-1])
    # From where the last ray ended: a skipped prism may be so slanted that it is left only
    # past the next hit.
    before = np.maximum(
        traversal.looked[projector], met_t - np.diff(traversal.chords.breaks).take(rays.chord)
    )
    start_t = np.minimum(met_t, before)
    traversal.looked[projector] = end_t
    curves = traversal.batch.take(projector)
    start = curves.place(start_t)
    span = traversal.chords.span[rays.chord]
    for _ in range(LAYERS):
        way = curves.place(np.minimum(traversal.hits.t.take(projector), end_t)) - start
        slack = way * (RESTART / length_of(way))
        origins, ways = (start - slack).astype(np.float32), (way + 2.0 * slack).astype(np.float32)
        traversal.counts.rays += len(projector)
        found = traversal.scene.mesh.trace(origins, ways, np.ones(len(projector), np.float32))
        other = np.flatnonzero((found >= 0) & (found != traversal.hits.triangle.take(projector)))
        if len(other) == 0:
            break
        before = traversal.hits.t[projector[other]]
        # In float32 a hit may be on the other side of an edge.
        across = traversal.scene.neighbours.take(found[other], 1).ravel()
        fresh, there = other[found[other] != triangle[other]], across >= 0
        pairs = np.concatenate([fresh, np.tile(other, 3)[there]])
        meet(traversal, projector[pairs], span[pairs], np.concatenate([found[fresh], across[there]]))
        confirmed = traversal.hits.triangle[projector[other]] == found[other]
        lost = other[(traversal.hits.t[projector[other]] >= before) | ~confirmed]
        if len(lost):
            # If it is not there either, it is passed.
            limits = np.ones(len(lost), np.float32)
            far = traversal.scene.mesh.trace_distance(origins[:, lost], ways[:, lost], limits)
            start[:, lost] += (way[:, lost] + 2.0 * slack[:, lost]) * far
        projector, triangle, end_t, span = projector[other], found[other], end_t[other], span[other]
        start, curves = start.take(other, 1), curves.take(other)
