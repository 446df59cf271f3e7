# SPDX-License-Identifier: GPL-3.0-or-later
"""Any UV-mapped triangle mesh as a control surface: Q(u, v) is its point at UV (u, v)."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ..typing import Array, IndexArray
from .surface import ControlSurface, SurfacePositions, SurfaceSample
from .uv_chart import CoveringTriangles, UVChart


@dataclass(frozen=True, eq=False)
class UVMesh(ControlSurface):
    """A mesh of triangles, each the affine image of its place in the UV square.

    points: (V, 3) the vertices, own space. chart: the triangles and their UVs.
    Islands of the UV map are the tiles; they need not meet. Where nothing is
    mapped the surface has a hole: valid is False, the derivatives are 0 and the
    position is the middle of the vertices. Where triangles overlap, and on a
    common edge, the one with the lowest number counts, with its derivatives.
    ``transformed`` shares the chart and its look-up.
    Raises ValueError for points of another shape, or too few of them.
    """

    points: Array = field(default_factory=lambda: np.array([[-0.5, -0.5, 0], [0.5, -0.5, 0], [-0.5, 0.5, 0]]))
    chart: UVChart = field(
        default_factory=lambda: UVChart(np.array([[[0.0, 0], [1, 0], [0, 1]]]), np.array([[0, 1, 2]]))
    )

    def __post_init__(self) -> None:
        shape = np.shape(self.points)
        if len(shape) != 2 or shape[1] != 3 or shape[0] == 0:
            raise ValueError(f"the vertices of a UV mesh need the shape (V, 3), got {shape}")
        corners = self.chart.vertices
        if corners.size and not 0 <= corners.min() <= corners.max() < shape[0]:
            raise ValueError(f"the triangles of a UV mesh name vertices beyond its {shape[0]}")

    @cached_property
    def _frames(self) -> Array:
        """First corner and edges to the second and third corner of each triangle, (3, 3, T)."""
        corners = np.asarray(self.points, np.float64)[self.chart.vertices]
        origin = corners[:, 0]
        return np.ascontiguousarray(
            np.stack([origin, corners[:, 1] - origin, corners[:, 2] - origin]).transpose(0, 2, 1)
        )

    @cached_property
    def _derivatives(self) -> Array:
        """Pu and Pv of each triangle, (2, 3, T)."""
        _, second, third = self._frames
        by_second, by_third = self.chart.slopes
        result: Array = by_second[:, None] * second + by_third[:, None] * third
        return result

    def _placed_at(self, found: CoveringTriangles) -> SurfacePositions:
        valid = found.triangle >= 0
        origin, second, third = (edge.take(found.triangle, 1, mode="clip") for edge in self._frames)
        position = origin + found.weights[0] * second + found.weights[1] * third
        if not valid.all():
            position[:, ~valid] = np.mean(self.points, axis=0)[:, None]
        return SurfacePositions(position, valid)

    def local_hull(self) -> Array:
        return np.asarray(self.points, np.float64).T

    def local_position(self, u: Array, v: Array) -> SurfacePositions:
        return self._placed_at(self.chart.find(u, v))

    def local(self, u: Array, v: Array) -> SurfaceSample:
        found = self.chart.find(u, v)
        position, valid = self._placed_at(found)
        du, dv = (slope.take(found.triangle, 1, mode="clip") * valid for slope in self._derivatives)
        tile: IndexArray = np.where(valid, self.chart.islands.take(found.triangle, mode="clip"), 0)
        return SurfaceSample(position, du, dv, tile.astype(np.int32), valid)
