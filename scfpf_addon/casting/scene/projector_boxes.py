# SPDX-License-Identifier: GPL-3.0-or-later
"""Boxes that certainly contain projectors, cut into pieces along t."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, IndexArray
from ...projection.volume.basis import SpanBasis

# Pieces of a span.
PIECES = 64

# Sets of weights in the cache: of the projections that are cast at a time.
KEPT = 16


def piece_edges(spans: SpanBasis, parts: int = 1) -> Array:
    """The edges in t of the P = S·PIECES·parts pieces, (P + 1,)."""
    starts = np.linspace(0.0, 1.0, PIECES * parts + 1)[:-1]
    lengths = np.diff(spans.breaks)[:, None]
    edges: Array = np.append((spans.breaks[:-1, None] + starts * lengths).ravel(), spans.breaks[-1])
    return edges


def piece_weights(spans: SpanBasis, parts: int = 1) -> Array:
    """Weights of the control points in those of the pieces, (S·PIECES·parts, degree+1, K), read-only."""
    weights = spans.point_weights
    return _kept_weights(
        spans.matrices.tobytes(), spans.matrices.shape, None if weights is None else weights.tobytes(), parts
    )


@lru_cache(maxsize=KEPT)
def _kept_weights(
    matrices: bytes, shape: tuple[int, int, int], point_weights: bytes | None, parts: int
) -> Array:
    """The cached ``piece_weights``: all tiles of an image need the same ones."""
    edges = np.linspace(0.0, 1.0, PIECES * parts + 1)
    weights = None if point_weights is None else np.frombuffer(point_weights).reshape(shape[:2])
    result = weights_between(edges, np.frombuffer(matrices).reshape(shape), weights)
    result.setflags(write=False)
    return result


def weights_between(edges: Array, matrices: Array, point_weights: Array | None) -> Array:
    """The weights of the P pieces between edges (P+1,) in the parameter of S spans, (S·P, degree+1, K).

    matrices, point_weights: as in ``SpanBasis``.
    """
    count, order, controls = matrices.shape
    pieces = _restrictions(order - 1, edges[:-1], edges[1:])
    if point_weights is None:
        weights = pieces @ matrices[:, None]
    else:
        shares = pieces * point_weights[:, None, None]
        shares /= shares.sum(axis=3, keepdims=True)
        weights = np.einsum("spji,sik->spjk", shares, matrices)
    result: Array = np.ascontiguousarray(weights.reshape(count * (len(edges) - 1), order, controls))
    return result


def _restrictions(degree: int, low: Array, high: Array) -> Array:
    """Weights of a Bézier curve's control points in those of its parts, from low to high (P,) in [0, 1].

    (P, degree+1, degree+1), row by row. A product of matrices takes a hundredth of de Casteljau's algorithm's
    time at degree 63.
    """
    begin, end = (low / high)[:, None], high[:, None]
    to_end, from_begin = np.zeros((2, len(low), degree + 1, degree + 1))
    # Bernstein polynomials of degrees 0 to ``degree`` at ``end``, and of the opposite degrees at ``begin``.
    to_end[:, 0, 0] = from_begin[:, degree, degree] = 1.0
    for row in range(1, degree + 1):
        to_end[:, row] = (1.0 - end) * to_end[:, row - 1]
        to_end[:, row, 1:] += end * to_end[:, row - 1, :-1]
        other = degree - row
        from_begin[:, other] = begin * from_begin[:, other + 1]
        from_begin[:, other, :-1] += (1.0 - begin) * from_begin[:, other + 1, 1:]
    return from_begin @ to_end


def piece_bounds(
    weights: Array, lower: NDArray[Any], upper: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """Bounds (3, P, B) of P pieces of projectors whose control points lie in boxes (K, 3, B).

    weights: of the pieces (``piece_weights``). The control points of a piece enclose it,
    and are weighted sums of the projector's. Computed in the precision of the boxes; the
    caller widens the bounds by its rounding.
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


def bounds_of_each(
    weights: Array, which: IndexArray, lower: NDArray[Any], upper: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """The bounds of the parts of one piece for each of M boxes, (3, parts, M) both.

    weights: (P, parts, degree+1, K). which: (M,) the pieces. lower, upper: (K, 3, M).
    """
    each = weights.astype(lower.dtype, copy=False).take(which, 0).transpose(3, 1, 2, 0)
    each = np.ascontiguousarray(each)
    positive = each if not (weights < 0.0).any() else np.maximum(each, 0.0)
    bounds = []
    for least, most, reduce in ((lower, upper, np.minimum), (upper, lower, np.maximum)):
        sums = np.einsum("kpjm,kcm->pjcm", positive, least)
        if positive is not each:
            sums += np.einsum("kpjm,kcm->pjcm", each - positive, most)
        bounds.append(reduce.reduce(sums, axis=1).swapaxes(0, 1))
    return bounds[0], bounds[1]
