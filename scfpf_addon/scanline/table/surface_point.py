# SPDX-License-Identifier: GPL-3.0-or-later
"""The point of a control surface at (u, v) as a node group: exact for the parametric kinds."""

from __future__ import annotations

from ...bridge.surfaces.kinds import PARAMETRIC_KINDS
from ...bridge.surfaces.surface_groups import KIND_ATTRIBUTE, KIND_NUMBERS, PREFIX
from ..nodes.field_nodes import FieldBuilder, Value, node_group
from .uv_pieces import NO_PIECE, uv_pieces_group

# A mesh whose vertices are off its own parameters by more than this share of its size has been
# reshaped by other modifiers. float32 vertices are right to 1e-6 of it, a pixel is 1e-3.
RESHAPED = 2e-5

# Label and attribute of every parameter that some kind has.
PARAMETERS = sorted(
    {(one.label, PREFIX + one.key) for kind in PARAMETRIC_KINDS.values() for one in kind.parameters}
)


def closed_form_group():
    """The point at (u, v) of the parametric kind of a number, in the surface's own space."""
    numbers = ", ".join(f"{n} {PARAMETRIC_KINDS[kind].title.lower()}" for kind, n in KIND_NUMBERS.items())
    inputs = {
        "Kind": ("Int", 0, numbers),
        "U": ("Float", None, ""),
        "V": ("Float", None, ""),
    }
    inputs |= {label: ("Float", None, "") for label, _ in PARAMETERS}

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        shapes = {}
        for key, kind in PARAMETRIC_KINDS.items():
            if kind.formula:
                nodes.open_frame(kind.title)
                values = {one.key: given[one.label].socket for one in kind.parameters}
                position = kind.formula(nodes, given["U"].socket, given["V"].socket, values)
                shapes[KIND_NUMBERS[key]] = position
        nodes.close_frame()
        return {"Position": _choose(nodes, given["Kind"], shapes)}

    text = "The point of a parametric control surface at (u, v), in its own space"
    return node_group("SCFPF Closed Form", text, inputs, {"Position": "Vector"}, build)


def _choose(nodes: FieldBuilder, kind: Value, shapes: dict) -> Value:
    """The position on the shape of a kind's number; the origin for numbers without a shape."""
    node = nodes.node("GeometryNodeIndexSwitch", "Shape of the Kind", {"Index": kind}, data_type="VECTOR")
    while len(node.index_switch_items) <= max(shapes):
        node.index_switch_items.new()
    for number, position in shapes.items():
        nodes.tree.links.new(position, node.inputs[str(number)])
    return Value(nodes, node.outputs[0])


def surface_point_group():
    """The point of any control surface at (u, v), in the space of the object that carries the modifier."""
    inputs = {
        "Surface": ("Object", None, "The control surface"),
        "UV Map": ("String", "UVMap", "The UV map of a surface that is a mesh"),
        "Columns": ("Int", 0, "Of a surface patch: points that Blender draws along u; else 0"),
        "Rows": ("Int", 0, "Of a surface patch: points that Blender draws along v"),
        "Cyclic U": ("Int", 0, "Of a surface patch: 1 if it is closed along u"),
        "Cyclic V": ("Int", 0, "Of a surface patch: 1 if it is closed along v"),
        "U": ("Float", None, ""),
        "V": ("Float", None, ""),
    }

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        nodes.open_frame("The surface as it is now")
        shape = nodes.node("GeometryNodeObjectInfo", "Its Shape", {"Object": given["Surface"]})
        place = nodes.node(
            "GeometryNodeObjectInfo", "Its Place", {"Object": given["Surface"]}, transform_space="RELATIVE"
        )
        mesh, matrix = Value(nodes, shape.outputs["Geometry"]), Value(nodes, place.outputs["Transform"])
        nodes.open_frame("Its parameters")
        kind = nodes.sample(mesh, nodes.attribute(KIND_ATTRIBUTE, "INT"), 0, "INT", "Kind")
        parameters = {
            label: nodes.sample(mesh, nodes.attribute(name), 0, "FLOAT", label) for label, name in PARAMETERS
        }
        nodes.open_frame("Is the mesh what they say, or did other modifiers reshape it?")
        uv = nodes.attribute("UVMap", "FLOAT_VECTOR").parts()
        position = nodes.out("GeometryNodeInputPosition", "Position", {})
        closed = {"Kind": kind} | parameters
        expected = nodes.call(closed_form_group(), "Where Vertices Belong", closed | {"U": uv[0], "V": uv[1]})
        off = nodes.statistic(mesh, (position - expected["Position"]).length(), "Max", "Farthest Off")
        size = nodes.statistic(mesh, position, "Range", "Size").length()
        is_exact = nodes.either((off < size * RESHAPED), nodes.compare(kind, "LESS_THAN", 1.5))
        nodes.open_frame("The exact point")
        exact = nodes.call(closed_form_group(), "Exact", closed | {"U": given["U"], "V": given["V"]})
        nodes.open_frame("Else the mesh at (u, v)")
        inside = nodes.xyz(given["U"], given["V"], 0.0, "(u, v)").most((0.0, 0.0, 0.0)).least((1.0, 1.0, 1.0))
        sampled = nodes.out(
            "GeometryNodeSampleUVSurface",
            "Mesh at (u, v)",
            {
                "Mesh": mesh,
                "Value": position,
                "UV Map": nodes.attribute(given["UV Map"], "FLOAT_VECTOR"),
                "Sample UV": inside,
            },
            data_type="FLOAT_VECTOR",
        )
        net = _net_point(nodes, given, mesh, position)
        sampled = nodes.switch(given["Columns"] > 3.5, sampled, net, "VECTOR", "Net or Mesh")
        nodes.close_frame()
        is_mesh = nodes.either(nodes.compare(kind, "LESS_THAN", 0.5), nodes.negate(is_exact))
        own = nodes.switch(is_mesh, exact["Position"], sampled, "VECTOR", "Exact or Mesh")
        nodes.open_frame("Which piece of a mesh in pieces is it?")
        layer = nodes.attribute(given["UV Map"], "FLOAT_VECTOR")
        pieces = nodes.call(uv_pieces_group(), "Pieces", {"Mesh": mesh, "UV": layer})
        found = nodes.node(
            "GeometryNodeSampleUVSurface",
            "Piece at (u, v)",
            {"Mesh": pieces["Mesh"], "Value": nodes.attribute("piece"), "UV Map": layer, "Sample UV": inside},
            data_type="FLOAT",
        )
        number, valid = (Value(nodes, found.outputs[name]) for name in ("Value", "Is Valid"))
        piece = nodes.switch(valid, NO_PIECE, (number + 0.5).floor(), "FLOAT", "Any?")
        plain_mesh = nodes.both(is_mesh, nodes.compare(given["Columns"], "LESS_THAN", 3.5))
        cut = nodes.switch(plain_mesh, False, pieces["Cut"], "BOOLEAN", "A Mesh?")
        flat = nodes.out(
            "GeometryNodeSetPosition", "Flat, at (u, v)", {"Geometry": pieces["Mesh"], "Position": layer}
        )
        return {
            "Position": nodes.point(own, matrix, "Placed"),
            "Cut": cut,
            "Border": nodes.switch(cut, None, flat, "GEOMETRY", "In Pieces?"),
            "Piece": nodes.switch(cut, 0.0, piece, "FLOAT", "In Pieces?"),
        }

    outputs = {"Position": "Vector", "Cut": "Bool", "Piece": "Float", "Border": "Geometry"}
    text = "The point of a control surface at (u, v); exact where the surface says its parameters"
    return node_group("SCFPF Control Surface", text, inputs, outputs, build)


def _net_point(nodes: FieldBuilder, given: dict[str, Value], mesh: Value, position: Value) -> Value:
    """Between the drawn points of a surface patch, which are exact: cubics through four of them each way."""
    nodes.open_frame("A surface patch between the points that are drawn of it")
    axes = []
    for parameter, count, cyclic in (
        (given["U"], given["Columns"], given["Cyclic U"]),
        (given["V"], given["Rows"], given["Cyclic V"]),
    ):
        along = parameter.most(0.0).least(1.0) * (count - 1.0 + cyclic)
        first = along.floor() - 1.0
        # An open net has no points beyond its ends: the outer cubics reach over two of their thirds.
        inside = first.most(0.0).least(count - 4.0)
        first = nodes.mix(cyclic, inside, first)
        f = along - first
        a, b, c = f - 1.0, f - 2.0, f - 3.0
        weights = (a * b * c * (-1 / 6), f * b * c * 0.5, f * a * c * -0.5, f * a * b * (1 / 6))
        whole = [first + float(step) for step in range(4)]
        indices = [index - (index / count).floor() * count for index in whole]
        axes.append(list(zip(indices, weights, strict=True)))
    total = None
    for column, across in axes[0]:
        strip = None
        for row, up in axes[1]:
            # Half more: whole numbers must not fall short by rounding.
            index = column * given["Rows"] + row + 0.5
            term = nodes.sample(mesh, position, index.floor(), "FLOAT_VECTOR", "Drawn Point") * up
            strip = term if strip is None else strip + term
        total = strip * across if total is None else total + strip * across
    return total
