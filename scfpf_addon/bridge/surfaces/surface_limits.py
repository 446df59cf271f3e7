# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits of the drawn mesh's resolution, which the node groups of parametric surfaces hold themselves.

An input's limits hold in the interface alone: scripts, drivers and damaged files may write any value. From
2^30 faces on, the mesh's size overflows and Blender ends.
"""

from __future__ import annotations

import bpy

LEAST_FACES, MOST_FACES = 1, 1024
LIMITS = {"Min": float(LEAST_FACES), "Max": float(MOST_FACES)}


def drawn_vertices(faces: int) -> int:
    """The number of vertices that the node groups draw where an input asks for a number of faces."""
    return min(max(faces, LEAST_FACES), MOST_FACES) + 1


def vertices_along(nodes, given: dict, axis: str):
    """The socket with the number of vertices along "u" or "v". given: the node group's inputs by key."""
    limited = {"Value": given[f"resolution_{axis}"]} | LIMITS
    faces = nodes.node("ShaderNodeClamp", _faces_name(axis), limited).outputs[0]
    return nodes.math("ADD", faces, 1.0, _vertices_name(axis))


def limit_older_groups() -> None:
    """Add the limits to node groups of the file that lack them."""
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
    # Collapsed where the link was, since an open node would cover others.
    faces.parent, faces.hide = vertices.parent, True
    faces.location = (vertices.location.x - 60.0, vertices.location.y)
    group.links.new(link.from_socket, faces.inputs["Value"])
    group.links.new(faces.outputs[0], vertices.inputs[0])


def _vertices_name(axis: str) -> str:
    return f"Vertices along {axis}"


def _faces_name(axis: str) -> str:
    return f"Faces along {axis}"
