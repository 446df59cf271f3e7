# SPDX-License-Identifier: GPL-3.0-or-later
"""The faces of sheets whose rays skip chords: each cell of the sheets has a path of its own.

A ray keeps its place (x, y), so each cell has one path, and a ray in it leaves out the chords that are empty
there. Cells share the sheets, and with them the places at which chords end. So each place of the image has
one path: where the paths of neighbours differ, there is no gap and no double image.

Rounding may move a ray across its cell's edge on its way to a sheet. It then goes on by the path of the
neighbour, whose hull contains it with its slack. So a face is needed wherever the path of a neighbour ends a
chord. The neighbour's rays may have passed another number of portals, but come along the same chord.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

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


def next_chords(occupied: BoolArray) -> NDArray[np.int16]:
    """The chord that a ray takes at each break, (chords + 1, rows, columns); their number where it leaves.

    occupied: (chords, rows, columns). A ray at break k, the end of chord k - 1, goes on at the start of chord
    next_chords[k] >= k; at break 0 are the rays that begin.
    """
    count = len(occupied)
    numbers = np.arange(count, dtype=np.int16)[:, None, None]
    following = np.full((count + 1, *occupied.shape[1:]), count, np.int16)
    following[:count] = np.where(occupied, numbers, np.int16(count))
    result: NDArray[np.int16] = np.minimum.accumulate(following[::-1], axis=0)[::-1]
    return result


def needed_faces(occupied: BoolArray) -> BoolArray:
    """Return whether rays may meet the face of each cell at each break, (chords + 1, rows, columns).

    A ray meets the faces at the ends of occupied chords. Those of all eight neighbours are added. All rays
    begin at break 0.
    """
    faces = np.append(np.ones_like(occupied[:1]), occupied, axis=0)
    for axis in (1, 2):
        here, before = np.moveaxis(faces, axis, 0), np.moveaxis(faces.copy(), axis, 0)
        here[1:] |= before[:-1]
        here[:-1] |= before[1:]
    return faces


def portals_passed(occupied: BoolArray, row: IndexArray, column: IndexArray, chord: IndexArray) -> IndexArray:
    """The portals that rays pass, (N,): the first, and one at the end of each chord without a hit.

    row, column: (N,) the cells of the rays. chord: (N,) the planned chord in which each meets something
    first, n if none.
    """
    before = np.cumsum(occupied, axis=0, dtype=np.int32)
    before = np.append(np.zeros_like(before[:1]), before, axis=0)
    passed: IndexArray = 1 + before[chord, row, column]
    return passed
