# SPDX-License-Identifier: GPL-3.0-or-later
"""What may leave its place in the image so that pins come free."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...projection.aim.vectors import dot
from ...projection.typing import Array, BoolArray, IndexArray


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
        found = np.isin(objects, self.objects)
        for number in np.flatnonzero(found):
            away = self.points - points[:, number, None]
            found[number] = dot(away, away).min() < self.reach**2
        return found
