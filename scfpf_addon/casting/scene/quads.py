# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles that are halves of quads, as quads in Embree: its tree is built in half the time and takes less.

A face of four corners (a, b, c, d) comes as two triangles one after the other, (a, b, c) and (a, c, d), in
mirrored copies as (a, c, b) and (a, d, c). Embree cuts a quad along the same diagonal, so what rays meet
stays what it was, also where the corners lie in no plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import BoolArray, Float32Array, IndexArray

# Fewer of the triangles than this share in pairs, and all stay triangles: one alone costs more as a quad.
FEWEST = 0.5


@dataclass(frozen=True)
class Quads:
    """Pairs of triangles, and triangles alone, as faces of Embree.

    faces: (F, 4) int32 vertices (b, c, d, a), or (b, c, a, a) of one alone. numbers: (2 F + 2,) int32, of the
    triangles (a, b, c) and (a, c, d) of each face, the same twice of one alone; in the end -1 twice, which
    the face -1, a miss, leads to.
    """

    faces: NDArray[np.int32]
    numbers: NDArray[np.int32]

    @classmethod
    def of(cls, triangles: NDArray[np.int32], usable: BoolArray) -> Self | None:
        """The triangles (T, 3) that are ``usable`` (T,), None where few are pairs."""
        lead, turned = _pairs(triangles, usable)
        if 2 * len(lead) < FEWEST * len(triangles):
            return None
        first, second = lead + turned, lead + ~turned
        usable = usable.copy()
        usable[lead] = usable[lead + 1] = False
        alone = np.flatnonzero(usable)
        numbers = np.full((len(lead) + len(alone) + 1, 2), -1, np.int32)
        numbers[: len(lead), 0], numbers[: len(lead), 1] = first, second
        numbers[len(lead) : -1] = alone[:, None]
        faces = np.empty((len(numbers) - 1, 4), np.int32)
        faces[:, [3, 0, 1]] = triangles.take(numbers[:-1, 0], axis=0)
        faces[:, 2] = faces[:, 3]
        faces[: len(lead), 2] = triangles[:, 2].take(second)
        return cls(faces, numbers.reshape(-1))

    def triangles(self, found: dict[str, Any], each: int) -> NDArray[np.int32]:
        """The triangles (N,) that rays have met, -1 for none.

        found: what embreex tells of N rays. each: as how many faces it counts a quad, see ``mesh_in_embree``.
        """
        return self.numbers.take(_halves(found, each)[0])

    def weights(
        self, found: dict[str, Any], each: int
    ) -> tuple[NDArray[np.int32], tuple[Float32Array, Float32Array]]:
        """As ``triangles``, with the weights of their second and third corners, each (N,)."""
        index, half = _halves(found, each)
        triangle, u, v = self.numbers.take(index), found["u"], found["v"]
        if each == 2:
            u, v = np.where(half, 1 - u, u), np.where(half, 1 - v, v)
        # The other half of a triangle alone, which has none: rounding.
        half = half & (self.numbers.take(index ^ 1) != triangle)
        rest = 1 - (u + v)
        return triangle, (np.where(half, 1 - v, rest), np.where(half, -rest, u))


def _pairs(triangles: NDArray[np.int32], usable: BoolArray) -> tuple[IndexArray, BoolArray]:
    """Triangles that make a quad with the next one, (P,), and where that one is (a, b, c), (P,)."""
    one, other = triangles[:-1], triangles[1:]
    common = np.flatnonzero((one[:, 0] == other[:, 0]) & usable[:-1] & usable[1:])
    one, other = one.take(common, axis=0), other.take(common, axis=0)
    turned = one[:, 1] == other[:, 2]
    joined = np.flatnonzero(turned | (one[:, 2] == other[:, 1]))
    lead, turned = common.take(joined), turned.take(joined)
    goes_on = np.diff(lead, prepend=-2) == 1
    if goes_on.any():
        # Of more that go round one corner the first and second make a quad, the third and fourth and so on.
        place = np.arange(len(lead))
        start = np.maximum.accumulate(np.where(goes_on, 0, place))
        kept = (place - start) % 2 == 0
        lead, turned = lead[kept], turned[kept]
    return lead, turned


def _halves(found: dict[str, Any], each: int) -> tuple[IndexArray, BoolArray]:
    """Where in ``Quads.numbers`` the triangles stand that rays have met, and which are second ones, (N,)."""
    index = found["primID"]
    if each == 2:
        return index, (index & 1).astype(bool)
    half: BoolArray = found["u"] + found["v"] > 1
    # embreex has made it for this answer.
    index *= 2
    index += half
    return index, half
