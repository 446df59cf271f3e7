# SPDX-License-Identifier: GPL-3.0-or-later
"""The triangles of a scene, as the reader hands them over."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..projection.typing import Array


@dataclass(frozen=True)
class Geometry:
    """A triangle soup with shared vertices.

    vertices: (V, 3) float64, world space. triangles: (T, 3) int32.
    corner_normals: (T, 3, 3) float32, unit, world space: the shading normal at
    each corner. material, object_index: (T,) int32. object_names: one name an index.
    uv: (T, 3, 2) float32, texture coordinates of the corners, NaN where a mesh has none;
    None where they were not asked for.
    """

    vertices: Array
    triangles: NDArray[np.int32]
    corner_normals: NDArray[np.float32]
    material: NDArray[np.int32]
    object_index: NDArray[np.int32]
    object_names: tuple[str, ...] = ()
    uv: NDArray[np.float32] | None = None
