# SPDX-License-Identifier: GPL-3.0-or-later
"""The empty space of a scene: a grid whose cells are marked by boxes around pieces of triangles.

Certain, not sampled: a box that meets no marked cell meets no triangle.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from functools import reduce
from itertools import pairwise, product

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, IndexArray
from .integral_image import count_in_boxes, integral_image, running_sums

# Cells of a scene's bounds, nearly cubes: the number per triangle, the least and the most of any scene, and
# the most along an axis. A scene of a million boxes gets more cells than the least, which takes half a
# second and saves a fifth to a third of the chords.
CELLS_EACH = 8
CELLS = 1 << 21
MOST_CELLS = 1 << 24
MOST_ALONG = 512

# Fine cells along each axis of a cell.
FINER = 2

# Fine cells are counted modulo this: the count of a box of fewer cells is exact.
MODULUS = 256

# Triangles whose boxes fill more than LARGE fine cells are cut in four, CUTS times at most: the box around a
# large slanted triangle is mostly empty.
LARGE = 18.0
CUTS = 6

# Boxes of more cells than this are marked by running sums over their corners.
MOST_MARKED = 96

# Triangles that are marked at a time: temporary arrays are ten times as large as the triangles.
AT_ONCE = 1 << 18

# No more pieces than this are made of those: triangles that are still large keep their box.
MOST_PIECES = 4_000_000

# Boxes are wider than their contents by this share of the scene: sixteen roundings of float32,
# for those of the boxes and of Embree.
SLACK = 2.0**-20


@dataclass(frozen=True)
class Occupancy:
    """A grid over the scene's bounds that tells whether boxes are empty.

    sums: (X+1, Y+1, Z+1) int32, the integral image of the marked cells. finer: the same of FINER
    times as many cells along each axis, uint8, modulo MODULUS. lower: (3,). scale: (3,) cells in a cast unit.
    """

    sums: IndexArray
    finer: NDArray[np.uint8]
    lower: Array
    scale: Array

    @classmethod
    def of(cls, corners: Array, around: float = 0.0, cells: int | None = None) -> Occupancy:
        """Make the grid of triangles (3 corners, 3, T), cast space, with all within ``around`` of them.

        cells: about how many there are, None for as many as pay for casting images.
        """
        lower, upper = corners.min(axis=(0, 2)) - around, corners.max(axis=(0, 2)) + around
        size = np.maximum(upper - lower, SLACK)
        lower, size = lower - SLACK, size + 2.0 * SLACK
        count = cells or min(max(CELLS, CELLS_EACH * corners.shape[2]), MOST_CELLS)
        along = FINER * np.clip(size * np.cbrt(count / size.prod()), 1, MOST_ALONG).astype(np.intp)
        scale = along / size
        held = np.zeros(along, bool)
        slack = ((SLACK + around) * scale)[:, None]
        for start in range(0, corners.shape[2], AT_ONCE):
            some = corners[:, :, start : start + AT_ONCE]
            for piece in _small_pieces((some - lower[:, None]) * scale[:, None]):
                first = np.clip(piece.min(axis=0) - slack, 0, along[:, None] - 1).astype(np.intp)
                last = np.clip(piece.max(axis=0) + slack, 0, along[:, None] - 1).astype(np.intp)
                _mark(held, first, last - first + 1)
        coarse = held
        for axis in range(3):
            parts = np.moveaxis(coarse, axis, 0)
            coarse = np.moveaxis(reduce(np.logical_or, [parts[k::FINER] for k in range(FINER)]), 0, axis)
        return cls(integral_image(coarse), integral_image(held, np.uint8), lower, scale / FINER)

    def holds(self, lower: Array, upper: Array) -> BoolArray:
        """Return whether boxes from lower to upper (3, …), cast space, meet a marked cell."""
        first, last = self._cells(lower, upper, 1)
        held: BoolArray = count_in_boxes(self.sums, first, last) != 0
        return held

    def holds_finely(self, lower: Array, upper: Array) -> BoolArray:
        """Return whether boxes meet a marked fine cell; those across MODULUS cells or more count too."""
        first, last = self._cells(lower, upper, FINER)
        size = last - first
        held: BoolArray = count_in_boxes(self.finer, first, last) != 0
        held |= size[0] * size[1] * size[2] >= MODULUS
        return held

    def _cells(self, lower: Array, upper: Array, finer: int) -> tuple[NDArray[np.int32], NDArray[np.int32]]:
        """The first cell of each box along each axis and the one after the last, (3, …) both."""
        shape = (3,) + (1,) * (lower.ndim - 1)
        origin, scale = (a.reshape(shape).astype(lower.dtype) for a in (self.lower, finer * self.scale))
        most = finer * (np.array(self.sums.shape) - 1).reshape(shape)
        with np.errstate(invalid="ignore", over="ignore"):
            least, past = lower - origin, upper - origin
            least *= scale
            past *= scale
            past += 1.0
            # Conversion to integers truncates, which is right from 0 on.
            first = np.clip(least, 0, most, out=least).astype(np.int32)
            last = np.clip(past, 0, most, out=past).astype(np.int32)
        return first, last


@dataclass(frozen=True)
class JoinedOccupancy(Occupancy):
    """The empty space that the grid of one scene and another one leave."""

    other: Occupancy

    @classmethod
    def of_both(cls, other: Occupancy, grid: Occupancy) -> JoinedOccupancy:
        """Join a grid, which is not joined itself, with another one."""
        return cls(**{field.name: getattr(grid, field.name) for field in fields(Occupancy)}, other=other)

    def holds(self, lower: Array, upper: Array) -> BoolArray:
        return super().holds(lower, upper) | self.other.holds(lower, upper)

    def holds_finely(self, lower: Array, upper: Array) -> BoolArray:
        return super().holds_finely(lower, upper) | self.other.holds_finely(lower, upper)


def _mark(held: BoolArray, first: IndexArray, size: IndexArray) -> None:
    """Set the cells of boxes; first: (3, M) lowest cells, size: (3, M) cells along each axis."""
    few = size.prod(axis=0) <= MOST_MARKED
    flat, (_, row, plane) = held.reshape(-1), held.shape
    number = (first[0] * row + first[1]) * plane + first[2]
    # Boxes of one shape together.
    shape = (size[0] * (MOST_MARKED + 1) + size[1]) * (MOST_MARKED + 1) + size[2]
    shape[~few] = 0
    order = np.argsort(shape.astype(np.int32))
    ends = np.flatnonzero(np.diff(shape[order], append=-1)) + 1
    for start, end in pairwise((0, *ends.tolist())):
        if shape[order[start]] == 0:
            _mark_large(held, first.take(order[start:end], 1), size.take(order[start:end], 1))
            continue
        base = number.take(order[start:end])
        for x, y, z in product(*(range(n) for n in size[:, order[start]].tolist())):
            flat[base + ((x * row + y) * plane + z)] = True


def _mark_large(held: BoolArray, first: IndexArray, size: IndexArray) -> None:
    """Set the cells of large boxes by running sums of +1 and -1 at their corners."""
    changes = np.zeros(np.array(held.shape) + 1, np.int32)
    for corner in product((0, 1), repeat=3):
        place = tuple(first + size * np.array(corner)[:, None])
        np.add.at(changes, place, 1 - 2 * (sum(corner) % 2))
    held |= running_sums(changes)[:-1, :-1, :-1] > 0


def _small_pieces(corners: Array) -> list[Array]:
    """Triangles (3 corners, 3, T) in units of cells, the large ones cut into pieces."""
    pieces = []
    for cut in range(CUTS + 1):
        across = corners.max(axis=0) - corners.min(axis=0) + 1.0
        large = np.flatnonzero(across[0] * across[1] * across[2] > LARGE)
        if cut == CUTS or 4 * len(large) > MOST_PIECES:
            large = large[:0]
        small = np.ones(corners.shape[2], bool)
        small[large] = False
        pieces.append(corners.take(np.flatnonzero(small), 2))
        if len(large) == 0:
            break
        a, b, c = corners.take(large, 2)
        ab, bc, ca = 0.5 * (a + b), 0.5 * (b + c), 0.5 * (c + a)
        quarters = ((a, ab, ca), (ab, b, bc), (ca, bc, c), (ab, bc, ca))
        corners = np.concatenate([np.stack(quarter) for quarter in quarters], axis=2)
    return pieces
