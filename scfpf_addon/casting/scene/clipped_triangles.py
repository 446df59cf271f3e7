# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles clipped to a box: what is beyond it cannot be hit, and need not be passed."""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array, IndexArray
from .cast_triangles import CastTriangles
from .graded_triangles import graded, has_long_edges, mesh_with_pieces
from .traced_mesh import TracedMesh


def enclosed_mesh(
    scene: CastTriangles, which: IndexArray, lower: Array, upper: Array
) -> tuple[TracedMesh, Array]:
    """Build triangles ``which`` (n,) of a scene in Embree, cut at a box where they are not inside.

    lower, upper: (3,), cast space. Also returns the corners of what is built, (3 corners, 3, M). Hits name
    triangles by their numbers in the scene.
    """
    corners = scene.corners_at(which)
    whole = ((corners >= lower[:, None]) & (corners <= upper[:, None])).all(axis=(0, 1))
    whole &= ~has_long_edges(corners, scene.core)
    pieces, owner = clipped(corners[:, :, ~whole], lower, upper)
    pieces, of_piece = graded(pieces, scene.core)
    owner = which[~whole][owner[of_piece]]
    mesh = mesh_with_pieces(scene.vertices, scene.triangles, which[whole], pieces, owner)
    return mesh, np.concatenate([corners[:, :, whole], pieces], axis=2)


def clipped(corners: Array, lower: Array, upper: Array) -> tuple[Array, IndexArray]:
    """The pieces of triangles in a box, (3 corners, 3, M), and of which triangle each is, (M,).

    corners: (3 corners, 3, N). lower, upper: (3,). Triangles inside come whole. Pieces of triangles with a
    common edge have common corners on it, so that no ray passes between them.
    """
    owner = np.arange(corners.shape[2])
    for axis in range(3):
        for bound, side in ((lower[axis], -1.0), (upper[axis], 1.0)):
            corners, which = _clipped_by(corners, axis, bound, side)
            owner = owner.take(which)
    return corners, owner


def _clipped_by(corners: Array, axis: int, bound: float, side: float) -> tuple[Array, IndexArray]:
    """The pieces at or below a bound of one coordinate, at or above it for side -1, and their triangles."""
    out = (corners[:, axis] - bound) * side > 0.0
    count = out.sum(axis=0)
    whole, one_out, two_out = (np.flatnonzero(count == number) for number in range(3))
    if len(whole) == len(count):
        return corners, whole
    # Turned so that the corner that differs from the two others comes first.
    first = _turned(corners, one_out, out[:, one_out].argmax(axis=0))
    last = _turned(corners, two_out, (~out[:, two_out]).argmax(axis=0))
    a, b, c = first
    to_b, to_c = _cut(b, a, axis, bound), _cut(c, a, axis, bound)
    d, e, f = last
    pieces = (
        corners[:, :, whole],
        np.stack([to_b, b, c]),
        np.stack([to_b, c, to_c]),
        np.stack([d, _cut(d, e, axis, bound), _cut(d, f, axis, bound)]),
    )
    return np.concatenate(pieces, axis=2), np.concatenate([whole, one_out, one_out, two_out])


def _turned(corners: Array, which: IndexArray, first: IndexArray) -> Array:
    """The corners of triangles ``which`` (M,) beginning with the number ``first`` (M,), (3, 3, M)."""
    turned: Array = np.stack([corners[(first + k) % 3, :, which].T for k in range(3)])
    return turned


def _cut(inside: Array, outside: Array, axis: int, bound: float) -> Array:
    """The points (3, M) at which edges from ``inside`` to ``outside`` (3, M) meet the bound."""
    way = outside - inside
    point: Array = inside + way * ((bound - inside[axis]) / way[axis])
    point[axis] = bound
    return point
