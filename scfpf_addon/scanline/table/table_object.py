# SPDX-License-Identifier: GPL-3.0-or-later
"""The object that holds a camera's table: its modifier takes the surfaces, drivers the camera's settings."""

from __future__ import annotations

import bpy

from ...bridge.blender.drivers import follow_property
from ...bridge.blender.mesh_grid import UV_LAYER, grid_points, uv_layer
from ...bridge.blender.modifier_inputs import input_property, renew_relations, set_inputs
from ...projection.surfaces.kinds import PARAMETRIC_KINDS, SURFACE_KINDS
from ...projection.user_error import UserError
from ...projection.volume.basis import WEIGHTED
from .mapping_table import store_parameters
from .table_nodes import table_group

# The camera's custom property that points to its table.
TABLE_KEY = "scfpf_table"
MODIFIER = "SCFPF Table"
# Cells of the table across and up for curved surfaces; for flat ones a single cell is exact.
CURVED_CELLS = (256, 128)
# The table's cells for a mesh are a multiple of the mesh' own, at most this many.
MOST_CELLS = 512


# Inputs of the modifier that follow a property of the camera.
_FOLLOWED = {
    "U Start": "u_range[0]",
    "U End": "u_range[1]",
    "V Start": "v_range[0]",
    "V End": "v_range[1]",
    "Polar": "reparameterisation",
}


def table_object(camera, key=TABLE_KEY, label="Table", scene=None, with_inverse=True):
    """Return the camera's table of projectors, a child of the camera, made or brought up to date.

    key: the camera's custom property that points to it. label: the end of its name. scene: the scene whose
    image it is for, None for the context's; only image mappings depend on it. with_inverse: False for
    projectors alone, without first guesses of the inverse.
    Call it when the list of surfaces, a kind, a weight, the basis, the re-parameterisation or
    ``mapping_table.image_signature`` has changed. The table follows shapes, transforms and animation by
    itself, without Python. It is linked to no collection: the modifier that reads it keeps it evaluated.
    """
    table = _own_table(camera, key, label)
    settings = camera.scfpf
    surfaces = [slot.object for slot in settings.surfaces]
    group = table_group_of(camera, with_inverse)
    modifier = table.modifiers.get(MODIFIER) or table.modifiers.new(MODIFIER, "NODES")
    modifier.show_viewport = modifier.show_render = True
    if modifier.node_group != group:
        table.animation_data_clear()  # drivers of another group's inputs
        modifier.node_group = group
    columns, rows = _cells(settings, surfaces)
    values = {"Columns": columns, "Rows": rows}
    values |= store_parameters(table, camera, scene or bpy.context.scene, (columns - 1, rows - 1))
    for number, surface in enumerate(surfaces, 1):
        values[f"Surface {number}"] = surface
        values[f"UV Map {number}"] = _uv_map(surface)
        values[f"Net {number}"] = _net(surface)
    set_inputs(modifier, values)
    for title, path in _FOLLOWED.items():
        follow_property(*input_property(modifier, title), camera, f"scfpf.{path}")
    renew_relations(modifier)
    table.update_tag()
    return table


def _own_table(camera, key: str, label: str):
    table = camera.get(key)
    if not isinstance(table, bpy.types.Object) or _is_of_another(table, camera, key):
        name = f"{camera.name} {label}"
        table = bpy.data.objects.new(name, bpy.data.meshes.new(name))
        table.hide_select = table.hide_render = True
        camera[key] = table
    if table.parent != camera:
        table.parent = camera
    return table


def table_group_of(camera, with_inverse=True):
    """Return the node group that computes a camera's table. with_inverse: as for ``table_object``."""
    settings = camera.scfpf
    weights = tuple(slot.weight for slot in settings.surfaces) if settings.basis in WEIGHTED else None
    return table_group(settings.basis, len(settings.surfaces), weights, with_inverse)


def _is_of_another(table, camera, key: str) -> bool:
    """Return whether a table belongs to another camera, of which this one is a duplicate."""
    parent = table.parent
    return parent is not None and parent != camera and parent.get(key) == table


def release_pointers(table) -> None:
    """Clear all pointers of a table to other data, as is necessary before undo and redo.

    Handlers change tables after a step was stored. If two steps agree on an object, Blender keeps it in
    memory as it is, and the data that it points to may be freed. ``table_object`` sets the pointers again.
    """
    table.animation_data_clear()
    modifier = table.modifiers.get(MODIFIER)
    if modifier is not None:
        table.modifiers.remove(modifier)


def is_made(table) -> bool:
    """Return whether a table has its node group; none between ``release_pointers`` and ``table_object``."""
    modifier = table.modifiers.get(MODIFIER)
    return modifier is not None and modifier.node_group is not None


def _uv_map(surface) -> str:
    layer = uv_layer(surface.data) if surface is not None and surface.type == "MESH" else None
    return layer.name if layer else UV_LAYER


def _net(surface) -> tuple[float, float, float]:
    """The numbers of points that Blender draws of a surface patch along u and v, and how it is closed.

    1 stands for closed along u, 2 for closed along v, 3 for both.
    """
    if surface is None or surface.type != "SURFACE" or len(surface.data.splines) != 1:
        return 0.0, 0.0, 0.0
    spline = surface.data.splines[0]
    return (
        float(spline.point_count_u * spline.resolution_u),
        float(spline.point_count_v * spline.resolution_v),
        float(spline.use_cyclic_u + 2 * spline.use_cyclic_v),
    )


def _cells(settings, surfaces) -> tuple[int, int]:
    """Columns and rows of the table: exact for flat surfaces and whole grids, fine for curved ones."""
    whole = settings.reparameterisation == "RECTANGLE" and all(
        tuple(span) == (0.0, 1.0) for span in (settings.u_range, settings.v_range)
    )
    cells = [1, 1]
    for surface in surfaces:
        own = _own_cells(surface)
        for axis in range(2):
            larger, smaller = max(cells[axis], own[axis]), min(cells[axis], own[axis])
            # Grid lines of both lie on the table's lines if one is a multiple of the other.
            cells[axis] = larger if larger % smaller == 0 else _multiple(larger, smaller)
    if not whole:
        cells = [max(count, least) for count, least in zip(cells, CURVED_CELLS, strict=True)]
    return cells[0] + 1, cells[1] + 1


def _multiple(larger: int, smaller: int) -> int:
    """A common multiple of two numbers of cells, or ``MOST_CELLS`` if none is small enough."""
    for factor in range(2, MOST_CELLS // larger + 1):
        if larger * factor % smaller == 0:
            return larger * factor
    return MOST_CELLS


def _own_cells(surface) -> tuple[int, int]:
    if surface is None:
        return 1, 1
    kind = surface.scfpf_surface.kind
    if kind in PARAMETRIC_KINDS and kind != "POINT" and len(surface.modifiers) > 1:
        return CURVED_CELLS  # reshaped by other modifiers
    if kind == "GRID":
        try:
            points = grid_points(surface)
        except UserError:
            return CURVED_CELLS
        return points.shape[1] - 1, points.shape[0] - 1
    straight = SURFACE_KINDS[kind].straight if kind in SURFACE_KINDS else ""
    columns, rows = (1 if axis in straight else cells for axis, cells in zip("UV", CURVED_CELLS, strict=True))
    return columns, rows


def grid_cells(surfaces) -> tuple[int, int]:
    """Cells across and up of the surfaces that are grids, whose lines are creases; 1 without grids."""
    cells = [1, 1]
    for surface in surfaces:
        if surface is not None and surface.scfpf_surface.kind == "GRID":
            own = _own_cells(surface)
            cells = [max(pair) for pair in zip(cells, own, strict=True)]
    return cells[0], cells[1]
