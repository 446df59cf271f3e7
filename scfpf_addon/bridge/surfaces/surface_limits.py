# SPDX-License-Identifier: GPL-3.0-or-later
"""How fine a parametric surface's drawn mesh may be, whatever its modifier's inputs say.

An input's limits hold in the interface alone. Scripts, drivers and damaged files write what they like, and
from 2^30 faces on Blender ends itself, as the mesh's size overflows: the node groups hold the limits.
"""

from __future__ import annotations

import bpy

LEAST_FACES, MOST_FACES = 1, 1024
LIMITS = {"Min": float(LEAST_FACES), "Max": float(MOST_FACES)}


def drawn_vertices(faces: int) -> int:
    """How many vertices the node groups draw where an input asks for so many faces."""
    return min(max(faces, LEAST_FACES), MOST_FACES) + 1


def vertices_along(nodes, given: dict, axis: str):
    """The socket with the number of vertices along "u" or "v". given: the node group's inputs by key."""
    limited = {"Value": given[f"resolution_{axis}"]} | LIMITS
    faces = nodes.node("ShaderNodeClamp", _faces_name(axis), limited).outputs[0]
    return nodes.math("ADD", faces, 1.0, _vertices_name(axis))


def limit_older_groups() -> None:
    """Put the limits into the file's node groups that were made without them."""
    for group in bpy.data.node_groups:
        if group.bl_idname == "GeometryNodeTree" and group.is_editable and not group.override_library:
            for axis in "uv":
                _limit(group, axis)


def _limit(group, axis: str) -> None:
    vertices = group.nodes.get(_vertices_name(axis))
    if vertices is None or not vertices.inputs[0].is_linked:
        return
    link = vertices.inputs[0].links[0]
    if link.from_node.bl_idname != "NodeGroupInput":
        return
    faces = group.nodes.new("ShaderNodeClamp")
    faces.name = faces.label = _faces_name(axis)
    for name, value in LIMITS.items():
        faces.inputs[name].default_value = value
    # Collapsed, where the link was: there is no room for it otherwise.
    faces.parent, faces.hide = vertices.parent, True
    faces.location = (vertices.location.x - 60.0, vertices.location.y)
    group.links.new(link.from_socket, faces.inputs["Value"])
    group.links.new(faces.outputs[0], vertices.inputs[0])


def _vertices_name(axis: str) -> str:
    return f"Vertices along {axis}"


def _faces_name(axis: str) -> str:
    return f"Faces along {axis}"
