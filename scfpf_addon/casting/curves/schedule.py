# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the chords of a tile's projectors begin and end.

All projectors of a tile share one list of breaks in t. The pixel error becomes a
length at each t: an error of ε pixels may move the picture of Q(t) by ε pixels,
so across the projector it may be as long as ε times the smaller stretch of the
map from pixels to space. The breaks then lie at equal quantiles of

    ∫ √(‖q''‖ / (16 ε(t))) dt,

q'' across the projector: short chords where the projector bends or pixels are
small. A chord over a step h strays ‖q''‖ h²/8; shifting the ends by half of that
(``SHIFT``) spreads the error to both sides, hence 16. The integral is finite
even for a near surface that is a point, where ε grows as t from 0.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...projection.typing import Array, BoolArray
from ...projection.volume.basis import SpanBasis
from ...projection.volume.bezier import restrict
from ...projection.volume.viewing_volume import Projection, image_derivatives
from ..scene.cast_scene import CastScene
from ..scene.cast_triangles import LARGEST_COORDINATE
from ..scene.projector_boxes import piece_bounds, piece_edges, piece_weights

# Projectors of a tile that its schedule looks at, besides its corners.
SAMPLES = 56

# Steps in t at which they are looked at, per span.
STEPS = 32

# Of those projectors, how many the finished schedule is measured on.
MEASURED = 24

# The denominator of a rational projector varies by less than this along a chord: as this
# times the finer the finer chords within.
MOST_VARIED = 4.0

# And by less than this between two places where a rational span is looked at.
STEADY = 1.5

# Where pixels are squeezed more than this in one direction (near a pole, at a
# fold) the error counts against this share of the wide direction: the chords
# would multiply for a difference that nobody sees.
MOST_SQUEEZE = 64.0

# Chords closer to the curve than this share of its coordinates are lost on
# Embree's float32 (2⁻²⁴ a rounding).
FINEST = 2.0**-22

# Chords are this much denser than the sampled projectors ask for.
MARGIN = 1.03

# The first and the last chord have one end that is not shifted, and so half as much
# error again: √(2/3) of the length makes up for it.
END_CHORD = 0.8165

# The end of a chord moves by this times q'' h² (see above).
SHIFT = 1.0 / 16.0

# More chords a span than this are never cast.
MOST_CHORDS = 4096

# Attempts to bring the measured error under the one asked for.
ATTEMPTS = 8


@dataclass(frozen=True)
class Schedule:
    """The chords of a tile.

    breaks: (n+1,) increasing t, those of the spans among them. ends: (n+1, K)
    weights of the K control points that give the chords' ends. error: the largest
    distance between curve and chord on the sampled projectors, in pixels.
    finest: the smallest tolerance, in cast units. finer: finer chords to a chord,
    where a hit is in doubt; they stray by the square of it less.
    """

    breaks: Array
    ends: Array
    error: float
    finest: float
    finer: int

    @property
    def count(self) -> int:
        """The number of chords."""
        return len(self.breaks) - 1


class Curves(NamedTuple):
    """Sampled projectors with their derivatives by one pixel step in x and in y, (K, 3, S)."""

    points: Array
    dx: Array
    dy: Array


class Tolerance(NamedTuple):
    """What is asked of chords at G places on S projectors.

    position: (3, G, S). length: (G, S) allowed distance, cast units. pixel: (G, S) size of
    a pixel there. bend: (G, S) ‖q''‖ across the projector.
    """

    position: Array
    length: Array
    pixel: Array
    bend: Array


def scene_reach(spans: SpanBasis, points: Array, scene: CastScene) -> tuple[float, float] | None:
    """The part of [0, 1] in t where any of the projectors can be inside the scene's bounds.

    points: (K, 3, N). None where they all pass it by. Certain, not sampled: the
    control points of a piece enclose it, and those of all projectors lie in a box.
    """
    low, high = piece_bounds(
        piece_weights(spans), points.min(axis=2)[:, :, None], points.max(axis=2)[:, :, None]
    )
    slack = FINEST * (1.0 + np.abs(points).max(initial=0.0))
    touching = (scene.upper + slack >= low[:, :, 0].T) & (scene.lower - slack <= high[:, :, 0].T)
    some, edges = np.flatnonzero(touching.all(axis=1)), piece_edges(spans)
    return (float(edges[some[0]]), float(edges[some[-1] + 1])) if len(some) else None


def sample_curves(
    projection: Projection,
    x: Array,
    y: Array,
    mask: BoolArray,
    pixel_size: tuple[float, float],
    columns: int | None = None,
) -> Curves:
    """A spread of the tile's projectors: its outermost ones and SAMPLES within.

    columns: says that they are whole rows of so many pixels.
    """
    present = np.flatnonzero(mask)
    if len(present) > SAMPLES:
        if columns is not None and len(present) == len(mask):
            last = len(mask) - 1
            outermost = [0, columns - 1, last - columns + 1, last]
        else:
            px, py = x[present], y[present]
            outermost = [int(f(a)) for a in (px, py, px + py, px - py) for f in (np.argmin, np.argmax)]
        # Multiples of the golden section spread evenly over rows and columns alike.
        spread = (np.arange(SAMPLES) * 0.6180339887498949 % 1.0 * len(present)).astype(np.int64)
        present = present[np.concatenate([outermost, spread])]
    image = projection.parameters(x[present], y[present])
    controls = projection.volume.controls(image.u, image.v)
    with np.errstate(invalid="ignore", over="ignore"):
        dx, dy = image_derivatives(controls.du, controls.dv, image.jacobian)
    curves = Curves(controls.points, dx * pixel_size[0], dy * pixel_size[1])
    # A surface need not have a derivative everywhere.
    with np.errstate(invalid="ignore"):
        finite = np.logical_and.reduce([(np.abs(c) < LARGEST_COORDINATE).all(axis=(0, 1)) for c in curves])
    return Curves(*(c[:, :, finite] for c in curves))


def tolerance(curves: Curves, spans: SpanBasis, span: int, local: Array, pixel_error: float) -> Tolerance:
    """Evaluate the demand on chords at ``local`` (G,) in a span."""
    here, slope, second = spans.within(span, local)
    position, dx, dy = (_blend(here, c) for c in curves)
    tangent, bend = _blend(slope, curves.points), _blend(second, curves.points)
    squared = (tangent**2).sum(axis=0)
    # Where the tangent vanishes there is no across: all of a vector counts.
    inverse = np.divide(1.0, squared, out=np.zeros_like(squared), where=squared > 0.0)
    dx, dy, bend = (a - tangent * ((a * tangent).sum(axis=0) * inverse) for a in (dx, dy, bend))
    xx, yy, xy = (dx * dx).sum(axis=0), (dy * dy).sum(axis=0), (dx * dy).sum(axis=0)
    pixel = pixel_lengths(xx, yy, xy)
    floor = FINEST * np.abs(position).max(axis=0) + np.finfo(np.float64).tiny
    length = np.maximum(pixel_error * pixel, floor)
    return Tolerance(position, length, pixel, np.sqrt((bend**2).sum(axis=0)))


def pixel_lengths(xx: Array, yy: Array, xy: Array) -> Array:
    """As ``pixel_widths``: how wide pixels are the narrow way, or a share of the other if that is more."""
    wide, narrow = pixel_widths(xx, yy, xy)
    size: Array = np.sqrt(np.maximum(narrow, wide / MOST_SQUEEZE**2))
    return size


def pixel_widths(xx: Array, yy: Array, xy: Array) -> tuple[Array, Array]:
    """Squares of how wide pixels are, there in space, the way they are widest and the other.

    xx, yy, xy: the scalar products of a pixel's sides, of any shape.
    """
    wide: Array = 0.5 * (xx + yy + np.sqrt((xx - yy) ** 2 + 4.0 * xy * xy))
    area = np.maximum(xx * yy - xy * xy, 0.0)
    return wide, np.divide(area, wide, out=np.zeros_like(area), where=wide > 0.0)


def _blend(weights: Array, points: Array) -> Array:
    """Sums of points (K, 3, S) by weights (G, K), (3, G, S)."""
    sums: Array = (weights @ points.reshape(len(points), -1)).reshape(-1, *points.shape[1:])
    return sums.swapaxes(0, 1)


def plan(
    spans: SpanBasis, curves: Curves, reach: tuple[float, float], pixel_error: float, finer: int
) -> Schedule:
    """The schedule for a tile whose projectors ``curves`` sample, over ``reach`` in t.

    pixel_error: of the chords, pixels. finer: see Schedule.
    """
    return _joined(
        [
            _plan_span(spans, span, local, curves, pixel_error, finer)
            for span, local in _spans_within(spans, reach)
        ]
    )


def corners(spans: SpanBasis, reach: tuple[float, float]) -> Schedule:
    """The schedule for spans of degree 1: each is its own chord."""
    return _joined(
        [_chords(spans, span, np.array(local), 1, None) for span, local in _spans_within(spans, reach)]
    )


def split(spans: SpanBasis, schedule: Schedule, parts: int) -> Schedule:
    """The schedule with each chord cut in ``parts``, which stray by half the square of that less.

    Half, because the steps in a chord are only about as long as they should be. Not for rational spans.
    """
    span = spans.locate(0.5 * (schedule.breaks[:-1] + schedule.breaks[1:]))[0]
    steps = np.arange(parts) / parts
    pieces = []
    for number in np.unique(span):
        chords = np.flatnonzero(span == number)
        start, end = spans.breaks[number], spans.breaks[number + 1]
        local = np.clip((schedule.breaks[chords[0] : chords[-1] + 2] - start) / (end - start), 0.0, 1.0)
        # Even steps in θ, as in the plan.
        edges = np.arccos(1.0 - 2.0 * local)
        finer = np.append(0.5 - 0.5 * np.cos(edges[:-1, None] + steps * np.diff(edges)[:, None]), local[-1])
        finer[::parts] = local
        pieces.append(_chords(spans, int(number), finer, 1, None))
    return replace(_joined(pieces), error=2.0 * schedule.error / parts**2, finest=schedule.finest / parts**2)


def _spans_within(spans: SpanBasis, reach: tuple[float, float]) -> list[tuple[int, tuple[float, float]]]:
    """The spans that ``reach`` in t touches, with the part of each in its own parameter."""
    result = []
    for span, (start, end) in enumerate(pairwise(spans.breaks)):
        low, high = max(reach[0], start), min(reach[1], end)
        if low < high:
            result.append((span, ((low - start) / (end - start), (high - start) / (end - start))))
    return result


def _joined(parts: list[Schedule]) -> Schedule:
    """Schedules of consecutive spans as one: each begins where the one before ends."""
    return Schedule(
        np.concatenate([p.breaks[:-1] for p in parts] + [parts[-1].breaks[-1:]]),
        np.concatenate([p.ends[:-1] for p in parts] + [parts[-1].ends[-1:]]),
        max(p.error for p in parts),
        min(p.finest for p in parts),
        parts[0].finer,
    )


def _plan_span(
    spans: SpanBasis,
    span: int,
    reach: tuple[float, float],
    curves: Curves,
    pixel_error: float,
    finer: int,
) -> Schedule:
    """The schedule of one span; reach: in the span's own parameter."""
    first, last = reach
    length = spans.breaks[span + 1] - spans.breaks[span]
    # s = (1 - cos θ)/2: even steps in θ are fine at both ends of s, which turns
    # the integrand's pole at a point-like near surface into a constant.
    edges = np.linspace(np.arccos(1.0 - 2.0 * first), np.arccos(1.0 - 2.0 * last), STEPS + 1)
    least: Array | float = 0.0
    if spans.point_weights is not None:
        edges, varied = _steady(spans.point_weights[span], edges)
        least = varied / np.log(MOST_VARIED)
    middle = 0.5 * (edges[1:] + edges[:-1])
    demand = tolerance(curves, spans, span, 0.5 - 0.5 * np.cos(middle), pixel_error)
    density = np.sqrt(SHIFT * demand.bend / demand.length).max(axis=1, initial=0.0) * length
    share = np.maximum(density * 0.5 * np.sin(middle) * np.diff(edges), least)
    total = np.concatenate([[0.0], np.cumsum(share)])
    needed = MARGIN * total[-1] + 2 * (1.0 - END_CHORD)
    for _ in range(ATTEMPTS):
        count = int(np.clip(np.ceil(needed), 1, MOST_CHORDS))
        shares = np.ones(count)
        shares[[0, -1]] = END_CHORD
        quantiles = np.concatenate([[0.0], np.cumsum(shares)]) * (total[-1] / shares.sum())
        local = 0.5 - 0.5 * np.cos(np.interp(quantiles, total, edges))
        local[0], local[-1] = first, last
        schedule = _chords(spans, span, local, finer, curves)
        excess, error = _measure(schedule, spans, span, local, curves, pixel_error)
        if excess <= 1.0 or count == MOST_CHORDS:
            break
        needed = max(count * MARGIN * np.sqrt(excess), count + 1)
    return replace(schedule, error=error, finest=float(demand.length.min(initial=np.inf)))


def _steady(weights: Array, edges: Array) -> tuple[Array, Array]:
    """Edges in θ, more where a denominator varies, and the logarithm by which it varies between two.

    weights: (d+1,), the denominator's Bézier coefficients; those of a part of the
    span bound it there.
    """
    while True:
        local = 0.5 - 0.5 * np.cos(edges)
        parts = restrict(weights[:, None], local[:-1], local[1:])
        varied = np.log(parts.max(axis=0) / parts.min(axis=0))
        much = np.flatnonzero(varied > np.log(STEADY))
        if len(much) == 0:
            return edges, varied
        edges = np.insert(edges, much + 1, 0.5 * (edges[much] + edges[much + 1]))


def _chords(spans: SpanBasis, span: int, local: Array, finer: int, curves: Curves | None) -> Schedule:
    """Chords between breaks given in the span's own parameter, inner ends shifted."""
    start, end = spans.breaks[span], spans.breaks[span + 1]
    ends, slopes, bends = spans.within(span, local)
    if curves is not None and spans.point_weights is not None:
        bends = _across(slopes, bends, curves)
    steps = np.diff(local) * (end - start)
    shift = SHIFT * (steps[1:] * steps[:-1])[:, None]
    ends[1:-1] -= shift * bends[1:-1]
    return Schedule(start + local * (end - start), ends, 0.0, np.inf, finer)


def _across(slopes: Array, bends: Array, curves: Curves) -> Array:
    """Bends (G, K) without what the sampled projectors have of them along their tangents, in the mean.

    Rational projectors speed up and slow down so much that ends would be shifted
    far along them.
    """
    tangent, bend = (np.einsum("gk,kcs->cgs", w, curves.points) for w in (slopes, bends))
    along, squared = (tangent * bend).sum(axis=(0, 2)), (tangent**2).sum(axis=(0, 2))
    share = np.divide(along, squared, out=np.zeros_like(along), where=squared > 0.0)
    across: Array = bends - share[:, None] * slopes
    return across


def _measure(
    schedule: Schedule, spans: SpanBasis, span: int, local: Array, curves: Curves, pixel_error: float
) -> tuple[float, float]:
    """Largest distance of curve and chords, in tolerances and in pixels.

    Compared at both ends and in the middle of each chord, on MEASURED projectors; of
    rational spans at the ends and in the middle of each of the finer chords, which too
    must be as near as they should.
    """
    some = Curves(*(c[:, :, :MEASURED] for c in curves))
    corners = _blend(schedule.ends, some.points)
    excess = error = 0.0
    parts = 1 if spans.point_weights is None else schedule.finer
    # All places at once: where a chord ends the next begins.
    steps = np.arange(2 * parts) / (2 * parts)
    places = np.append((local[:-1, None] + steps * np.diff(local)[:, None]).ravel(), local[-1])
    whole = tolerance(some, spans, span, places, pixel_error)
    demands = []
    for first in range(2 * parts + 1):
        here = slice(first, first + len(places) - 2 * parts, 2 * parts)
        demand = Tolerance(*(field[..., here, :] for field in whole))
        distance = _distance(demand.position, corners[:, :-1], corners[:, 1:])
        excess = max(excess, float((distance / demand.length).max(initial=0.0)))
        known = demand.pixel > 0.0
        error = max(error, float(np.max(distance[known] / demand.pixel[known], initial=0.0)))
        demands.append(demand)
    if spans.point_weights is not None:
        for before, middle, after in zip(demands[:-2:2], demands[1::2], demands[2::2], strict=True):
            distance = _distance(middle.position, before.position, after.position)
            # Twice, for these are not shifted.
            allowed = 2.0 * middle.length / schedule.finer**2
            excess = max(excess, float((distance / allowed).max(initial=0.0)))
    return excess, error


def _distance(points: Array, start: Array, end: Array) -> Array:
    """From points to the segments from start to end, all (3, G, S): (G, S)."""
    chord, offset = end - start, points - start
    length = (chord**2).sum(axis=0)
    inverse = np.divide(1.0, length, out=np.zeros_like(length), where=length > 0.0)
    along = np.clip((offset * chord).sum(axis=0) * inverse, 0.0, 1.0)
    distance: Array = np.sqrt(((offset - chord * along) ** 2).sum(axis=0))
    return distance
