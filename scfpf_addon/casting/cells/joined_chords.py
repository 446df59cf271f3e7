# SPDX-License-Identifier: GPL-3.0-or-later
"""Consecutive chords of a cell joined into one where the cell is straighter than the image's worst place.

Chords are planned for the worst place. Elsewhere a ray may run straight from one sheet to a later one.
Sheets stay as they are: a joined chord ends where the last of those ends that it replaces.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, IndexArray

# A pixel's narrow width counts as this share of the wide one at least, as in the planning of chords.
MOST_SQUEEZE = 64.0

# How far a chord is from its curve, as a share of the distance of its end from the chord past that end: a
# quarter where chords end on a curve of constant bend, less where they are shifted.
OWN_ERROR = 0.25

# On a joined chord t advances evenly; the ends of the chords that it replaces are off by this at most.
T_ERROR = 1e-3

# The corners of a cell: by row, then by column. The neighbour of each across and up, from low to high.
CORNERS = ((0, 0), (0, 1), (1, 0), (1, 1))
LEFT, RIGHT, BELOW, ABOVE = [0, 0, 2, 2], [1, 1, 3, 3], [0, 1, 0, 1], [2, 3, 2, 3]


class _Runs(NamedTuple):
    """Runs of two or more occupied chords, R of them.

    cell: (R,) of rows × columns. start, end: (R,) the breaks at which each begins and ends. first: (R,) the
    place of its first break among those of all runs.
    """

    cell: IndexArray
    start: IndexArray
    end: IndexArray
    first: IndexArray


class _Breaks(NamedTuple):
    """The breaks of runs, B of all together, at the four corners of their cells, and pixels there.

    t: (B,). points: (3, 4, B). tangent: (3, 4, B), unit, along the projector. widest: (3, 4, B), unit, the
    direction across it in which pixels are widest. wide, narrow: (4, B), squares of their widths. own:
    (4, B), how far the chords before and after are from their curve, in pixels.
    """

    t: Array
    points: Array
    tangent: Array
    widest: Array
    wide: Array
    narrow: Array
    own: Array

    def moved(self, which: IndexArray, offset: Array) -> Array:
        """The pixels by which offsets (3, 4, n) at breaks ``which`` (n,) move the image, (4, n)."""
        offset = _across(offset, self.tangent[:, :, which])
        along = (offset * self.widest[:, :, which]).sum(axis=0) ** 2
        rest = np.maximum((offset**2).sum(axis=0) - along, 0.0)
        moved: Array = np.sqrt(along / self.wide[:, which] + rest / self.narrow[:, which])
        return moved


def chord_ends(
    ends: Array, breaks: Array, occupied: BoolArray, pixels: tuple[float, float], pixel_error: float
) -> NDArray[np.int16]:
    """The break at which the chord that begins at each break ends, (chords, rows, columns).

    ends, occupied: as of ``occupied_chords``. breaks: (chords + 1,) t of each. pixels: across and up a cell.
    As many consecutive occupied chords are joined as the pixel error allows, measured at the cell's four
    corners, with t even along them to T_ERROR. A ray that begins inside a joined chord ends with it. Empty
    chords end at the next break.
    """
    count, cells = len(occupied), occupied[0].size
    last = np.repeat(np.arange(1, count + 1, dtype=np.int16), cells).reshape(count, cells)
    runs = _runs(occupied)
    if len(runs.cell):
        with np.errstate(invalid="ignore", over="ignore", divide="ignore"):
            found = _breaks(np.asarray(ends, np.float64), breaks, runs, pixels)
            which, start, end = _pieces(runs, found, pixel_error)
        length = end - start
        run, place = _counted(length)
        last[start[run] + place, runs.cell[which[run]]] = end[run]
    return last.reshape(occupied.shape)


def _runs(occupied: BoolArray) -> _Runs:
    flat = occupied.reshape(len(occupied), -1).T
    edges = np.diff(np.pad(flat, ((0, 0), (1, 1))).astype(np.int8), axis=1)
    (cell, start), (_, end) = np.nonzero(edges > 0), np.nonzero(edges < 0)
    several = end - start > 1
    cell, start, end = cell[several], start[several], end[several]
    length = end - start + 1
    return _Runs(cell, start, end, np.cumsum(length) - length)


def _counted(length: IndexArray) -> tuple[IndexArray, IndexArray]:
    """For each of ``length`` (n,) so many items: its number, and the place of each item in it."""
    owner = np.repeat(np.arange(len(length)), length)
    return owner, np.arange(len(owner)) - np.repeat(np.cumsum(length) - length, length)


def _breaks(ends: Array, breaks: Array, runs: _Runs, pixels: tuple[float, float]) -> _Breaks:
    """The breaks of runs with their pixels, by differences between the cell's corners."""
    run, place = _counted(runs.end - runs.start + 1)
    at = runs.start[run] + place
    row, column = np.divmod(runs.cell[run], ends.shape[3] - 1)
    by_axis = np.ascontiguousarray(ends.swapaxes(0, 1))

    def points(step: int) -> Array:
        """The points a step before or after."""
        there = np.clip(at + step, 0, len(ends) - 1)
        return np.stack([by_axis[:, there, row + up, column + right] for up, right in CORNERS], axis=1)

    here, before, after = points(0), points(-1), points(1)
    tangent = after - before
    tangent /= np.sqrt((tangent**2).sum(axis=0))
    dx = _across((here[:, RIGHT] - here[:, LEFT]) / pixels[0], tangent)
    dy = _across((here[:, ABOVE] - here[:, BELOW]) / pixels[1], tangent)
    xx, yy, xy = (dx * dx).sum(axis=0), (dy * dy).sum(axis=0), (dx * dy).sum(axis=0)
    wide = 0.5 * (xx + yy + np.sqrt((xx - yy) ** 2 + 4.0 * xy * xy))
    narrow = np.maximum((xx * yy - xy * xy) / wide, wide / MOST_SQUEEZE**2)
    # From the larger of two equal expressions.
    flat = xx >= yy
    widest = dx * np.where(flat, wide - yy, xy) + dy * np.where(flat, xy, wide - xx)
    widest /= np.sqrt((widest**2).sum(axis=0))
    found = _Breaks(breaks[at], here, tangent, widest, wide, narrow, np.zeros_like(wide))
    bend = _across(here - before, after - before)
    return found._replace(own=OWN_ERROR * found.moved(np.arange(len(at)), bend))


def _pieces(runs: _Runs, breaks: _Breaks, pixel_error: float) -> tuple[IndexArray, IndexArray, IndexArray]:
    """The chords that runs are joined into: the run of each, its start and its end, three (n,)."""
    active = np.arange(len(runs.cell))
    start, end = runs.start.copy(), runs.start + 1
    pieces = []
    while len(active):
        fits = _fits(runs, breaks, active, start, end + 1, pixel_error)
        pieces.append((active[~fits], start[~fits], end[~fits]))
        start, end = np.where(fits, start, end), end + 1
        over = end == runs.end[active]
        pieces.append((active[over], start[over], end[over]))
        active, start, end = active[~over], start[~over], end[~over]
    run, start, end = (np.concatenate(part) for part in zip(*pieces, strict=True))
    return run, start, end


def _fits(
    runs: _Runs, breaks: _Breaks, run: IndexArray, start: IndexArray, end: IndexArray, pixel_error: float
) -> BoolArray:
    """Whether chords from start to end, parts of runs ``run``, stay close enough to their curves, (n,)."""
    length = end - start - 1
    chord, place = _counted(length)
    first = (runs.first[run] + start - runs.start[run])[chord]
    inner, last = first + 1 + place, first + 1 + length[chord]
    origin = breaks.points[:, :, first]
    offset, whole = breaks.points[:, :, inner] - origin, breaks.points[:, :, last] - origin
    error = breaks.moved(inner, _across(offset, whole)) + breaks.own[:, inner]
    share = (offset * whole).sum(axis=0) / (whole**2).sum(axis=0)
    t, low, high = breaks.t[inner], breaks.t[first], breaks.t[last]
    close = (error <= pixel_error) & (np.abs(low + share * (high - low) - t) <= T_ERROR)
    fits: BoolArray = np.logical_and.reduceat(close.all(axis=0), np.cumsum(length) - length)
    return fits


def _across(vector: Array, along: Array) -> Array:
    """The part of vectors (3, …) across others (3, …); NaN where these vanish."""
    share = (vector * along).sum(axis=0) / (along**2).sum(axis=0)
    across: Array = vector - along * share
    return across
