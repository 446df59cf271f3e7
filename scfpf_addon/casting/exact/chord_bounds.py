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

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array
from ...projection.volume.basis import SpanBasis
from ...projection.volume.bezier import bernstein, restrict
from .rational_bounds import rational_chords

# Ends are shifted by this times q'' h², half of the distance of a chord from its curve.
SHIFT = 1.0 / 16.0

# Pieces of a span whose bounds are compared with the scene's, at each level.
PIECES = 32

# Levels at which the part of a span within reach is cut into pieces.
REACH_LEVELS = 10

# Rounding of a piece's bounds, as a share of the largest coordinate of its control points.
ROUNDING = 1e-14

# Places at which a span is looked at for its need of chords.
STEPS = 64

# More chords a span than this are never cast.
MOST_CHORDS = 1 << 16

# Chords are added by this factor until the bound holds.
GROWTH = 1.03


@dataclass(frozen=True)
class Chords:
    """Chords of a tile: n in all.

    breaks: (n+1,) increasing t. ends: (n+1, K) weights of the control points at the
    chords' ends. span: (n,) the span of each.
    """

    breaks: Array
    ends: Array
    span: NDArray[np.intp]

    @property
    def count(self) -> int:
        """The number of chords."""
        return len(self.span)


def certain_chords(
    spans: SpanBasis, points: Array, lower: Array, upper: Array, epsilon: float
) -> tuple[Chords | None, float]:
    """Chords that stay within epsilon of the projectors (K, 3, N) while these are in a box.

    lower, upper: (3,) the box. The chords cover, without a gap, all t at which any
    projector may be in it. None where none can. Also returns the distance that is
    certain: epsilon or less, more only where MOST_CHORDS do not suffice.
    """
    low, high, weights = points.min(axis=2), points.max(axis=2), spans.point_weights
    reach = [
        span_reach(matrix, low, high, lower, upper, None if weights is None else weights[span])
        for span, matrix in enumerate(spans.matrices)
    ]
    used = [span for span, part in enumerate(reach) if part is not None]
    if not used:
        return None, 0.0
    parts, bound = [], 0.0
    for span in range(used[0], used[-1] + 1):
        first, last = reach[span] or (0.0, 1.0)
        # The chords are one line: between spans it goes through the break itself.
        start, end = first if span == used[0] else 0.0, last if span == used[-1] else 1.0
        if weights is not None:
            local, ends, certain = rational_chords(spans, span, points, (start, end), epsilon)
        else:
            joined = span > used[0], span < used[-1]
            local, ends, certain = _span_chords(spans.matrices[span], points, (start, end), epsilon, joined)
        bound = max(bound, certain)
        begin, length = spans.breaks[span], spans.breaks[span + 1] - spans.breaks[span]
        breaks = begin + local * length
        if end == 1.0:
            breaks[-1] = spans.breaks[span + 1]
        parts.append(Chords(breaks, ends, np.full(len(local) - 1, span)))
    return _joined(parts), bound


def span_reach(
    matrix: Array, low: Array, high: Array, lower: Array, upper: Array, weights: Array | None = None
) -> tuple[float, float] | None:
    """The part of a span, in its own parameter, in which curves can be in a box.

    matrix: (d+1, K); low, high: (K, 3) bounds of the control points; lower, upper: (3,); weights: (d+1,)
    of a rational span.
    None where they cannot. Certain: pieces lie within the hull of their control points.
    """
    degree = len(matrix) - 1
    slack = ROUNDING * max(float(np.abs(low).max()), float(np.abs(high).max()))
    first, last = 0.0, 1.0
    for _ in range(REACH_LEVELS):
        edges = np.linspace(first, last, PIECES + 1)
        identity = np.broadcast_to(np.eye(degree + 1)[:, :, None], (degree + 1, degree + 1, PIECES))
        pieces = restrict(identity, edges[:-1], edges[1:])
        if weights is not None:
            pieces = pieces * weights[:, None]
            pieces /= pieces.sum(axis=1, keepdims=True)
        shares = np.einsum("jip,ik->pjk", pieces, matrix)
        positive, negative = np.maximum(shares, 0.0), np.minimum(shares, 0.0)
        least = (positive @ low + negative @ high).min(axis=1)
        most = (positive @ high + negative @ low).max(axis=1)
        touching = ((least <= upper + slack) & (most >= lower - slack)).all(axis=1)
        inside = np.flatnonzero(touching)
        if len(inside) == 0:
            return None
        before = last - first
        first, last = float(edges[inside[0]]), float(edges[inside[-1] + 1])
        if last - first > 0.5 * before:
            break
    return first, last


def _joined(parts: list[Chords]) -> Chords:
    return Chords(
        np.concatenate([p.breaks[:-1] for p in parts] + [parts[-1].breaks[-1:]]),
        np.concatenate([p.ends[:-1] for p in parts] + [parts[-1].ends[-1:]]),
        np.concatenate([p.span for p in parts]),
    )


def _span_chords(
    matrix: Array, points: Array, reach: tuple[float, float], epsilon: float, joined: tuple[bool, bool]
) -> tuple[Array, Array, float]:
    """Breaks (n+1,) in a span's own parameter, weights (n+1, K) of the ends, and their bound.

    joined: whether another span's chords come before and after.
    """
    first, last = reach
    second, third = _derivative_bounds(matrix, points)
    if not second.any():
        local = np.array([first, last])
        return local, bernstein(len(matrix) - 1, local).T @ matrix, 0.0
    edges = np.linspace(first, last, STEPS + 1)
    density = np.sqrt(SHIFT * _blend(second, 0.5 * (edges[1:] + edges[:-1])) / epsilon)
    # Where q'' vanishes for an instant steps would grow without limit.
    density = np.maximum(density, 0.1 * density.max())
    total = np.concatenate([[0.0], np.cumsum(density * np.diff(edges))])
    count = int(np.clip(np.ceil(total[-1]), 1, MOST_CHORDS))
    while True:
        local = np.interp(np.linspace(0.0, total[-1], count + 1), total, edges)
        local[0], local[-1] = first, last
        steps = np.diff(local)
        around = np.concatenate([steps[:1], steps, steps[-1:]])
        shift = around[1:] * around[:-1]
        shift[[0, -1]] = np.where(joined, 0.0, shift[[0, -1]])
        bound = _bound(local, shift, second, third)
        if bound <= epsilon or count >= MOST_CHORDS:
            break
        count = min(max(int(count * GROWTH), count + 1), MOST_CHORDS)
    degree = len(matrix) - 1
    curvature = degree * (degree - 1) * np.diff(matrix, 2, axis=0)
    ends = bernstein(degree, local).T @ matrix
    ends -= SHIFT * shift[:, None] * (bernstein(degree - 2, local).T @ curvature)
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
    # What control points on one straight line leave by rounding is no bend.
    noise = 1e-15 * degree**2 * np.abs(points).max()
    return np.where(bounds[0] > noise, bounds[0], 0.0), bounds[1]


def _blend(coefficients: Array, at: Array) -> Array:
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
    middle = _blend(second, 0.5 * (local[:-1] + local[1:]))
    apart = area * (middle * share + change * (0.125 + SHIFT * np.maximum(alpha, beta)))
    return float(apart.max())
