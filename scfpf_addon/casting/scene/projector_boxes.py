# SPDX-License-Identifier: GPL-3.0-or-later
"""Projectors cut into pieces along t, and boxes that certainly hold them."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, IndexArray
from ...projection.volume.basis import SpanBasis
from ...projection.volume.bezier import restrict

# Pieces of a span.
PIECES = 64

# Sets of weights that are kept, of the projections that are cast at a time.
KEPT = 16


def piece_edges(spans: SpanBasis, parts: int = 1) -> Array:
    """Where the P = S·PIECES·parts pieces begin and end in t, (P + 1,)."""
    starts = np.linspace(0.0, 1.0, PIECES * parts + 1)[:-1]
    lengths = np.diff(spans.breaks)[:, None]
    edges: Array = np.append((spans.breaks[:-1, None] + starts * lengths).ravel(), spans.breaks[-1])
    return edges


def piece_weights(spans: SpanBasis, parts: int = 1) -> Array:
    """How pieces' control points are made of the projector's, (S·PIECES·parts, degree+1, K), read-only."""
    weights = spans.point_weights
    return _kept_weights(
        spans.matrices.tobytes(), spans.matrices.shape, None if weights is None else weights.tobytes(), parts
    )


@lru_cache(maxsize=KEPT)
def _kept_weights(
    matrices: bytes, shape: tuple[int, int, int], point_weights: bytes | None, parts: int
) -> Array:
    """As piece_weights: every tile of a picture asks for the same ones."""
    edges = np.linspace(0.0, 1.0, PIECES * parts + 1)
    order = shape[1]
    made = np.frombuffer(matrices).reshape(shape)
    identity = np.broadcast_to(np.eye(order)[:, :, None], (order, order, PIECES * parts))
    pieces = restrict(identity, edges[:-1], edges[1:])
    if point_weights is None:
        weights = np.einsum("jip,sik->spjk", pieces, made)
    else:
        shares = np.einsum("jip,si->spji", pieces, np.frombuffer(point_weights).reshape(shape[:2]))
        shares /= shares.sum(axis=3, keepdims=True)
        weights = np.einsum("spji,sik->spjk", shares, made)
    result: Array = np.ascontiguousarray(weights.reshape(-1, order, shape[2]))
    result.setflags(write=False)
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


def bounds_of_each(
    weights: Array, which: IndexArray, lower: NDArray[Any], upper: NDArray[Any]
) -> tuple[NDArray[Any], NDArray[Any]]:
    """As piece_bounds, of the parts (P, parts, degree+1, K) of one piece each: (3, parts, M) both.

    which: (M,) the pieces. lower, upper: (K, 3, M).
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
