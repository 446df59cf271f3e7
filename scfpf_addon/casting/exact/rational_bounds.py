# SPDX-License-Identifier: GPL-3.0-or-later
"""Chords whose distance from rational projectors is certain, for ``chord_bounds``.

All projectors of a volume share the weights of its surfaces, so that a point is a sum of
control points by rational functions R of t alone: q = Σ R P. A chord from a to b leaves its
curve, at the same t, by at most max‖q''‖ (b - a)²/8. On pieces in which the denominator
hardly varies ‖q''‖ is measured in the middle, and bounded elsewhere by ‖q'''‖, for which the
Bernstein coefficients of the R''' suffice.
"""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array
from ...projection.volume.basis import SpanBasis
from ...projection.volume.bezier import bernstein, derivative, product, restrict
from ..curves.chord_rules import fewest_certain, halved_until_steady

# Pieces between which chords are graded: the least number; they are halved until the denominator's
# coefficients in each are within the factor.
LEAST_PIECES = 24
STEADY = 1.3


def rational_chords(
    spans: SpanBasis, span: int, points: Array, reach: tuple[float, float], epsilon: float
) -> tuple[Array, Array, float]:
    """Chords of one span within epsilon of rational projectors (K, 3, N).

    reach: the part of the span, in its own parameter. Returns the breaks in that (n+1,), the
    weights (n+1, K) of the chords' ends, which lie on the curves, and the distance that is certain:
    it is above epsilon only where MOST_CERTAIN chords do not suffice.
    """
    assert spans.point_weights is not None
    weights = spans.point_weights[span]
    edges, _ = halved_until_steady(weights, np.linspace(*reach, LEAST_PIECES + 1), STEADY)
    bends = _bends(weights, spans.matrices[span], points, edges)

    def bound(local: Array) -> float:
        """The largest distance of chords between these breaks."""
        first = np.clip(np.searchsorted(edges, local[:-1], side="right") - 1, 0, len(bends) - 1)
        last = np.clip(np.searchsorted(edges, local[1:], side="left"), first + 1, len(bends))
        # reduceat takes the pieces from each even place to the odd one after it.
        most = np.maximum.reduceat(np.append(bends, 0.0), np.stack([first, last], axis=1).ravel())[::2]
        return float((0.125 * most * np.diff(local) ** 2).max())

    demand = np.sqrt(0.125 * bends / epsilon) * np.diff(edges)
    local, certain = fewest_certain(edges, demand, epsilon, bound)
    return local, spans.values(span, local), certain


def _bends(weights: Array, matrix: Array, points: Array, edges: Array) -> Array:
    """The largest ‖q''‖ of the curves in each piece, (P,), by the span's own parameter.

    Of R = n/w the derivatives are b/w², c/w³ and e/w⁴ with b = n'w - nw', c = b'w - 2bw',
    e = c'w - 3cw'.
    """
    denominator = restrict(weights[:, None], edges[:-1], edges[1:])
    pieces = np.broadcast_to((weights[:, None] * matrix)[:, :, None], (*matrix.shape, len(edges) - 1))
    above = restrict(pieces, edges[:-1], edges[1:])
    twice = _derived(_derived(above, denominator, 1), denominator, 2)
    third = _derived(twice, denominator, 3)
    # Σ R''' = 0: by the steps from point to point, whose lengths are known.
    sums = np.abs(np.cumsum(third, axis=1)[:, :-1]).max(axis=0) / denominator.min(axis=0) ** 4
    steps = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1).max(axis=1))
    bends = 0.5 * steps @ sums
    by_point = _middle(twice) / _middle(denominator) ** 3
    for piece, second in enumerate(by_point.T):
        bent = np.einsum("k,kcn->cn", second, points)
        bends[piece] += np.sqrt(np.einsum("cn,cn->n", bent, bent).max())
    result: Array = bends / np.diff(edges) ** 2
    return result


def _derived(above: Array, below: Array, power: int) -> Array:
    """The numerator over w^(power+1) of the derivative of a/w^power: a (d+1, K, P), w (e+1, P)."""
    rising, slope = derivative(above), derivative(below)
    first = product(rising[:, None] * below[None, :, None])
    second = product(above[:, None] * slope[None, :, None])
    result: Array = first - power * second
    return result


def _middle(coefficients: Array) -> Array:
    value: Array = np.einsum("k,k...->...", bernstein(len(coefficients) - 1, np.array(0.5)), coefficients)
    return value
