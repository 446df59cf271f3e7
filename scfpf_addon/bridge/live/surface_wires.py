# SPDX-License-Identifier: GPL-3.0-or-later
"""Wires and vertices of the control surfaces that are selected or edited, drawn over a live image."""

from __future__ import annotations

from typing import NamedTuple

import bmesh
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from numpy.typing import NDArray

from ..scene.mesh_arrays import foreach
from ..volume.camera_members import surfaces_of

LINE_SHADER, POINT_SHADER = "POLYLINE_UNIFORM_COLOR", "POINT_UNIFORM_COLOR"
LINE_WIDTH = 1.0


class Wires(NamedTuple):
    """Lines (S, 2, 3) and points (P, 3) of a surface in world space, float32, and which are selected.

    is_edited: whether it is in Edit Mode, where vertices are shown.
    """

    lines: NDArray[np.float32]
    chosen_lines: NDArray[np.bool_]
    points: NDArray[np.float32]
    chosen: NDArray[np.bool_]
    is_edited: bool


def read_wires(surface, depsgraph) -> Wires:
    """Read the wires of a control surface as a viewport shows them."""
    matrix = np.array(surface.evaluated_get(depsgraph).matrix_world, np.float64)
    if surface.mode == "EDIT":
        points, edges, chosen = _edited(surface)
    else:
        points, edges = _evaluated(surface.evaluated_get(depsgraph))
        chosen = np.zeros(len(points), bool)
    placed = (points @ matrix[:3, :3].T + matrix[:3, 3]).astype(np.float32)
    lines = placed[edges].reshape(-1, 2, 3)
    return Wires(lines, chosen[edges].all(axis=1), placed, chosen, surface.mode == "EDIT")


def _edited(surface) -> tuple[NDArray, NDArray, NDArray]:
    """Points (P, 3), edges (E, 2) and selection (P,) of a surface in Edit Mode."""
    if surface.type == "MESH":
        mesh = bmesh.from_edit_mesh(surface.data)
        mesh.verts.index_update()
        points = np.array([vertex.co for vertex in mesh.verts], np.float64).reshape(-1, 3)
        chosen = np.array([vertex.select for vertex in mesh.verts], bool)
        edges = [[vertex.index for vertex in edge.verts] for edge in mesh.edges if not edge.hide]
        return points, np.array(edges, np.intp).reshape(-1, 2), chosen
    if surface.type == "LATTICE":
        data, sizes = surface.data, (surface.data.points_w, surface.data.points_v, surface.data.points_u)
        points, chosen = foreach(data.points, "co_deform", 3), foreach(data.points, "select", dtype=bool)
        return points, _grid_edges(sizes), chosen
    spline = surface.data.splines[0]
    points = foreach(spline.points, "co", 4)[:, :3]
    chosen = foreach(spline.points, "select", dtype=bool)
    return points, _grid_edges((spline.point_count_v, spline.point_count_u)), chosen


def _grid_edges(sizes: tuple[int, ...]) -> NDArray[np.intp]:
    """The edges (E, 2) between neighbours of a grid of points, the last axis varying fastest."""
    numbers = np.arange(np.prod(sizes)).reshape(sizes)
    pairs = []
    for axis in range(len(sizes)):
        turned = np.moveaxis(numbers, axis, 0)
        pairs.append(np.stack([turned[:-1].ravel(), turned[1:].ravel()], axis=1))
    return np.concatenate(pairs)


def _evaluated(surface) -> tuple[NDArray, NDArray]:
    """Points (P, 3) and edges (E, 2) of an evaluated surface."""
    if surface.type == "LATTICE":
        data = surface.data
        return foreach(data.points, "co_deform", 3), _grid_edges(
            (data.points_w, data.points_v, data.points_u)
        )
    mesh = surface.to_mesh()
    try:
        edges = foreach(mesh.edges, "vertices", 2, np.int32)
        return foreach(mesh.vertices, "co", 3), edges.reshape(-1, 2)
    finally:
        surface.to_mesh_clear()


def draw_wires(camera, depsgraph, space, theme, scale: float) -> None:
    """Draw the wires of a camera's selected and edited surfaces that a viewport shows, in front of all.

    theme: bpy.types.Theme. scale: factor of line widths, which are in pixels.
    """
    if not space.overlay.show_overlays:
        return
    colors = theme.view_3d
    for surface in dict.fromkeys(surfaces_of(camera)):
        is_edited = surface.mode == "EDIT"
        if not (is_edited or surface.select_get()) or not surface.visible_get(viewport=space):
            continue
        wires = read_wires(surface, depsgraph)
        plain = (*colors.wire_edit, 1.0) if is_edited else (*colors.object_selected, 1.0)
        chosen = wires.chosen_lines
        _draw_lines(wires.lines[~chosen], plain, scale)
        _draw_lines(wires.lines[chosen], (*colors.edge_select, 1.0), scale)
        if is_edited:
            size = (colors.vertex_size + 2) * scale
            _draw_points(wires.points[~wires.chosen], (*colors.vertex, 1.0), size)
            _draw_points(wires.points[wires.chosen], (*colors.vertex_select, 1.0), size)


def _draw_lines(lines: NDArray, color: tuple[float, ...], scale: float) -> None:
    if len(lines):
        shader = gpu.shader.from_builtin(LINE_SHADER)
        shader.bind()
        shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
        shader.uniform_float("lineWidth", LINE_WIDTH * scale)
        shader.uniform_float("color", color)
        batch_for_shader(shader, "LINES", {"pos": lines.reshape(-1, 3)}).draw(shader)


def _draw_points(points: NDArray, color: tuple[float, ...], size: float) -> None:
    if len(points):
        gpu.state.point_size_set(size)
        shader = gpu.shader.from_builtin(POINT_SHADER)
        shader.bind()
        shader.uniform_float("color", color)
        batch_for_shader(shader, "POINTS", {"pos": points}).draw(shader)
