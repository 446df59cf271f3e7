# SPDX-License-Identifier: GPL-3.0-or-later
"""Long slanted triangles cut into pieces, whose boxes are less empty: wires, ropes, roofs, cables.

The pieces cover their triangle, so what meets no piece does not meet the triangle.
"""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array, BoolArray, IndexArray

# Pieces are not cut smaller than the scene's longest side over this.
PARTS = 64

# A triangle is cut if its box has this many times as many cells of that size as it passes itself.
WASTE = 8.0

# Times that a triangle is halved at most, and pieces of all.
CUTS = 14
MOST_PIECES = 1 << 20


def cut_triangles(points: Array, lower: Array, upper: Array) -> tuple[Array, IndexArray]:
    """The triangles or their pieces that may meet a box (3,), (3, 3, N), and of which triangle each is, (N,).

    points: (3 corners, 3, M). Pieces outside of the box are left out.
    """
    size = max(float((upper - lower).max()) / PARTS, np.finfo(np.float64).tiny)
    owner, pieces, owners = np.arange(points.shape[2]), [], []
    room = MOST_PIECES
    for _ in range(CUTS):
        long = np.flatnonzero(_is_wasteful(points, size))
        room -= len(long)
        if len(long) == 0 or room < 0:
            break
        short = np.ones(len(owner), bool)
        short[long] = False
        pieces.append(points[:, :, short])
        owners.append(owner[short])
        points, owner = _halves(points.take(long, axis=2)), np.tile(owner.take(long), 2)
        meets = (points.min(axis=0) <= upper[:, None]) & (points.max(axis=0) >= lower[:, None])
        near = np.flatnonzero(meets.all(axis=0))
        points, owner = points.take(near, axis=2), owner.take(near)
    return np.concatenate([*pieces, points], axis=2), np.concatenate([*owners, owner])


def _is_wasteful(points: Array, size: float) -> BoolArray:
    """Return whether the boxes of triangles (3, 3, M) are mostly empty, in cells of a size, (M,)."""
    with np.errstate(over="ignore", invalid="ignore"):
        whole = ((points.max(axis=0) - points.min(axis=0)) / size + 1.0).prod(axis=0)
        # Few are left, so that the rest is computed for these alone.
        wasteful: BoolArray = whole > WASTE
        points = points[:, :, wasteful]
        edges = (points[[1, 2, 0]] - points) / size
        length = np.sqrt((edges**2).sum(axis=1)).max(axis=0, initial=0.0)
        area = np.sqrt((np.cross(edges[0], edges[1], axis=0) ** 2).sum(axis=0))
        wasteful[wasteful] = whole[wasteful] > WASTE * (area + length + 1.0)
    return wasteful


def _halves(points: Array) -> Array:
    """Both halves of triangles (3, 3, M), cut from the middle of their longest edges, (3, 3, 2 M)."""
    edges = points[[1, 2, 0]] - points
    longest = (edges**2).sum(axis=1).argmax(axis=0)
    which = np.arange(points.shape[2])
    start, end, tip = (points[(longest + k) % 3, :, which].T for k in range(3))
    middle = 0.5 * start + 0.5 * end
    return np.concatenate([np.stack([start, middle, tip]), np.stack([middle, end, tip])], axis=2)
