# SPDX-License-Identifier: GPL-3.0-or-later
"""The wavefront that casts the chords of a tile: all its projectors take the same steps in t."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, IndexArray

# Chords overlap by this share of their length, so that no hit falls between two.
OVERLAP = 1e-5

# Rays that have hit stay in their block's batch, switched off, until they are more than
# this share of it: picking out single ones costs as much as casting some for nothing.
MOST_DEAD = 0.5


class Records(NamedTuple):
    """Hits of chords before the curves are solved: projector, chord and triangle, each (M,)."""

    projector: NDArray[np.intp]
    chord: NDArray[np.intp]
    triangle: NDArray[np.int32]

    def take(self, index: IndexArray) -> Records:
        """The records at ``index``."""
        return Records._make(field.take(index) for field in self)


# The triangles that rays meet (N,), -1 for none, and where on the rays, or None if that is not needed.
Traced = tuple[NDArray[np.int32], NDArray[Any] | None]
Trace = Callable[[NDArray[Any], NDArray[Any], NDArray[np.float32]], Traced]


def march(
    source: NDArray[Any], ends: Array, held: BoolArray, members: IndexArray, mask: BoolArray, trace: Trace
) -> tuple[Records, NDArray[np.float64], int]:
    """The first chord of each projector that hits something, where on it, and the number of rays cast.

    source: (K, 3, N) control points, in the precision to compute in. ends: (n+1, K) weights of the
    chords' ends. held: (n, B) whether a block may meet something on a chord; others are not cast.
    members: (B, S) the projectors of each block, -1 where there are fewer. Whole blocks are cast, whose
    data are contiguous and whose rays are near each other. mask: (N,). trace: called with start (3, M),
    way (3, M) and limits (M,), negative for rays that are switched off.
    The records come block by block. Where on the chords: 0 if trace does not tell.
    """
    size = members.shape[1]
    controls = source.take(members.ravel(), 2)
    # Of each ray, negative if none is to be cast.
    limits = np.full(members.size, 1.0 + OVERLAP, np.float32)
    limits[(members < 0).ravel()] = -1.0
    limits[~mask.take(members.ravel())] = -1.0
    # The number of rays of a block that are still to be cast.
    left = (limits > 0.0).reshape(members.shape).sum(axis=1)
    triangle = np.full(members.size, -1, np.int32)
    chords, shares = np.zeros(members.size, np.intp), np.zeros(members.size)
    weights, ways = ends.astype(source.dtype), np.diff(ends, axis=0).astype(source.dtype)
    cast = 0
    for chord, way in enumerate(ways):
        blocks = np.flatnonzero(held[chord] & (left > 0))
        if len(blocks) == 0:
            continue
        count = int(left.take(blocks).sum())
        cast += count
        rays = (blocks[:, None] * size + np.arange(size)).ravel()
        if count < (1.0 - MOST_DEAD) * len(rays):
            rays = rays[limits.take(rays) > 0.0]
            some = controls.take(rays, 2)
        elif len(blocks) == len(members):
            some = controls
        else:
            some = controls.reshape(*source.shape[:2], *members.shape).take(blocks, 2)
            some = some.reshape(*source.shape[:2], -1)
        start = np.einsum("k,kcn->cn", weights[chord], some)
        found, where = trace(start, np.einsum("k,kcn->cn", way, some), limits.take(rays))
        met = np.flatnonzero(found >= 0)
        rays = rays.take(met)
        triangle[rays], chords[rays], limits[rays] = found.take(met), chord, -1.0
        if where is not None:
            shares[rays] = where.take(met)
        left -= np.bincount(rays // size, minlength=len(left))
    hit = np.flatnonzero(triangle >= 0)
    records = Records(members.ravel().take(hit), chords.take(hit), triangle.take(hit))
    return records, shares.take(hit), cast


def first_hits(found: NDArray[np.int32], which: IndexArray, count: int) -> IndexArray:
    """The first ray of each of ``count`` projectors that hits, as indices (m,) of the rays.

    found: (M,) triangles, -1 for none. which: (M,) the projector of each ray; rays of one projector come
    in order.
    """
    # Of several hits written to a place the last is the first of the rays.
    hit = np.flatnonzero(found >= 0)[::-1]
    first = np.full(count, -1)
    first[which[hit]] = hit
    return first[first >= 0]
