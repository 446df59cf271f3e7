# SPDX-License-Identifier: GPL-3.0-or-later
"""The node group that makes one mesh of a scene's instances, with the shading that they have in the scene.

Blender shades an instance with its mesh' own normals, moved by the inverse transpose of its
transform. Realize Instances computes them anew instead, from the mesh as it was scaled, and turns what
is mirrored inside out. So instances that are scaled unevenly, sheared or mirrored are realized apart.
"""

from __future__ import annotations

from ..nodes.field_nodes import FieldBuilder, Value, node_group

NORMAL = "scfpf_normal"
# Which of a level's instances a vertex comes from.
INSTANCE = "scfpf_instance"
# Levels of instances within instances that are looked at one by one; each nested collection is two.
LEVELS = 24
# Squares of lengths and scalar products of a matrix' columns that differ by less than this share are
# equal: normals are off by half of it.
UNEVEN = 1e-4


def realize_group():
    """One mesh of all geometry and instances; its shading normals are the corners' attribute ``NORMAL``."""
    inputs = {"Geometry": ("Geometry", None, "Meshes, and instances of meshes within instances")}
    text = "One mesh of all instances, with the shading that they have in the scene"
    return node_group("SCFPF Realize", text, inputs, {"Mesh": "Geometry"}, _build)


def _build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
    geometry = given["Geometry"]
    nodes.open_frame("Is any instance scaled unevenly, sheared or mirrored? Asked without the meshes")
    empty = nodes.out(
        "GeometryNodeDeleteGeometry", "Instances of Nothing", {"Geometry": geometry, "Selection": True}
    )

    def look(state: dict[str, Value]) -> dict[str, Value]:
        odd = nodes.statistic(state["Rest"], _is_odd(nodes) + 0.0, "Sum", "Odd Ones", domain="INSTANCE")
        after = {"Rest": _level(nodes, state["Rest"]), "Odd": state["Odd"] + odd}
        return _while_any(nodes, state, after, {"Rest": "GEOMETRY", "Odd": "FLOAT"})

    seen = nodes.repeat(LEVELS, {"Rest": ("GEOMETRY", empty), "Odd": ("FLOAT", 0.0)}, "Look", look)
    nodes.open_frame("None is: all at once")
    plain = _with_normals(nodes, _mesh_of(nodes, _level(nodes, geometry, every=True)))
    nodes.open_frame("Some are: level by level")
    first = nodes.node("GeometryNodeSeparateComponents", "What Is No Instance", {"Geometry": geometry})
    state = {
        "Rest": ("GEOMETRY", Value(nodes, first.outputs["Instances"])),
        "Done": ("GEOMETRY", _with_normals(nodes, Value(nodes, first.outputs["Mesh"]))),
    }

    def realize(state: dict[str, Value]) -> dict[str, Value]:
        return _while_any(nodes, state, _one_level(nodes, state), {"Rest": "GEOMETRY", "Done": "GEOMETRY"})

    made = nodes.repeat(LEVELS, state, "Realize", realize)
    return {"Mesh": nodes.switch(seen["Odd"] > 0.5, plain, made["Done"], "GEOMETRY", "Any Odd?")}


def _is_odd(nodes: FieldBuilder) -> Value:
    """Whether an instance's transform is more than a turn, a move and an even scale."""
    own = nodes.out("GeometryNodeInstanceTransform", "Of the Instance", {})
    a, b, c = (
        nodes.out("FunctionNodeTransformDirection", "Column", {0: axis, 1: own})
        for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    )
    size = a.dot(a)
    off = (size - b.dot(b)).absolute().most((size - c.dot(c)).absolute())
    for product in (a.dot(b), b.dot(c), c.dot(a)):
        off = off.most(product.absolute())
    mirrored = a.cross(b).dot(c) < 0.0
    return nodes.either(mirrored, off > size * UNEVEN)


def _level(nodes: FieldBuilder, geometry: Value, every: bool = False) -> Value:
    """Geometry with one level of its instances realized; those within them then are the outermost."""
    inputs = {"Geometry": geometry, "Realize All": every, "Depth": 1}
    return nodes.out("GeometryNodeRealizeInstances", "Realize", inputs)


def _while_any(nodes: FieldBuilder, state, after, kinds: dict[str, str]) -> dict[str, Value]:
    """The next state as long as there are instances; a Switch evaluates only the side that is asked for."""
    size = nodes.node("GeometryNodeAttributeDomainSize", "Size", {0: state["Rest"]}, component="INSTANCES")
    count = Value(nodes, size.outputs["Instance Count"])
    return {
        name: nodes.switch(count > 0.5, state[name], after[name], kind, "Any Left?")
        for name, kind in kinds.items()
    }


def _mesh_of(nodes: FieldBuilder, geometry: Value) -> Value:
    return nodes.out("GeometryNodeSeparateComponents", "Mesh", {"Geometry": geometry}, "Mesh")


def _with_normals(nodes: FieldBuilder, geometry: Value) -> Value:
    """A mesh whose corners know their shading normals; without faces it has no corners: nothing is left."""
    faces = nodes.out(
        "GeometryNodeAttributeDomainSize", "Faces", {0: geometry}, "Face Count", component="MESH"
    )
    geometry = nodes.switch(faces > 0.5, None, geometry, "GEOMETRY", "Nothing without Faces")
    normal = nodes.out("GeometryNodeInputNormal", "Normal", {})
    return nodes.store(geometry, NORMAL, normal, "FLOAT_VECTOR", "CORNER")


def _one_level(nodes: FieldBuilder, state: dict[str, Value]) -> dict[str, Value]:
    odd, even = nodes.separate(state["Rest"], _is_odd(nodes), "Odd Ones", "INSTANCE")
    even = nodes.node("GeometryNodeSeparateComponents", "Even Ones", {"Geometry": _level(nodes, even)})
    # Within instances too, each mesh once.
    normal = nodes.out("GeometryNodeInputNormal", "Normal", {})
    odd = nodes.store(odd, NORMAL, normal, "FLOAT_VECTOR", "CORNER")
    odd = nodes.store(odd, INSTANCE, nodes.out("GeometryNodeInputIndex", "Index", {}), "INT", "INSTANCE")
    parts = nodes.node("GeometryNodeSeparateComponents", "Odd Ones, Real", {"Geometry": _level(nodes, odd)})
    mesh = _shaded(nodes, Value(nodes, parts.outputs["Mesh"]), odd)
    plain = _with_normals(nodes, Value(nodes, even.outputs["Mesh"]))
    rest = nodes.join(*(Value(nodes, each.outputs["Instances"]) for each in (even, parts)))
    return {"Rest": rest, "Done": nodes.join(state["Done"], plain, mesh)}


def _shaded(nodes: FieldBuilder, mesh: Value, instances: Value) -> Value:
    """A mesh of instances with the normals that these have in the scene, mirrored ones not inside out."""
    number = nodes.attribute(INSTANCE, "INT")
    own = nodes.out("GeometryNodeInstanceTransform", "Of the Instance", {})
    inverse = nodes.out("FunctionNodeInvertMatrix", "Inverse", {0: own})
    turned = nodes.out("FunctionNodeTransposeMatrix", "Transpose", {0: inverse})
    turned = nodes.sample(instances, turned, number, "FLOAT4X4", "Of Its Instance", "INSTANCE")
    normal = nodes.attribute(NORMAL, "FLOAT_VECTOR")
    normal = nodes.out("FunctionNodeTransformDirection", "Turned", {0: normal, 1: turned})
    normal = nodes.combine("NORMALIZE", normal)
    mesh = nodes.store(mesh, NORMAL, normal, "FLOAT_VECTOR", "CORNER")
    mirrored = nodes.out("FunctionNodeMatrixDeterminant", "Determinant", {0: own}) < 0.0
    mirrored = nodes.sample(instances, mirrored, number, "BOOLEAN", "Mirrored", "INSTANCE")
    return nodes.out("GeometryNodeFlipFaces", "Mirrored Faces", {"Mesh": mesh, "Selection": mirrored})
