# SPDX-License-Identifier: GPL-3.0-or-later
"""Control surfaces in forms that a preset file can hold: their own kind if that is exact, else a grid."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..editing.resolution import change, grid_within
from ..editing.volume_edits import sampled
from ..surfaces.surface import ControlSurface
from ..surfaces.uv_mesh import UVMesh
from ..typing import Array
from .preset import SHEAR_TOLERANCE, PresetSurface

# The largest error of a surface by its own kind, as a share of its size: float32 with room to spare.
SAME = 1e-4
# Places along an axis at which both are compared, a quarter of them.
COMPARED = 16
# UV meshes of more triangles than this become grids: their files would be megabytes.
MOST_TRIANGLES = 20_000
# The largest error of a grid, as a share of the surface's size: a tenth of a pixel of a thousand.
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

    kind, parameters, points, matrix: its description as in ``kinds.surface_from_parameters``. Without one, or
    with one that does not match (modifiers, other knots, a sheared matrix), the surface becomes a grid in
    camera space. A UV mesh described as one stays one, in camera space, with its holes. Raises UserError
    for any other surface with holes.
    """
    if kind == "UV_MESH" and isinstance(surface, UVMesh) and len(surface.chart.uv) <= MOST_TRIANGLES:
        own = np.asarray(surface.points, np.float64)
        points = own @ surface.matrix[:3, :3].T + surface.matrix[:3, 3]
        return PresetSurface(
            name=name,
            kind=kind,
            matrix=np.eye(4),
            parameters={},
            points=points,
            weight=weight,
            chart=surface.chart,
        )
    if kind and matrix is not None and _is_upright(matrix):
        described = PresetSurface(
            name=name,
            kind=kind,
            matrix=matrix,
            parameters=dict(parameters or {}),
            points=points,
            weight=weight,
        )
        try:
            same = change(surface, described.surface(), COMPARED, COMPARED) <= SAME
        except ValueError:
            same = False
        if same:
            return described
    columns, rows = grid_within(surface, GRID_ERROR)
    points = sampled(surface, columns + 1, rows + 1)
    return PresetSurface(
        name=name, kind="GRID", matrix=np.eye(4), parameters={}, points=points, weight=weight
    )


def _is_upright(matrix: Array) -> bool:
    """Return whether a matrix is free of shear, which files cannot hold."""
    linear = matrix[:3, :3]
    axes = linear / np.sqrt((linear**2).sum(axis=0))
    return bool(np.abs(axes.T @ axes - np.eye(3)).max() <= SHEAR_TOLERANCE)
