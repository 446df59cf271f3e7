# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact casting: the first hit in float64, certified by a walk through prisms.

Chords within ε of the projectors (``certify``) are cast at prisms that enclose all
points within ε of each triangle (``prisms``). Where a chord enters or leaves a prism
the curve itself is met with that triangle in float64; a hit bounds the walk, which
goes on until nothing lies before it that was not entered. Prisms that are entered at
one place, which Embree cannot tell apart, are left to a look at the triangles
themselves, as far as the thickness of a prism. Where the first prism that is met holds a
hit well within its triangle, that look is all that is needed; only the others are walked.
Chords through space that certainly holds no prism (``occupancy``) are not cast.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..projection.typing import Array, BoolArray, IndexArray
from .certify import Chords, certain_chords
from .curves import T_ROUNDING, Bundle, Solutions
from .hits import CastCounts, Hits
from .march import OVERLAP, march
from .occupancy import stretches
from .prisms import Float32Array
from .scene import CastScene, PrismScene

# A walk goes on this far, in cast units, behind the face it has met: 32 roundings (2⁻²⁴)
# of a coordinate of 1, so that it does not meet the face again.
RESTART = 2e-6

# Prisms that a step back finds are told apart when they begin this share of a step apart.
SLIGHT = np.float32(0.1)

# Shorter ways than this have no direction.
SHORTEST = 1e-300

# Chord ends are computed in float32 where their rounding is less than this, in cast units.
LARGEST_ROUNDING = 1e-6

# A walk that meets more faces than this, as only one along a prism's face does, takes
# steps that grow by this factor from then on: it must end.
MOST_FACES = 4096
GROWTH = 1.05

# What lies beyond the prisms' box, in cast units, is passed at once.
BORDER = 1e-3

# A straight look from a prism's face to a hit strays this far from the curve at most: a few
# roundings (2⁻²⁴) of a coordinate of 1.
STRAY = 3e-7

# A way is well within its triangle where it stays this far from the edges, in cast units: float32
# cannot take a neighbour for it.
WELL_WITHIN = 2e-6

# Where projectors begin in a prism their way out of it is looked at in so many straight pieces.
FIRST_LOOKS = 16

# Things before a hit that are looked at one after the other.
LAYERS = 4


class Rays(NamedTuple):
    """Places where walks go on. projector, chord: (M,); share: (M,) of the chord; the last
    two triangles that were met on this chord: (2, M), -1 for none.
    """

    projector: NDArray[np.intp]
    chord: NDArray[np.intp]
    share: Array
    last: NDArray[np.int32]

    def take(self, index: IndexArray) -> Rays:
        """The rays at ``index``."""
        return Rays(self.projector[index], self.chord[index], self.share[index], self.last[:, index])


class Walk(NamedTuple):
    """What every step of a tile's walk looks at and fills in.

    looked: (N,) t up to which the triangles themselves have been looked at, inf at first.
    block: (N,) of each projector. following: (n+1, B) for each chord and block the first from
    there on that may enter a prism, n if none does. far: whether projectors reach so far out
    that float32 would move chords in the scene.
    """

    scene: CastScene
    prisms: PrismScene
    bundle: Bundle
    chords: Chords
    hits: Hits
    looked: Array
    block: IndexArray
    following: NDArray[np.intp]
    counts: CastCounts
    far: bool

    def trace(
        self, start: NDArray[Any], way: NDArray[Any], limits: Float32Array
    ) -> tuple[NDArray[np.int32], NDArray[Any]]:
        """The first prisms on the chords from start (3, M) along way, and where on these."""
        self.counts.rays += int(np.count_nonzero(limits > 0.0))
        if not self.far:
            return self.prisms.trace(
                start.astype(np.float32, copy=False), way.astype(np.float32, copy=False), limits
            )
        # From where the chord enters the box of all prisms.
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            inverse = 1.0 / way
            lower, upper = self.prisms.lower[:, None] - BORDER, self.prisms.upper[:, None] + BORDER
            sides = np.fmin((lower - start) * inverse, (upper - start) * inverse)
            skipped = np.clip(np.nan_to_num(sides, nan=0.0).max(axis=0), 0.0, 2.0)
            found, far = self.prisms.trace(
                (start + way * skipped).astype(np.float32),
                way.astype(np.float32),
                (limits - skipped).astype(np.float32),
            )
        return found, far + skipped


def cast_exact(
    scene: CastScene, bundle: Bundle, mask: BoolArray, columns: int | None, counts: CastCounts
) -> Hits:
    """The first hits of the projectors of ``bundle``, cast space; mask: (N,) says which exist.

    columns: says that the projectors are whole rows of that many neighbouring pixels; empty
    space is then skipped for blocks of them. Positions and tangents are left to
    ``chords.complete``. t is exact to float64's rounding. What is left to float32 is finding
    candidates: hits less than RESTART apart, in cast units, may be exchanged, and a triangle
    seen at a slant may be missed if its prism is entered together with another and something
    else follows at once (docs/accuracy.md has the figures).
    Raises CastError when there is not enough memory for the prisms.
    """
    prisms = scene.prisms
    hits = Hits.empty(bundle.count)._replace(mask=mask)
    present = np.flatnonzero(mask)
    if len(present) == 0:
        return hits
    if len(present) < bundle.count:
        # They take part in bounds; somewhere else they would widen these.
        points = bundle.points.copy()
        points[:, :, ~mask] = points[:, :, present[:1]]
        bundle = Bundle(bundle.spans, points)
    chords, _ = certain_chords(bundle.spans, bundle.points, prisms.lower, prisms.upper, prisms.epsilon)
    if chords is None:
        return hits
    # Rounding of a sum of that many terms.
    farthest = max(float(bundle.points.max()), -float(bundle.points.min()))
    rounding = (len(bundle.points) + 1) * farthest * 2.0**-24
    where = stretches(prisms.occupancy, bundle.spans, bundle.single, columns, prisms.epsilon)
    held = where.within(chords.breaks[:-1], chords.breaks[1:])
    walk = Walk(
        scene,
        prisms,
        bundle,
        chords,
        hits,
        np.full(bundle.count, np.inf),
        where.block,
        _following(held),
        counts,
        rounding > LARGEST_ROUNDING,
    )
    if chords.breaks[0] == 0.0:
        _look_around(walk, present[where.held[0].take(where.block.take(present))])
    rays, found = _first_wave(walk, held, where.members(), mask)
    # A bound on rational chords says nothing of ‖q''‖.
    rational = bundle.spans.point_weights is not None
    doubtful = np.arange(len(found)) if rational else _settle(walk, rays, found)
    rays, found = rays.take(doubtful), found[doubtful]
    step, faces = RESTART, 0
    while len(rays.projector):
        faces += 1
        if faces > MOST_FACES:
            step *= GROWTH
            counts.unresolved += len(rays.projector)
        fresh = np.flatnonzero((found != rays.last).all(axis=0))
        tested = rays.take(fresh)
        _meet_near(walk, tested, found[fresh])
        _overtaken(walk, rays, found, step)
        _look(walk, tested, found[fresh], _crossing(walk, tested, found[fresh]))
        rays.last[1], rays.last[0] = rays.last[0], found
        rays, found = _advance(walk, _behind(walk, rays, step))
    return hits


def _look_around(walk: Walk, alive: NDArray[np.intp]) -> None:
    """Meet the curves with the triangles whose prisms they begin in: chords never enter these.

    A way along one of the three axes leaves the two caps of any prism within √3 times
    the distance between them.
    """
    at = np.einsum("k,kcn->cn", walk.chords.ends[0], walk.bundle.points.take(alive, 2))
    held = np.flatnonzero(walk.prisms.occupancy.holds_finely(at - RESTART, at + RESTART))
    alive, at = alive.take(held), at.take(held, 1)
    if len(alive) == 0:
        return
    length = 2.0 * np.sqrt(3.0) * (walk.prisms.thickness + RESTART)
    for axis in np.eye(3):
        projector = alive
        start, gone = at, np.zeros(len(alive))
        while len(projector):
            way = np.repeat(axis[:, None] * length, len(projector), axis=1)
            origin = start + axis[:, None] * gone
            found, far = walk.trace(origin, way, (1.0 - gone / length).astype(np.float32))
            met = np.flatnonzero(found >= 0)
            projector, start = projector[met], start[:, met]
            _meet(walk, projector, np.zeros(len(met), np.intp), found[met])
            gone = gone[met] + far[met] * length + RESTART
    # Among many small triangles a way out of one prism passes others over.
    first = walk.bundle.points.take(alive, 2)
    way = np.einsum("k,kcn->cn", walk.chords.ends[1] - walk.chords.ends[0], first)
    share = np.minimum(length / np.maximum(np.sqrt((way**2).sum(axis=0)), SHORTEST), 1.0) / FIRST_LOOKS
    none, zero = np.full((2, len(alive)), -1, np.int32), np.zeros(len(alive), np.intp)
    for step in range(FIRST_LOOKS):
        _look(walk, Rays(alive, zero, step * share, none), none[0], share * walk.chords.breaks[1])


def _following(held: BoolArray) -> NDArray[np.intp]:
    """See Walk.following; held: (n, B)."""
    count, blocks = held.shape
    following = np.full((count + 1, blocks), count)
    for chord in range(count - 1, -1, -1):
        following[chord] = np.where(held[chord], chord, following[chord + 1])
    return following


def _first_wave(
    walk: Walk, held: BoolArray, members: IndexArray, mask: BoolArray
) -> tuple[Rays, NDArray[np.int32]]:
    """Follow the chords of all projectors, in step, until each enters a prism."""
    source: NDArray[Any] = walk.bundle.points if walk.far else walk.bundle.single
    before = walk.counts.rays
    records, share, cast = march(source, walk.chords.ends, held, members, mask, walk.trace)
    walk.counts.chords += cast
    walk.counts.rays = before + cast
    last = np.full((2, len(share)), -1, np.int32)
    return Rays(records.projector, records.chord, np.minimum(share, 1.0), last), records.triangle


def _settle(walk: Walk, rays: Rays, triangle: NDArray[np.int32]) -> IndexArray:
    """Keep the hits of which it is certain that they are the first; the other rays have to be walked on.

    rays: at the first face that each projector meets. triangle: (M,) whose prism that is. Its
    prism is the only one that was entered, but for some that are entered at the same place,
    and its neighbours', which are not entered where a hit is well within the triangle. A
    look at the triangles themselves, straight from there to the hit, finds what is between.
    """
    scene, chords = walk.scene, walk.chords
    curves = walk.bundle.take(rays.projector)
    low = chords.breaks.take(rays.chord)
    steps = np.diff(chords.breaks)
    met_t = low + rays.share * steps.take(rays.chord)
    # Chords of steps h are ‖q''‖ h²/16 from their curves, at most ε, a straight line over a
    # share of one ‖q''‖ (share h)²/8; it may end on the next chord.
    length = np.minimum(steps, np.append(steps[1:], steps[-1])).take(rays.chord)
    straight = min(float(np.sqrt(0.5 * STRAY / walk.prisms.epsilon)), 1.0)
    found = curves.next_root(scene, triangle, chords.span.take(rays.chord), met_t, met_t + straight * length)
    walk.counts.tested += len(triangle)
    start = curves.place(met_t)
    way = curves.place(np.where(found.inside, found.t, met_t)) - start
    margin = WELL_WITHIN * walk.prisms.steepest.take(triangle)
    with np.errstate(invalid="ignore"):
        certain = found.inside & (found.t < walk.hits.t.take(rays.projector))
        for second, third in (found.barycentric, scene.barycentric(start, triangle)):
            certain &= (second > margin) & (third > margin) & (1.0 - second - third > margin)
    some = np.flatnonzero(certain)
    way, start = way.take(some, 1), start.take(some, 1)
    slack = way * (RESTART / np.maximum(np.sqrt(np.einsum("cn,cn->n", way, way)), SHORTEST))
    walk.counts.rays += len(some)
    seen = scene.trace(
        (start - slack).astype(np.float32),
        (way + 2.0 * slack).astype(np.float32),
        np.ones(len(some), np.float32),
    )
    clear = (seen < 0) | (seen == triangle.take(some))
    some = some[clear]
    certain[:] = False
    certain[some] = True
    _store(walk.hits, rays.projector.take(some), found.take(some))
    return np.flatnonzero(~certain)


def _time(walk: Walk, rays: Rays) -> Array:
    low, high = walk.chords.breaks[rays.chord], walk.chords.breaks[rays.chord + 1]
    return low + rays.share * (high - low)


def _advance(walk: Walk, rays: Rays) -> tuple[Rays, NDArray[np.int32]]:
    """Follow chords until they meet prisms' faces; gives where and which, without those that meet none."""
    chords = walk.chords
    parts, triangles = [], []
    projector, chord, share, last = rays
    controls = walk.bundle.points.take(projector, 2)
    start = np.einsum("kn,kcn->cn", chords.ends.T.take(chord, 1), controls)
    end = np.einsum("kn,kcn->cn", chords.ends.T.take(chord + 1, 1), controls)
    start += (end - start) * share
    while len(projector):
        low, high = chords.breaks[chord], chords.breaks[chord + 1]
        limit = (walk.hits.t[projector] - low) / (high - low)
        limit = np.where(limit < 1.0, (limit - share) / (1.0 - share), 1.0) + OVERLAP
        walk.counts.chords += len(projector)
        found, far = walk.trace(start, end - start, limit.astype(np.float32))
        met = np.flatnonzero(found >= 0)
        if len(met):
            at = share[met] + far[met] * (1.0 - share[met])
            parts.append(Rays(projector[met], chord[met], np.minimum(at, 1.0), last[:, met]))
            triangles.append(found[met])
        chord = walk.following[chord + 1, walk.block[projector]]
        going = np.flatnonzero((found < 0) & (chord < chords.count))
        going = going[walk.hits.t[projector[going]] > chords.breaks[chord[going]]]
        projector, chord = projector[going], chord[going]
        last = np.full((2, len(going)), -1, np.int32)
        share = np.zeros(len(going))
        controls = controls.take(going, 2)
        start = np.einsum("kn,kcn->cn", chords.ends.T.take(chord, 1), controls)
        end = np.einsum("kn,kcn->cn", chords.ends.T.take(chord + 1, 1), controls)
    if not parts:
        return rays.take(np.empty(0, np.intp)), np.empty(0, np.int32)
    return Rays(*(np.concatenate([p[k] for p in parts], axis=-1) for k in range(4))), np.concatenate(
        triangles
    )


def _meet(walk: Walk, projector: IndexArray, span: IndexArray, triangle: NDArray[np.int32]) -> None:
    """Meet curves with triangles, from the spans given on, and keep what is nearer."""
    breaks = walk.bundle.spans.breaks
    walk.counts.tested += len(triangle)
    while len(projector):
        curves = walk.bundle.take(projector)
        # What lies at the very end of a span may come out past it by rounding.
        low, high = breaks[span] - T_ROUNDING, breaks[span + 1] + T_ROUNDING
        found = curves.solve(walk.scene, triangle, span, low, high)
        nearer = np.flatnonzero(found.inside & (found.t < walk.hits.t[projector]))
        _store(walk.hits, projector[nearer], found.take(nearer))
        going = np.flatnonzero(~found.inside & (span + 2 < len(breaks)))
        projector, triangle, span = projector[going], triangle[going], span[going] + 1


def _meet_near(walk: Walk, rays: Rays, triangle: NDArray[np.int32]) -> None:
    """Meet curves with the triangles whose prisms their chords enter or leave.

    Where both ends of a chord lie outside the slab that a prism is in, all that it holds of the curve is
    on this chord. Otherwise the whole curve is met with the triangle.
    """
    scene, chords = walk.scene, walk.chords
    curves = walk.bundle.take(rays.projector)
    ends = (np.einsum("kn,kcn->cn", chords.ends.T.take(rays.chord + k, 1), curves.points) for k in (0, 1))
    slab = walk.prisms.thickness + RESTART
    near = np.logical_or.reduce([np.abs(scene.heights(end, triangle)) <= slab for end in ends])
    long, short = np.flatnonzero(near), np.flatnonzero(~near)
    _meet(walk, rays.projector[long], chords.span[rays.chord[long]], triangle[long])
    walk.counts.tested += len(short)
    chord, projector = rays.chord[short], rays.projector[short]
    found = curves.take(short).solve(
        scene, triangle[short], chords.span[chord], chords.breaks[chord], chords.breaks[chord + 1]
    )
    nearer = np.flatnonzero(found.inside & (found.t < walk.hits.t[projector]))
    _store(walk.hits, projector[nearer], found.take(nearer))


def _store(hits: Hits, projector: IndexArray, found: Solutions) -> None:
    hits.t[projector] = found.t
    hits.triangle[projector] = found.triangle
    hits.barycentric[:, projector] = found.barycentric


def _behind(walk: Walk, rays: Rays, step: float) -> Rays:
    """The rays ``step`` behind the faces they have met, without those that have passed their hit."""
    chords = walk.chords
    controls = walk.bundle.points.take(rays.projector, 2)
    start = np.einsum("kn,kcn->cn", chords.ends.T.take(rays.chord, 1), controls)
    end = np.einsum("kn,kcn->cn", chords.ends.T.take(rays.chord + 1, 1), controls)
    length = np.sqrt(((end - start) ** 2).sum(axis=0))
    share = rays.share + step / np.maximum(length, SHORTEST)
    over = share >= 1.0
    beyond = walk.following[rays.chord + 1, walk.block[rays.projector]]
    chord = np.where(over, beyond, rays.chord)
    share = np.where(over, 0.0, share)
    rays = Rays(rays.projector, chord, share, np.where(over, np.int32(-1), rays.last))
    rays = rays.take(np.flatnonzero(chord < chords.count))
    return rays.take(np.flatnonzero(_time(walk, rays) < walk.hits.t[rays.projector]))


def _overtaken(walk: Walk, rays: Rays, triangle: NDArray[np.int32], step: float) -> None:
    """Meet the triangles whose prisms begin in the ``step`` behind a face, which the walk passes over.

    Short rays back from where walks go on find the last of them first.
    triangle: (M,) whose prisms' faces were met.
    """
    chords = walk.chords
    controls = walk.bundle.points.take(rays.projector, 2)
    start = np.einsum("kn,kcn->cn", chords.ends.T.take(rays.chord, 1), controls)
    way = np.einsum("kn,kcn->cn", chords.ends.T.take(rays.chord + 1, 1), controls) - start
    start += way * rays.share
    way *= step / np.maximum(np.sqrt((way**2).sum(axis=0)), SHORTEST)
    start += way
    limits = np.full(len(triangle), 1.5, np.float32)
    projector, span = rays.projector, chords.span[rays.chord]
    for _ in range(LAYERS):
        found, far = walk.trace(start, -way, limits)
        other = np.flatnonzero((found >= 0) & (found != triangle))
        if len(other) == 0:
            break
        _meet(walk, projector[other], span[other], found[other])
        far = far[other] + SLIGHT
        projector, span, triangle, way = projector[other], span[other], triangle[other], way[:, other]
        start, limits = start[:, other] - way * far, limits[other] - far


def _look(walk: Walk, rays: Rays, triangle: NDArray[np.int32], length: Array) -> None:
    """Look at the triangles themselves, from where prisms were met to the hit or their other side.

    Prisms that are entered less than RESTART behind another are passed over by the
    walk: those of neighbours in one plane, of sheets that nearly coincide. What they
    hold lies before the prism's other side or the next test: so near that the straight
    look does not leave the curve.
    triangle: (M,) whose prisms were met, and which have been met with already. length: (M,) in t.
    """
    projector, met_t = rays.projector, _time(walk, rays)
    end_t = np.minimum(met_t + length, walk.chords.breaks[-1])
    # From where the last look ended: a prism passed over may be so slanted that it is left only
    # behind the next hit.
    before = np.maximum(walk.looked[projector], met_t - np.diff(walk.chords.breaks).take(rays.chord))
    start_t = np.minimum(met_t, before)
    walk.looked[projector] = end_t
    curves = walk.bundle.take(projector)
    start = curves.place(start_t)
    span = walk.chords.span[rays.chord]
    for _ in range(LAYERS):
        way = curves.place(np.minimum(walk.hits.t.take(projector), end_t)) - start
        slack = way * (RESTART / np.maximum(np.sqrt((way**2).sum(axis=0)), SHORTEST))
        origins, ways = (start - slack).astype(np.float32), (way + 2.0 * slack).astype(np.float32)
        walk.counts.rays += len(projector)
        found = walk.scene.trace(origins, ways, np.ones(len(projector), np.float32))
        other = np.flatnonzero((found >= 0) & (found != walk.hits.triangle.take(projector)))
        if len(other) == 0:
            break
        before = walk.hits.t[projector[other]]
        fresh = other[found[other] != triangle[other]]
        _meet(walk, projector[fresh], span[fresh], found[fresh])
        lost = other[walk.hits.t[projector[other]] >= before]
        if len(lost):
            # On the other side of an edge for float32; if not there either, it is passed.
            for across in walk.scene.neighbours[:, found[lost]]:
                there = lost[across >= 0]
                _meet(walk, projector[there], span[there], across[across >= 0])
            limits = np.ones(len(lost), np.float32)
            far = walk.scene.trace_distance(origins[:, lost], ways[:, lost], limits)
            start[:, lost] += (way[:, lost] + 2.0 * slack[:, lost]) * far
        projector, triangle, end_t, span = projector[other], found[other], end_t[other], span[other]
        start, curves = start[:, other], curves.take(other)


def _crossing(walk: Walk, rays: Rays, triangle: NDArray[np.int32]) -> Array:
    """How long in t chords take from one cap of a triangle's prism to the other, at most all of a chord."""
    chords = walk.chords
    controls = walk.bundle.points.take(rays.projector, 2)
    way = np.einsum("kn,kcn->cn", (chords.ends[1:] - chords.ends[:-1]).T.take(rays.chord, 1), controls)
    climb = np.abs(np.einsum("cn,cn->n", way, walk.scene.normals(triangle)))
    share = 2.0 * walk.prisms.thickness / np.maximum(climb, 2.0 * walk.prisms.thickness)
    crossing: Array = np.minimum(1.5 * share, 1.0) * np.diff(chords.breaks).take(rays.chord)
    return crossing
