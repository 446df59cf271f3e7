# SPDX-License-Identifier: GPL-3.0-or-later
"""Volumes that walk round a thing: along one of its sides, round its front, and along the other side."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ..mesh import Array


def walk(
    reach: float, heights: ArrayLike, along: ArrayLike, turns: ArrayLike, *, radius: float, start: float
) -> Array:
    """Points (rows, columns, 3) of a control surface at a distance from the line at which projectors end.

    heights: (rows,) of its points. along: (columns,) places in the picture from left to right, 0 midway,
    in the widths of things. turns: (rows,) the most that projectors turn to each side, in radians. The line
    begins at y = start, above x = 0, and runs to +y.

    At distance t from the line, a step ds in the picture passes t dturn + sin(turn) dback, which is ds at t =
    radius. It is positive everywhere, so that the volume has no folds.
    """
    z, s = np.meshgrid(heights, along, indexing="ij")
    most = np.asarray(turns, float)[:, None]
    gone = np.tanh(s / (radius * most))
    turn = most * gone
    slope = gone**2 / np.where(turn == 0.0, 1.0, np.sin(turn))
    step = (slope[:, 1:] + slope[:, :-1]) / 2 * np.diff(s, axis=1)
    back = np.append(np.zeros((len(s), 1)), np.cumsum(step, axis=1), axis=1)
    back -= back[:, s.shape[1] // 2, None]
    return np.stack([reach * np.sin(turn), start + back - reach * np.cos(turn), z], axis=-1)
