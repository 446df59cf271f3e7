# SPDX-License-Identifier: GPL-3.0-or-later
"""The paths of cells: the chords along which a cell's rays travel, and the sheets that they meet.

A ray keeps its place (x, y), so each cell has one path, and a ray in it leaves out the chords that are empty
there. Cells share the sheets, and with them the places at which chords end. So each place of the image has
one path: where the paths of neighbours differ, there is no gap and no double image.

Rounding may move a ray across its cell's edge on its way to a sheet. It then goes on by the path of the
neighbour, whose hull contains it with its slack. So a face is needed wherever the path of a neighbour ends a
chord. The neighbour's rays may have passed another number of portals, but come along the same chord.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import BoolArray, IndexArray


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
