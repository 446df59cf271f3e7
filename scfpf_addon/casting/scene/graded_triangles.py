# SPDX-License-Identifier: GPL-3.0-or-later
"""Large triangles cut into pieces that are small near the origin, for Embree.

Embree's error grows with the corners' distance from the ray's origin: a slanted ground of 1,000 km is off by
0.1 m, and so is its edge. Pieces no longer than their distance from the origin, or than the core, have the
error of things of their size. Whether an edge is cut depends on the edge alone, so that neighbours are cut
alike and no ray passes between pieces.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, IndexArray
from ..common.geometry import renumbered
from ..common.parallel import chunks, parallel_map
from .traced_mesh import TracedMesh

# A plane through the core makes 30 pieces each time the distance doubles.
MOST_PIECES = 1 << 20


def graded_mesh(
    vertices: NDArray[np.floating], triangles: NDArray[np.int32], usable: BoolArray, core: float
) -> TracedMesh:
    """Build the usable (T,) triangles in Embree, the large ones in pieces.

    vertices: (3, V) cast space. triangles: (T, 3). core: see ``CastSpace``. Hits name the whole triangles.
    """
    large = _large(vertices, triangles, usable, core)
    if not len(large):
        return TracedMesh(vertices, triangles, usable)
    kept = usable.copy()
    kept[large] = False
    corners = vertices.take(triangles[large].T, 1).swapaxes(0, 1).astype(np.float64)
    pieces, owner = graded(corners, core)
    return mesh_with_pieces(vertices, triangles, np.flatnonzero(kept), pieces, large[owner])


def mesh_with_pieces(
    vertices: NDArray[np.floating],
    triangles: NDArray[np.int32],
    whole: IndexArray,
    pieces: Array,
    owner: IndexArray,
) -> TracedMesh:
    """Build triangles ``whole`` (n,) and pieces (3 corners, 3, M) of others in Embree.

    owner: (M,) the triangle of each piece, by which hits name it.
    """
    used, faces = renumbered(triangles[whole], vertices.shape[1])
    more = np.arange(3 * pieces.shape[2], dtype=np.int32).reshape(-1, 3) + np.int32(len(used))
    return TracedMesh(
        np.concatenate([vertices[:, used], pieces.transpose(1, 2, 0).reshape(3, -1)], axis=1),
        np.concatenate([faces, more]),
        np.ones(len(faces) + len(more), bool),
        np.concatenate([whole, owner]),
    )


def graded(corners: Array, core: float) -> tuple[Array, IndexArray]:
    """The pieces of triangles (3 corners, 3, N), (3, 3, M), and of which triangle each is, (M,).

    Beyond MOST_PIECES they stay larger.
    """
    owner = np.arange(corners.shape[2])
    pieces, owners = [corners[:, :, :0]], [owner[:0]]
    done = 0
    while corners.shape[2]:
        long = _long_edges(corners, core)
        count = long.sum(axis=0)
        if done + (count + 1).sum() > MOST_PIECES:
            count[:] = 0
        pieces.append(corners[:, :, count == 0])
        owners.append(owner[count == 0])
        done += len(owners[-1])
        cut = [_cut(corners, np.flatnonzero(count == number), long, number) for number in (1, 2, 3)]
        corners = np.concatenate([part for part, _ in cut], axis=2)
        owner = owner[np.concatenate([which for _, which in cut])]
    return np.concatenate(pieces, axis=2), np.concatenate(owners)


def has_long_edges(corners: NDArray[np.floating], core: float) -> BoolArray:
    """Return whether ``graded`` cuts each of triangles (3 corners, 3, N), (N,)."""
    if not core < np.inf:
        return np.zeros(corners.shape[2], bool)
    has: BoolArray = _long_edges(corners, core).any(axis=0)
    return has


def _large(
    vertices: NDArray[np.floating], triangles: NDArray[np.int32], usable: BoolArray, core: float
) -> IndexArray:
    """The usable triangles that are to be cut."""
    if not core < np.inf:
        return np.empty(0, np.intp)
    large: BoolArray = np.zeros(len(triangles), bool)

    def find(some: slice) -> None:
        """Mark those of a chunk."""
        corners = vertices.take(triangles[some].T, 1).swapaxes(0, 1)
        large[some] = has_long_edges(corners, core)

    parallel_map(find, chunks(len(triangles)))
    return np.flatnonzero(large & usable)


def _long_edges(corners: NDArray[np.floating], core: float) -> BoolArray:
    """Return whether the edge from each corner to the next is to be cut, (3, N).

    The same for both directions of an edge, to the last bit.
    """
    following = corners[[1, 2, 0]]
    length = ((corners - following) ** 2).sum(axis=1)
    away = ((corners + following) ** 2).sum(axis=1)
    long: BoolArray = length > np.maximum(0.25 * away, core * core)
    return long


def _cut(corners: Array, which: IndexArray, long: BoolArray, count: int) -> tuple[Array, IndexArray]:
    """The pieces of triangles ``which`` (n,), cut at the middles of ``count`` edges, and their triangles.

    long: (3, N), see ``_long_edges``.
    """
    edges = long[:, which]
    # Turned so that the first edge is cut, or only the last is not.
    first = edges.argmax(axis=0) if count == 1 else (edges.argmin(axis=0) + 1) % 3
    a, b, c = (corners[(first + k) % 3, :, which].T for k in range(3))
    ab, bc, ca = 0.5 * a + 0.5 * b, 0.5 * b + 0.5 * c, 0.5 * c + 0.5 * a
    pieces = {
        1: ((a, ab, c), (ab, b, c)),
        2: ((ab, b, bc), (a, ab, bc), (a, bc, c)),
        3: ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca)),
    }[count]
    return np.concatenate([np.stack(piece) for piece in pieces], axis=2), np.tile(which, len(pieces))
