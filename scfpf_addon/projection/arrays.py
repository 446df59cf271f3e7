# SPDX-License-Identifier: GPL-3.0-or-later
"""Operations on arrays that several modules share: affine maps, polynomial pieces, bilinear nets, medians."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from .typing import Array, IndexArray

# Places at which pieces are evaluated together: their coefficients fit into a processor's cache.
BLOCK = 4096
# OpenBLAS computes products of fewer multiplications in the caller's thread (its SMP_THRESHOLD_MIN times
# GEMM_MULTITHREAD_THRESHOLD), and inverts smaller triangles there.
MOST_MULTIPLICATIONS, LARGEST_TRIANGLE = 1 << 18, 64


def transform(matrix: Array, vectors: Array, offset: Array | None = None) -> Array:
    """matrix (3, 3) times vectors (3, N), plus offset (3,).

    Row by row without a matrix product: BLAS would start threads of its own
    inside each of ours. Terms that a matrix does not have cost nothing.
    """
    result = np.empty(vectors.shape)
    term = np.empty(vectors.shape[1:])
    for row, target in zip(matrix, result, strict=True):
        used = np.flatnonzero(row)
        if len(used) == 0:
            target.fill(0.0)
            continue
        np.multiply(vectors[used[0]], row[used[0]], out=target)
        for column in used[1:]:
            target += np.multiply(vectors[column], row[column], out=term)
    if offset is not None:
        result += offset[:, None]
    return result


def put_columns(target: NDArray[Any], where: slice | IndexArray, values: NDArray[Any]) -> None:
    """Store columns (K, n) at ``where`` in ``target`` (K, N).

    Row by row: NumPy takes twice as long for all rows at once. It takes four times as long to read columns
    by an index, instead of by ``take``, whose result also is contiguous.
    """
    for row, own in zip(target, values, strict=True):
        row[where] = own


def product(a: Array, b: Array) -> Array:
    """The matrix product (M, K) · (K, N), in pieces that BLAS computes in this thread.

    Where other programs keep the cores busy, BLAS waits for its own threads up to a hundred times as long as
    the product takes.
    """
    result = np.empty((len(a), b.shape[1]))
    step = max(1, MOST_MULTIPLICATIONS // max(min(a.size, b.size), 1))
    # The larger matrix is cut: fewer pieces do.
    if a.size < b.size:
        for start in range(0, b.shape[1], step):
            np.matmul(a, b[:, start : start + step], out=result[:, start : start + step])
    else:
        for start in range(0, len(a), step):
            np.matmul(a[start : start + step], b, out=result[start : start + step])
    return result


def inverse_triangle(lower: Array) -> Array:
    """The inverse of a lower triangular matrix (N, N), by halves, for the reason of ``product``."""
    half = len(lower) // 2
    if len(lower) <= LARGEST_TRIANGLE:
        return np.asarray(np.linalg.inv(lower), np.float64)
    result = np.zeros(lower.shape)
    result[:half, :half] = inverse_triangle(lower[:half, :half])
    result[half:, half:] = inverse_triangle(lower[half:, half:])
    result[half:, :half] = -product(product(result[half:, half:], lower[half:, :half]), result[:half, :half])
    return result


def evaluate_pieces(table: Array, piece: IndexArray, a: Array, b: Array, total: Array) -> None:
    """Write polynomials of a and b, (N,) each, into ``total`` (K, N).

    table: (powers of b, powers of a, K, pieces), lowest powers first. piece: (N,), the number of each
    polynomial, whose coefficients are fetched at once. Best for N up to ``BLOCK``.
    """
    # NumPy's fastest mode.
    along = table[-1].take(piece, axis=-1, mode="wrap")
    for power in table[-2::-1]:
        along *= b
        along += power.take(piece, axis=-1, mode="wrap")
    total[:] = along[-1]
    for coefficient in along[-2::-1]:
        total *= a
        total += coefficient


def bilinear_net(values: Array, parts: int) -> Array:
    """Values (..., R, C) at the lines of a net with each cell cut into parts × parts, joined bilinearly.

    Returns (..., parts · (R - 1) + 1, parts · (C - 1) + 1).
    """
    share = np.arange(parts) / parts
    for _ in range(2):
        between = values[..., :-1, None] * (1.0 - share) + values[..., 1:, None] * share
        values = np.concatenate([between.reshape(*values.shape[:-1], -1), values[..., -1:]], axis=-1)
        values = np.swapaxes(values, -1, -2)
    return values


def median(values: Array) -> Array:
    """The median of values (N, ...) along their first axis, (...), NaN where one is; N > 0.

    The first call of ``np.median`` imports masked arrays, which takes 17 ms.
    """
    low, high = (len(values) - 1) // 2, len(values) // 2
    # NaN comes last.
    ordered = np.partition(values, (low, high, -1), axis=0)
    return np.where(np.isnan(ordered[-1]), np.nan, 0.5 * (ordered[low] + ordered[high]))
