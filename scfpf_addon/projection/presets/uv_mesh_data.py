# SPDX-License-Identifier: GPL-3.0-or-later
"""UV meshes in preset files: points, a place in the UV square for each, and triangles of them."""

from __future__ import annotations

import numpy as np

from ..file_limits import MAXIMUM_AT_VERTEX, MAXIMUM_OVERLAPS, PresetError, check_numbers
from ..file_values import COORDINATE, Limit, read_numbers
from ..surfaces.uv_chart import UVChart
from ..typing import Array, IndexArray

# The limits of UVs: those outside of the unit square are kept, but show nothing.
_UV = Limit(-1000.0, 1000.0)


def read_mesh(values: dict[str, object], where: str) -> tuple[Array, UVChart]:
    """The points (V, 3) and the chart of a surface's "points", "uv" and "triangles", checked.

    Raises PresetError, which says what is wrong.
    """
    points = _rows(values["points"], f"{where}: points", 3, COORDINATE)
    uv = _rows(values["uv"], f"{where}: uv", 2, _UV)
    if len(uv) != len(points):
        raise PresetError("{0}: uv must be as many as the points, {1}, not {2}", where, len(points), len(uv))
    last = len(points) - 1
    corners = _rows(values["triangles"], f"{where}: triangles", 3, Limit(0, last))
    triangles: IndexArray = corners.astype(np.int64)
    if (triangles != corners).any():
        raise PresetError("{0}: triangles must be whole numbers from 0 to {1}", where, last)
    chart = UVChart(uv[triangles], triangles)
    if not chart.used.any():
        raise PresetError("{0}: no triangle has an area in the UV square from 0 to 1", where)
    _check_work(triangles, chart, where)
    return points, chart


def _check_work(triangles: IndexArray, chart: UVChart, where: str) -> None:
    """Raise PresetError for a mesh that would take too long to look up in, or Blender to show."""
    most = int(np.bincount(triangles.ravel()).max())
    if most > MAXIMUM_AT_VERTEX:
        raise PresetError(
            "{0}: {1} triangles meet at one point, at most {2} are allowed", where, most, MAXIMUM_AT_VERTEX
        )
    # The mean first: of triangles that lie on one another in great numbers no bins are made.
    if chart.mean_overlaps > MAXIMUM_OVERLAPS or chart.most_overlaps > MAXIMUM_OVERLAPS:
        raise PresetError(
            "{0}: too many triangles overlap in the UV square, at most {1} may lie in one place",
            where,
            MAXIMUM_OVERLAPS,
        )


def mesh_data(points: Array, chart: UVChart) -> dict[str, object]:
    """A UV mesh as a file has it; a point with several UVs stands there several times."""
    corners = np.concatenate([chart.vertices.reshape(-1, 1), chart.uv.reshape(-1, 2)], axis=1)
    own, number = np.unique(corners, axis=0, return_inverse=True)
    vertices = own[:, 0].astype(np.int64)
    return {
        "points": np.asarray(points, np.float64)[vertices].tolist(),
        "uv": own[:, 1:].tolist(),
        "triangles": number.reshape(-1, 3).tolist(),
    }


def _rows(value: object, where: str, width: int, limit: Limit) -> Array:
    """Rows of ``width`` numbers each within the limit, (N, width) float64."""
    form = PresetError("{0} must be a list of rows of {1} numbers", where, width)
    if not isinstance(value, list) or not value or set(map(type, value)) != {list}:
        raise form
    check_numbers(width * len(value))
    if set(map(len, value)) != {width}:
        raise form
    return read_numbers(value, where, limit)
