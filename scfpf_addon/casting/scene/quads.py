# SPDX-License-Identifier: GPL-3.0-or-later
"""Pairs of triangles as quads in Embree, whose tree is then built in half the time and takes less memory.

A face of four corners (a, b, c, d) comes as two consecutive triangles, (a, b, c) and (a, c, d), in
mirrored copies as (a, c, b) and (a, d, c). Embree cuts a quad along the same diagonal, so rays meet
the same triangles, also where the corners are not in one plane.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import BoolArray, IndexArray
from .neighbours import alternate

# If less than this share of the triangles are in pairs, none become quads: a single one costs more as a quad.
FEWEST = 0.5


@dataclass(frozen=True)
class Quads:
    """Pairs of triangles and single triangles as faces of Embree.

    faces: (F, 4) int32 vertices (b, c, d, a), or (b, c, a, a) for a single triangle. numbers: (2 F + 2,)
    int32, the triangles (a, b, c) and (a, c, d) of each face, the same one twice for a single triangle; -1
    twice at the end, where the face -1, a miss, leads to.
    """

    faces: NDArray[np.int32]
    numbers: NDArray[np.int32]

    @classmethod
    def of(cls, triangles: NDArray[np.int32], usable: BoolArray) -> Self | None:
        """Return the faces of the ``usable`` (T,) triangles (T, 3), or None if few are in pairs."""
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

        found: embreex's output for N rays. each: see ``EmbreeMesh.faces_each``.
        """
        index: IndexArray = found["primID"]
        if each == 1:
            # embreex's output is not used again.
            index *= 2
            index += found["u"] + found["v"] > 1
        return self.numbers.take(index)


def _pairs(triangles: NDArray[np.int32], usable: BoolArray) -> tuple[IndexArray, BoolArray]:
    """Triangles that make a quad with the next one, (P,), and whether that one is (a, b, c), (P,)."""
    one, other = triangles[:-1], triangles[1:]
    common = np.flatnonzero((one[:, 0] == other[:, 0]) & usable[:-1] & usable[1:])
    one, other = one.take(common, axis=0), other.take(common, axis=0)
    turned = one[:, 1] == other[:, 2]
    joined = np.flatnonzero(turned | (one[:, 2] == other[:, 1]))
    lead, turned = common.take(joined), turned.take(joined)
    # Of more triangles around one corner the first and second make a quad, the third and fourth and so on.
    chosen = alternate(lead)
    return lead[chosen], turned[chosen]
