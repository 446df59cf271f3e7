# SPDX-License-Identifier: GPL-3.0-or-later
"""First hits that exact casting certifies without traversal: nearly all of them."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, IndexArray
from ..curves.plane_hits import Solutions, first_root
from ..scene.cast_scene import CastScene
from .traversal import RESTART, Rays, Traversal, length_of, time_of

# The straight way from a prism's face to a hit strays at most this far from the curve: a few
# roundings (2⁻²⁴) of a coordinate of 1.
STRAY = 3e-7

# A way is well within its triangle, and clear of an edge, if it stays this far from the edges,
# in cast units: float32 cannot mistake a neighbour for it.
WELL_WITHIN = 2e-6


def certify(traversal: Traversal, rays: Rays, triangle: NDArray[np.int32]) -> IndexArray:
    """Keep the hits that are certainly the first. Returns the numbers of the other rays, left to traversal.

    rays: at the first face that each projector meets. triangle: (M,) whose prism that is. It is the
    only prism entered, except for those that are entered at the same place and those of its neighbours,
    which do not matter to a hit well within the triangle. A ray against the triangles themselves,
    straight from there to the hit, finds anything between.
    """
    scene = traversal.scene
    curves = traversal.batch.take(rays.projector)
    met_t, end_t = _straight(traversal, rays)
    found, way = first_root(curves, scene, triangle, traversal.chords.span.take(rays.chord), met_t, end_t)
    traversal.counts.tested += len(triangle)
    start = curves.place(met_t)
    way -= start
    certain = _well_within(traversal, found.barycentric, triangle) & _nearer(traversal, rays, found)
    certain &= _well_within(traversal, scene.barycentric(start, triangle), triangle)
    some = np.flatnonzero(certain)
    seen = _seen(traversal, start.take(some, 1), way.take(some, 1), 1.0)
    some = some[(seen < 0) | (seen == triangle.take(some))]
    found.take(some).store(traversal.hits, rays.projector.take(some))
    certain[:] = False
    certain[some] = True
    rest = np.flatnonzero(~certain)
    return rest[~_beside(traversal, rays.take(rest), triangle[rest], found.take(rest))]


def _straight(traversal: Traversal, rays: Rays) -> tuple[Array, Array]:
    """The t of the rays, and the t up to which curves are straight from there, (M,) each."""
    breaks = traversal.chords.breaks
    steps = np.diff(breaks)
    met_t = time_of(traversal, rays)
    # A chord of step h is ‖q''‖ h²/16 ≤ ε from its curve, a straight line over a
    # share of it ‖q''‖ (share h)²/8; that may end on the next chord.
    length = np.minimum(steps, np.append(steps[1:], steps[-1])).take(rays.chord)
    straight = min(float(np.sqrt(0.5 * STRAY / traversal.prisms.epsilon)), 1.0)
    return met_t, met_t + straight * length


def _nearer(traversal: Traversal, rays: Rays, found: Solutions) -> BoolArray:
    """Return whether solutions are hits before the known ones, of projectors that begin in prisms, (M,)."""
    with np.errstate(invalid="ignore"):
        nearer: BoolArray = found.inside & (found.t < traversal.hits.t.take(rays.projector))
    return nearer


def _well_within(traversal: Traversal, weights: Array, triangle: IndexArray) -> BoolArray:
    """Return whether points with barycentric weights (2, M) are away from edges of their triangles, (M,)."""
    margin = WELL_WITHIN * traversal.prisms.steepest.take(triangle)
    with np.errstate(invalid="ignore"):
        well: BoolArray = (_all_weights(weights) > margin).all(axis=0)
    return well


def _seen(traversal: Traversal, start: Array, way: Array, after: float) -> NDArray[np.int32]:
    """The first triangle on each straight ray, (M,); -1 where a ray meets none.

    start, way: (3, M) the origins, and the vectors to the ends. Rays begin a little before their origin and
    go on past their end by ``after`` times that.
    """
    slack = way * (RESTART / length_of(way))
    traversal.counts.rays += way.shape[1]
    return traversal.scene.mesh.trace(
        (start - slack).astype(np.float32),
        (way + (1.0 + after) * slack).astype(np.float32),
        np.ones(way.shape[1], np.float32),
    )


def _beside(traversal: Traversal, rays: Rays, triangle: NDArray[np.int32], known: Solutions) -> BoolArray:
    """Certify hits whose ways lead over two triangles that share an edge; return which are certain, (M,).

    known: where the curves meet the triangles whose prisms were met. Such a triangle must be one of the two
    or next to them. A way begins and ends over the two, and stays so far from all of their other
    edges that float32 cannot be wrong about their neighbours. A way over one triangle alone has entered
    the prism of a neighbour first.
    """
    scene = traversal.scene
    curves = traversal.batch.take(rays.projector)
    met_t, end_t = _straight(traversal, rays)
    start = curves.place(met_t)
    aim = _seen(traversal, start, curves.place(np.minimum(end_t, 1.0)) - start, 0.0)
    some = np.flatnonzero(aim >= 0)
    curves, start, aim, known = curves.take(some), start.take(some, 1), aim[some], known.take(some)
    part, met_t, end_t = rays.take(some), met_t[some], end_t[some]
    span = traversal.chords.span.take(part.chord)
    found, place = first_root(curves, scene, aim, span, met_t, end_t)
    begin, end = _over(scene, start, aim), _all_weights(found.barycentric)
    margin = WELL_WITHIN * traversal.prisms.steepest.take(aim)
    with np.errstate(invalid="ignore"):
        aside = ~(end > margin).all(axis=0)
        edge = np.where(aside, end.argmin(axis=0), begin.argmin(axis=0))
    around, number = scene.neighbours.take(aim, 1), np.arange(len(aim))
    met = triangle[some]
    clear = ~aside & (begin > margin).all(axis=0)
    other = around[edge, number]
    pair = np.flatnonzero(~clear & (other >= 0))
    mate = other[pair]
    clear &= (met == aim) | (around == met).any(axis=0)
    two, there = first_root(curves.take(pair), scene, mate, span[pair], met_t[pair], end_t[pair])
    traversal.counts.tested += len(some) + len(pair)
    with np.errstate(invalid="ignore"):
        better = two.inside & ~(found.inside[pair] & (found.t[pair] <= two.t))
    found.put(pair, two, np.flatnonzero(better))
    place[:, pair] = np.where(better, there, place.take(pair, 1))
    beside = (scene.neighbours.take(mate, 1) == met[pair]).any(axis=0)
    beside |= (met[pair] == aim[pair]) | (around.take(pair, 1) == met[pair]).any(axis=0)
    over = _over_pair(traversal, start.take(pair, 1), place.take(pair, 1), aim[pair], mate)
    clear[pair] = beside & over
    with np.errstate(invalid="ignore"):
        clear &= ~(known.inside & (known.t < found.t))
    clear &= _nearer(traversal, part, found)
    found.take(np.flatnonzero(clear)).store(traversal.hits, part.projector[clear])
    certain = np.zeros(len(rays.projector), bool)
    certain[some] = clear
    return certain


def _all_weights(weights: Array) -> Array:
    """The weights of all three corners, (3, M), from those of the second and third."""
    return np.stack([1.0 - weights[0] - weights[1], *weights])


def _over(scene: CastScene, positions: Array, triangle: IndexArray) -> Array:
    """Weights (3, M) of the triangles' corners at positions (3, M)."""
    return _all_weights(scene.barycentric(positions, triangle))


def _over_pair(traversal: Traversal, start: Array, end: Array, one: IndexArray, two: IndexArray) -> BoolArray:
    """Return whether straight ways (3, M) are over two neighbours each, far from their other edges, (M,)."""
    scene = traversal.scene
    number = np.arange(len(one))
    over = []
    clear = np.ones(len(one), bool)
    for triangle, across in ((one, two), (two, one)):
        shared = scene.neighbours.take(triangle, 1) == across
        clear &= shared.any(axis=0)
        margin = WELL_WITHIN * traversal.prisms.steepest.take(triangle)
        for point in (start, end):
            with np.errstate(invalid="ignore"):
                well = _over(scene, point, triangle) > margin
            over.append(((well | shared).all(axis=0), well.all(axis=0)))
        apart = _apart(traversal, start, end - start, triangle)
        # Edges are numbered by the corner opposite.
        apart[shared.argmax(axis=0), number] = np.inf
        clear &= apart.min(axis=0, initial=np.inf) > WELL_WITHIN
    (start_one, end_one, start_two, end_two) = over
    for first, second in ((start_one, start_two), (end_one, end_two)):
        clear &= first[1] | second[1] | (first[0] & second[0])
    return clear


def _apart(traversal: Traversal, start: Array, way: Array, triangle: IndexArray) -> Array:
    """Distances (3, M) of straight lines from the lines through the edges opposite the triangles' corners."""
    corners = [traversal.scene.vertices.take(row, 1) for row in traversal.scene.triangles.take(triangle, 0).T]
    apart = np.empty((3, len(triangle)))
    for k, (first, second) in enumerate(
        zip(corners[1:] + corners[:1], corners[2:] + corners[:2], strict=True)
    ):
        across = np.cross(way, second - first, axis=0)
        apart[k] = np.abs(np.einsum("cn,cn->n", start - first, across)) / length_of(across)
    return apart
