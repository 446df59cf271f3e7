# SPDX-License-Identifier: GPL-3.0-or-later
"""Any mesh with a UV map as a control surface: Q(u, v) is the evaluated mesh's point at UV (u, v)."""

from __future__ import annotations

import numpy as np

from ...projection.file_values import LARGEST_LENGTH
from ...projection.surfaces.surface import ControlSurface, Grid
from ...projection.surfaces.uv_chart import UVChart
from ...projection.surfaces.uv_mesh import UVMesh
from ...projection.user_error import UserError
from ..blender.mesh_grid import UV_LAYER, grid_points, require_finite, uv_layer


def read_uv_mesh(evaluated_object, matrix) -> UVMesh:
    """The evaluated mesh in the triangles that Blender draws it with, by the UV map that it renders with.

    matrix: (4, 4), own space to volume space. Raises UserError when there is
    no face, no UV map, or no face inside of the UV square.
    """
    name = evaluated_object.name
    mesh = evaluated_object.to_mesh()
    try:
        points, triangles, uv = _arrays(name, mesh)
    finally:
        evaluated_object.to_mesh_clear()
    require_finite(name, points)
    if not np.isfinite(uv).all():
        raise UserError("The UV map of '{0}' is not finite: unwrap it again (U in Edit Mode)", name)
    chart = UVChart(uv, triangles)
    if not chart.used.any():
        raise UserError(
            "No face of '{0}' has an area in the UV square from 0 to 1: unwrap it (U in Edit "
            "Mode) and place its islands inside the square",
            name,
        )
    return UVMesh(points, chart, matrix=matrix)


def _arrays(name: str, mesh):
    """Vertices (V, 3) float64, triangles (T, 3) of them, and the UVs of their corners (T, 3, 2) float64."""
    if not mesh.polygons:
        raise UserError("'{0}' has no faces: a UV mesh surface needs some", name)
    layer = uv_layer(mesh)
    if layer is None:
        raise UserError("'{0}' has no UV map: unwrap it (U in Edit Mode)", name)
    mesh.calc_loop_triangles()
    points = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", points)
    triangles, corners = np.empty((2, 3 * len(mesh.loop_triangles)), np.int32)
    mesh.loop_triangles.foreach_get("vertices", triangles)
    mesh.loop_triangles.foreach_get("loops", corners)
    uv = np.empty(2 * len(mesh.loops), np.float32)
    layer.uv.foreach_get("vector", uv)
    return (
        points.reshape(-1, 3).astype(np.float64),
        triangles.reshape(-1, 3),
        uv.reshape(-1, 2).astype(np.float64)[corners].reshape(-1, 3, 2),
    )


def write_uv_mesh(mesh, sheet: UVMesh) -> None:
    """Replace a mesh by a UV mesh's triangles, in its own space. Raises UserError if too large."""
    if not (np.abs(sheet.points) <= LARGEST_LENGTH).all():
        raise UserError("A UV mesh's points must be numbers up to {0:g}", LARGEST_LENGTH)
    corners = np.ascontiguousarray(sheet.chart.vertices, np.int32).ravel()
    mesh.clear_geometry()
    mesh.vertices.add(len(sheet.points))
    mesh.vertices.foreach_set("co", np.asarray(sheet.points, np.float32).ravel())
    mesh.loops.add(len(corners))
    mesh.loops.foreach_set("vertex_index", corners)
    mesh.polygons.add(len(corners) // 3)
    mesh.polygons.foreach_set("loop_start", np.arange(0, len(corners), 3, dtype=np.int32))
    mesh.update(calc_edges=True)
    layer = mesh.uv_layers.get(UV_LAYER) or mesh.uv_layers.new(name=UV_LAYER)
    layer.uv.foreach_set("vector", np.asarray(sheet.chart.uv, np.float32).ravel())


def read_reshaped(evaluated_object, matrix) -> ControlSurface:
    """A parametric surface that further modifiers act on: a grid while they leave it one, else a UV mesh.

    Raises UserError as ``read_uv_mesh`` does.
    """
    points = _grid_or_none(evaluated_object)
    if points is None:
        return read_uv_mesh(evaluated_object, matrix)
    require_finite(evaluated_object.name, points)
    return Grid(points, matrix=matrix)


def mesh_kind(surface) -> str:
    """The kind that a mesh object without one looks like: PATCH, GRID or UV_MESH.

    GRID too without a UV map of its own: a modifier may add it.
    """
    if surface.mode == "EDIT":
        surface.update_from_editmode()
    if not surface.data.uv_layers:
        return "GRID"
    points = _grid_or_none(surface)
    if points is None:
        return "UV_MESH"
    return "PATCH" if points.shape[:2] == (2, 2) else "GRID"


def _grid_or_none(surface):
    """``grid_points`` of an object, evaluated or not; None where the mesh is no regular grid."""
    try:
        return grid_points(surface)
    except UserError:
        return None
