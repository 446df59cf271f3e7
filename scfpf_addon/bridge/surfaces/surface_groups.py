# SPDX-License-Identifier: GPL-3.0-or-later
"""The node group of each parametric kind: the drawn mesh, its UV map, its handles.

The mesh holds the kind and its parameters as attributes, from which other node groups (the nodes preview's
table) have the exact surface.
"""

from __future__ import annotations

import bpy

from ..blender.mesh_grid import UV_LAYER
from ..blender.node_builder import NodeBuilder
from .kinds import PARAMETRIC_KINDS
from .surface_limits import vertices_along

PREFIX = "scfpf_"
KIND_ATTRIBUTE = PREFIX + "kind"
# The numbers by which meshes say their kind; a mesh without the attribute answers 0.
KIND_NUMBERS = {kind: number for number, kind in enumerate(PARAMETRIC_KINDS, 1)}


def group_inputs(group) -> dict[str, str]:
    """Identifiers of a node group's inputs by name."""
    return {
        item.name: item.identifier
        for item in group.interface.items_tree
        if item.item_type == "SOCKET" and item.in_out == "INPUT"
    }


def surface_group(kind: str):
    """The node group of a parametric kind: the file's own if it is whole, else a new one."""
    description = PARAMETRIC_KINDS[kind]
    labels = [given.label for given in description.inputs]
    existing = bpy.data.node_groups.get((description.group_name, None))
    if existing and existing.bl_idname == "GeometryNodeTree" and list(group_inputs(existing)) == labels:
        return existing
    tree = bpy.data.node_groups.new(description.group_name, "GeometryNodeTree")
    tree.is_modifier = True
    tree.description = f"The control surface {description.title} of a flexible camera"
    tree.interface.new_socket("Mesh", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    for given in description.inputs:
        socket = tree.interface.new_socket(
            given.label, description=given.description, in_out="INPUT", socket_type=given.socket_type
        )
        socket.subtype = given.subtype
        socket.min_value, socket.max_value = given.minimum, given.maximum
        socket.default_value = given.default
    nodes = NodeBuilder(tree)
    source = nodes.node("NodeGroupInput", "Parameters", {})
    given = {one.key: source.outputs[one.label] for one in description.inputs}
    formula = description.formula
    mesh = _build_sheet(nodes, formula, given) if formula else _build_point(nodes, given)
    mesh = _store_parameters(nodes, kind, mesh, given)
    nodes.close_frame()
    nodes.node("NodeGroupOutput", "Surface", {"Mesh": mesh})
    if description.handles:
        nodes.open_frame("Handles in the viewport")
        description.handles(nodes, given)
        nodes.close_frame()
    return tree


def _build_point(nodes, given):
    """A cross of three lines through the origin."""
    arms = []
    half = nodes.math("MULTIPLY", given["size"], -0.5, "Start")
    for axis in range(3):
        start, offset = ([size if i == axis else 0.0 for i in range(3)] for size in (half, given["size"]))
        line = {
            "Count": 2,
            "Start Location": nodes.vector(*start, "Start of " + "XYZ"[axis]),
            "Offset": nodes.vector(*offset, "Length of " + "XYZ"[axis]),
        }
        arms.append(nodes.node("GeometryNodeMeshLine", "Arm " + "XYZ"[axis], line).outputs["Mesh"])
    nodes.close_frame()
    join = nodes.node("GeometryNodeJoinGeometry", "Cross", {})
    for arm in arms:
        nodes.tree.links.new(arm, join.inputs["Geometry"])
    return join.outputs["Geometry"]


def _build_sheet(nodes, formula, given):
    """A grid in UV, moved onto the surface, with its UV map."""
    nodes.open_frame("Grid in UV")
    count = {f"Vertices {axis}": vertices_along(nodes, given, key) for axis, key in (("X", "u"), ("Y", "v"))}
    grid = nodes.node("GeometryNodeMeshGrid", "Grid", count)
    uv = nodes.node("ShaderNodeSeparateXYZ", "u, v", {"Vector": grid.outputs["UV Map"]})
    nodes.open_frame("Position at u, v")
    position = formula(nodes, uv.outputs["X"], uv.outputs["Y"], given)
    nodes.open_frame("Mesh with UV map")
    moved = nodes.node(
        "GeometryNodeSetPosition",
        "Onto the Surface",
        {"Geometry": grid.outputs["Mesh"], "Position": position},
    )
    stored = nodes.node(
        "GeometryNodeStoreNamedAttribute",
        "UV Map",
        {"Geometry": moved.outputs["Geometry"], "Name": UV_LAYER, "Value": grid.outputs["UV Map"]},
        data_type="FLOAT2",
        domain="CORNER",
    )
    return stored.outputs["Geometry"]


def _store_parameters(nodes, kind: str, geometry, given):
    """The geometry socket with a kind's number and parameters as attributes."""
    nodes.open_frame("What shape it is, for other node groups")
    for name, value, data_type in [
        (KIND_ATTRIBUTE, KIND_NUMBERS[kind], "INT"),
        *((PREFIX + one.key, given[one.key], "FLOAT") for one in PARAMETRIC_KINDS[kind].parameters),
    ]:
        inputs = {"Geometry": geometry, "Name": name, "Value": value}
        node = nodes.node("GeometryNodeStoreNamedAttribute", f"Store {name}", inputs, data_type=data_type)
        geometry = node.outputs["Geometry"]
    return geometry
