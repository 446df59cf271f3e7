# SPDX-License-Identifier: GPL-3.0-or-later
"""Image positions to hits."""

from __future__ import annotations

import math

import numpy as np

from ..projection.typing import Array, BoolArray
from ..projection.volume.viewing_volume import Projection
from .common.hits import CastCounts, CastError, Hits
from .curves.bends import bend_groups
from .curves.chords import cast_chords, complete
from .curves.projector_batch import ProjectorBatch
from .curves.schedule import corners, plan, sample_curves, scene_reach, split
from .exact.exact_cast import cast_exact
from .scene.cast_scene import CastScene
from .scene.occupancy import boxes_of_blocks, stretches
from .straight import cast_straight

__all__ = ["CastCounts", "Hits", "cast"]

# Control points farther out than this, in cast units (the scene reaches to 1),
# cannot be told from infinity in float32; their projectors count as not finite.
FARTHEST = 1e15

# Where a hit is in doubt a projector is followed again by chords that stray this share of the
# pixel error, or by the chords cut in so many, which is quicker to plan and as near.
FINE_SHARE = 1.0 / 16.0
FINER = 6

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
    may be missed, and t of what is hit is that of the curve itself, but for edges that chords
    of a sixteenth of the error meet and the curve does not. 0: the first hit in
    float64, certified (``exact.cast_exact``). counts: added to when given. columns: says that x, y
    are whole rows of that many neighbouring pixels, from the bottom up; empty space is then
    skipped for square blocks of them.
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
    if pixel_error == 0.0:
        points, mask, _ = usable_projectors(projection, x, y)
        counts.projectors += int(np.count_nonzero(mask))
        batch = ProjectorBatch(spans, points)
        return complete(cast_exact(scene, batch, mask, columns, counts), batch)
    if not spans.is_polyline:
        return _cast_curved(scene, projection, x, y, pixel_size, pixel_error, counts, columns)
    points, mask, farthest = usable_projectors(projection, x, y)
    if spans.is_straight and farthest <= FAR:
        return cast_straight(scene, points, mask, (0.0, 1.0), counts, weighted)
    reach = scene_reach(spans, points, scene)
    if spans.is_straight:
        return cast_straight(scene, points, mask, reach or (0.0, 1.0), counts, weighted)
    counts.projectors += int(np.count_nonzero(mask))
    batch = ProjectorBatch(spans, points)
    if reach is None:
        return complete(Hits.unplaced(len(x))._replace(mask=mask), batch)
    return complete(cast_chords(scene, batch, mask, corners(spans, reach), counts)[0], batch)


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
    spans = projection.volume.spans
    with np.errstate(invalid="ignore", over="ignore"):
        points, mask = projection.projectors(x, y)
        batch = ProjectorBatch(spans, points)
        boxes = boxes_of_blocks(batch.single, columns)
    if not boxes.farthest < FARTHEST:
        points, mask, _ = usable_projectors(projection, x, y)
        batch = ProjectorBatch(spans, points)
        boxes = boxes_of_blocks(batch.single, columns)
    counts.projectors += int(np.count_nonzero(mask))
    where = stretches(scene.occupancy, spans, boxes)
    reach = where.reach
    if reach is None or not mask.any():
        return complete(Hits.unplaced(len(x))._replace(mask=mask), batch)
    error = max(pixel_error, SMALLEST_ERROR)
    groups = bend_groups(points, mask)
    answer = Hits.unplaced(len(x) if len(groups) > 1 else 0)
    for group in groups:
        curves = sample_curves(projection, x, y, group, pixel_size, columns)
        schedule = plan(spans, curves, reach, error, 1)
        counts.error_bound = max(counts.error_bound, schedule.error)
        hits, doubtful = cast_chords(scene, batch, group, schedule, counts, where, False)
        if len(doubtful):
            counts.refined += len(doubtful)
            if spans.point_weights is None:
                fine = split(spans, schedule, FINER)
            else:
                fine = plan(spans, curves, reach, FINE_SHARE * error, 1)
            own = CastCounts()
            some, there = batch.take(doubtful), where.take(doubtful)
            hits.put(doubtful, cast_chords(scene, some, group[doubtful], fine, own, there)[0])
            own.chords = 0
            counts.add(own)
        if len(groups) == 1:
            return complete(hits, batch)
        which = np.flatnonzero(group)
        answer.put(which, hits.take(which))
    return complete(answer, batch)


def usable_projectors(projection: Projection, x: Array, y: Array) -> tuple[Array, BoolArray, float]:
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
