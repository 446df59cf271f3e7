# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes as regular grids of points: written with a UV map, and read in its order."""

from __future__ import annotations

import numpy as np

from ...projection.file_values import LARGEST_LENGTH
from ...projection.user_error import UserError

UV_LAYER = "UVMap"
# Vertices whose UVs differ by less share a grid line: float32 UVs of a line agree to about 1e-7, and no
# sensible grid has 10,000 lines.
UV_LINE_GAP = 1e-4
# The largest distance of a vertex from its place in the UV map, as a share of one cell: enough for float32
# and for subdivided UVs, far below a visible shift.
UV_CELL_TOLERANCE = 1e-2


def checked_grid(points) -> np.ndarray:
    """The points (rows, columns, 3) of a grid as float64, or a UserError if no mesh can hold them."""
    points = np.asarray(points, np.float64)
    if points.ndim != 3 or points.shape[2] != 3 or min(points.shape[:2]) < 2:
        raise UserError("A grid needs rows × columns × 3 numbers, at least 2 × 2, got {0}", points.shape)
    if not (np.abs(points) <= LARGEST_LENGTH).all():
        raise UserError("A grid's points must be numbers up to {0:g}", LARGEST_LENGTH)
    return points


def write_grid(mesh, points) -> None:
    """Replace a mesh by a grid of quadrilaterals with its UV map. points: see ``checked_grid``."""
    points = checked_grid(points)
    rows, columns = points.shape[:2]
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    corners = np.stack([first, first + 1, first + columns + 1, first + columns], 1).ravel()
    mesh.clear_geometry()
    mesh.vertices.add(rows * columns)
    mesh.vertices.foreach_set("co", points.astype(np.float32).ravel())
    mesh.loops.add(len(corners))
    mesh.loops.foreach_set("vertex_index", corners.astype(np.int32))
    mesh.polygons.add(len(first))
    mesh.polygons.foreach_set("loop_start", np.arange(0, len(corners), 4, dtype=np.int32))
    mesh.update(calc_edges=True)
    layer = mesh.uv_layers.get(UV_LAYER) or mesh.uv_layers.new(name=UV_LAYER)
    uv = np.stack([corners % columns / (columns - 1), corners // columns / (rows - 1)], 1)
    layer.uv.foreach_set("vector", uv.astype(np.float32).ravel())


def grid_points(evaluated_object):
    """The vertices of an evaluated mesh in the order of its UV map, (rows, columns, 3) float64, own space.

    Raises UserError unless they are a regular grid that fills the UV square.
    """
    name = evaluated_object.name
    mesh = evaluated_object.to_mesh()
    try:
        layer = uv_layer(mesh)
        if not mesh.vertices or layer is None:
            raise UserError("'{0}' has no vertices with a UV map: a grid surface needs both", name)
        points = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", points)
        corners = np.empty(len(mesh.loops), np.int32)
        mesh.loops.foreach_get("vertex_index", corners)
        uv = np.empty(2 * len(corners), np.float32)
        layer.uv.foreach_get("vector", uv)
    finally:
        evaluated_object.to_mesh_clear()
    points = points.reshape(-1, 3).astype(np.float64)
    return points[_grid_order(name, len(points), corners, uv.reshape(-1, 2).astype(np.float64))]


def require_finite(name: str, points) -> None:
    """Raise UserError if vertices, an array of any shape, are NaN, infinite or too far away."""
    if not (np.abs(points) <= LARGEST_LENGTH).all():
        raise UserError(
            "'{0}' has vertices that are not finite or farther out than {1:g}: look for the "
            "modifier or shape key that moves them there",
            name,
            LARGEST_LENGTH,
        )


def uv_layer(mesh):
    """The UV map that a mesh renders with, or None.

    Geometry Nodes may leave no map switched on: then the first one counts. In 4.5 ``uv_layers.active`` is an
    unnamed attribute then.
    """
    shown = next((layer for layer in mesh.uv_layers if layer.active_render), None)
    return shown or next(iter(mesh.uv_layers), None)


def _grid_order(name: str, count: int, corners, uv):
    """Vertex indices (rows, columns) of a regular UV grid. corners: (C,) vertices; uv: (C, 2)."""
    of_vertex = np.full((count, 2), np.nan)
    of_vertex[corners] = uv
    if not np.isfinite(of_vertex).all():
        raise UserError("'{0}' has loose vertices or broken UVs: every vertex must belong to a face", name)
    if np.abs(of_vertex[corners] - uv).max() > UV_LINE_GAP:
        raise UserError(
            "'{0}' has a seam in its UV map: a grid surface needs one UV for each vertex; or "
            "make it a UV Mesh",
            name,
        )
    columns, rows = (int((np.diff(np.sort(axis)) > UV_LINE_GAP).sum()) + 1 for axis in of_vertex.T)
    if min(rows, columns) < 2 or rows * columns != count:
        raise UserError(
            "'{0}' is not a regular grid: its UV map has {1} × {2} places for {3} vertices; "
            "make it a UV Mesh",
            name,
            columns,
            rows,
            count,
        )
    place = of_vertex * (columns - 1, rows - 1)
    nearest = np.rint(place)
    index = (nearest[:, 1] * columns + nearest[:, 0]).astype(np.int64)
    even = np.abs(place - nearest).max() < UV_CELL_TOLERANCE
    if not even or not np.array_equal(np.sort(index), np.arange(count)):
        raise UserError(
            "'{0}' is not evenly spaced in its UV map from 0 to 1: unwrap it as a regular "
            "grid, or make it a UV Mesh",
            name,
        )
    return np.argsort(index).reshape(rows, columns)
