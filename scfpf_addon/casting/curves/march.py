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
        return Records(self.projector.take(index), self.chord.take(index), self.triangle.take(index))


# The triangles that rays meet (N,), -1 for none, and where on the rays, or None if that is not needed.
Traced = tuple[NDArray[np.int32], NDArray[Any] | None]
Trace = Callable[[NDArray[Any], NDArray[Any], NDArray[np.float32]], Traced]


def march(
    source: NDArray[Any], ends: Array, held: BoolArray, members: IndexArray, mask: BoolArray, trace: Trace
) -> tuple[Records, NDArray[np.float64], int]:
    """The first chord of each projector that meets something, where on it, and how many rays that took.

    source: (K, 3, N) control points, in the precision to reckon in. ends: (n+1, K) weights of
    chords' ends. held: (n, B) whether a block may meet something on a chord; others are not cast.
    members: (B, S) the projectors of each block, -1 where there are fewer: what is taken of them
    at a chord are whole blocks, in one piece of memory each, with rays near each other. mask:
    (N,). trace: start (3, M), way (3, M), limits (M,), negative where no ray is to be cast.
    The records come block by block. Where on the chords: 0 if trace does not tell.
    """
    size = members.shape[1]
    controls = source.take(members.ravel(), 2)
    # Of each ray, negative where none is cast.
    limits = np.full(members.shape, 1.0 + OVERLAP, np.float32)
    if not mask.all():
        limits[~mask.take(members)] = -1.0
    limits[members < 0] = -1.0
    weights = ends.astype(source.dtype)
    ways = np.diff(ends, axis=0).astype(source.dtype)
    triangle = np.full(members.shape, -1, np.int32)
    chords = np.zeros(members.shape, np.int32)
    shares = np.zeros(members.shape)
    # How many rays of a block are still to be cast.
    left = (limits > 0.0).sum(axis=1)
    cast = 0
    for chord in range(len(ways)):
        blocks = np.flatnonzero(held[chord] & (left > 0))
        count = int(left.take(blocks).sum())
        if count == 0:
            continue
        cast += count
        whole = len(blocks) == len(members)
        now = limits if whole else limits.take(blocks, 0)
        sparse = count < (1.0 - MOST_DEAD) * now.size
        if sparse:
            rays = np.flatnonzero(now.ravel() > 0.0)
            some = controls.take(blocks.take(rays // size) * size + rays % size, 2)
        elif whole:
            some = controls
        else:
            some = controls.reshape(*source.shape[:2], *members.shape).take(blocks, 2)
            some = some.reshape(*source.shape[:2], -1)
        start = np.einsum("k,kcn->cn", weights[chord], some)
        way = np.einsum("k,kcn->cn", ways[chord], some)
        found, where = trace(start, way, now.ravel().take(rays) if sparse else now.ravel())
        if sparse:
            met = np.flatnonzero(found >= 0)
            slot = rays.take(met)
            slot = blocks.take(slot // size) * size + slot % size
            triangle.ravel()[slot], chords.ravel()[slot] = found.take(met), chord
            limits.ravel()[slot] = -1.0
            if where is not None:
                shares.ravel()[slot] = where.take(met)
            left -= np.bincount(slot // size, minlength=len(left))
            continue
        found = found.reshape(now.shape)
        hit = found >= 0
        left[blocks] -= hit.sum(axis=1)
        # Whole blocks are written back: what has been met before is kept.
        before = triangle.take(blocks, 0)
        triangle[blocks] = np.maximum(before, found, out=before)
        number = chords.take(blocks, 0)
        np.putmask(number, hit, chord)
        chords[blocks] = number
        np.putmask(now, hit, -1.0)
        limits[blocks] = now
        if where is not None:
            share = shares.take(blocks, 0)
            np.copyto(share, where.reshape(now.shape), where=hit)
            shares[blocks] = share
    slot = np.flatnonzero(triangle >= 0)
    chord_of = chords.ravel().take(slot).astype(np.intp)
    records = Records(members.ravel().take(slot), chord_of, triangle.ravel().take(slot))
    return records, shares.ravel().take(slot), cast
