# SPDX-License-Identifier: GPL-3.0-or-later
"""The projectors of a camera's table as points: coefficients of powers of t, and pieces of the volume."""

from __future__ import annotations

from typing import NamedTuple

from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group
from ..nodes.solve_nodes import PROJECTOR, TABLE_INPUTS, look_up_group, whole_table
from .surface_point import surface_point_group
from .uv_pieces import NO_PIECE, OF_SURFACE, PIECE, PIECES

# A gap between two rows that is this many times the next one is a leap.
LEAP = 4.0


class TableSockets(NamedTuple):
    """The points of a table.

    size: columns, rows, spans. cut: whether the volume is in pieces. border: the pieces of its surfaces, flat
    over the image, as an instance.
    """

    table: Value
    size: Value
    cut: Value
    border: Value


class _Controls(NamedTuple):
    """The control points of the projectors.

    points: a field for each surface. borders: its pieces. piece: a number that combines those of the
    surfaces' pieces. base: that number's next factor. cut: whether a surface is in pieces. several: how many
    are. hole: whether a surface has a hole there.
    """

    points: list[Value]
    borders: list[Value]
    piece: Value
    base: Value
    cut: Value
    several: Value
    hole: Value


def store_projectors(nodes: GeometryBuilder, given: dict[str, Value], powers, polar: Value) -> TableSockets:
    """Make the table's points, with their projectors and pieces.

    given: inputs of ``table_group``. powers: of ``power_spans``. polar: 1 for a disc in polar coordinates.
    """
    spans, _, count = powers.shape
    nodes.open_frame("A point a projector, row by row, span by span")
    columns, rows = given["Columns"], given["Rows"]
    cells = columns * rows
    points = nodes.out("GeometryNodePoints", "Points of the Table", {"Count": cells * float(spans)})
    span, within = divmod(nodes.index(), cells)
    row, column = divmod(within, columns)
    x, y = column / (columns - 1.0), row / (rows - 1.0)
    mapped = given["Pictured"] > 0.5
    inputs = {"X": x, "Y": y, "Point": within, "Disk": polar}
    u, v, shown = nodes.call(_parameters_group(), "u and v", inputs, given)["Parameters"].parts()
    controls = _controls(nodes, given, u, v, count)
    nodes.open_frame("Holes and the seam of the picture's points")
    holed = given["Pictured"] > 1.5
    hole = controls.hole | (holed & (shown < 0.5))
    piece = controls.piece + (holed & (shown > 1.25)) * 0.5
    nodes.open_frame("Coefficients of its powers of t")
    coefficients = [_combined(nodes, span, powers[:, power], controls.points) for power in range(4)]
    matrix = nodes.matrix([*coefficients[1:], coefficients[0]])
    size = nodes.xyz(columns, rows, float(spans), "Columns, Rows, Spans")
    table = nodes.store(points, PROJECTOR, matrix, "FLOAT4X4")
    nodes.open_frame("Does a polar picture of a part of a turn leap where it begins and ends?")
    plain = (polar > 0.5) & ~mapped
    leap = plain & nodes.call(_leap_group(), "Leap", {"Table": table, "Size": size})["Leap"]
    piece = (leap & (y * 2.0 - 1.0 < -1e-5)) * controls.base + piece
    cut = controls.cut | holed | leap
    nodes.open_frame("Their borders, flat over the picture")
    inputs = {"Pieces": nodes.join(*controls.borders), "Leap": leap, "Several": controls.several}
    border = nodes.call(_border_group(), "Borders", inputs, given)["Borders"]
    nodes.open_frame("In pieces? Their numbers")
    pieces = nodes.store(table, PIECE, nodes.switch(hole, piece, NO_PIECE, "FLOAT", "Hole?"), "FLOAT")
    table = nodes.switch(cut, table, pieces, "GEOMETRY", "In Pieces?")
    # Through image mappings borders run as nothing but the table's points can tell.
    border = nodes.switch(cut & ~mapped, None, border, "GEOMETRY", "In Pieces?")
    return TableSockets(table, size, cut, border)


# The inputs of ``table_group`` that say which part of u and v an image shows.
_RANGE = {
    f"{axis} {end}": ("Float", value, "") for axis in "UV" for end, value in (("Start", 0.0), ("End", 1.0))
}


@defines_group(
    "SCFPF Parameters",
    {
        "X": ("Float", None, ""),
        "Y": ("Float", None, ""),
        "Point": ("Float", None, "Number of the picture's point"),
        "Picture": ("Geometry", None, "u, v and what is shown of the table's corners, as positions"),
        "Pictured": ("Int", 0, "1: u and v are those of the picture's points, 2: which have holes or a seam"),
        "Disk": ("Float", 0.0, "1 for a disk in polar coordinates"),
    }
    | _RANGE,
    {"Parameters": "Vector"},
)
def _parameters_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """u and v of a point of the picture, and as z whether it is shown."""
    x, y, polar = (given[label] for label in ("X", "Y", "Disk"))
    nodes.open_frame("(u, v) of the picture's x and y")
    turn, radius = nodes.polar(x * 2.0 - 1.0, y * 2.0 - 1.0)
    u, v = (
        nodes.mix(part, given[f"{axis} Start"], given[f"{axis} End"])
        for part, axis in ((nodes.mix(polar, x, turn), "U"), (nodes.mix(polar, y, radius), "V"))
    )
    nodes.open_frame("Those of the picture's points, where it has mappings")
    own = nodes.sample(given["Picture"], nodes.position(), given["Point"], "FLOAT_VECTOR", "The Picture's")
    plain = nodes.xyz(u, v, 1.0, "Plain")
    return {"Parameters": nodes.switch(given["Pictured"] > 0.5, plain, own, "VECTOR", "Mapped?")}


def _controls(nodes: GeometryBuilder, given, u: Value, v: Value, count: int) -> _Controls:
    nodes.open_frame("Control points of the projector")
    points, borders = [], []
    pieces = {"Piece": 0.0, "Base": 1.0, "Several": 0.0, "Cut": False, "Hole": False}
    for number in range(1, count + 1):
        inputs = {"Net": given[f"Net {number}"], "U": u, "V": v, **pieces}
        inputs |= {label: given[f"{label} {number}"] for label in ("Surface", "UV Map")}
        found = nodes.call(_control_point_group(), f"On Surface {number}", inputs)
        points.append(found.pop("Position"))
        borders.append(found.pop("Border"))
        pieces = found
    return _Controls(
        points=points,
        borders=borders,
        piece=pieces["Piece"],
        base=pieces["Base"],
        cut=pieces["Cut"],
        several=pieces["Several"],
        hole=pieces["Hole"],
    )


@defines_group(
    "SCFPF Control Point",
    {
        "Surface": ("Object", None, "The control surface"),
        "UV Map": ("String", "UVMap", "The UV map of a surface that is a mesh"),
        "Net": ("Vector", None, "Of a surface patch: points drawn along u and v, closed"),
        "U": ("Float", None, ""),
        "V": ("Float", None, ""),
        "Piece": ("Float", 0.0, "The number of the pieces of the surfaces before"),
        "Base": ("Float", 1.0, "The factor of this one's"),
        "Several": ("Float", 0.0, "How many of the surfaces before are in pieces"),
        "Cut": ("Bool", False, "Is one of them in pieces?"),
        "Hole": ("Bool", False, "Has one of them a hole here?"),
    },
    {"Position": "Vector", "Border": "Geometry"}
    | {"Piece": "Float", "Base": "Float", "Several": "Float", "Cut": "Bool", "Hole": "Bool"},
)
def _control_point_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The point of a projector on one of its control surfaces, and its piece with those before."""
    along_u, along_v, closed = given["Net"].parts()
    half = (closed * 0.5).floor()
    inputs = {"Columns": along_u, "Rows": along_v, "Cyclic U": closed - half * 2.0, "Cyclic V": half}
    found = nodes.call(surface_point_group(), "On the Surface", inputs, given)
    several = given["Several"]
    return {
        "Position": found["Position"],
        "Border": nodes.store(found["Border"], OF_SURFACE, several, "FLOAT"),
        "Piece": found["Piece"] * given["Base"] + given["Piece"],
        "Base": nodes.switch(found["Cut"], 1.0, PIECES, "FLOAT", "In Pieces?") * given["Base"],
        "Several": found["Cut"] + several,
        "Cut": found["Cut"] | given["Cut"],
        "Hole": (found["Piece"] < NO_PIECE + 0.5) | given["Hole"],
    }


@defines_group(
    "SCFPF Borders",
    {
        "Pieces": ("Geometry", None, "Those of the surfaces, flat at (u, v)"),
        "Leap": ("Bool", False, "Does a polar picture leap where it begins and ends?"),
        "Several": ("Float", 0.0, "How many surfaces are in pieces"),
    }
    | _RANGE,
    {"Borders": "Geometry"},
)
def _border_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """All pieces of surfaces, flat over the picture, as one instance; also the halves of one that leaps.

    The image runs from 0 to 1 across and up; a polar one over the whole turn and its radius.
    """
    starts, ends = (nodes.xyz(given[f"U {end}"], given[f"V {end}"], 0.0, end) for end in ("Start", "End"))
    position = nodes.position()
    place = (position - starts) / (ends - starts + (0.0, 0.0, 1.0))
    flat = nodes.set_position(given["Pieces"], place, "Over the Picture")
    halves = []
    for number in range(2):
        size = {"Size X": 0.5, "Size Y": 1.0, "Vertices X": 2, "Vertices Y": 2}
        half = nodes.out("GeometryNodeMeshGrid", "Half a Turn", size)
        moved = {"Geometry": half, "Translation": (0.25 + 0.5 * number, 0.5, 0.0)}
        half = nodes.out("GeometryNodeTransform", "In Its Place", moved)
        half = nodes.store(half, PIECE, float(number), "FLOAT")
        halves.append(nodes.store(half, OF_SURFACE, given["Several"], "FLOAT"))
    both = nodes.switch(given["Leap"], None, nodes.join(*halves), "GEOMETRY", "Leaps?")
    joined = {"Geometry": nodes.join(flat, both)}
    return {"Borders": nodes.out("GeometryNodeGeometryToInstance", "Borders", joined)}


@defines_group("SCFPF Leap", {key: TABLE_INPUTS[key] for key in ("Table", "Size")}, {"Leap": "Bool"})
def _leap_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """Return whether a table leaps between the middle row's right half and the row below it."""
    table, size = given["Table"], given["Size"]
    points = nodes.out("GeometryNodePoints", "64 Samples", {"Count": 64})
    across = (nodes.index() + 1.0) / 128.0 + 0.5
    row = 1.0 / (size.parts()[1] - 1.0)
    whole = whole_table(table, size, (0.0, 0.0, 0.0))
    result = None
    for t in (0.25, 1.0):
        below, middle, above = (
            nodes.call(look_up_group(), "Place", {"Position": nodes.xyz(across, y, t, "Place")}, whole)
            for y in (0.5 - row, 0.5 + row * 0.0, 0.5 + row)
        )
        down = nodes.statistic(points, (middle["Position"] - below["Position"]).length(), "Max", "Down")
        up = nodes.statistic(points, (above["Position"] - middle["Position"]).length(), "Max", "Up")
        result = down > up * LEAP if result is None else result | (down > up * LEAP)
    return {"Leap": result}


def _combined(nodes: GeometryBuilder, span: Value, weights, controls: list[Value]) -> Value:
    """Σ weights[span, i] · controls[i]. weights: (S, count)."""
    total = None
    for column, control in zip(weights.T.tolist(), controls, strict=True):
        if not any(column):
            continue
        is_constant = len(set(column)) == 1
        weight = column[0] if is_constant else nodes.choose(span, column, "FLOAT", "Weight by Span")
        term = control * weight
        total = term if total is None else total + term
    return nodes.xyz(0.0, 0.0, 0.0, "Nothing") if total is None else total
