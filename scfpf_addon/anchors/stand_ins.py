# SPDX-License-Identifier: GPL-3.0-or-later
"""Faces that stand for strokes, hair and points, by which plans know where these are and what they hide.

They are never cast at for a picture: the engine draws the things themselves.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..projection.typing import Array, IndexArray

# The corners of a tube's cross section, around a circle with radius 1: nothing that is drawn reaches out.
SQUARE = np.array([(1, 1), (-1, 1), (-1, -1), (1, -1)], np.float64)
# An octahedron around a sphere reaches so many radii.
OUTER = 3.0**0.5
# Triangles of an octahedron whose corners are ±x, ±y, ±z.
OCTAHEDRON = np.array(
    [(0, 2, 4), (2, 1, 4), (1, 3, 4), (3, 0, 4), (2, 0, 5), (1, 2, 5), (3, 1, 5), (0, 3, 5)], np.int32
)


NO_BOXES = np.empty((0, 8, 3))


class StandIns(NamedTuple):
    """Faces: vertices (V, 3) in world space, triangles (T, 3) int32.

    whole: (K, 8, 3), corners of boxes around things of which an engine knows no depth where a camera's near
    plane cuts their boxes.
    """

    vertices: Array
    triangles: NDArray[np.int32]
    whole: Array = NO_BOXES

    @classmethod
    def joined(cls, parts: list[StandIns]) -> StandIns | None:
        """All parts as one; None if they have no triangle."""
        parts = [part for part in parts if len(part.triangles)]
        if not parts:
            return None
        starts = np.cumsum([0, *(len(part.vertices) for part in parts)])
        triangles = [part.triangles + np.int32(start) for part, start in zip(parts, starts, strict=False)]
        vertices, whole = (np.concatenate([part[k] for part in parts]) for k in (0, 2))
        return cls(vertices, np.concatenate(triangles), whole)


def tubes(points: Array, counts: IndexArray, radius: Array) -> StandIns:
    """Tubes with four sides around polylines. points: (N, 3). counts: (L,) of each. radius: (N,)."""
    begins = np.flatnonzero(~_is_last(points, counts))
    if not len(begins):
        return StandIns(np.empty((0, 3)), np.empty((0, 3), np.int32))
    way = points[begins + 1] - points[begins]
    side = np.cross(way, np.eye(3)[np.abs(way).argmin(axis=1)])
    side /= np.maximum(np.linalg.norm(side, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    up = np.cross(way, side)
    up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), np.finfo(np.float64).tiny)
    ring = np.einsum("ka,anc->nkc", SQUARE, np.stack([side, up]))
    ends = [points[at][:, None] + radius[at][:, None, None] * ring for at in (begins, begins + 1)]
    vertices = np.concatenate(ends, axis=1).reshape(-1, 3)
    corner = np.arange(4, dtype=np.int32)
    beside = (corner + 1) % 4
    halves = [
        np.stack([corner, beside, beside + 4], axis=1),
        np.stack([corner, beside + 4, corner + 4], axis=1),
    ]
    triangles = np.concatenate(halves) + 8 * np.arange(len(begins), dtype=np.int32)[:, None, None]
    return StandIns(vertices, triangles.reshape(-1, 3))


def fans(points: Array, counts: IndexArray) -> StandIns:
    """The insides of polygons as fans: roughly, for hollows are filled too. See ``tubes``."""
    last = _is_last(points, counts)
    first = np.repeat(np.cumsum(counts) - counts, counts)
    which = np.flatnonzero(~last & (np.arange(len(points)) > first))
    triangles = np.stack([first[which], which, which + 1], axis=1).astype(np.int32)
    return StandIns(points, triangles)


def octahedra(points: Array, radius: Array) -> StandIns:
    """Octahedra around spheres with radii (N,) at points (N, 3)."""
    axes = np.concatenate([np.eye(3), -np.eye(3)])[[0, 3, 1, 4, 2, 5]]
    vertices = points[:, None] + OUTER * radius[:, None, None] * axes
    triangles = OCTAHEDRON + 6 * np.arange(len(points), dtype=np.int32)[:, None, None]
    return StandIns(vertices.reshape(-1, 3), triangles.reshape(-1, 3))


def _is_last(points: Array, counts: IndexArray) -> NDArray[np.bool_]:
    """Return which points (N, 3) end a line, (N,)."""
    last = np.zeros(len(points), bool)
    last[np.cumsum(counts[counts > 0]) - 1] = True
    return last
