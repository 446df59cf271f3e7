# SPDX-License-Identifier: GPL-3.0-or-later
"""First hits of which exact casting is certain without a walk, nearly all."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..projection.typing import Array, BoolArray, IndexArray
from .curves import Solutions
from .walk import RESTART, SHORTEST, Rays, Walk, store

# A straight look from a prism's face to a hit strays this far from the curve at most: a few
# roundings (2⁻²⁴) of a coordinate of 1.
STRAY = 3e-7

# A way is well within its triangle, and clear of an edge, where it stays this far from the edges,
# in cast units: float32 cannot take a neighbour for it.
WELL_WITHIN = 2e-6


def settle(walk: Walk, rays: Rays, triangle: NDArray[np.int32]) -> IndexArray:
    """Keep the hits of which it is certain that they are the first; the other rays have to be walked on.

    rays: at the first face that each projector meets. triangle: (M,) whose prism that is. Its
    prism is the only one that was entered, but for some that are entered at the same place,
    and its neighbours', which are not entered where a hit is well within the triangle. A
    look at the triangles themselves, straight from there to the hit, finds what is between.
    """
    scene = walk.scene
    curves = walk.bundle.take(rays.projector)
    met_t, end_t = _straight(walk, rays)
    found, way = curves.next_root(scene, triangle, walk.chords.span.take(rays.chord), met_t, end_t)
    walk.counts.tested += len(triangle)
    start = curves.place(met_t)
    way -= start
    certain = _well_within(walk, found.barycentric, triangle) & _nearer(walk, rays, found)
    certain &= _well_within(walk, scene.barycentric(start, triangle), triangle)
    some = np.flatnonzero(certain)
    seen = _seen(walk, start.take(some, 1), way.take(some, 1), 1.0)
    some = some[(seen < 0) | (seen == triangle.take(some))]
    store(walk.hits, rays.projector.take(some), found.take(some))
    certain[:] = False
    certain[some] = True
    rest = np.flatnonzero(~certain)
    return rest[~_beside(walk, rays.take(rest), triangle[rest])]


def _straight(walk: Walk, rays: Rays) -> tuple[Array, Array]:
    """In t, where the rays are and how far curves are straight from there, (M,) each."""
    breaks = walk.chords.breaks
    steps = np.diff(breaks)
    met_t = breaks.take(rays.chord) + rays.share * steps.take(rays.chord)
    # Chords of steps h are ‖q''‖ h²/16 from their curves, at most ε, a straight line over a
    # share of one ‖q''‖ (share h)²/8; it may end on the next chord.
    length = np.minimum(steps, np.append(steps[1:], steps[-1])).take(rays.chord)
    straight = min(float(np.sqrt(0.5 * STRAY / walk.prisms.epsilon)), 1.0)
    return met_t, met_t + straight * length


def _nearer(walk: Walk, rays: Rays, found: Solutions) -> BoolArray:
    """Which solutions are hits before those known from looking around, where projectors begin in prisms."""
    with np.errstate(invalid="ignore"):
        nearer: BoolArray = found.inside & (found.t < walk.hits.t.take(rays.projector))
    return nearer


def _well_within(walk: Walk, weights: Array, triangle: IndexArray) -> BoolArray:
    """Whether places (barycentric weights (2, M)) are not near the edges of their triangles."""
    margin = WELL_WITHIN * walk.prisms.steepest.take(triangle)
    second, third = weights
    with np.errstate(invalid="ignore"):
        well: BoolArray = (second > margin) & (third > margin) & (1.0 - second - third > margin)
    return well


def _seen(walk: Walk, start: Array, way: Array, after: float) -> NDArray[np.int32]:
    """The first triangles on straight ways (3, M), -1 for none, from a little before to ``after`` as much."""
    slack = way * (RESTART / np.maximum(np.sqrt(np.einsum("cn,cn->n", way, way)), SHORTEST))
    walk.counts.rays += way.shape[1]
    return walk.scene.trace(
        (start - slack).astype(np.float32),
        (way + (1.0 + after) * slack).astype(np.float32),
        np.ones(way.shape[1], np.float32),
    )


def _beside(walk: Walk, rays: Rays, triangle: NDArray[np.int32]) -> BoolArray:
    """As settle, where the way leads over an edge from one triangle to its neighbour: which are certain.

    It begins over one of the two, well within it, and ends well within the other. It stays so
    far from all of their edges that float32 cannot be wrong about which of the two it meets.
    """
    scene = walk.scene
    curves = walk.bundle.take(rays.projector)
    met_t, end_t = _straight(walk, rays)
    start = curves.place(met_t)
    way = curves.place(np.minimum(end_t, 1.0)) - start
    aim = _seen(walk, start, way, 0.0)
    certain = aim >= 0
    # Where the way ends on the triangle whose prism was met, it begins over a neighbour of that.
    second, third = scene.barycentric(start, triangle)
    edge = np.argmin(np.stack([1.0 - second - third, second, third]), axis=0)
    over = np.where(aim == triangle, scene.neighbours[edge, triangle], triangle)
    certain &= (over >= 0) & (scene.neighbours.take(aim, 1) == over).any(axis=0)
    some = np.flatnonzero(certain)
    curves, start, way = curves.take(some), start.take(some, 1), way.take(some, 1)
    aim, over, rays = aim[some], over[some], rays.take(some)
    walk.counts.tested += len(some)
    span = walk.chords.span.take(rays.chord)
    found, _ = curves.next_root(scene, aim, span, met_t[some], end_t[some])
    clear = _nearer(walk, rays, found) & _well_within(walk, found.barycentric, aim)
    clear &= _well_within(walk, scene.barycentric(start, over), over)
    clear &= (_apart(walk, start, way, aim) > WELL_WITHIN) & (_apart(walk, start, way, over) > WELL_WITHIN)
    store(walk.hits, rays.projector[clear], found.take(np.flatnonzero(clear)))
    certain[some] = clear
    return certain


def _apart(walk: Walk, start: Array, way: Array, triangle: IndexArray) -> Array:
    """How far straight lines (3, M) are from the lines through their triangles' edges at least, (M,)."""
    corners = [walk.scene.vertices.take(row, 1) for row in walk.scene.triangles.take(triangle, 0).T]
    least = np.full(len(triangle), np.inf)
    for first, second in zip(corners, corners[1:] + corners[:1], strict=True):
        across = np.cross(way, second - first, axis=0)
        length = np.sqrt(np.einsum("cn,cn->n", across, across))
        apart = np.abs(np.einsum("cn,cn->n", start - first, across)) / np.maximum(length, SHORTEST)
        np.minimum(least, apart, out=least)
    return least
