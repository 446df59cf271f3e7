# SPDX-License-Identifier: GPL-3.0-or-later
"""The cells of chords: hulls of the eight points at which four neighbouring projectors have a chord's ends.

A ray that begins inside the cell's face of one sheet and runs along the mean of the chords at the corners
stays within the hull. Planes fitted around all eight corners enclose it.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, Float32Array, IndexArray
from .body_tree import CHILDREN, box_rows, parents, rounded_out

# Rays leave their cells by this share of the cell's largest coordinate at most: 64 roundings of float32, for
# those of the sheets' vertices, of the ray and of the triangles that it is tested against.
SLACK = 2.0**-18

# Cells across a block at the top of the tree, as a power of 2.
LEVELS = 4

# Cells around which planes are fitted at a time.
PLANES_AT_ONCE = 1 << 12

# A cell's corners: bit 0 counts columns, bit 1 rows, bit 2 the chord's ends.
CORNERS = 8


class CellTree(NamedTuple):
    """The cells of a few chords, and the boxes of their tree.

    points: (P, 3), all corners. corner: (M, CORNERS) of each cell, in ``points``. room: (M,) the slack of
    each. number: (M,) of each cell among chords, rows and columns; -1 of cells that fill up a block. boxes,
    child, extent, roots: see ``BodyTree``, beginning with the M cells.
    """

    points: Array
    corner: IndexArray
    room: Array
    number: IndexArray
    boxes: Float32Array
    child: IndexArray
    extent: Float32Array
    roots: IndexArray


class Planes(NamedTuple):
    """Six planes around each of M hulls, whose outside is normal · p > limit.

    normals: (M, 6, 3), unit, or 0 where the hull has no such side. limits: (M, 6), slack included.
    width: (M,) the least distance of two opposite ones.
    """

    normals: Array
    limits: Array
    width: Array


def cells_of(ends: Array, slack: float) -> CellTree:
    """The cells between sheets; those with a corner that is not finite meet nothing.

    ends: (G + 1, 3, rows + 1, columns + 1). slack: in addition to the rounding, in the unit of ``ends``.
    """
    group, rows, columns = len(ends) - 1, ends.shape[2] - 1, ends.shape[3] - 1
    low, high = (_over_corners(ends, f) for f in (np.minimum, np.maximum))
    finite = np.isfinite(low).all(axis=0) & np.isfinite(high).all(axis=0)
    with np.errstate(invalid="ignore"):
        room = slack + SLACK * np.maximum(-low, high).max(axis=0)
        low, high = np.where(finite, low - room, np.inf), np.where(finite, high + room, -np.inf)
    first = (np.arange(group)[:, None, None] * (rows + 1) + np.arange(rows)[:, None]) * (columns + 1)
    first = first + np.arange(columns)
    bits = [np.array([corner >> bit & 1 for corner in range(CORNERS)]) for bit in range(3)]
    step = (bits[2] * (rows + 1) + bits[1]) * (columns + 1) + bits[0]
    numbers = np.arange(finite.size).reshape(finite.shape)
    lower, upper = (
        np.stack([_in_blocks(axis, beyond) for axis in side])
        for side, beyond in ((low, np.inf), (high, -np.inf))
    )
    boxes, child, extent, roots = _levels(*rounded_out(lower, upper))
    return CellTree(
        points=np.ascontiguousarray(ends.transpose(0, 2, 3, 1)).reshape(-1, 3),
        corner=_in_blocks(first, 0)[:, None] + step,
        room=_in_blocks(room, 0.0),
        number=_in_blocks(numbers, -1),
        boxes=boxes,
        child=child,
        extent=extent,
        roots=roots,
    )


def planes_around(corners: Array, room: Array) -> Planes:
    """Planes around hulls of cells. corners: (M, CORNERS, 3). room: (M,), by which they are moved out."""
    count = len(corners)
    planes = Planes(np.empty((count, 6, 3)), np.empty((count, 6)), np.empty(count))
    for start in range(0, count, PLANES_AT_ONCE):
        some = slice(start, start + PLANES_AT_ONCE)
        for whole, part in zip(planes, _planes_around(corners[some], room[some]), strict=True):
            whole[some] = part
    return planes


def _planes_around(corners: Array, room: Array) -> Planes:
    """The planes around so few cells that the arrays stay in a core's cache."""
    normals = np.empty((6, 3, len(corners)))
    corner = np.ascontiguousarray(corners.transpose(1, 2, 0))
    middle = corner.sum(axis=0) / CORNERS
    sides = [[c for c in range(CORNERS) if c >> bit & 1 == end] for bit in range(3) for end in (0, 1)]
    for number, (first, second, third, fourth) in enumerate(sides):
        # The diagonals' cross product is that of the mean edges.
        one, other = corner[fourth] - corner[first], corner[third] - corner[second]
        normal = np.cross(one, other, axis=0)
        centre = 0.25 * (corner[first] + corner[second] + corner[third] + corner[fourth])
        outwards = (normal * (centre - middle)).sum(axis=0)
        length = np.sqrt((normal * normal).sum(axis=0))
        scale = np.divide(1.0, length, out=np.zeros_like(length), where=length > 0.0)
        normals[number] = normal * np.copysign(scale, outwards)
    along = np.einsum("pcm,kcm->kpm", normals, corner)
    limits = along.max(axis=0)
    width = (limits - along.min(axis=0)).min(axis=0)
    return Planes(normals.transpose(2, 0, 1), (limits + room).T, width)


def _over_corners(ends: Array, f: np.ufunc) -> Array:
    """Minima or maxima of the corners of each cell, (3, G, rows, columns)."""
    over = f(ends[:-1], ends[1:])
    over = f(over[:, :, :-1], over[:, :, 1:])
    over = f(over[..., :-1], over[..., 1:])
    return np.ascontiguousarray(over.swapaxes(0, 1))


def _in_blocks(values: NDArray[Any], beyond: float) -> NDArray[Any]:
    """Values of cells (G, rows, columns) in the order of the tree: four neighbours after one another."""
    side = 1 << LEVELS
    rows, columns = (-(-count // side) for count in values.shape[1:])
    spare = ((0, 0), (0, rows * side - values.shape[1]), (0, columns * side - values.shape[2]))
    values = np.pad(values, spare, constant_values=beyond)
    values = values.reshape(len(values), rows, *(2,) * LEVELS, columns, *(2,) * LEVELS)
    row, column = range(2, 2 + LEVELS), range(3 + LEVELS, 3 + 2 * LEVELS)
    pairs = [axis for pair in zip(row, column, strict=True) for axis in pair]
    return values.transpose(0, 1, 2 + LEVELS, *pairs).ravel()


def _levels(
    lower: Float32Array, upper: Float32Array
) -> tuple[Float32Array, IndexArray, Float32Array, IndexArray]:
    """The boxes, children, extents and roots of a ``CellTree`` of cells in boxes (3, M)."""
    count, start = lower.shape[1], 0
    levels, children = [(lower, upper)], [np.full(count, -1)]
    for _ in range(LEVELS):
        lower, upper = parents(lower, upper)
        levels.append((lower, upper))
        children.append(start + CHILDREN * np.arange(lower.shape[1]))
        start, count = start + count, lower.shape[1]
    low, high = (np.concatenate(side, axis=1) for side in zip(*levels, strict=True))
    with np.errstate(invalid="ignore"):
        extent = (high - low).max(axis=0)
    return box_rows(low, high), np.concatenate(children), extent, np.arange(start, start + count)
