# SPDX-License-Identifier: GPL-3.0-or-later
"""Parts of obstacles that need not stay where the image shows them, so that pins come free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..projection.typing import Array, BoolArray, IndexArray
from .solver.vectors import dot

# Points that are compared at a time.
POINTS = 1 << 12


@dataclass(frozen=True)
class Released:
    """The parts of obstacles that may leave their places in the image.

    objects: (K,), their numbers. points: (3, N), where projectors meet them. reach: in world units.
    """

    objects: IndexArray
    points: Array
    reach: float

    def covers(self, points: Array, objects: IndexArray) -> BoolArray:
        """Return whether world points (3, M) on objects (M,) belong to these parts."""
        found: BoolArray = np.isin(objects, self.objects)
        number = np.flatnonzero(found)
        for some in np.array_split(number, -(-len(number) // POINTS)) if len(number) else ():
            away = self.points[:, None] - points[:, some, None]
            found[some] = dot(away, away).min(axis=1) < self.reach**2
        return found
