# SPDX-License-Identifier: GPL-3.0-or-later
"""The results of casting: hits, counts and errors."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.arrays import put_columns
from ...projection.typing import Array, BoolArray, IndexArray
from ...projection.user_error import UserError


class CastError(UserError):
    """Casting is impossible; the message says what to do."""


class NothingToCastAt(CastError):
    """The scene has no triangle that a ray could hit."""


class Hits(NamedTuple):
    """The first hit of N projectors, in cast space.

    t: (N,) float64 in [0, 1], inf on a miss. triangle: (N,) int32, -1 on a miss.
    barycentric: (2, N) float64, weights of the triangle's second and third corner,
    0 on a miss. position: (3, N) float64, the point Q(t). tangent: (3, N) float64,
    dQ/dt there, not normalised. On a miss position and tangent are those of t = 1,
    where the projector leaves the volume.
    mask: (N,) bool, False where there is no projector: outside the image map, in a
    hole of a surface, or not finite. There position and tangent are 0.
    """

    t: Array
    triangle: NDArray[np.int32]
    barycentric: Array
    position: Array
    tangent: Array
    mask: BoolArray

    @classmethod
    def empty(cls, count: int) -> Hits:
        """Hits of ``count`` projectors that meet nothing, to be filled in."""
        return cls(
            t=np.full(count, np.inf),
            triangle=np.full(count, -1, np.int32),
            barycentric=np.zeros((2, count)),
            position=np.zeros((3, count)),
            tangent=np.zeros((3, count)),
            mask=np.zeros(count, bool),
        )

    @classmethod
    def joined(cls, parts: Sequence[Hits]) -> Hits:
        """The hits of all parts, in order."""
        return cls._make(np.concatenate(fields, axis=-1) for fields in zip(*parts, strict=True))

    def take(self, index: IndexArray) -> Hits:
        """Copy the hits at ``index``."""
        return Hits._make(field.take(index, -1) for field in self)

    def put(self, where: slice | IndexArray, part: Hits) -> None:
        """Store ``part`` at ``where``."""
        self.t[where], self.triangle[where], self.mask[where] = part.t, part.triangle, part.mask
        put_columns(self.barycentric, where, part.barycentric)
        put_columns(self.position, where, part.position)
        put_columns(self.tangent, where, part.tangent)


@dataclass
class CastCounts:
    """Counts of the work of a cast; ``add`` sums them over tiles.

    projectors: projectors cast. rays: rays traced for them. chords: rays of the first march
    (1 per projector of a straight volume). on_neighbours: hits solved on a neighbour of the triangle that a
    chord hit. refined: projectors followed again by finer chords, because their curve misses
    the triangle that a chord hit. tested: curves intersected with triangles in exact casting.
    unresolved: hits that keep the answer of the finest chord; in exact casting, steps of
    traversals that were cut short. error_bound: the largest distance between curve and chords
    on the sampled projectors, in pixels; ``add`` keeps the larger.
    """

    projectors: int = 0
    rays: int = 0
    chords: int = 0
    on_neighbours: int = 0
    refined: int = 0
    tested: int = 0
    unresolved: int = 0
    error_bound: float = 0.0

    def add(self, other: CastCounts) -> None:
        """Add another cast's counts to these."""
        for field in fields(self):
            mine, its = getattr(self, field.name), getattr(other, field.name)
            larger = field.name == "error_bound"
            setattr(self, field.name, max(mine, its) if larger else mine + its)
