# SPDX-License-Identifier: GPL-3.0-or-later
"""A control surface as a preset file can hold it: as what it is if that is the same, else as a grid."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from .editing import sampled
from .preset import SHEAR_TOLERANCE, PresetSurface
from .resolution import change, grid_within
from .surfaces import ControlSurface
from .typing import Array

# A description that is off by more than this share of the surface's size is none: float32 with room to spare.
SAME = 1e-4
# Places along an axis at which both are compared, a quarter of them.
COMPARED = 16
# A grid is off by no more than this share of the surface's size: a tenth of a pixel of a thousand.
GRID_ERROR = 1e-4


def stored_surface(
    name: str,
    surface: ControlSurface,
    weight: float = 1.0,
    kind: str = "",
    parameters: Mapping[str, float] | None = None,
    points: Array | None = None,
    matrix: Array | None = None,
) -> PresetSurface:
    """A surface in camera space as a preset's.

    kind, parameters, points, matrix: what it is said to be, as in ``preset.surface_from_parameters``. Where
    that is not so (modifiers, other knots, a sheared matrix), or nothing is said, it becomes a
    grid in camera space. Raises EditingError for a surface with holes.
    """
    if kind and matrix is not None and _is_upright(matrix):
        described = PresetSurface(name, kind, matrix, dict(parameters or {}), points, weight)
        try:
            same = change(surface, described.surface(), COMPARED, COMPARED) <= SAME
        except ValueError:
            same = False
        if same:
            return described
    columns, rows = grid_within(surface, GRID_ERROR)
    return PresetSurface(name, "GRID", np.eye(4), {}, sampled(surface, columns + 1, rows + 1), weight)


def _is_upright(matrix: Array) -> bool:
    """Whether a matrix has no shear, for which files have no place."""
    linear = matrix[:3, :3]
    axes = linear / np.sqrt((linear**2).sum(axis=0))
    return bool(np.abs(axes.T @ axes - np.eye(3)).max() <= SHEAR_TOLERANCE)
