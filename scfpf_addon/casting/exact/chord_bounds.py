# SPDX-License-Identifier: GPL-3.0-or-later
"""Chords whose distance from their curves is certain, for all projectors of a tile.

Over a step h a chord with shifted ends differs from its curve, at the same t, by

    h² q'' (-σ(1-σ)/2 + ((1-σ) α + σ β)/16),   σ in [0, 1]

plus what the change of q'' adds, with α and β the shifts in units of h²/16. So the
largest ‖q''‖ and ‖q'''‖ of the tile bound the distance; by the convex hull
property Bernstein polynomials of the control points' differences bound those.
The method of Wang (1984), with the ends shifted and breaks graded along t.
"""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array
from ...projection.volume.basis import SpanBasis
from ...projection.volume.bezier import bernstein, restrict
from ..curves.chord_rules import SHIFT, Chords, fewest_certain, joined
from ..scene.projector_boxes import piece_bounds, weights_between
from .rational_bounds import rational_chords

# Pieces of a span whose bounds are compared with the scene's, at each level.
PIECES = 32

# Levels at which the part of a span within reach is cut into pieces.
REACH_LEVELS = 10

# Rounding of a piece's bounds, as a share of the largest coordinate of its control points.
ROUNDING = 1e-14

# Places at which the demand of a span for chords is evaluated.
STEPS = 64


def certain_chords(
    spans: SpanBasis, points: Array, lower: Array, upper: Array, epsilon: float
) -> tuple[Chords | None, float]:
    """Chords that stay within epsilon of the projectors (K, 3, N) while these are in a box.

    lower, upper: (3,) the box. The chords cover, without a gap, all t at which any
    projector may be in it; None if no projector can. Also returns the distance that is
    certain: it is above epsilon only where MOST_CERTAIN chords a span do not suffice.
    """
    low, high = points.min(axis=2), points.max(axis=2)
    reach = [_span_reach(spans, span, low, high, lower, upper) for span in range(len(spans.matrices))]
    used = [span for span, part in enumerate(reach) if part is not None]
    if not used:
        return None, 0.0
    parts, bound = [], 0.0
    for span in range(used[0], used[-1] + 1):
        first, last = reach[span] or (0.0, 1.0)
        # The chords are one line: between spans it goes through the break itself.
        start, end = first if span == used[0] else 0.0, last if span == used[-1] else 1.0
        if spans.point_weights is not None:
            local, ends, certain = rational_chords(spans, span, points, (start, end), epsilon)
        else:
            between = span > used[0], span < used[-1]
            local, ends, certain = _span_chords(spans.matrices[span], points, (start, end), epsilon, between)
        bound = max(bound, certain)
        begin, length = spans.breaks[span], spans.breaks[span + 1] - spans.breaks[span]
        breaks = begin + local * length
        if end == 1.0:
            breaks[-1] = spans.breaks[span + 1]
        parts.append(Chords(breaks, ends, np.full(len(local) - 1, span)))
    return joined(parts), bound


def _span_reach(
    spans: SpanBasis, span: int, low: Array, high: Array, lower: Array, upper: Array
) -> tuple[float, float] | None:
    """The part of a span, in its own parameter, in which curves can be in a box; None if they cannot.

    low, high: (K, 3) bounds of the control points; lower, upper: (3,) the box. Certain: pieces lie within
    the hull of their control points.
    """
    slack = ROUNDING * max(float(np.abs(low).max()), float(np.abs(high).max()))
    matrix = spans.matrices[span : span + 1]
    weights = None if spans.point_weights is None else spans.point_weights[span : span + 1]
    first, last = 0.0, 1.0
    for _ in range(REACH_LEVELS):
        edges = np.linspace(first, last, PIECES + 1)
        pieces = weights_between(edges, matrix, weights)
        least, most = (bound[:, :, 0].T for bound in piece_bounds(pieces, low[:, :, None], high[:, :, None]))
        touching = ((least <= upper + slack) & (most >= lower - slack)).all(axis=1)
        inside = np.flatnonzero(touching)
        if len(inside) == 0:
            return None
        before = last - first
        first, last = float(edges[inside[0]]), float(edges[inside[-1] + 1])
        if last - first > 0.5 * before:
            break
    return first, last


def _span_chords(
    matrix: Array, points: Array, reach: tuple[float, float], epsilon: float, between: tuple[bool, bool]
) -> tuple[Array, Array, float]:
    """Breaks (n+1,) in a span's own parameter, weights (n+1, K) of the ends, and their bound.

    between: whether another span's chords come before and after.
    """
    second, third = _derivative_bounds(matrix, points)
    if not second.any():
        local = np.array(reach)
        return local, bernstein(len(matrix) - 1, local).T @ matrix, 0.0
    edges = np.linspace(*reach, STEPS + 1)
    density = np.sqrt(SHIFT * _bezier_value(second, 0.5 * (edges[1:] + edges[:-1])) / epsilon)
    # Where q'' vanishes for an instant steps would grow without limit.
    density = np.maximum(density, 0.1 * density.max())

    def shifts(local: Array) -> Array:
        """Shifts of the ends, in units of SHIFT."""
        steps = np.diff(local)
        around = np.concatenate([steps[:1], steps, steps[-1:]])
        shift: Array = around[1:] * around[:-1]
        shift[[0, -1]] = np.where(between, 0.0, shift[[0, -1]])
        return shift

    local, bound = fewest_certain(
        edges, density * np.diff(edges), epsilon, lambda local: _bound(local, shifts(local), second, third)
    )
    degree = len(matrix) - 1
    curvature = degree * (degree - 1) * np.diff(matrix, 2, axis=0)
    ends = bernstein(degree, local).T @ matrix
    ends -= SHIFT * shifts(local)[:, None] * (bernstein(degree - 2, local).T @ curvature)
    return local, ends, bound


def _derivative_bounds(matrix: Array, points: Array) -> tuple[Array, Array]:
    """Bernstein coefficients that bound ‖q''‖ and ‖q'''‖ of all curves, (d-1,) and (d-2,)."""
    degree = len(matrix) - 1
    bounds = []
    for order in (2, 3):
        if degree < order:
            bounds.append(np.zeros(1))
            continue
        factor = degree * (degree - 1) * (degree - 2 if order == 3 else 1)
        differences = np.einsum("ik,kcn->icn", factor * np.diff(matrix, order, axis=0), points)
        bounds.append(np.sqrt((differences**2).sum(axis=1).max(axis=1)))
    # Control points on a straight line have second differences by rounding alone.
    noise = 1e-15 * degree**2 * np.abs(points).max()
    return np.where(bounds[0] > noise, bounds[0], 0.0), bounds[1]


def _bezier_value(coefficients: Array, at: Array) -> Array:
    """The polynomial with Bernstein coefficients (d+1,) at parameters (n,)."""
    result: Array = coefficients @ bernstein(len(coefficients) - 1, at)
    return result


def _bound(local: Array, shift: Array, second: Array, third: Array) -> float:
    """The largest distance of chords and curves at the same t (see above)."""
    steps = np.diff(local)
    area = steps**2
    alpha, beta = shift[:-1] / area, shift[1:] / area
    lowest = np.clip(0.5 - (beta - alpha) * SHIFT, 0.0, 1.0)
    deepest = -0.5 * lowest * (1.0 - lowest) + SHIFT * ((1.0 - lowest) * alpha + lowest * beta)
    share = np.maximum(np.maximum(alpha, beta) * SHIFT, np.abs(deepest))
    pieces = restrict(np.repeat(third[:, None], len(steps), axis=1), local[:-1], local[1:])
    change = pieces.max(axis=0) * 0.5 * steps
    middle = _bezier_value(second, 0.5 * (local[:-1] + local[1:]))
    apart = area * (middle * share + change * (0.125 + SHIFT * np.maximum(alpha, beta)))
    return float(apart.max())
