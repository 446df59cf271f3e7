# SPDX-License-Identifier: GPL-3.0-or-later
"""Traversal for exact casting: chords are followed from prism to prism, where curves are intersected."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, Float32Array, IndexArray
from ..common.hits import CastCounts, Hits
from ..curves.chord_rules import Chords
from ..curves.march import OVERLAP, first_hits
from ..curves.plane_hits import T_ROUNDING, Solutions, solve
from ..curves.projector_batch import ProjectorBatch
from ..scene.cast_scene import CastScene
from ..scene.prisms import PrismScene
from ..straight import entry

# Traversal restarts this far, in cast units, past the face it has met: 32 roundings (2⁻²⁴)
# of a coordinate of 1, so that it does not meet the face again.
RESTART = 2e-6

# Shorter vectors than this have no direction.
SHORTEST = 1e-300

# Fewer rays than this are cast with all their remaining chords at once, those past a face in vain: to
# step through the chords costs more. At most so many chords then.
FEW = 1024
MOST_AT_ONCE = 1 << 15


class Rays(NamedTuple):
    """Places where traversal continues.

    projector, chord: (M,). share: (M,) of the chord. last: (2, M) the last two triangles met on this chord,
    -1 for none.
    """

    projector: NDArray[np.intp]
    chord: NDArray[np.intp]
    share: Array
    last: NDArray[np.int32]

    def take(self, index: IndexArray) -> Rays:
        """The rays at ``index``."""
        return Rays._make(field.take(index, -1) for field in self)


class Traversal(NamedTuple):
    """The state of a tile's traversal.

    looked: (N,) t up to which rays have been traced against the triangles themselves, inf at first.
    block: (N,) of each projector. following: (n+1, B), see ``next_chords``. far: whether control points
    are so far out that float32 would displace chords in the scene.
    """

    scene: CastScene
    prisms: PrismScene
    batch: ProjectorBatch
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
        skipped = entry(start, way, self.prisms.lower, self.prisms.upper)
        found, far = self.prisms.trace(
            (start + way * skipped).astype(np.float32),
            way.astype(np.float32),
            (limits - skipped).astype(np.float32),
        )
        return found, far + skipped


def next_chords(held: BoolArray) -> NDArray[np.intp]:
    """The next chord that may enter a prism, from each chord on: itself or a later one, (n+1, B).

    It is n where no further chord may. held: (n, B) whether a chord of a block's projectors may enter one.
    """
    count, blocks = held.shape
    after = np.full((count + 1, blocks), count)
    for chord in range(count - 1, -1, -1):
        after[chord] = np.where(held[chord], chord, after[chord + 1])
    return after


def length_of(vectors: Array) -> Array:
    """Lengths (M,) of vectors (3, M), at least SHORTEST."""
    length: Array = np.maximum(np.sqrt((vectors**2).sum(axis=0)), SHORTEST)
    return length


def time_of(traversal: Traversal, rays: Rays) -> Array:
    """The t of the rays, (M,)."""
    low, high = traversal.chords.breaks[rays.chord], traversal.chords.breaks[rays.chord + 1]
    return low + rays.share * (high - low)


def advance(traversal: Traversal, rays: Rays) -> tuple[Rays, NDArray[np.int32]]:
    """Follow chords until they meet prisms' faces. Returns those that do, there, and the triangles."""
    chords = traversal.chords
    parts, triangles = [], []
    while len(rays.projector):
        if len(rays.projector) <= FEW:
            along = _ahead(traversal, rays)
            if np.count_nonzero(along) <= MOST_AT_ONCE:
                some, found = _advance_at_once(traversal, rays, along)
                parts.append(some)
                triangles.append(found)
                break
        found, share = _cast(traversal, rays)
        met = np.flatnonzero(found >= 0)
        if len(met):
            parts.append(rays.take(met)._replace(share=share[met]))
            triangles.append(found[met])
        chord = traversal.following[rays.chord + 1, traversal.block[rays.projector]]
        going = np.flatnonzero((found < 0) & (chord < chords.count))
        going = going[traversal.hits.t[rays.projector[going]] > chords.breaks[chord[going]]]
        rays = Rays(
            rays.projector[going],
            chord[going],
            np.zeros(len(going)),
            np.full((2, len(going)), -1, np.int32),
        )
    if not parts:
        return rays, np.empty(0, np.int32)
    joined = Rays(*(np.concatenate([p[k] for p in parts], axis=-1) for k in range(4)))
    return joined, np.concatenate(triangles)


def _ahead(traversal: Traversal, rays: Rays) -> BoolArray:
    """Return whether rays may still meet something on each chord, (M, n)."""
    chords, number = traversal.chords, np.arange(traversal.chords.count)
    held: BoolArray = number == traversal.following[:-1].take(traversal.block[rays.projector], 1).T
    held &= (number > rays.chord[:, None]) & (chords.breaks[:-1] < traversal.hits.t[rays.projector][:, None])
    held[np.arange(len(held)), rays.chord] = True
    return held


def _advance_at_once(traversal: Traversal, rays: Rays, along: BoolArray) -> tuple[Rays, NDArray[np.int32]]:
    """Follow all chords ``along`` (M, n) in one batch: the first that meets a face counts."""
    which, chord = np.nonzero(along)
    here = chord == rays.chord[which]
    fresh = Rays(
        rays.projector[which],
        chord,
        np.where(here, rays.share[which], 0.0),
        np.where(here, rays.last.take(which, 1), np.int32(-1)),
    )
    found, share = _cast(traversal, fresh)
    first = first_hits(found, which, len(along))
    return fresh.take(first)._replace(share=share[first]), found[first]


def _cast(traversal: Traversal, rays: Rays) -> tuple[NDArray[np.int32], Array]:
    """The prisms that rays meet on the rest of their chords, or up to a known hit, -1 for none, and where."""
    low, high = traversal.chords.breaks[rays.chord], traversal.chords.breaks[rays.chord + 1]
    limit = (traversal.hits.t[rays.projector] - low) / (high - low)
    start, end = chord_ends(traversal, rays)
    way, left = end - start, 1.0 - rays.share
    limit = np.where(limit < 1.0, (limit - rays.share) / left, 1.0) + OVERLAP
    traversal.counts.chords += len(left)
    found, far = traversal.trace(start + way * rays.share, way * left, limit.astype(np.float32))
    where: Array = np.minimum(rays.share + far * left, 1.0)
    return found, where


def chord_ends(traversal: Traversal, rays: Rays) -> tuple[Array, Array]:
    """The start and end of the rays' chords, (3, M) each."""
    return traversal.chords.ends_of(traversal.batch.points.take(rays.projector, 2), rays.chord)


def meet(traversal: Traversal, projector: IndexArray, span: IndexArray, triangle: NDArray[np.int32]) -> None:
    """Intersect curves with triangles, from the given spans on, and keep nearer hits."""
    breaks = traversal.batch.spans.breaks
    traversal.counts.tested += len(triangle)
    while len(projector):
        curves = traversal.batch.take(projector)
        # By rounding, a hit at the very end of a span may come out past it.
        low, high = breaks[span] - T_ROUNDING, breaks[span + 1] + T_ROUNDING
        found = solve(curves, traversal.scene, triangle, span, low, high)
        keep(traversal, projector, found)
        going = np.flatnonzero(~found.inside & (span + 2 < len(breaks)))
        projector, triangle, span = projector[going], triangle[going], span[going] + 1


def meet_prisms(traversal: Traversal, rays: Rays, triangle: NDArray[np.int32], step: float) -> None:
    """Intersect curves with the triangles whose prisms their chords enter or leave.

    If both ends of a chord lie outside the slab that contains a prism, the part of the curve in the prism is
    on this chord. Otherwise the whole curve is intersected. step: how far past a ray a prism may begin.
    """
    scene, chords = traversal.scene, traversal.chords
    curves = traversal.batch.take(rays.projector)
    ends = chords.ends_of(curves.points, rays.chord)
    slab = traversal.prisms.thickness + step
    near = np.logical_or.reduce([np.abs(scene.heights(end, triangle)) <= slab for end in ends])
    span, breaks = chords.span[rays.chord], traversal.batch.spans.breaks
    low = np.where(near, breaks[span] - T_ROUNDING, chords.breaks[rays.chord])
    high = np.where(near, breaks[span + 1] + T_ROUNDING, chords.breaks[rays.chord + 1])
    traversal.counts.tested += len(triangle)
    found = solve(curves, scene, triangle, span, low, high)
    keep(traversal, rays.projector, found)
    going = np.flatnonzero(near & ~found.inside & (span + 2 < len(breaks)))
    meet(traversal, rays.projector[going], span[going] + 1, triangle[going])


def keep(traversal: Traversal, projector: IndexArray, found: Solutions) -> None:
    """Store the hits that are nearer than the known ones; a projector may have several."""
    nearer = np.flatnonzero(found.inside & (found.t < traversal.hits.t[projector]))
    # Of several writes to a place the last is the nearest.
    nearer = nearer[np.argsort(-found.t[nearer], kind="stable")]
    found.take(nearer).store(traversal.hits, projector[nearer])


def past_faces(traversal: Traversal, rays: Rays, step: float) -> Rays:
    """The rays ``step`` past the faces they have met, without those that have passed their hit."""
    chords = traversal.chords
    start, end = chord_ends(traversal, rays)
    share = rays.share + step / length_of(end - start)
    over = share >= 1.0
    beyond = traversal.following[rays.chord + 1, traversal.block[rays.projector]]
    chord = np.where(over, beyond, rays.chord)
    share = np.where(over, 0.0, share)
    rays = Rays(rays.projector, chord, share, np.where(over, np.int32(-1), rays.last))
    rays = rays.take(np.flatnonzero(chord < chords.count))
    return rays.take(np.flatnonzero(time_of(traversal, rays) < traversal.hits.t[rays.projector]))


def crossing_time(traversal: Traversal, rays: Rays, triangle: NDArray[np.int32]) -> Array:
    """The t that chords take from cap to cap of a triangle's prism, at most a whole chord's, (M,)."""
    chords = traversal.chords
    controls = traversal.batch.points.take(rays.projector, 2)
    way = np.einsum("kn,kcn->cn", (chords.ends[1:] - chords.ends[:-1]).T.take(rays.chord, 1), controls)
    climb = np.abs(np.einsum("cn,cn->n", way, traversal.scene.normals(triangle)))
    share = 2.0 * traversal.prisms.thickness / np.maximum(climb, 2.0 * traversal.prisms.thickness)
    duration: Array = np.minimum(1.5 * share, 1.0) * np.diff(chords.breaks).take(rays.chord)
    return duration
