# SPDX-License-Identifier: GPL-3.0-or-later
"""A camera's table as an object: its modifier takes the surfaces, drivers its other settings."""

from __future__ import annotations

import bpy

from ...bridge.blender import versions
from ...bridge.blender.mesh_grid import UV_LAYER, SurfaceError, grid_points, uv_layer
from ...projection.surfaces.kinds import PARAMETRIC_KINDS, SURFACE_KINDS
from .mapping_table import store_picture
from .table_nodes import table_group

# The camera's custom property that names its table; a pointer, so that renaming does no harm.
TABLE_KEY = "scfpf_table"
MODIFIER = "SCFPF Table"
# Cells of the table across and up where surfaces are curved; flat ones are exact with one cell.
CURVED_CELLS = (256, 128)
# Cells where a surface is a mesh: the multiple of its own that comes to this many, at most.
MOST_CELLS = 512


def table_object(camera, key=TABLE_KEY, label="Table", scene=None):
    """The camera's table of projectors, made or brought up to date; a child of the camera.

    key: the camera's custom property that names it. label: what comes after the camera's name in its own.
    scene: whose picture it is for, the context's if not given; it matters to image mappings alone.
    Call it when the list of surfaces, a kind, a weight, the basis, the re-parameterisation
    or ``picture_table.picture_signature`` has changed; shapes, transforms and
    animation it follows by itself, without Python.
    It is linked to no collection: the modifier that reads it keeps it evaluated.
    """
    table = camera.get(key)
    if not isinstance(table, bpy.types.Object) or _is_another_s(table, camera, key):
        name = f"{camera.name} {label}"
        table = bpy.data.objects.new(name, bpy.data.meshes.new(name))
        table.hide_select = table.hide_render = True
        camera[key] = table
    if table.parent != camera:
        table.parent = camera
    settings = camera.scfpf
    surfaces = [slot.object for slot in settings.surfaces]
    group = table_group_of(camera)
    modifier = table.modifiers.get(MODIFIER) or table.modifiers.new(MODIFIER, "NODES")
    modifier.show_viewport = modifier.show_render = True
    if modifier.node_group != group:
        table.animation_data_clear()  # drivers of another group's inputs
        modifier.node_group = group
    inputs = {
        item.name: item.identifier
        for item in group.interface.items_tree
        if item.item_type == "SOCKET" and item.in_out == "INPUT"
    }
    columns, rows = _cells(settings, surfaces)
    values = {"Columns": columns, "Rows": rows}
    values |= store_picture(table, camera, scene or bpy.context.scene, (columns - 1, rows - 1))
    for number, surface in enumerate(surfaces, 1):
        values[f"Surface {number}"] = surface
        values[f"UV Map {number}"] = _uv_map(surface)
        values[f"Net {number}"] = _net(surface)
    for title, value in values.items():
        if title.startswith("Net") or versions.modifier_input(modifier, inputs[title]) != value:
            versions.set_modifier_input(modifier, inputs[title], value)
    for title, path in {
        "U Start": "u_range[0]",
        "U End": "u_range[1]",
        "V Start": "v_range[0]",
        "V End": "v_range[1]",
        "Polar": "reparameterisation",
    }.items():
        _drive(modifier, inputs[title], camera, f"scfpf.{path}")
    # Assigning the group once more rebuilds the depsgraph's relations; setting an input does not in 4.5.
    modifier.node_group = group
    table.update_tag()
    return table


def table_group_of(camera):
    """The node group that computes a camera's table, built if need be."""
    settings = camera.scfpf
    weights = tuple(slot.weight for slot in settings.surfaces) if settings.basis == "NURBS" else None
    return table_group(settings.basis, len(settings.surfaces), weights)


def _is_another_s(table, camera, key: str) -> bool:
    """Whether a table is another camera's, of which this one is a duplicate; it may have lost its parent."""
    parent = table.parent
    return parent is not None and parent != camera and parent.get(key) == table


def release_pointers(table) -> None:
    """Take from a table all that points to other data, before Blender goes to another step of undo.

    Handlers change tables after the step was stored. Where two steps agree on an object Blender keeps it as
    it is in memory, and what it then points to may be freed. ``table_object`` makes it again.
    """
    table.animation_data_clear()
    modifier = table.modifiers.get(MODIFIER)
    if modifier is not None:
        table.modifiers.remove(modifier)


def is_made(table) -> bool:
    """Whether a table has what computes it; not between ``release_pointers`` and ``table_object``."""
    modifier = table.modifiers.get(MODIFIER)
    return modifier is not None and modifier.node_group is not None


def _drive(modifier, identifier: str, owner, path: str) -> None:
    """Let an input follow a property, without Python."""
    follow_property(*versions.modifier_input_property(modifier, identifier), owner, path)


def follow_property(place, name: str, owner, path: str) -> None:
    """Let place.name follow a property of the add-on's, which files have only where it is installed."""
    curve = place.driver_add(name)
    curve.driver.type = "AVERAGE"
    for old in list(curve.driver.variables):
        curve.driver.variables.remove(old)
    variable = curve.driver.variables.new()
    variable.type = "SINGLE_PROP"
    target = variable.targets[0]
    target.id = owner
    target.data_path = path
    # Without the add-on the file has no such property: the table keeps what it was made with.
    target.use_fallback_value = True
    target.fallback_value = _number(owner, path)


def _number(owner, path: str) -> float:
    """A property's value as drivers see it: an enum is its number."""
    value = owner.path_resolve(path)
    if isinstance(value, str):
        value = owner.path_resolve("scfpf").bl_rna.properties[path.rpartition(".")[2]].enum_items[value].value
    return float(value)


def _uv_map(surface) -> str:
    layer = uv_layer(surface.data) if surface is not None and surface.type == "MESH" else None
    return layer.name if layer else UV_LAYER


def _net(surface) -> tuple[float, float, float]:
    """Points that Blender draws of a surface patch along u and v; 1 if closed along u, plus 2 if along v."""
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
    """A common multiple if it is not too many, else the most there may be."""
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
        except SurfaceError:
            return CURVED_CELLS
        return points.shape[1] - 1, points.shape[0] - 1
    straight = SURFACE_KINDS[kind].straight if kind in SURFACE_KINDS else ""
    columns, rows = (1 if axis in straight else cells for axis, cells in zip("UV", CURVED_CELLS, strict=True))
    return columns, rows


def grid_cells(surfaces) -> tuple[int, int]:
    """Cells across and up of the surfaces that are grids, whose lines are creases; 1 where there are none."""
    cells = [1, 1]
    for surface in surfaces:
        if surface is not None and surface.scfpf_surface.kind == "GRID":
            own = _own_cells(surface)
            cells = [max(pair) for pair in zip(cells, own, strict=True)]
    return cells[0], cells[1]
