# SPDX-License-Identifier: GPL-3.0-or-later
"""The wave that casts the chords of a tile: all its projectors take the same steps in t."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..projection.typing import Array, BoolArray, IndexArray
from .records import Records

# Chords overlap by this share of their length, so that no hit falls between two.
OVERLAP = 1e-5

# Rays that have hit stay in their block's batch, switched off, until they are more than
# this share of it: picking out single ones costs as much as casting some for nothing.
MOST_DEAD = 0.5

# What rays have met: triangles (N,), -1 for none, and where, if that is asked for.
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
    searching = mask[members] & (members >= 0)
    # Of each ray, negative where none is cast, and how many of a block are.
    limits = np.where(searching, np.float32(1.0 + OVERLAP), np.float32(-1.0))
    left = searching.sum(axis=1)
    weights = ends.astype(source.dtype)
    ways = np.diff(ends, axis=0).astype(source.dtype)
    triangle = np.full(members.size, -1, np.int32)
    chords = np.zeros(members.size, np.intp)
    shares = np.zeros(members.size)
    cast = 0
    for chord in range(len(ways)):
        blocks = np.flatnonzero(held[chord] & (left > 0))
        count = int(left[blocks].sum())
        if count == 0:
            continue
        cast += count
        now = limits.take(blocks, 0).ravel()
        sparse = count < (1.0 - MOST_DEAD) * len(now)
        if sparse:
            rays = np.flatnonzero(now > 0.0)
            slots = blocks[rays // size] * size + rays % size
            some, now = controls.take(slots, 2), now.take(rays)
        elif len(blocks) < len(members):
            some = controls.reshape(*source.shape[:2], *members.shape).take(blocks, 2)
            some = some.reshape(*source.shape[:2], -1)
        else:
            some = controls
        start = np.einsum("k,kcn->cn", weights[chord], some)
        way = np.einsum("k,kcn->cn", ways[chord], some)
        found, where = trace(start, way, now)
        hit = np.flatnonzero(found >= 0)
        if len(hit) == 0:
            continue
        slot = slots[hit] if sparse else blocks[hit // size] * size + hit % size
        triangle[slot], chords[slot] = found[hit], chord
        if where is not None:
            shares[slot] = where[hit]
        limits.ravel()[slot] = -1.0
        left -= np.bincount(slot // size, minlength=len(left))
    slot = np.flatnonzero(triangle >= 0)
    return Records(members.ravel()[slot], chords[slot], triangle[slot]), shares[slot], cast
