# SPDX-License-Identifier: GPL-3.0-or-later
"""Polylines as segments for drawing: (S, 2, 3) float32, as the GPU reads them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from .typing import Array, BoolArray, IndexArray
from .volume import Projection

Segments: TypeAlias = NDArray[np.float32]


def segments(lines: Array, valid: BoolArray, tile: IndexArray | None = None) -> Segments:
    """Segments of L polylines of K points each. lines: (3, L, K); valid, tile: (L, K).

    Those of no length and those that touch a point that is not valid are left out.
    Where the tile changes the polyline is broken: tiles need not meet.
    """
    points = np.moveaxis(lines, 0, -1).astype(np.float32)
    pairs = np.stack([points[:, :-1], points[:, 1:]], axis=2)
    kept = valid[:, :-1] & valid[:, 1:] & (pairs[:, :, 0] != pairs[:, :, 1]).any(axis=2)
    if tile is not None:
        kept &= tile[:, :-1] == tile[:, 1:]
    found: Segments = np.ascontiguousarray(pairs[kept])
    return found


def joined(parts: Sequence[Segments]) -> Segments:
    """All segments of the parts; no parts make none."""
    return np.concatenate(parts) if parts else np.zeros((0, 2, 3), np.float32)


def ranged(projection: Projection, x: Array, y: Array) -> tuple[Array, Array]:
    """(u, v) at shares x, y of the projection's u and v ranges."""
    (u0, u1), (v0, v1) = projection.u_range, projection.v_range
    return u0 + x * (u1 - u0), v0 + y * (v1 - v0)
