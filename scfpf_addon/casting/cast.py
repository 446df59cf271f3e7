# SPDX-License-Identifier: GPL-3.0-or-later
"""Casting: from image positions to hits."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..projection.typing import Array, BoolArray, IndexArray
from ..projection.volume.viewing_volume import Projection
from .common.hits import CastCounts, CastError, Hits
from .common.space_order import space_keys
from .curves.chords import cast_chords, complete
from .curves.projector_batch import ProjectorBatch
from .curves.sampled_curves import sample_curves
from .curves.schedule import corners, plan, scene_reach, split
from .exact.exact_cast import cast_exact
from .scene.cast_scene import CastScene
from .scene.stretches import stretches
from .straight import cast_straight

__all__ = ["CastCounts", "Hits", "cast", "cast_at_nothing"]

# Control points farther out than this, in cast units (the scene extends to 1), are
# as good as infinite in float32; their projectors count as not finite.
FARTHEST = 1e15

# A projector whose hit is in doubt is followed again by chords that stray this share of the pixel
# error, or by the chords cut in so many parts, which is faster to plan and as precise.
FINE_SHARE = 1.0 / 16.0
FINE_PARTS = 6

# Smaller pixel errors are beyond float32 and count as this.
SMALLEST_ERROR = 1e-4

# If the control points are farther out than this, straight rays start where the scene begins:
# float32 loses a digit with every power of ten.
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
    in_order: bool = False,
) -> Hits:
    """The first hit of the projectors through image positions x, y.

    projection: in cast space, ``projection.transformed(scene.matrix)``. x, y: (N,)
    float64 in [0, 1], near to each other in the image, since they
    share their chords. pixel_size: a pixel's width and height in the same units.
    pixel_error: the largest displacement of a silhouette by curved projectors, in pixels, >= 0.
    Chords keep it on sampled projectors of the tile, with a margin. Things thinner than it
    may be missed. t of a hit is that of the curve itself, except at edges that chords
    of a sixteenth of the error meet and the curve does not. 0: the first hit in
    float64, certified (``exact.cast_exact``). Straight projectors and polylines have only
    float32's error: their rays may pass an edge that they should meet, or the other way round.
    counts: if given, added to. columns: if given, x, y
    are whole rows of that many neighbouring pixels, from the bottom up; empty space is then
    skipped for square blocks of them.
    weighted: whether barycentric weights are needed; if not, straight rays leave them 0.
    in_order: whether positions that follow one another are near to each other; they are sorted otherwise.
    Raises CastError for a negative or non-finite pixel error, and for 0 if the memory
    does not suffice.
    """
    if not 0.0 <= pixel_error < math.inf:
        raise CastError("the pixel error must be 0 or more, not {0}", pixel_error)
    counts = CastCounts() if counts is None else counts
    x, y = np.asarray(x, np.float64), np.asarray(y, np.float64)
    if len(x) == 0:
        return Hits.empty(0)
    if columns is not None and len(x) % columns:
        raise CastError("{0} image positions are not rows of {1}", len(x), columns)
    tile = _Tile(scene=scene, projection=projection, x=x, y=y, pixel_size=pixel_size, columns=columns)
    if in_order or columns is not None or not needs_order(projection, pixel_error):
        return _cast_tile(tile, pixel_error, counts, weighted)
    order = near_order(x, y, pixel_size)
    tile = tile._replace(projection=projection.subset(order), x=x[order], y=y[order])
    hits = Hits.empty(len(x))
    hits.put(order, _cast_tile(tile, pixel_error, counts, weighted))
    return hits


def needs_order(projection: Projection, pixel_error: float) -> bool:
    """Return whether casting has to know which image positions are near to each other."""
    return pixel_error == 0.0 or not projection.volume.spans.is_polyline


def near_order(x: Array, y: Array, pixel_size: tuple[float, float]) -> IndexArray:
    """The order (N,) of image positions in which those that follow one another are near to each other."""
    return np.argsort(space_keys(np.stack([x / pixel_size[0], y / pixel_size[1]])), kind="stable")


def _cast_tile(tile: _Tile, pixel_error: float, counts: CastCounts, weighted: bool) -> Hits:
    """Cast a tile, whose positions are in an order in which neighbours are near to each other."""
    scene, projection, x, y, _, columns = tile
    spans = projection.volume.spans
    if pixel_error > 0.0 and not spans.is_polyline:
        return _cast_curved(tile, max(pixel_error, SMALLEST_ERROR), counts)
    points, mask, farthest = usable_projectors(projection, x, y)
    if pixel_error > 0.0 and spans.is_straight:
        return cast_straight(scene, points, mask, farthest > FAR, counts, weighted)
    counts.projectors += int(np.count_nonzero(mask))
    batch = ProjectorBatch(spans, points)
    if pixel_error == 0.0:
        return complete(cast_exact(scene, batch, mask, columns, counts), batch)
    reach = scene_reach(spans, points, scene)
    if reach is None:
        return complete(Hits.empty(len(x))._replace(mask=mask), batch)
    return complete(cast_chords(scene, batch, mask, corners(spans, reach), counts)[0], batch)


def cast_at_nothing(projection: Projection, x: Array, y: Array) -> Hits:
    """The projectors through image positions x, y (N,), which all miss."""
    if len(x) == 0:
        return Hits.empty(0)
    points, mask, _ = usable_projectors(projection, x, y)
    misses = Hits.empty(len(x))._replace(mask=mask)
    return complete(misses, ProjectorBatch(projection.volume.spans, points))


class _Tile(NamedTuple):
    """The arguments of ``cast``."""

    scene: CastScene
    projection: Projection
    x: Array
    y: Array
    pixel_size: tuple[float, float]
    columns: int | None


def _cast_curved(tile: _Tile, pixel_error: float, counts: CastCounts) -> Hits:
    """Cast projectors whose spans are of degree 2 and more, or rational."""
    spans = tile.projection.volume.spans
    points, mask, _ = usable_projectors(tile.projection, tile.x, tile.y)
    batch = ProjectorBatch(spans, points)
    counts.projectors += int(np.count_nonzero(mask))
    where = stretches(tile.scene.occupancy, spans, batch.single, tile.columns)
    if where.reach is None or not mask.any():
        return complete(Hits.empty(batch.count)._replace(mask=mask), batch)
    curves = sample_curves(tile.projection, tile.x, tile.y, mask, tile.pixel_size, tile.columns)
    schedule = plan(spans, curves, where.reach, pixel_error)
    counts.error_bound = max(counts.error_bound, schedule.error)
    hits, doubtful = cast_chords(tile.scene, batch, mask, schedule, counts, where, last=False)
    if len(doubtful):
        counts.refined += len(doubtful)
        if spans.point_weights is None:
            fine = split(spans, schedule, FINE_PARTS)
        else:
            fine = plan(spans, curves, where.reach, FINE_SHARE * pixel_error)
        own = CastCounts()
        some, there = batch.take(doubtful), where.take(doubtful)
        hits.put(doubtful, cast_chords(tile.scene, some, mask[doubtful], fine, own, there)[0])
        own.chords = 0
        counts.add(own)
    return complete(hits, batch)


def usable_projectors(projection: Projection, x: Array, y: Array) -> tuple[Array, BoolArray, float]:
    """Control points (K, 3, N), whether each projector exists (N,), and the largest coordinate.

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
