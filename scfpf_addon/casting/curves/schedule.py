# SPDX-License-Identifier: GPL-3.0-or-later
"""The schedule of a tile: where the chords of its projectors begin and end.

All projectors of a tile share one list of breaks in t. The pixel error becomes a
length at each t. An error of ε pixels may move the image of Q(t) by ε pixels,
so across the projector it may be as long as ε times the smaller stretch of the
map from pixels to space. The breaks then lie at equal quantiles of

    ∫ √(‖q''‖ / (16 ε(t))) dt,

q'' across the projector: chords are short where the projector bends or pixels are
small. For the factor 16 see ``chord_rules.SHIFT``. The integral is finite
even for a near surface that is a point, where ε grows as t from 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...projection.typing import Array
from ...projection.volume.basis import SpanBasis
from ..scene.cast_scene import CastScene
from ..scene.projector_boxes import piece_bounds, piece_edges, piece_weights
from .chord_rules import (
    END_CHORD,
    SHIFT,
    Chords,
    graded,
    half_cosine,
    halved_until_steady,
    joined,
    running_total,
)
from .sampled_curves import FINEST, Curves, across, blend, footprint, pixel_length

# Steps in t at which sampled projectors are evaluated, per span.
STEPS = 32

# Of those projectors, how many the finished schedule is measured on.
MEASURED = 24

# The denominator of a rational projector varies by a smaller factor than this along a chord.
MOST_VARIED = 4.0

# And by a smaller factor than this between two places where the span is evaluated.
STEADY = 1.5

# Chords are this much denser than the sampled projectors require.
MARGIN = 1.03

# More chords a span than this are never cast.
MOST_CHORDS = 4096

# Attempts to bring the measured error under the pixel error.
ATTEMPTS = 8


@dataclass(frozen=True)
class Schedule(Chords):
    """The chords of a tile, within a pixel error.

    error: the largest distance between curve and chord on the sampled projectors, in pixels.
    finest: the smallest tolerance, in cast units.
    """

    error: float = 0.0
    finest: float = np.inf


class Tolerance(NamedTuple):
    """The tolerance of chords at G places on S projectors.

    position: (3, G, S). length: (G, S) allowed distance, cast units. pixel: (G, S) size of
    a pixel there. bend: (G, S) ‖q''‖ across the projector.
    """

    position: Array
    length: Array
    pixel: Array
    bend: Array


def scene_reach(spans: SpanBasis, points: Array, scene: CastScene) -> tuple[float, float] | None:
    """The part of [0, 1] in t where any projector can be inside the scene's bounds, or None.

    points: (K, 3, N). Certain, not sampled: the control points of a piece enclose it, and those of all
    projectors lie in a box.
    """
    low, high = piece_bounds(
        piece_weights(spans), points.min(axis=2)[:, :, None], points.max(axis=2)[:, :, None]
    )
    slack = FINEST * (1.0 + np.abs(points).max(initial=0.0))
    touching = (scene.upper + slack >= low[:, :, 0].T) & (scene.lower - slack <= high[:, :, 0].T)
    some, edges = np.flatnonzero(touching.all(axis=1)), piece_edges(spans)
    return (float(edges[some[0]]), float(edges[some[-1] + 1])) if len(some) else None


def tolerance(curves: Curves, spans: SpanBasis, span: int, local: Array, pixel_error: float) -> Tolerance:
    """Evaluate the tolerance of chords at ``local`` (G,) in a span."""
    there = footprint(curves, spans, span, local)
    pixel = pixel_length(there.wide, there.narrow)
    floor = FINEST * np.abs(there.position).max(axis=0) + np.finfo(np.float64).tiny
    bend = across(there.bend, there.tangent)
    length = np.maximum(pixel_error * pixel, floor)
    return Tolerance(there.position, length, pixel, np.sqrt((bend**2).sum(axis=0)))


def plan(spans: SpanBasis, curves: Curves, reach: tuple[float, float], pixel_error: float) -> Schedule:
    """Plan the schedule of a tile whose projectors ``curves`` sample, over ``reach`` in t."""
    return _joined(
        [_plan_span(spans, span, local, curves, pixel_error) for span, local in _spans_within(spans, reach)]
    )


def corners(spans: SpanBasis, reach: tuple[float, float]) -> Schedule:
    """The schedule for spans of degree 1: each is its own chord."""
    return _joined([_chords(spans, span, np.array(local)) for span, local in _spans_within(spans, reach)])


def split(spans: SpanBasis, schedule: Schedule, parts: int) -> Schedule:
    """The schedule with each chord cut in ``parts``, which stray by 2/parts² as much. Not for rational spans.

    2, not 1, because the steps in a chord are only about as long as they should be.
    """
    steps = np.arange(parts) / parts
    pieces = []
    for number in np.unique(schedule.span):
        chords = np.flatnonzero(schedule.span == number)
        start, end = spans.breaks[number], spans.breaks[number + 1]
        local = np.clip((schedule.breaks[chords[0] : chords[-1] + 2] - start) / (end - start), 0.0, 1.0)
        # Even steps in θ, as in the plan.
        edges = np.arccos(1.0 - 2.0 * local)
        fine = np.append(half_cosine(edges[:-1, None] + steps * np.diff(edges)[:, None]), local[-1])
        fine[::parts] = local
        pieces.append(_chords(spans, int(number), fine))
    return replace(_joined(pieces), error=2.0 * schedule.error / parts**2, finest=schedule.finest / parts**2)


def _spans_within(spans: SpanBasis, reach: tuple[float, float]) -> list[tuple[int, tuple[float, float]]]:
    """The spans that ``reach`` in t touches, with the part of each in its own parameter."""
    result = []
    for span, (start, end) in enumerate(pairwise(spans.breaks)):
        low, high = max(reach[0], start), min(reach[1], end)
        if low < high:
            result.append((span, ((low - start) / (end - start), (high - start) / (end - start))))
    return result


def _joined(parts: Sequence[Schedule]) -> Schedule:
    """Schedules of consecutive spans as one."""
    whole = joined(parts)
    error, finest = max(p.error for p in parts), min(p.finest for p in parts)
    return Schedule(whole.breaks, whole.ends, whole.span, error, finest)


def _plan_span(
    spans: SpanBasis, span: int, reach: tuple[float, float], curves: Curves, pixel_error: float
) -> Schedule:
    """The schedule of one span; reach: in the span's own parameter."""
    first, last = reach
    length = spans.breaks[span + 1] - spans.breaks[span]
    # Even steps in θ (``half_cosine``) turn the integrand's pole at a point-like near surface
    # into a constant.
    edges = np.linspace(np.arccos(1.0 - 2.0 * first), np.arccos(1.0 - 2.0 * last), STEPS + 1)
    least: Array | float = 0.0
    if spans.point_weights is not None:
        edges, varied = halved_until_steady(spans.point_weights[span], edges, STEADY, half_cosine)
        least = np.log(varied) / np.log(MOST_VARIED)
    middle = 0.5 * (edges[1:] + edges[:-1])
    demand = tolerance(curves, spans, span, half_cosine(middle), pixel_error)
    density = np.sqrt(SHIFT * demand.bend / demand.length).max(axis=1, initial=0.0) * length
    total = running_total(np.maximum(density * 0.5 * np.sin(middle) * np.diff(edges), least))
    needed = MARGIN * total[-1] + 2 * (1.0 - END_CHORD)
    for _ in range(ATTEMPTS):
        count = int(np.clip(np.ceil(needed), 1, MOST_CHORDS))
        local = graded(total, edges, count)
        local[0], local[-1] = first, last
        schedule = _chords(spans, span, local, curves)
        excess, error = _measure(schedule, spans, span, local, curves, pixel_error)
        if excess <= 1.0 or count == MOST_CHORDS:
            break
        needed = max(count * MARGIN * np.sqrt(excess), count + 1)
    return replace(schedule, error=error, finest=float(demand.length.min(initial=np.inf)))


def _chords(spans: SpanBasis, span: int, local: Array, curves: Curves | None = None) -> Schedule:
    """Chords between breaks given in the span's own parameter, inner ends shifted."""
    start, end = spans.breaks[span], spans.breaks[span + 1]
    ends, slopes, bends = spans.within(span, local)
    if curves is not None and spans.point_weights is not None:
        bends = _mean_across(slopes, bends, curves)
    steps = np.diff(local) * (end - start)
    shift = SHIFT * (steps[1:] * steps[:-1])[:, None]
    ends[1:-1] -= shift * bends[1:-1]
    return Schedule(start + local * (end - start), ends, np.full(len(steps), span))


def _mean_across(slopes: Array, bends: Array, curves: Curves) -> Array:
    """Bends (G, K) without the mean of their part along the sampled projectors' tangents.

    Rational projectors speed up and slow down so much that ends would be shifted
    far along them.
    """
    tangent, bend = (np.einsum("gk,kcs->cgs", w, curves.points) for w in (slopes, bends))
    along, squared = (tangent * bend).sum(axis=(0, 2)), (tangent**2).sum(axis=(0, 2))
    share = np.divide(along, squared, out=np.zeros_like(along), where=squared > 0.0)
    part: Array = bends - share[:, None] * slopes
    return part


def _measure(
    schedule: Schedule, spans: SpanBasis, span: int, local: Array, curves: Curves, pixel_error: float
) -> tuple[float, float]:
    """Largest distance of curve and chords, in tolerances and in pixels.

    Compared at both ends and in the middle of each chord, on MEASURED projectors. Rational spans are also
    compared with chords whose ends are not shifted, within twice the tolerance.
    """
    some = curves.only(slice(MEASURED))
    ends = blend(schedule.ends, some.points)
    # All places at once: where a chord ends the next begins.
    places = np.append((local[:-1, None] + np.array([0.0, 0.5]) * np.diff(local)[:, None]).ravel(), local[-1])
    whole = tolerance(some, spans, span, places, pixel_error)
    before, middle, after = (
        Tolerance(*(field[..., first : first + len(places) - 2 : 2, :] for field in whole))
        for first in range(3)
    )
    excess = error = 0.0
    for demand in (before, middle, after):
        distance = _distance(demand.position, ends[:, :-1], ends[:, 1:])
        excess = max(excess, float((distance / demand.length).max(initial=0.0)))
        known = demand.pixel > 0.0
        error = max(error, float(np.max(distance[known] / demand.pixel[known], initial=0.0)))
    if spans.point_weights is not None:
        distance = _distance(middle.position, before.position, after.position)
        excess = max(excess, float((distance / (2.0 * middle.length)).max(initial=0.0)))
    return excess, error


def _distance(points: Array, start: Array, end: Array) -> Array:
    """Distances (G, S) from points to the segments from start to end, all (3, G, S)."""
    chord, offset = end - start, points - start
    length = (chord**2).sum(axis=0)
    inverse = np.divide(1.0, length, out=np.zeros_like(length), where=length > 0.0)
    along = np.clip((offset * chord).sum(axis=0) * inverse, 0.0, 1.0)
    distance: Array = np.sqrt(((offset - chord * along) ** 2).sum(axis=0))
    return distance
