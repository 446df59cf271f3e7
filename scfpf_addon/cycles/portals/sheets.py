# SPDX-License-Identifier: GPL-3.0-or-later
"""The mesh of the portals as arrays: a screen, a sheet where each chord ends, and the far sheet.

A sheet is the image's grid of projectors cut at one t. All sheets have the same triangles. A ray leaves a
point of a triangle along the mean of the chords at its corners, and so meets the same point of the same
triangle of the next sheet: no error adds up from sheet to sheet. Sheets whose rays skip chords have the faces
that rays meet; nodes can replace them by whole sheets, of which the mesh holds one.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...projection.typing import Array, IndexArray
from .paths import Faces

# Slots of the materials on the mesh: a sheet that turns rays, the screen, its surround, the far sheet, a
# sheet that sends rays to another place, and a screen without a lens.
SHEET_SLOT, SCREEN_SLOT, SURROUND_SLOT, FAR_SLOT, JUMP_SLOT, PLAIN_SLOT = range(6)

# Pixels by which sheets extend beyond a rectangular image, for Cycles' filter.
PADDING = 2.0

# A sheet is a line if its breadth is at most this share of the volume's size: float32's error.
LINE = 1e-6

# The surround covers images up to this many times as wide as high, or as high as wide.
SURROUND = 60.0
# Its vertices are the last ones.
SURROUND_CORNERS = 4


# The number of the screen behind those of the chords.
BEHIND = -1

# The third value of a vertex' place before the nodes, where it is no sheet's: corners of the surround,
# breaks, and the one sheet that the nodes repeat for each break.
SURROUNDS, BREAKS, REPEATED = -1.0, -2.0, -3.0


class Portals(NamedTuple):
    """Vertices of a rig's mesh before the nodes, and its triangles.

    places: (3, N). Of the first vertices, t and shift of each break, and BREAKS. Of the others x and y in the
    table of projectors, and SURROUNDS, REPEATED, or the number of the sheet: 0 the screen, n the far sheet.
    onward: (N,) the chord that a ray goes on along, n for none. length: (N,) of the chords that a ray is led
    past, known for sheets whose rays skip chords. depth: (N,) how far the screen and its surround are moved
    back: as far as rays skip, so that their footprints grow as on the way. triangles: (T, 3). slots: (T,)
    int, of materials.
    """

    places: Array
    onward: Array
    length: Array
    depth: Array
    triangles: IndexArray
    slots: IndexArray


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
    breaks: Array,
    shifts: Array,
    cells: tuple[int, int],
    size: tuple[int, int],
    polar: bool,
    faces: Faces | None = None,
) -> Portals:
    """The arrays of a rig's mesh.

    breaks, shifts: (n+1,), as in ChordPlan. cells: across and up the sheet that the nodes repeat. size: of
    the image, pixels. faces: those of sheets whose rays skip chords, None without such sheets.
    """
    count = len(breaks) - 1
    x, y, triangles = grid(cells, size, polar)
    around = np.array([[-1, 1, 1, -1], [-1, -1, 1, 1], [0, 0, 0, 0]]) * SURROUND + [[0.5], [0.5], [SURROUNDS]]
    places = [np.stack([breaks, shifts, np.full(count + 1, BREAKS)]), around]
    places.append(np.stack([x, y, np.full(len(x), REPEATED)]))
    corner = count + 1
    faced = [np.array([[0, 1, 2], [0, 2, 3]]) + corner, triangles + corner + SURROUND_CORNERS]
    slots = [np.full(2, SURROUND_SLOT), np.zeros(len(triangles), np.intp)]
    known = sum(part.shape[1] for part in places)
    onward, length, depth = [np.zeros(known)], [np.zeros(known)], [np.zeros(known)]
    if faces is not None:
        own = _skipping(faces, count, size, polar)
        places.append(own.places)
        onward.append(own.onward)
        length.append(own.length)
        depth.append(own.depth)
        depth[0][corner : corner + SURROUND_CORNERS] = own.depth.max(initial=0.0)
        faced.append(own.triangles + known)
        slots.append(own.slots)
    return Portals(
        np.concatenate(places, axis=1),
        np.concatenate(onward),
        np.concatenate(length),
        np.concatenate(depth),
        np.concatenate(faced).astype(np.int32),
        np.concatenate(slots).astype(np.int32),
    )


def _skipping(faces: Faces, count: int, size: tuple[int, int], polar: bool) -> Portals:
    """Sheets whose rays skip chords.

    The screen is a plane for each chord that rays go on along. A whole one is behind these, for rays that
    rounding leads between two of them.
    """
    x, y, triangles = grid(faces.cells, size, polar)
    behind = np.flatnonzero(faces.sheet == 0)
    cell, onward = (np.append(part, part[behind]) for part in (faces.cell, faces.onward))
    sheet = np.append(faces.sheet, np.full(len(behind), BEHIND))
    corners = triangles.reshape(-1, 2, 3)[cell]
    # Faces share a vertex if rays go on from it alike.
    step = ((sheet - BEHIND) * (count + 1) + onward)[:, None, None] * len(x)
    keys, numbers = np.unique(corners + step, return_inverse=True)
    own, going = np.divmod(keys // len(x), count + 1)
    own, vertex = own + BEHIND, keys % len(x)
    slots = np.where(onward == sheet, SHEET_SLOT, JUMP_SLOT)
    slots = np.where(sheet == count, FAR_SLOT, np.where(sheet <= 0, PLAIN_SLOT, slots))
    skipped = np.median(faces.lengths, axis=1)
    depth = np.where(own == 0, skipped[going], np.where(own == BEHIND, skipped.max(), 0.0))
    number = np.maximum(own, 0)
    places = np.stack([x[vertex], y[vertex], number.astype(np.float64)])
    length = faces.lengths[going, vertex] - faces.lengths[np.maximum(number - 1, 0), vertex]
    return Portals(
        places, going.astype(np.float64), length, depth, numbers.reshape(-1, 3), np.repeat(slots, 2)
    )


def whole_vertices(count: int, cells: tuple[int, int], polar: bool) -> int:
    """The number of vertices of sheets that skip no chord."""
    rows, columns = sheet_shape(cells, polar)
    return first_sheet(count) + (count + 1) * rows * columns


def first_sheet(count: int) -> int:
    """The number of vertices before those of the sheets."""
    return count + 1 + SURROUND_CORNERS


def sheet_shape(cells: tuple[int, int], polar: bool) -> tuple[int, int]:
    """Rows and columns of the vertices of a whole sheet."""
    padding = 1 if polar else 3
    return cells[1] + padding, cells[0] + padding


def grid(cells: tuple[int, int], size: tuple[int, int], polar: bool) -> tuple[Array, Array, IndexArray]:
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
    """Return whether a sheet behind the screen is a line or a point, which no ray meets.

    layers: (n+1, 3, R, C) ends of the chords of R × C projectors.
    """
    for layer in layers[1:]:
        points = layer.reshape(3, -1)
        _, breadth, _ = np.linalg.svd(points - points.mean(axis=1, keepdims=True), compute_uv=False)
        if breadth <= LINE * np.abs(layers).max():
            return True
    return False
