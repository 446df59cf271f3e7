# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups for the point of a control surface at (u, v): exact for the parametric kinds."""

from __future__ import annotations

from ...bridge.surfaces.kinds import PARAMETRIC_KINDS
from ...bridge.surfaces.surface_groups import KIND_ATTRIBUTE, KIND_NUMBERS, PREFIX
from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group
from .uv_pieces import NO_PIECE, PIECE, uv_pieces_group

# Other modifiers have reshaped a mesh if its vertices are off its own parameters by more than this share of
# its size. float32 vertices are right to 1e-6 of it, a pixel is 1e-3.
RESHAPED = 2e-5

# Label and attribute of every parameter that some kind has.
PARAMETERS = sorted(
    {(one.label, PREFIX + one.key) for kind in PARAMETRIC_KINDS.values() for one in kind.parameters}
)
_NUMBERS = ", ".join(f"{n} {PARAMETRIC_KINDS[kind].title.lower()}" for kind, n in KIND_NUMBERS.items())


@defines_group(
    "SCFPF Closed Form",
    {"Kind": ("Int", 0, _NUMBERS), "U": ("Float", None, ""), "V": ("Float", None, "")}
    | {label: ("Float", None, "") for label, _ in PARAMETERS},
    {"Position": "Vector"},
)
def closed_form_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The point of a parametric control surface at (u, v), in its own space; the origin for a point."""
    shapes = [None] * (max(KIND_NUMBERS.values()) + 1)
    for key, kind in PARAMETRIC_KINDS.items():
        if kind.formula:
            nodes.open_frame(kind.title)
            values = {one.key: given[one.label].socket for one in kind.parameters}
            shapes[KIND_NUMBERS[key]] = kind.formula(nodes, given["U"].socket, given["V"].socket, values)
    nodes.close_frame()
    return {"Position": nodes.choose(given["Kind"], shapes, "VECTOR", "Shape of the Kind")}


# The parameters of a point of a surface patch.
PATCH_INPUTS = {
    "Columns": ("Int", 0, "Of a surface patch: points that Blender draws along u; else 0"),
    "Rows": ("Int", 0, "Of a surface patch: points that Blender draws along v"),
    "Cyclic U": ("Int", 0, "Of a surface patch: 1 if it is closed along u"),
    "Cyclic V": ("Int", 0, "Of a surface patch: 1 if it is closed along v"),
    "U": ("Float", None, ""),
    "V": ("Float", None, ""),
}

# The four drawn points of a cubic, and their weights.
_INDICES, _WEIGHTS = (tuple(f"{part} {number}" for number in range(1, 5)) for part in ("Index", "Weight"))


@defines_group(
    "SCFPF Patch Axis",
    {
        "Parameter": ("Float", None, "u or v"),
        "Count": ("Int", 0, "Points that are drawn along it"),
        "Cyclic": ("Int", 0, "1 if the patch is closed along it"),
    },
    dict.fromkeys((*_INDICES, *_WEIGHTS), "Float"),
)
def _patch_axis_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The four points of a cubic along u or v, and their weights."""
    count, cyclic = given["Count"], given["Cyclic"]
    along = given["Parameter"].max(0.0).min(1.0) * (count - 1.0 + cyclic)
    first = along.floor() - 1.0
    # An open net has no points beyond its ends: the outer cubics reach over two of their thirds.
    inside = first.max(0.0).min(count - 4.0)
    first = nodes.mix(cyclic, inside, first)
    f = along - first
    a, b, c = f - 1.0, f - 2.0, f - 3.0
    weights = (a * b * c * (-1 / 6), f * b * c * 0.5, f * a * c * -0.5, f * a * b * (1 / 6))
    whole = [first + float(step) for step in range(4)]
    indices = [index - (index / count).floor() * count for index in whole]
    return dict(zip((*_INDICES, *_WEIGHTS), (*indices, *weights), strict=True))


@defines_group(
    "SCFPF Patch Strip",
    {
        "Mesh": ("Geometry", None, "The drawn patch"),
        "Column": ("Float", 0.0, "Number of the strip"),
        "Rows": ("Int", 0, "Points that are drawn of it"),
    }
    | dict.fromkeys((*_INDICES, *_WEIGHTS), ("Float", None, "")),
    {"Position": "Vector"},
)
def _patch_strip_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The point of a cubic through four drawn points of a strip."""
    first, position, total = given["Column"] * given["Rows"], nodes.position(), None
    for row, weight in zip(_INDICES, _WEIGHTS, strict=True):
        # Half more: rounding must not make a whole number fall short.
        index = (first + given[row] + 0.5).floor()
        term = nodes.sample(given["Mesh"], position, index, "FLOAT_VECTOR", "Drawn Point") * given[weight]
        total = term if total is None else total + term
    return {"Position": total}


@defines_group(
    "SCFPF Patch Point",
    {"Mesh": ("Geometry", None, "The drawn patch")} | PATCH_INPUTS,
    {"Position": "Vector"},
)
def _patch_point_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The point of a surface patch, interpolated between its drawn points, which are exact.

    Cubics run through four of them each way.
    """
    across, up = (
        nodes.call(
            _patch_axis_group(),
            f"Along {axis}",
            {
                "Parameter": given[axis.upper()],
                "Count": given[count],
                "Cyclic": given[f"Cyclic {axis.upper()}"],
            },
        )
        for axis, count in (("u", "Columns"), ("v", "Rows"))
    )
    total = None
    for column, weight in zip(_INDICES, _WEIGHTS, strict=True):
        inputs = {"Mesh": given["Mesh"], "Column": across[column], "Rows": given["Rows"]}
        strip = nodes.call(_patch_strip_group(), "Strip", inputs, up)["Position"] * across[weight]
        total = strip if total is None else total + strip
    return {"Position": total}


@defines_group(
    "SCFPF Control Surface",
    {
        "Surface": ("Object", None, "The control surface"),
        "UV Map": ("String", "UVMap", "The UV map of a surface that is a mesh"),
    }
    | PATCH_INPUTS,
    {"Position": "Vector", "Cut": "Bool", "Piece": "Float", "Border": "Geometry"},
)
def surface_point_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The point of a control surface at (u, v); exact if the surface has parameters.

    It is in the space of the modified object. Cut: whether the surface is in pieces; Piece: the number of the
    point's, or a hole's. Border: the pieces, flat at (u, v).
    """
    nodes.open_frame("The surface as it is now")
    mesh, matrix = nodes.object_info(given["Surface"])
    exact, is_mesh = _exact_point(nodes, given, mesh)
    nodes.open_frame("Else the mesh at (u, v)")
    inside = nodes.xyz(given["U"], given["V"], 0.0, "(u, v)").max((0.0, 0.0, 0.0)).min((1.0, 1.0, 1.0))
    position, layer = nodes.position(), nodes.attribute(given["UV Map"], "FLOAT_VECTOR")
    inputs = {"Mesh": mesh, "Value": position, "UV Map": layer, "Sample UV": inside}
    sampled = nodes.out("GeometryNodeSampleUVSurface", "Mesh at (u, v)", inputs, data_type="FLOAT_VECTOR")
    net = nodes.call(_patch_point_group(), "Patch at (u, v)", {"Mesh": mesh}, given)["Position"]
    sampled = nodes.switch(given["Columns"] > 3.5, sampled, net, "VECTOR", "Net or Mesh")
    nodes.close_frame()
    own = nodes.switch(is_mesh, exact, sampled, "VECTOR", "Exact or Mesh")
    nodes.open_frame("Which piece of a mesh in pieces is it?")
    pieces = nodes.call(uv_pieces_group(), "Pieces", {"Mesh": mesh, "UV": layer})
    inputs = {"Mesh": pieces["Mesh"], "Value": nodes.attribute(PIECE), "UV Map": layer, "Sample UV": inside}
    outputs = ("Value", "Is Valid")
    sample = "GeometryNodeSampleUVSurface"
    number, valid = nodes.outs(sample, "Piece at (u, v)", inputs, *outputs, data_type="FLOAT")
    piece = nodes.switch(valid, NO_PIECE, (number + 0.5).floor(), "FLOAT", "Any?")
    plain_mesh = is_mesh & (given["Columns"] < 3.5)
    cut = nodes.switch(plain_mesh, False, pieces["Cut"], "BOOLEAN", "A Mesh?")
    flat = nodes.set_position(pieces["Mesh"], layer, "Flat, at (u, v)")
    return {
        "Position": nodes.point(own, matrix, "Placed"),
        "Cut": cut,
        "Border": nodes.switch(cut, None, flat, "GEOMETRY", "In Pieces?"),
        "Piece": nodes.switch(cut, 0.0, piece, "FLOAT", "In Pieces?"),
    }


def _exact_point(nodes: GeometryBuilder, given: dict[str, Value], mesh: Value) -> tuple[Value, Value]:
    """The point by the surface's parameters, and whether the mesh decides instead.

    It does if the surface has none, or if other modifiers have reshaped it.
    """
    nodes.open_frame("Its parameters")
    kind = nodes.sample_attribute(mesh, KIND_ATTRIBUTE, 0, "Kind", "INT")
    closed = {"Kind": kind} | {
        label: nodes.sample_attribute(mesh, name, 0, label, "FLOAT") for label, name in PARAMETERS
    }
    nodes.open_frame("Is the mesh what they say, or did other modifiers reshape it?")
    u, v, _ = nodes.attribute("UVMap", "FLOAT_VECTOR").parts()
    position = nodes.position()
    expected = nodes.call(closed_form_group(), "Where Vertices Belong", {"U": u, "V": v}, closed)
    off = nodes.statistic(mesh, (position - expected["Position"]).length(), "Max", "Farthest Off")
    size = nodes.statistic(mesh, position, "Range", "Size").length()
    is_exact = (off < size * RESHAPED) | (kind < 1.5)
    nodes.open_frame("The exact point")
    exact = nodes.call(closed_form_group(), "Exact", closed, given)
    return exact["Position"], (kind < 0.5) | ~is_exact
