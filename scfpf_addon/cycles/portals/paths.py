# SPDX-License-Identifier: GPL-3.0-or-later
"""The faces of sheets whose rays skip chords: each cell of the sheets has a path of its own."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...casting.cells.cell_paths import needed_faces, next_chords
from ...projection.typing import Array, BoolArray, IndexArray


class Faces(NamedTuple):
    """F faces of sheets, each one cell wide.

    cell: (F,) row by row. sheet: (F,) its number, 0 for the screen. onward: (F,) the chord that rays go on
    along, n for none. cells: across and up a whole sheet, its border not included. passed: portals on the way
    of a ray that meets nothing, the mean. lengths: (n+1, V) of the chords before each at the V vertices of a
    whole sheet, 0 for n.
    """

    cell: IndexArray
    sheet: IndexArray
    onward: IndexArray
    cells: tuple[int, int]
    passed: float
    lengths: Array


def faces_of(occupied: BoolArray, cells: tuple[int, int], ends: Array) -> Faces:
    """The faces that rays need which travel the occupied chords (n, rows, columns) only.

    cells: as in Faces; rows and columns include the border. ends: (n+1, 3, rows + 1, columns + 1) of chords.
    """
    sheet, row, column = np.nonzero(needed_faces(occupied))
    onward = next_chords(occupied)[sheet, row, column].astype(np.intp)
    passed = 1.0 + float(occupied.sum(axis=0).mean())
    steps = np.diff(np.asarray(ends, np.float64), axis=0)[:-1]
    lengths = np.zeros((len(ends), ends[0, 0].size))
    with np.errstate(invalid="ignore", over="ignore"):
        total = np.cumsum(np.sqrt((steps**2).sum(axis=1)), axis=0)
    lengths[1:-1] = np.nan_to_num(total.reshape(len(steps), lengths.shape[1]))
    return Faces(row * occupied.shape[2] + column, sheet, onward, cells, passed, lengths)
