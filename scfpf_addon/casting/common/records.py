# SPDX-License-Identifier: GPL-3.0-or-later
"""Hits of chords, as they are recorded before they are solved."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import IndexArray


class Records(NamedTuple):
    """Hits of chords: projector, chord and triangle, each (M,)."""

    projector: NDArray[np.intp]
    chord: NDArray[np.intp]
    triangle: NDArray[np.int32]

    def take(self, index: IndexArray) -> Records:
        """The records at ``index``."""
        return Records(self.projector.take(index), self.chord.take(index), self.triangle.take(index))
