# SPDX-License-Identifier: GPL-3.0-or-later
"""Image positions to hits."""

from __future__ import annotations

import math

import numpy as np

from ..projection.typing import Array, BoolArray
from ..projection.volume import Projection
from .chords import cast_chords, complete
from .curves import Bundle
from .exact import cast_exact
from .hits import CastCounts, Hits
from .occupancy import stretches
from .scene import CastError, CastScene
from .schedule import Schedule, corners, plan, sample_curves, scene_reach
from .straight import cast_straight

__all__ = ["CastCounts", "Hits", "cast"]

# Control points farther out than this, in cast units (the scene reaches to 1),
# cannot be told from infinity in float32; their projectors count as not finite.
FARTHEST = 1e15

# Error in pixels of chords that are compared with their neighbours': the eight around
# a pixel reach this far from its centre, so what its chord passes, one of theirs meets.
NEIGHBOUR_ERROR = 1.5

# But they never stray more than this many times the pixel error: a thing so thin that no
# neighbour sees it either must come to light when the error is set lower.
MOST_COARSER = 10.0

# Doubtful hits are looked at with chords that stray this share of the pixel error:
# they decide, so they should add little to it.
FINE_SHARE = 0.3

# Pixel errors below this are beyond float32 and count as this.
SMALLEST_ERROR = 1e-4

# Straight rays start where the scene does when the control points lie farther out
# than this: float32 loses a digit with every power of ten.
FAR = 4.0


def cast(
    scene: CastScene,
    projection: Projection,
    x: Array,
    y: Array,
    pixel_size: tuple[float, float],
    pixel_error: float = 0.1,
    counts: CastCounts | None = None,
    columns: int | None = None,
    weighted: bool = True,
) -> Hits:
    """The first hit of the projectors through image positions x, y.

    projection: in cast space, ``projection.transformed(scene.matrix)``. x, y: (N,)
    float64 in [0, 1]; neighbours in the image should be neighbours here, since they
    share their chords. pixel_size: a pixel's width and height in the same units.
    pixel_error: how far, in pixels, a silhouette may be displaced by curved
    projectors, >= 0. Straight ones and polylines have no such error, but float32's:
    their rays may pass an edge that they should meet, or the other way round. Chords are
    held to it on sampled projectors of the tile, with a margin; things thinner than it
    may be missed, and t of what is hit is that of the curve itself. 0: the first hit in
    float64, certified (``exact.cast_exact``); rational projectors have no certain chords
    and are cast with SMALLEST_ERROR then. counts: added to when given. columns: says that x, y
    are whole rows of that many neighbouring pixels, from the bottom up; curved
    projectors are then cast in a fraction of the time (``chords.cast_chords``).
    weighted: whether barycentric weights are wanted; straight rays leave them 0 if not.
    Raises CastError for a negative or non-finite pixel error, and for 0 where the memory
    does not suffice.
    """
    if not 0.0 <= pixel_error < math.inf:
        raise CastError(f"the pixel error must be 0 or more, not {pixel_error}")
    counts = CastCounts() if counts is None else counts
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    if len(x) == 0:
        return Hits.empty(0)
    if columns is not None and len(x) % columns:
        raise CastError(f"{len(x)} image positions are not rows of {columns}")
    spans = projection.volume.spans
    if pixel_error == 0.0 and spans.point_weights is None:
        points, mask, _ = _projectors(projection, x, y)
        counts.projectors += int(np.count_nonzero(mask))
        bundle = Bundle(spans, points)
        return complete(cast_exact(scene, bundle, mask, columns, counts), bundle)
    if spans.degree > 1 or spans.point_weights is not None:
        return _cast_curved(scene, projection, x, y, pixel_size, pixel_error, counts, columns)
    points, mask, farthest = _projectors(projection, x, y)
    single = spans.direct
    if single and farthest <= FAR:
        return cast_straight(scene, points, mask, (0.0, 1.0), counts, weighted)
    reach = scene_reach(spans, points, scene)
    if single:
        return cast_straight(scene, points, mask, reach or (0.0, 1.0), counts, weighted)
    schedule = None if reach is None else corners(spans, reach)
    counts.projectors += int(np.count_nonzero(mask))
    bundle = Bundle(spans, points)
    return complete(cast_chords(scene, bundle, mask, schedule, None, counts)[0], bundle)


def _cast_curved(
    scene: CastScene,
    projection: Projection,
    x: Array,
    y: Array,
    pixel_size: tuple[float, float],
    pixel_error: float,
    counts: CastCounts,
    columns: int | None,
) -> Hits:
    """As cast, for spans of degree 2 and more, and for rational ones."""
    border = columns or 0
    if columns is not None:
        # A row more on either side, for the outer rows to be compared with.
        x = np.concatenate([x[:columns], x, x[-columns:]])
        y = np.concatenate([y[:columns] - pixel_size[1], y, y[-columns:] + pixel_size[1]])
    points, mask, _ = _projectors(projection, x, y)
    if columns is not None:
        mask[:columns] &= y[:columns] > 0.0
        mask[-columns:] &= y[-columns:] < 1.0
    spans = projection.volume.spans
    inner = slice(border, len(x) - border)
    bundle, shown = Bundle(spans, points), Bundle(spans, points[:, :, inner])
    counts.projectors += int(np.count_nonzero(mask[inner]))
    where = stretches(scene.occupancy, spans, bundle.single, columns)
    reach = where.reach
    if reach is None or not mask.any():
        return complete(cast_chords(scene, shown, mask[inner], None, None, counts)[0], shown)
    curves = sample_curves(projection, x, y, mask, pixel_size)

    def schedule(chord_error: float) -> Schedule:
        fine_error = FINE_SHARE * max(pixel_error, SMALLEST_ERROR)
        finer = math.ceil(math.sqrt(max(chord_error / fine_error, 1.0)))
        return plan(spans, curves, reach, chord_error, finer)

    if columns is not None:
        coarse = schedule(max(pixel_error, min(NEIGHBOUR_ERROR, MOST_COARSER * pixel_error)))
        if coarse.error > pixel_error:
            hits, thin = cast_chords(scene, bundle, mask, coarse, columns, counts, where)
            hits, where = hits.within(inner), where.take(inner)
            if len(thin):
                counts.thin += len(thin)
                fine = schedule(pixel_error)
                some, there = shown.take(thin), where.take(thin)
                again = cast_chords(scene, some, hits.mask[thin], fine, None, counts, there)[0]
                nearer = np.flatnonzero(again.t < hits.t[thin])
                hits.put(thin[nearer], again.take(nearer))
            return complete(hits, shown)
    where = where.take(inner)
    hits = cast_chords(scene, shown, mask[inner], schedule(pixel_error), None, counts, where)[0]
    return complete(hits, shown)


def _projectors(projection: Projection, x: Array, y: Array) -> tuple[Array, BoolArray, float]:
    """Control points (K, 3, N), which projectors exist, and the largest coordinate.

    Projectors that are not finite do not exist; their control points are 0.
    """
    with np.errstate(invalid="ignore", over="ignore"):
        points, mask = projection.projectors(x, y)
        farthest = float(max(points.max(), -points.min()))
        if not farthest < FARTHEST:
            finite = (np.abs(points) < FARTHEST).all(axis=(0, 1))
            points, mask = np.where(finite, points, 0.0), mask & finite
            farthest = float(np.abs(points).max())
    return points, mask, farthest
