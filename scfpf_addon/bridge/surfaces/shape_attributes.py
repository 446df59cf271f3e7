# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of a parametric surface as attributes of its mesh.

What reads the mesh in other node groups (the live preview's table) has the exact
surface by them, not only its faces.
"""

from __future__ import annotations

PREFIX = "scfpf_"
KIND_ATTRIBUTE = PREFIX + "kind"
# The numbers by which meshes say their kind; a mesh without the attribute answers 0.
KIND_NUMBERS = {"POINT": 1, "PLANE": 2, "DISC": 3, "CYLINDER": 4, "CONE": 5, "SPHERE": 6}


def store_shape(nodes, kind: str, keys, geometry, given):
    """Store a kind's number and its parameters; returns the geometry socket.

    keys: of the parameters. given: the node group's inputs by key.
    """
    nodes.open_frame("What shape it is, for other node groups")
    for name, value, data_type in [
        (KIND_ATTRIBUTE, KIND_NUMBERS[kind], "INT"),
        *((PREFIX + key, given[key], "FLOAT") for key in keys),
    ]:
        inputs = {"Geometry": geometry, "Name": name, "Value": value}
        node = nodes.node("GeometryNodeStoreNamedAttribute", f"Store {name}", inputs, data_type=data_type)
        geometry = node.outputs["Geometry"]
    return geometry
