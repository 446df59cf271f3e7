# SPDX-License-Identifier: GPL-3.0-or-later
"""Polylines as segments for drawing: (S, 2, 3) float32, as the GPU reads them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..typing import Array, BoolArray, IndexArray
from ..volume.viewing_volume import Projection

Segments: TypeAlias = NDArray[np.float32]


def segments(lines: Array, valid: BoolArray, tile: IndexArray | None = None) -> Segments:
    """Segments of L polylines of K points each. lines: (3, L, K); valid, tile: (L, K).

    Segments of length 0 and those that touch an invalid point are left out.
    Where the tile changes the polyline is broken: tiles need not meet.
    """
    x, y, z = components = lines.astype(np.float32)
    kept = valid[:, :-1] & valid[:, 1:]
    kept &= (x[:, :-1] != x[:, 1:]) | (y[:, :-1] != y[:, 1:]) | (z[:, :-1] != z[:, 1:])
    if tile is not None:
        kept &= tile[:, :-1] == tile[:, 1:]
    pairs = np.empty((*kept.shape, 2, 3), np.float32)
    for target, component in zip(np.moveaxis(pairs, -1, 0), components, strict=True):
        target[..., 0], target[..., 1] = component[:, :-1], component[:, 1:]
    found: Segments = pairs.reshape(-1, 2, 3) if kept.all() else pairs[kept]
    return found


def joined(parts: Sequence[Segments]) -> Segments:
    """The segments of all parts, perhaps of no part."""
    return np.concatenate(parts) if parts else np.zeros((0, 2, 3), np.float32)


def image_rim(resolution: int) -> tuple[Array, Array]:
    """x and y, (4 · resolution + 1,) each, once round the image's border from its lower left corner."""
    step = np.arange(resolution) / resolution
    one, nought = np.ones(resolution), np.zeros(resolution)
    x = np.concatenate([step, one, 1 - step, nought, [0.0]])
    return x, np.concatenate([nought, step, one, 1 - step, [0.0]])


def ranged(projection: Projection, x: Array, y: Array) -> tuple[Array, Array]:
    """(u, v) at shares x, y of the projection's u and v ranges."""
    (u0, u1), (v0, v1) = projection.u_range, projection.v_range
    return u0 + x * (u1 - u0), v0 + y * (v1 - v0)
