# SPDX-License-Identifier: GPL-3.0-or-later
"""The paths of cells: the chords along which a cell's rays travel, and the sheets that they meet.

A ray keeps its place (x, y), so each cell has one path, and a ray in it leaves out the chords that are empty
there. Cells share the sheets, and with them the places at which chords end. So each place of the image has
one path: where the paths of neighbours differ, there is no gap and no double image.

Rounding may move a ray across its cell's edge on its way to a sheet. It then goes on by the path of the
neighbour, whose hull contains it with its slack. So a face is needed wherever the path of a neighbour ends a
chord. The neighbour's rays may have passed another number of portals and come from another break.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import BoolArray, IndexArray


class CellPaths(NamedTuple):
    """The path of each cell of n chords, (n + 1, rows, columns) by break. Rays begin at break 0.

    start: int16, the break at which a ray goes on that arrives there, n if it leaves the volume. end: int16,
    the break at which it arrives then, n if it leaves. arrives: bool, whether rays of the cell arrive there.
    faces: bool, whether rays of the cell or of its eight neighbours do. origin: int16, the earliest break at
    which such rays began their chord, n without a face, 0 at break 0.
    """

    start: NDArray[np.int16]
    end: NDArray[np.int16]
    arrives: BoolArray
    faces: BoolArray
    origin: NDArray[np.int16]

    def portals_passed(self, row: IndexArray, column: IndexArray, chord: IndexArray) -> IndexArray:
        """The portals that rays pass, (N,): the first, and one at the end of each chord without a hit.

        row, column: (N,) the cells of the rays. chord: (N,) the planned chord in which each meets something
        first, n if none.
        """
        before = np.cumsum(self.arrives, axis=0, dtype=np.int32)
        passed: IndexArray = before[chord, row, column]
        return passed


def cell_paths(occupied: BoolArray, last: NDArray[np.int16] | None = None) -> CellPaths:
    """The paths along the occupied chords (n, rows, columns) of cells.

    last: the break at which each chord ends (``chord_ends``), None to join no chords.
    """
    count = len(occupied)
    if last is None:
        last = np.broadcast_to(np.arange(1, count + 1, dtype=np.int16)[:, None, None], occupied.shape)
    start = next_chords(occupied)
    ends = np.append(last, np.full_like(start[:1], count), axis=0)
    end = np.take_along_axis(ends, start.astype(np.intp), axis=0)
    origin = np.full(start.shape, count, np.int16)
    origin[0] = 0
    for place in range(count):
        row, column = np.nonzero((origin[place] < count) & (start[place] < count))
        origin[end[place, row, column], row, column] = start[place, row, column]
    arrives = origin < count
    for axis in (1, 2):
        here, before = np.moveaxis(origin[1:], axis, 0), np.moveaxis(origin[1:].copy(), axis, 0)
        np.minimum(here[1:], before[:-1], out=here[1:])
        np.minimum(here[:-1], before[1:], out=here[:-1])
    return CellPaths(start, end, arrives, origin < count, origin)


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
    """Whether rays may meet the face of each cell at each break, (chords + 1, rows, columns).

    A ray meets the faces at the ends of occupied chords. Those of all eight neighbours are added. All rays
    begin at break 0.
    """
    return cell_paths(occupied).faces
