# SPDX-License-Identifier: GPL-3.0-or-later
"""Boxes that certainly hold the parts of a control surface between lines of its parameters."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..typing import Array, IndexArray
from .surface import ControlSurface


class Boxes(NamedTuple):
    """Boxes of the cells between lines of parameters. lower, upper: (3, rows, columns), volume space."""

    lower: Array
    upper: Array


def boxes_of_cells(surface: ControlSurface, u: Array, v: Array) -> Boxes | None:
    """The boxes of a surface between neighbouring u (columns + 1,) and v (rows + 1,), increasing in [0, 1].

    None if the surface does not know its ``bends``. Between the lines and its creases it strays from the
    bilinear patch through four corners by at most an eighth of the squared widths times these: the error of
    linear interpolation, along u and then along v. Rounding is left to the caller.
    """
    bends = surface.bends
    if bends is None:
        return None
    lines = [
        np.union1d(edges, creases[(creases > edges[0]) & (creases < edges[-1])])
        for edges, creases in zip((u, v), surface.creases, strict=True)
    ]
    across, up = np.meshgrid(*lines)
    position = surface.positions(across.ravel(), up.ravel()).position.reshape(3, *across.shape)
    margin = (np.diff(u).max() ** 2 * bends[0] + np.diff(v).max() ** 2 * bends[1]) / 8.0
    reach = np.linalg.norm(surface.matrix[:3, :3], axis=1)[:, None, None] * margin
    columns, rows = (_windows(line, edges) for line, edges in zip(lines, (u, v), strict=True))
    lower, upper = (
        f.reduceat(f.reduceat(position, rows, axis=1)[:, ::2], columns, axis=2)[..., ::2]
        for f in (np.minimum, np.maximum)
    )
    return Boxes(lower - reach, upper + reach)


def _windows(line: Array, edges: Array) -> IndexArray:
    """Indices for reduceat: of each cell the first place in ``line``, and the one after its last."""
    ends = np.stack([np.searchsorted(line, edges[:-1]), np.searchsorted(line, edges[1:]) + 1], axis=1)
    # The last cell reaches to the end.
    windows: IndexArray = ends.ravel()[:-1]
    return windows
