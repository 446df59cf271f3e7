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


class _Wave:
    """The state of the projectors of B blocks of at most S, while a tile's chords are cast in turn.

    source: (K, 3, N) control points. members: (B, S), see ``march``. limits: (B, S) float32, of each ray,
    negative if none is to be cast. left: (B,) rays of a block still to be cast. triangle, chord, share:
    (B, S) the first hits so far, triangle -1 for none.
    """

    def __init__(self, source: NDArray[Any], members: IndexArray, mask: BoolArray) -> None:
        self.members = members
        self.controls = source.take(members.ravel(), 2)
        self.limits = np.full(members.shape, 1.0 + OVERLAP, np.float32)
        if not mask.all():
            self.limits[~mask.take(members)] = -1.0
        self.limits[members < 0] = -1.0
        self.left = (self.limits > 0.0).sum(axis=1)
        self.triangle = np.full(members.shape, -1, np.int32)
        self.chord = np.zeros(members.shape, np.int32)
        self.share = np.zeros(members.shape)

    def step(self, number: int, blocks: IndexArray, ends: Array, way: Array, trace: Trace) -> None:
        """Cast chord ``number`` of the rays left in ``blocks``; ends, way: (K,) weights of start and way."""
        size, whole = self.members.shape[1], len(blocks) == len(self.members)
        now = self.limits if whole else self.limits.take(blocks, 0)
        if int(self.left.take(blocks).sum()) < (1.0 - MOST_DEAD) * now.size:
            rays = np.flatnonzero(now.ravel() > 0.0)
            slot = blocks.take(rays // size) * size + rays % size
            some = self.controls.take(slot, 2)
            self._keep_single(slot, number, _traced(some, ends, way, now.ravel().take(rays), trace))
            return
        some = self.controls
        if not whole:
            shape = self.controls.shape[:2]
            some = some.reshape(*shape, *self.members.shape).take(blocks, 2).reshape(*shape, -1)
        self._keep_blocks(blocks, now, number, _traced(some, ends, way, now.ravel(), trace))

    def _keep_single(self, slot: IndexArray, number: int, traced: Traced) -> None:
        """Keep what single rays have met."""
        found, where = traced
        met = np.flatnonzero(found >= 0)
        slot = slot.take(met)
        self.triangle.ravel()[slot], self.chord.ravel()[slot] = found.take(met), number
        self.limits.ravel()[slot] = -1.0
        if where is not None:
            self.share.ravel()[slot] = where.take(met)
        self.left -= np.bincount(slot // self.members.shape[1], minlength=len(self.left))

    def _keep_blocks(self, blocks: IndexArray, now: NDArray[Any], number: int, traced: Traced) -> None:
        """Keep what whole blocks of rays, some switched off, have met; now: their limits."""
        found, where = traced
        found = found.reshape(now.shape)
        hit = found >= 0
        self.left[blocks] -= hit.sum(axis=1)
        # Whole blocks are written back with their earlier hits.
        before = self.triangle.take(blocks, 0)
        self.triangle[blocks] = np.maximum(before, found, out=before)
        chord = self.chord.take(blocks, 0)
        np.putmask(chord, hit, number)
        self.chord[blocks] = chord
        np.putmask(now, hit, -1.0)
        self.limits[blocks] = now
        if where is not None:
            share = self.share.take(blocks, 0)
            np.copyto(share, where.reshape(now.shape), where=hit)
            self.share[blocks] = share

    def records(self) -> tuple[Records, NDArray[np.float64]]:
        """The first hits, block by block, and where on the chords."""
        slot = np.flatnonzero(self.triangle >= 0)
        chord = self.chord.ravel().take(slot).astype(np.intp)
        found = Records(self.members.ravel().take(slot), chord, self.triangle.ravel().take(slot))
        return found, self.share.ravel().take(slot)


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
    wave = _Wave(source, members, mask)
    weights = ends.astype(source.dtype)
    ways = np.diff(ends, axis=0).astype(source.dtype)
    cast = 0
    for chord in range(len(ways)):
        blocks = np.flatnonzero(held[chord] & (wave.left > 0))
        if len(blocks):
            cast += int(wave.left.take(blocks).sum())
            wave.step(chord, blocks, weights[chord], ways[chord], trace)
    return *wave.records(), cast


def _traced(
    controls: NDArray[Any], ends: Array, way: Array, limits: NDArray[np.float32], trace: Trace
) -> Traced:
    """Trace one chord of projectors (K, 3, M); ends, way: (K,) weights of its start and its way."""
    return trace(np.einsum("k,kcn->cn", ends, controls), np.einsum("k,kcn->cn", way, controls), limits)
