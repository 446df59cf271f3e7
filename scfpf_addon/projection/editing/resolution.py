# SPDX-License-Identifier: GPL-3.0-or-later
"""The number of points that a surface needs as a grid or a patch, so that the image stays the same."""

from __future__ import annotations

import numpy as np

from ..surfaces.nurbs import NurbsPatch
from ..surfaces.surface import ControlSurface, Grid
from .nurbs_edits import CUBIC, patch_near
from .volume_edits import lattice, sampled

# Faces of a grid along an axis: at least enough to be edited, at most a number that is handy.
LEAST_FACES, MOST_FACES = 8, 512
# The most control points of a patch along an axis.
MOST_POINTS = 64
# The factor by which points are added along the direction that lacks them.
GROWTH = 1.35
# Lines of constant u, and of v, along which a grid's chords are measured: in the middle between faces too.
LINES = 33


def change(before: ControlSurface, after: ControlSurface, columns: int, rows: int) -> float:
    """The greatest distance between two surfaces at equal (u, v), as a share of the size of the first.

    columns, rows: pieces of the second, each looked at in four places along an axis.
    """
    u, v = lattice(4 * columns + 1, 4 * rows + 1)
    exact, now = before.evaluate(u, v).position, after.evaluate(u, v).position
    size = float(np.ptp(exact, axis=1).max())
    return float(np.linalg.norm(now - exact, axis=0).max()) / size if size > 0 else 0.0


def patch_within(surface: ControlSurface, share: float) -> NurbsPatch:
    """The ``patch_near`` with about the fewest points whose error is at most a share of the size.

    With MOST_POINTS along both axes the error may be larger. Raises UserError for a surface with holes.
    """
    counts = (CUBIC, CUBIC)
    best, off = _patch(surface, counts)
    while off > share and not isinstance(surface, Grid):
        tried = []
        for finer in {(_more(counts[0], MOST_POINTS), counts[1]), (counts[0], _more(counts[1], MOST_POINTS))}:
            if finer != counts:
                tried.append((finer, *_patch(surface, finer)))
        if not tried:
            break
        counts, best, off = min(tried, key=lambda one: (one[2], one[0]))
    return best


def _patch(surface: ControlSurface, counts: tuple[int, int]) -> tuple[NurbsPatch, float]:
    patch = patch_near(surface, *counts)
    return patch, change(surface, patch, *counts)


def _more(count: int, most: int) -> int:
    return min(max(count + 1, round(count * GROWTH)), most)


def grid_within(surface: ControlSurface, share: float) -> tuple[int, int]:
    """Faces along u and along v, up to MOST_FACES, of a grid with an error of about a share of the size.

    Raises UserError for a surface with holes.
    """
    error = share * float(np.ptp(sampled(surface, LINES, LINES).reshape(-1, 3), axis=0).max())
    # The two directions' errors add up; one may use what the other leaves.
    rows, off = _faces(surface, 1, error / 2)
    columns, _ = _faces(surface, 0, max(error - off, error / 2))
    return columns, rows


def _faces(surface: ControlSurface, axis: int, error: float) -> tuple[int, float]:
    """About the fewest faces along u (0) or v (1) whose chords leave the surface by at most an error.

    Also returns the largest distance of the chords from the surface.
    """
    count = LEAST_FACES
    while True:
        along = 2 * count + 1
        points = sampled(surface, along, LINES) if axis == 0 else sampled(surface, LINES, along)
        line = points.swapaxes(0, 1) if axis == 0 else points
        off = float(np.linalg.norm(line[1::2] - (line[:-1:2] + line[2::2]) / 2, axis=2).max())
        if off <= error or count == MOST_FACES:
            return count, off
        count = _more(count, MOST_FACES)
