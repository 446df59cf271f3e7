# SPDX-License-Identifier: GPL-3.0-or-later
"""The mesh of the portals as arrays: a screen, a sheet where each chord ends, and the far sheet.

A sheet is the image's grid of projectors cut at one t. All sheets have the same triangles. A ray leaves a
point of a triangle along the mean of the chords at its corners, and so meets the same point of the same
triangle of the next sheet: no error adds up from sheet to sheet.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...projection.typing import Array, BoolArray, IndexArray

# Pixels by which sheets extend beyond a rectangular image, for Cycles' filter.
PADDING = 2.0

# Within this share of a chord at its ends, a sheet does not turn a ray too early.
TOUCHED = 1e-3

# A sheet is a line if its breadth is at most this share of the volume's size: float32's error.
LINE = 1e-6

# The surround covers images up to this many times as wide as high, or as high as wide.
SURROUND = 60.0
# Its vertices are the last ones.
SURROUND_CORNERS = 4


class Portals(NamedTuple):
    """Vertices of all sheets and their triangles.

    places: (3, N): x and y in the table of projectors, and the number of the sheet: 0 the screen, n the far
    sheet, -1 the surround. start, end: (3, N): t and shift at the start and the end of the vertex' chord; it
    ends at the vertex on the far sheet. The third value of start is 1 on the far sheet, of end the number
    of vertices of a sheet. triangles: (T, 3). screen, far, surround: (T,) bool; the others are of sheets.
    """

    places: Array
    start: Array
    end: Array
    triangles: IndexArray
    screen: BoolArray
    far: BoolArray
    surround: BoolArray


def image_places(x: Array, y: Array, polar: bool, aspect: float) -> tuple[Array, Array]:
    """The image positions of places (x, y) in a sheet, each (N,); a polar image's square becomes its disc."""
    return disc_places(*pressed(x, y), aspect) if polar else (x, y)


def disc_places(x: Array, y: Array, aspect: float) -> tuple[Array, Array]:
    """The image positions of places in the square around a polar disc, each (N,)."""
    return 0.5 + (x - 0.5) / max(aspect, 1.0), 0.5 + (y - 0.5) / max(1.0 / aspect, 1.0)


def disc_square(x: Array, y: Array, aspect: float) -> tuple[Array, Array]:
    """The inverse of ``disc_places``."""
    return 0.5 + (x - 0.5) * max(aspect, 1.0), 0.5 + (y - 0.5) * max(1.0 / aspect, 1.0)


def pressed(x: Array, y: Array) -> tuple[Array, Array]:
    """Places of the unit square moved towards its centre, into its inscribed disc."""
    a, b = 2.0 * np.asarray(x, np.float64) - 1.0, 2.0 * np.asarray(y, np.float64) - 1.0
    radius = np.hypot(a, b)
    largest = np.maximum(np.abs(a), np.abs(b))
    share = np.divide(largest, radius, out=np.ones_like(radius), where=radius > 0.0)
    return 0.5 + 0.5 * a * share, 0.5 + 0.5 * b * share


def portals(
    breaks: Array, shifts: Array, cells: tuple[int, int], size: tuple[int, int], polar: bool
) -> Portals:
    """The arrays of n+1 sheets, screen and far sheet included, and of the surround.

    breaks, shifts: (n+1,), as in ChordPlan. cells: of each sheet, across and up. size: of the image, pixels.
    """
    x, y, triangles = _grid(cells, size, polar)
    count, many = len(breaks) - 1, len(x)
    number = np.repeat(np.arange(count + 1), many)
    chord = np.minimum(number, count - 1)
    places = np.stack([np.tile(x, count + 1), np.tile(y, count + 1), number])
    far = (number == count).astype(np.float64)
    start = np.stack([breaks[chord], shifts[chord], far])
    end = np.stack([breaks[chord + 1], shifts[chord + 1], np.full(len(number), float(many))])
    faces = (triangles[None] + (np.arange(count + 1) * many)[:, None, None]).reshape(-1, 3)
    owner = np.repeat(np.arange(count + 1), len(triangles))
    around = np.array([[-1, 1, 1, -1], [-1, -1, 1, 1], [0, 0, 0, 0]]) * SURROUND + [[0.5], [0.5], [-1.0]]
    corner = places.shape[1]
    faces = np.concatenate([faces, [[corner, corner + 1, corner + 2], [corner, corner + 2, corner + 3]]])
    owner = np.concatenate([owner, [-1, -1]])
    return Portals(
        np.concatenate([places, around], axis=1),
        np.concatenate([start, np.zeros((3, SURROUND_CORNERS))], axis=1),
        np.concatenate([end, np.ones((3, SURROUND_CORNERS))], axis=1),
        faces.astype(np.int32),
        owner == 0,
        owner == count,
        owner < 0,
    )


def vertex_count(count: int, cells: tuple[int, int], polar: bool) -> int:
    """The number of vertices that ``portals`` makes for a number of chords."""
    padding = 1 if polar else 3
    return (count + 1) * (cells[0] + padding) * (cells[1] + padding) + SURROUND_CORNERS


def _grid(cells: tuple[int, int], size: tuple[int, int], polar: bool) -> tuple[Array, Array, IndexArray]:
    """x and y of a sheet's vertices, row by row, and its triangles."""
    lines = [np.arange(count + 1) / count for count in cells]
    if not polar:
        padding = [PADDING / pixels for pixels in size]
        lines = [
            np.concatenate([[-pad], line, [1.0 + pad]]) for line, pad in zip(lines, padding, strict=True)
        ]
    columns, rows = len(lines[0]), len(lines[1])
    x, y = (a.ravel() for a in np.meshgrid(*lines))
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    right, up, far = first + 1, first + columns, first + columns + 1
    rising = np.stack([[first, right, far], [first, far, up]]).transpose(2, 0, 1)
    if not polar:
        return x, y, rising.reshape(-1, 3)
    # Diagonals through the centre: the square's corners lie on them.
    falling = np.stack([[first, right, up], [right, far, up]]).transpose(2, 0, 1)
    middle = x[first] + x[far] - 1.0, y[first] + y[far] - 1.0
    rises = (middle[0] * middle[1] >= 0.0)[:, None, None]
    triangles = np.where(rises, rising, falling).reshape(-1, 3)
    return *pressed(x, y), triangles


def has_no_area(layers: Array) -> bool:
    """Whether a sheet behind the screen is a line or a point, which no ray meets.

    layers: as of ``crosses_itself``.
    """
    for layer in layers[1:]:
        points = layer.reshape(3, -1)
        _, breadth, _ = np.linalg.svd(points - points.mean(axis=1, keepdims=True), compute_uv=False)
        if breadth <= LINE * np.abs(layers).max():
            return True
    return False


def crosses_itself(layers: Array, gated: bool) -> bool:
    """Whether chords between consecutive layers of a volume meet sheets elsewhere than at their own ends.

    layers: (n+1, 3, R, C) ends of the chords of R × C projectors. gated: a sheet turns only rays from the
    sheet before, so that only a fold between two sheets does harm. Sampled, not certain.
    """
    count = len(layers) - 1
    a, b = layers[:, :, :-1, :-1], layers[:, :, :-1, 1:]
    c, d = layers[:, :, 1:, 1:], layers[:, :, 1:, :-1]
    corners = [np.stack(pair, axis=-1).reshape(count + 1, 3, -1) for pair in ((a, a), (b, c), (c, d))]
    # The chords of the cells' middles: those of the vertices would run along edges.
    middle = 0.25 * (a + b + c + d)
    middle = middle.reshape(count + 1, 3, -1)
    cells = np.arange(middle.shape[2])
    # Each cell has two triangles, one after the other.
    elsewhere = cells[:, None] != np.repeat(cells, 2)
    for chord in range(count):
        start, end = middle[chord], middle[chord + 1]
        for sheet in (chord + 1,) if gated else range(count + 1):
            hits = _hits(start, end - start, *(part[sheet] for part in corners))
            if (hits & elsewhere).any() or (sheet not in (chord, chord + 1) and hits.any()):
                return True
    return False


def _hits(origin: Array, direction: Array, a: Array, b: Array, c: Array) -> BoolArray:
    """Whether N segments meet M triangles, (N, M) (Möller and Trumbore 1997)."""
    first, second = b - a, c - a
    normal = np.cross(direction[:, :, None], second[:, None], axis=0)
    determinant = np.einsum("cnm,cm->nm", normal, first)
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / determinant
        offset = origin[:, :, None] - a[:, None]
        u = np.einsum("cnm,cnm->nm", offset, normal) * inverse
        turned = np.cross(offset, first[:, None], axis=0)
        v = np.einsum("cn,cnm->nm", direction, turned) * inverse
        t = np.einsum("cm,cnm->nm", second, turned) * inverse
        # A little less than to the end: a chord may touch the neighbours of its own cell.
        met: BoolArray = (u >= 0.0) & (v >= 0.0) & (u + v <= 1.0) & (t >= TOUCHED) & (t <= 1.0 - TOUCHED)
    return met
