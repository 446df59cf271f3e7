# SPDX-License-Identifier: GPL-3.0-or-later
"""Projector bases: the rules by which the control points of a projector make its curve.

In every basis a projector is a short list of Bézier spans. Each has a matrix, and for NURBS a weight for each
of their control points. Casting, drawing and inversion know spans only.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from typing import Literal

import numpy as np

from ..typing import Array, IndexArray
from .bezier import bernstein, bernstein_derivative, bernstein_second_derivative

BasisKind = Literal["BEZIER", "POLYLINE", "B_SPLINE", "NURBS", "SMOOTH"]

# Bases that ask each control surface for a number.
WEIGHTED: frozenset[str] = frozenset({"NURBS", "SMOOTH"})

# Of B-spline and NURBS projectors; cubic is the least degree whose pieces meet with one curvature.
B_SPLINE_DEGREE = 3

# Weights of NURBS projectors: farther apart, a projector is its control polygon to float32
# and runs from corner to corner in a millionth of t.
SMALLEST_WEIGHT, LARGEST_WEIGHT = 1e-3, 1e3


@dataclass(frozen=True)
class SpanBasis:
    """Bézier spans of a curve with ``count`` control points.

    breaks: (S+1,) increasing from 0 to 1, where the spans meet in t.
    matrices: (S, d+1, count), rows that sum to 1; matrices[s] @ control points = the
    Bézier control points of span s.
    point_weights: (S, d+1), above 0, the weights of these where the spans are rational;
    None where they are polynomials.
    """

    breaks: Array
    matrices: Array
    point_weights: Array | None = None

    @property
    def degree(self) -> int:
        """Degree of every span."""
        return int(self.matrices.shape[1]) - 1

    @cached_property
    def direct(self) -> bool:
        """Return whether the control points are themselves the Bézier control points of the one span."""
        count = self.matrices.shape[2]
        return self.matrices.shape == (1, count, count) and np.array_equal(self.matrices[0], np.eye(count))

    @property
    def is_bezier(self) -> bool:
        """Return whether the control points are those of one Bézier curve without weights."""
        return self.direct and self.point_weights is None

    @property
    def is_polyline(self) -> bool:
        """Return whether every span is a line segment along which t advances evenly."""
        return self.degree == 1 and self.point_weights is None

    @property
    def is_straight(self) -> bool:
        """Return whether the curve is one line segment along which t advances evenly."""
        return self.is_polyline and self.direct

    def locate(self, t: Array) -> tuple[IndexArray, Array, Array]:
        """The span at each t, (N,), its start and its length in t.

        At a break the right-hand span counts, at t = 1 the last; outside [0, 1] the
        end spans do.
        """
        span = np.clip(np.searchsorted(self.breaks, t, side="right") - 1, 0, len(self.matrices) - 1)
        start = self.breaks[span]
        return span, start, self.breaks[span + 1] - start

    def weights(self, t: Array) -> tuple[Array, Array]:
        """Weights of the control points at t and their derivatives by t.

        t: (N,). Returns two (count, N) arrays. Spans as in ``locate``, continued
        outside [0, 1].
        """
        t = np.asarray(t, np.float64)
        span, start, length = self.locate(t)
        local = (t - start) / length
        value, slope = bernstein(self.degree, local), bernstein_derivative(self.degree, local)
        if self.point_weights is not None:
            value, slope, _ = _rational(value, slope, self.point_weights[span].T)
        if len(self.matrices) == 1:
            matrix = self.matrices[0]
            return np.einsum("kn,kc->cn", value, matrix), np.einsum("kn,kc->cn", slope, matrix) / length
        matrices = self.matrices[span]
        return (
            np.einsum("kn,nkc->cn", value, matrices),
            np.einsum("kn,nkc->cn", slope, matrices) / length,
        )

    def values(self, span: int, local: Array) -> Array:
        """Weights of the control points at ``local`` (G,) in a span, as ``within`` has them: (G, count)."""
        value = bernstein(self.degree, local)
        if self.point_weights is not None:
            value = value * self.point_weights[span][:, None]
            value = value / value.sum(axis=0)
        weights: Array = value.T @ self.matrices[span]
        return weights

    def within(self, span: int, local: Array) -> tuple[Array, Array, Array]:
        """Weights of the control points at ``local`` (G,) in a span, their slopes and their bends.

        local: the span's own parameter, in [0, 1]. slopes: derivatives by t. bends: second
        derivatives by t, up to a multiple of the slopes, which does not bend a curve: of a
        rational C = A/w the part (A'' - C w'')/w, since C'' is that - 2 (w'/w) C'. Each (G, count).
        """
        degree, matrix = self.degree, self.matrices[span]
        length = self.breaks[span + 1] - self.breaks[span]
        value, slope = bernstein(degree, local), bernstein_derivative(degree, local)
        bend = bernstein_second_derivative(degree, local)
        if self.point_weights is not None:
            weights = self.point_weights[span][:, None]
            value, slope, total = _rational(value, slope, weights)
            bend = bend * weights
            bend = (bend - value * bend.sum(axis=0)) / total
        return value.T @ matrix, slope.T @ matrix / length, bend.T @ matrix / length**2


def _rational(value: Array, slope: Array, weights: Array) -> tuple[Array, Array, Array]:
    """Rational Bernstein functions, their derivatives, each (d+1, N), and their denominator (N,).

    value, slope: (d+1, N) of the polynomials. weights: (d+1, N) or (d+1, 1).
    """
    value, slope = value * weights, slope * weights
    total = value.sum(axis=0)
    # R_i' = Σ_j (N_i' N_j - N_j' N_i) / w²: at the ends of a span the two that are not 0
    # are each other's negative to the last bit, so that coincident points stand still.
    products = slope[:, None] * value
    return value / total, (products - products.swapaxes(0, 1)).sum(axis=1) / total**2, total


def span_basis(kind: BasisKind, count: int, weights: Sequence[float] | None = None) -> SpanBasis:
    """The spans of a basis over ``count`` >= 2 control points.

    BEZIER: one span of degree count-1 (paper §4.1). POLYLINE: count-1 straight
    spans of equal length in t. B_SPLINE: the uniform B-spline of degree 3, or
    count-1 if that is less, clamped to its end points; with up to four control
    points it is the Bézier curve. NURBS: the same with a weight for each control point,
    above 0; if they are all equal it is the B-spline. SMOOTH: cubic spans of equal length in t that
    run through all control points without a corner. weights: (count,), of the control points of NURBS, None
    for equal ones; for SMOOTH their places along the projector, which rise or fall, else they count as even.
    Raises ValueError for fewer than two control points, an unknown kind or other weights.
    """
    if count < 2:
        raise ValueError("a projector needs at least two control points")
    if kind == "BEZIER":
        return SpanBasis(np.array([0.0, 1.0]), np.eye(count)[None])
    if kind == "POLYLINE":
        identity = np.eye(count)
        return SpanBasis(
            np.linspace(0.0, 1.0, count),
            np.stack([identity[i : i + 2] for i in range(count - 1)]),
        )
    if kind == "B_SPLINE":
        return _b_spline(count)
    if kind == "NURBS":
        return _weighted(_b_spline(count), np.ones(count) if weights is None else np.asarray(weights))
    if kind == "SMOOTH":
        return _smooth(count, np.ones(count) if weights is None else np.asarray(weights, np.float64))
    raise ValueError(f"unknown projector basis {kind!r}")


def _b_spline(count: int) -> SpanBasis:
    """The Bézier spans of a clamped uniform B-spline.

    Control point j of the span from a to b is the blossom at (a × (d-j), b × j),
    by de Boor's recurrence. Farin, Curves and Surfaces for CAGD, §8.
    """
    degree = min(B_SPLINE_DEGREE, count - 1)
    breaks = np.linspace(0.0, 1.0, count - degree + 1)
    knots = np.concatenate([np.zeros(degree), breaks, np.ones(degree)])
    matrices = np.zeros((count - degree, degree + 1, count))
    for span, (start, end) in enumerate(pairwise(breaks)):
        for j in range(degree + 1):
            points = np.eye(count)[span : span + degree + 1]
            for level, argument in enumerate([start] * (degree - j) + [end] * j):
                low = knots[span + 1 + level : span + 1 + degree]
                high = knots[span + 1 + degree : span + 1 + 2 * degree - level]
                share = ((argument - low) / (high - low))[:, None]
                points = points[:-1] * (1.0 - share) + points[1:] * share
            matrices[span, j] = points[0]
    return SpanBasis(breaks, matrices)


def _smooth(count: int, places: Array) -> SpanBasis:
    """The spans of cubic Bessel interpolation, whose slope at a point is that of a parabola through three.

    places: (count,), the points' values of the parameter by which slopes are taken. What is linear in it
    stays so. De Boor, A Practical Guide to Splines, chapter IV.
    """
    if places.shape != (count,):
        raise ValueError(f"{count} control points need as many places")
    points, steps = np.eye(count), np.diff(places)
    if count == 2:
        return SpanBasis(np.array([0.0, 1.0]), points[None])
    if not ((steps > 0.0).all() or (steps < 0.0).all()):
        steps = np.ones(count - 1)
    steps = np.abs(steps)[:, None]
    secants = np.diff(points, axis=0) / steps
    before, after = steps[:-1], steps[1:]
    inner = (after * secants[:-1] + before * secants[1:]) / (before + after)
    slopes = np.concatenate([2.0 * secants[:1] - inner[:1], inner, 2.0 * secants[-1:] - inner[-1:]])
    third = steps / 3.0
    matrices = np.stack(
        [points[:-1], points[:-1] + third * slopes[:-1], points[1:] - third * slopes[1:], points[1:]], axis=1
    )
    return SpanBasis(np.linspace(0.0, 1.0, count), matrices)


def _weighted(basis: SpanBasis, weights: Array) -> SpanBasis:
    """The rational spans that a weight for each control point makes of polynomial ones.

    Homogeneous control points (w Q, w) follow the same matrices. Farin, §13.
    """
    if weights.shape != basis.matrices.shape[2:]:
        raise ValueError(f"{basis.matrices.shape[2]} control points need as many weights")
    if not (np.isfinite(weights).all() and weights.min() > 0.0):
        raise ValueError("every weight must be a number above 0")
    if (weights == weights[0]).all():
        return basis
    # Only their ratios count.
    matrices = basis.matrices * (weights / weights.max())
    point_weights = matrices.sum(axis=2)
    return SpanBasis(basis.breaks, matrices / point_weights[:, :, None], point_weights)
