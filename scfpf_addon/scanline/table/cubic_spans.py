# SPDX-License-Identifier: GPL-3.0-or-later
"""A projector basis as cubic spans of equal length in t, in powers: what the preview's table holds."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...projection.volume.basis import BasisKind, SpanBasis, span_basis

# Spans that replace a polynomial of higher degree or a rational curve: its cubic Hermite pieces are off by
# a 384th of the fourth difference over a span, 4e-8 of the fourth derivative.
HIGH_DEGREE_SPANS = 16

# Bézier points to powers, by degree.
_POWERS = {
    1: [[1, 0], [-1, 1]],
    2: [[1, 0, 0], [-2, 2, 0], [1, -2, 1]],
    3: [[1, 0, 0, 0], [-3, 3, 0, 0], [3, -6, 3, 0], [-1, 3, -3, 1]],
}
# Value and slope at the start, then at the end, to powers.
_HERMITE = [[1, 0, 0, 0], [0, 1, 0, 0], [-3, -2, 3, -1], [2, 1, -2, 1]]


def power_spans(kind: BasisKind, count: int, weights: Sequence[float] | None = None):
    """(S, 4, count): powers[s, k] @ control points is the coefficient of τᵏ, τ = S·t - s in [0, 1]."""
    spans = span_basis(kind, count, weights)
    if spans.degree > 3 or spans.point_weights is not None:
        return _hermite_pieces(spans)
    powers = np.zeros((len(spans.matrices), 4, count))
    powers[:, : spans.degree + 1] = np.array(_POWERS[spans.degree], np.float64) @ spans.matrices
    return powers


def _hermite_pieces(spans: SpanBasis):
    ends = np.linspace(0.0, 1.0, HIGH_DEGREE_SPANS + 1)
    value, slope = spans.weights(ends)
    slope = slope / HIGH_DEGREE_SPANS
    pieces = np.stack([value[:, :-1], slope[:, :-1], value[:, 1:], slope[:, 1:]])
    return np.einsum("kj,jcs->skc", np.array(_HERMITE, np.float64), pieces)
