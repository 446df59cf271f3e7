# SPDX-License-Identifier: GPL-3.0-or-later
"""Sheets made of polynomial pieces, evaluated at many places."""

from __future__ import annotations

from ..typing import Array, IndexArray

# Parameters taken at once: what acts on so many fits into a processor's cache.
BLOCK = 4096


def evaluate_pieces(table: Array, piece: IndexArray, a: Array, b: Array, total: Array) -> None:
    """Polynomials of a and b, (N,) each, into ``total`` (K, N).

    table: (powers of b, powers of a, K, pieces), lowest powers first. piece: (N,), which one; its
    coefficients are fetched at once. Best for N up to ``BLOCK``.
    """
    along = table[-1].take(piece, axis=-1)
    for power in table[-2::-1]:
        along *= b
        along += power.take(piece, axis=-1)
    total[:] = along[-1]
    for coefficient in along[-2::-1]:
        total *= a
        total += coefficient
