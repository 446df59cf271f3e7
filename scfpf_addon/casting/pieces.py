# SPDX-License-Identifier: GPL-3.0-or-later
"""Projectors cut into pieces along t, and boxes that certainly hold them."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..projection.basis import SpanBasis
from ..projection.bezier import restrict
from ..projection.typing import Array

# Pieces of a span.
PIECES = 64


def piece_edges(spans: SpanBasis, parts: int = 1) -> Array:
    """Where the P = S·PIECES·parts pieces begin and end in t, (P + 1,)."""
    starts = np.linspace(0.0, 1.0, PIECES * parts + 1)[:-1]
    lengths = np.diff(spans.breaks)[:, None]
    edges: Array = np.append((spans.breaks[:-1, None] + starts * lengths).ravel(), spans.breaks[-1])
    return edges


def piece_weights(spans: SpanBasis, parts: int = 1) -> Array:
    """How the pieces' control points are made of the projector's, (S·PIECES·parts, degree+1, K)."""
    edges = np.linspace(0.0, 1.0, PIECES * parts + 1)
    degree = spans.degree
    identity = np.broadcast_to(np.eye(degree + 1)[:, :, None], (degree + 1, degree + 1, PIECES * parts))
    pieces = restrict(identity, edges[:-1], edges[1:])
    if spans.point_weights is None:
        weights = np.einsum("jip,sik->spjk", pieces, spans.matrices)
    else:
        shares = np.einsum("jip,si->spji", pieces, spans.point_weights)
        shares /= shares.sum(axis=3, keepdims=True)
        weights = np.einsum("spji,sik->spjk", shares, spans.matrices)
    result: Array = weights.reshape(-1, degree + 1, weights.shape[3])
    return result


def piece_bounds(
    weights: Array, lower: NDArray[Any], upper: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Bounds (3, P, B) of P pieces of projectors whose control points lie in boxes (K, 3, B).

    weights: of the pieces (``piece_weights``). The control points of a piece enclose it,
    and are weighted sums of the projector's. Reckoned in the precision of the boxes; the
    caller makes them wider by its rounding.
    """
    rounded = weights.astype(lower.dtype, copy=False)
    positive, negative = np.maximum(rounded, 0.0), np.minimum(rounded, 0.0)
    if not negative.any():
        # Pieces of Bézier and B-spline projectors, nearly all.
        shape = len(weights), weights.shape[1], 3, -1
        low, high = ((positive.reshape(-1, len(b)) @ b.reshape(len(b), -1)) for b in (lower, upper))
        return low.reshape(shape).min(axis=1).swapaxes(0, 1), high.reshape(shape).max(axis=1).swapaxes(0, 1)
    low, high = np.empty((2, 3, len(weights), lower.shape[2]), lower.dtype)
    for axis in range(3):
        least, most = lower[:, axis], upper[:, axis]
        low[axis] = (positive @ least + negative @ most).min(axis=1)
        high[axis] = (positive @ most + negative @ least).max(axis=1)
    return low, high
