# SPDX-License-Identifier: GPL-3.0-or-later
"""The node group that makes one mesh of a scene's instances, with the shading that they have in the scene.

Blender shades an instance with its mesh' own normals, moved by the inverse transpose of its transform.
Realize Instances recomputes them from the scaled mesh, and turns mirrored instances inside out. So instances
that are scaled unevenly, sheared or mirrored are realized apart.
"""

from __future__ import annotations

from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group

NORMAL = "scfpf_normal"
# The number of the instance that a vertex comes from, within its level.
INSTANCE = "scfpf_instance"
# Levels of instances within instances that are looked at one by one; each nested collection is two.
LEVELS = 24
# Squares of lengths and scalar products of a matrix' columns that differ by less than this share are
# equal: normals are off by half of it.
UNEVEN = 1e-4


@defines_group(
    "SCFPF Realize",
    {"Geometry": ("Geometry", None, "Meshes, and instances of meshes within instances")},
    {"Mesh": "Geometry"},
)
def realize_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """One mesh of all instances, with the shading that they have in the scene.

    The shading normals are the corners' attribute ``NORMAL``.
    """
    geometry = given["Geometry"]
    nodes.open_frame("Is any instance scaled unevenly, sheared or mirrored? Asked without the meshes")
    empty = nodes.out(
        "GeometryNodeDeleteGeometry", "Instances of Nothing", {"Geometry": geometry, "Selection": True}
    )

    def look(state: dict[str, Value]) -> dict[str, Value]:
        odd = nodes.statistic(state["Rest"], _is_odd(nodes) + 0.0, "Sum", "Odd Ones", domain="INSTANCE")
        return {"Rest": _level(nodes, state["Rest"]), "Odd": state["Odd"] + odd}

    def any_left(state: dict[str, Value]) -> Value:
        return nodes.domain_size(state["Rest"], "Instance Count", "INSTANCES") > 0.5

    state = {"Rest": ("GEOMETRY", empty), "Odd": ("FLOAT", 0.0)}
    seen = nodes.repeat(LEVELS, state, "Look", look, any_left)
    nodes.open_frame("None is: all at once")
    plain, _ = _parts(nodes, _level(nodes, geometry, every=True), "Mesh")
    plain = _with_normals(nodes, plain)
    nodes.open_frame("Some are: level by level")
    mesh, instances = _parts(nodes, geometry, "What Is No Instance")
    state = {"Rest": ("GEOMETRY", instances), "Done": ("GEOMETRY", _with_normals(nodes, mesh))}
    made = nodes.repeat(LEVELS, state, "Realize", lambda state: _one_level(nodes, state), any_left)
    return {"Mesh": nodes.switch(seen["Odd"] > 0.5, plain, made["Done"], "GEOMETRY", "Any Odd?")}


def _is_odd(nodes: GeometryBuilder) -> Value:
    """Return whether an instance's transform is more than a turn, a move and an even scale."""
    own = nodes.out("GeometryNodeInstanceTransform", "Of the Instance", {})
    a, b, c = (
        nodes.direction(axis, own, "Column") for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    )
    size = a.dot(a)
    off = (size - b.dot(b)).absolute().max((size - c.dot(c)).absolute())
    for product in (a.dot(b), b.dot(c), c.dot(a)):
        off = off.max(product.absolute())
    mirrored = a.cross(b).dot(c) < 0.0
    return mirrored | (off > size * UNEVEN)


def _level(nodes: GeometryBuilder, geometry: Value, every: bool = False) -> Value:
    """Geometry with one level of its instances realized; those within them then are the outermost."""
    inputs = {"Geometry": geometry, "Realize All": every, "Depth": 1}
    return nodes.out("GeometryNodeRealizeInstances", "Realize", inputs)


def _parts(nodes: GeometryBuilder, geometry: Value, label: str) -> tuple[Value, ...]:
    """The mesh and the instances of a geometry."""
    inputs = {"Geometry": geometry}
    return nodes.outs("GeometryNodeSeparateComponents", label, inputs, "Mesh", "Instances")


def _with_normals(nodes: GeometryBuilder, geometry: Value) -> Value:
    """A mesh whose corners know their shading normals; without faces it has no corners: nothing is left."""
    faces = nodes.domain_size(geometry, "Face Count")
    geometry = nodes.switch(faces > 0.5, None, geometry, "GEOMETRY", "Nothing without Faces")
    normal = nodes.out("GeometryNodeInputNormal", "Normal", {})
    return nodes.store(geometry, NORMAL, normal, "FLOAT_VECTOR", "CORNER")


def _one_level(nodes: GeometryBuilder, state: dict[str, Value]) -> dict[str, Value]:
    """Realize the outermost instances. Rest: the instances within them. Done: the mesh so far."""
    odd, even = nodes.separate(state["Rest"], _is_odd(nodes), "Odd Ones", "INSTANCE")
    plain, below = _parts(nodes, _level(nodes, even), "Even Ones")
    # Within instances too, each mesh once.
    normal = nodes.out("GeometryNodeInputNormal", "Normal", {})
    odd = nodes.store(odd, NORMAL, normal, "FLOAT_VECTOR", "CORNER")
    odd = nodes.store(odd, INSTANCE, nodes.index(), "INT", "INSTANCE")
    mesh, below_odd = _parts(nodes, _level(nodes, odd), "Odd Ones, Real")
    done = nodes.join(state["Done"], _with_normals(nodes, plain), _shaded(nodes, mesh, odd))
    return {"Rest": nodes.join(below, below_odd), "Done": done}


def _shaded(nodes: GeometryBuilder, mesh: Value, instances: Value) -> Value:
    """A mesh of instances with the normals that these have in the scene, mirrored ones not inside out."""
    number = nodes.attribute(INSTANCE, "INT")
    own = nodes.out("GeometryNodeInstanceTransform", "Of the Instance", {})
    inverse = nodes.out("FunctionNodeInvertMatrix", "Inverse", {0: own})
    turned = nodes.out("FunctionNodeTransposeMatrix", "Transpose", {0: inverse})
    turned = nodes.sample(instances, turned, number, "FLOAT4X4", "Of Its Instance", "INSTANCE")
    normal = nodes.attribute(NORMAL, "FLOAT_VECTOR")
    normal = nodes.direction(normal, turned, "Turned")
    normal = nodes.combine("NORMALIZE", normal)
    mesh = nodes.store(mesh, NORMAL, normal, "FLOAT_VECTOR", "CORNER")
    mirrored = nodes.out("FunctionNodeMatrixDeterminant", "Determinant", {0: own}) < 0.0
    mirrored = nodes.sample(instances, mirrored, number, "BOOLEAN", "Mirrored", "INSTANCE")
    return nodes.out("GeometryNodeFlipFaces", "Mirrored Faces", {"Mesh": mesh, "Selection": mirrored})
