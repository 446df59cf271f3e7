# SPDX-License-Identifier: GPL-3.0-or-later
"""Projector bases: how the control points of a projector make its curve.

Whatever the basis, a projector is a short list of Bézier spans, one matrix a
span; casting, drawing and inversion know spans only.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np

from .bezier import bernstein, bernstein_derivative
from .typing import Array, IndexArray

BasisKind = Literal["BEZIER", "POLYLINE", "B_SPLINE"]

# Of B-spline projectors; cubic is the least degree whose pieces meet with one curvature.
B_SPLINE_DEGREE = 3


@dataclass(frozen=True)
class SpanBasis:
    """Bézier spans of a curve with ``count`` control points.

    breaks: (S+1,) increasing from 0 to 1, where the spans meet in t.
    matrices: (S, d+1, count); matrices[s] @ control points = the Bézier control
    points of span s.
    """

    breaks: Array
    matrices: Array

    @property
    def degree(self) -> int:
        """Degree of every span."""
        return int(self.matrices.shape[1]) - 1

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
        if len(self.matrices) == 1:
            matrix = self.matrices[0]
            return np.einsum("kn,kc->cn", value, matrix), np.einsum("kn,kc->cn", slope, matrix) / length
        matrices = self.matrices[span]
        return (
            np.einsum("kn,nkc->cn", value, matrices),
            np.einsum("kn,nkc->cn", slope, matrices) / length,
        )


def span_basis(kind: BasisKind, count: int) -> SpanBasis:
    """The spans of a basis over ``count`` >= 2 control points.

    BEZIER: one span of degree count-1 (paper §4.1). POLYLINE: count-1 straight
    spans of equal length in t. B_SPLINE: the uniform B-spline of degree 3, or
    count-1 if that is less, clamped to its end points; with up to four control
    points it is the Bézier curve.
    Raises ValueError for fewer than two control points or an unknown kind.
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
