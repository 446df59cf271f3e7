# SPDX-License-Identifier: GPL-3.0-or-later
"""The faces of sheets whose rays skip chords: each cell of the sheets has a path of its own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...casting.cells.cell_paths import needed_faces, next_chords
from ...projection.typing import BoolArray, IndexArray


class Faces(NamedTuple):
    """F faces of sheets, each one cell wide.

    cell: (F,) row by row. sheet: (F,) its number, 0 for the screen. onward: (F,) the chord that rays go on
    along, n for none. cells: across and up a whole sheet, its border not included. passed: portals on the way
    of a ray that meets nothing, the mean.
    """

    cell: IndexArray
    sheet: IndexArray
    onward: IndexArray
    cells: tuple[int, int]
    passed: float


def faces_of(occupied: BoolArray, cells: tuple[int, int]) -> Faces:
    """The faces that rays need which travel the occupied chords (n, rows, columns) only.

    cells: as in Faces; rows and columns include the border.
    """
    sheet, row, column = np.nonzero(needed_faces(occupied))
    onward = next_chords(occupied)[sheet, row, column].astype(np.intp)
    passed = 1.0 + float(occupied.sum(axis=0).mean())
    return Faces(row * occupied.shape[2] + column, sheet, onward, cells, passed)
