# SPDX-License-Identifier: GPL-3.0-or-later
"""The table of a volume in pieces as one of them sees it: extended beyond its border, wherever that runs.

Between the projectors of two pieces there is nothing to blend. So the points that are on other pieces, or
on none, get what the piece would have there: the nearest of its own points, and on from it as it changes
from there to its neighbours inside.
"""

from __future__ import annotations

from ..nodes.field_nodes import FieldBuilder, Value, node_group
from ..nodes.solve_nodes import PROJECTOR, TABLE_INPUTS
from .table_sheets import PIECE

# Which of the table's points a point of one piece is.
NUMBER = "number"


def piece_table_group():
    """A table in which all points but a piece's own go on from that piece."""
    inputs = {key: TABLE_INPUTS[key] for key in ("Table", "Size")} | {"Piece": ("Float", 0.0, "")}
    text = "The table of a volume in pieces, extended from one of them"
    return node_group("SCFPF Piece of the Table", text, inputs, {"Table": "Geometry"}, _build)


def _build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
    table, (columns, rows, spans) = given["Table"], given["Size"].parts()
    nodes.open_frame("Points of one span, as columns and rows, and those of the piece among them")
    index = nodes.out("GeometryNodeInputIndex", "Index", {}) + 0.0
    cells = columns * rows
    span = ((index + 0.5) / cells).floor()
    within = index - span * cells
    row = ((within + 0.5) / columns).floor()
    place = nodes.xyz(within - row * columns, row, 0.0, "Column, Row")
    own = (nodes.attribute(PIECE) - given["Piece"]).absolute() < 0.25
    numbered = nodes.store(table, NUMBER, index, "FLOAT")
    numbered, _ = nodes.separate(numbered, nodes.both(index < cells - 0.5, own), "Its Points", "POINT")
    number = nodes.attribute(NUMBER)
    column_there = number - ((number + 0.5) / columns).floor() * columns
    flat = nodes.out(
        "GeometryNodeSetPosition",
        "As Columns and Rows",
        {
            "Geometry": numbered,
            "Position": nodes.xyz(column_there, ((number + 0.5) / columns).floor(), 0.0, "Column, Row"),
        },
    )
    nodes.open_frame("The nearest of them, and its neighbors inside")
    nearest = nodes.out(
        "GeometryNodeSampleNearest", "Nearest", {"Geometry": flat, "Sample Position": place}, domain="POINT"
    )
    start = nodes.sample(flat, number, nearest, "FLOAT", "Its Number")
    start_row = ((start + 0.5) / columns).floor()
    start_place = nodes.xyz(start - start_row * columns, start_row, 0.0, "Its Column, Row")
    x, y, _ = start_place.parts()
    away = (place - start_place).parts()
    steps = [
        _way_inside(nodes, given, start, at, count, stride)
        for at, count, stride in ((x, columns, 1.0), (y, rows, columns))
    ]
    nodes.open_frame("On from there")
    first = start + span * cells
    corners = [
        _projector(nodes, table, number) for number in (first, first + steps[0][1], first + steps[1][1])
    ]
    parts = []
    for here, right, up in zip(*corners, strict=True):
        along = (right - here) * (away[0] * steps[0][0]) + (up - here) * (away[1] * steps[1][0])
        parts.append(here + along)
    extended = nodes.matrix([*parts[1:], parts[0]])
    other = nodes.both(nodes.negate(own), index < cells * spans - 0.5)
    return {"Table": nodes.store(table, PROJECTOR, extended, "FLOAT4X4", selection=other)}


def _way_inside(
    nodes: FieldBuilder, given, start: Value, at: Value, count: Value, stride
) -> tuple[Value, Value]:
    """Along columns or rows, where a point's neighbour is of the same piece: +1, -1 or 0; by index."""
    sides = []
    for way in (1.0, -1.0):
        neighbour = (start + stride * way + 0.5).floor()
        piece = nodes.sample(given["Table"], nodes.attribute(PIECE), neighbour, "FLOAT", "Neighbor's Piece")
        there = nodes.both(at + way > -0.5, at + way < count - 0.5)
        sides.append(nodes.both(there, (piece - given["Piece"]).absolute() < 0.25))
    back = nodes.switch(sides[1], 0.0, -1.0, "FLOAT", "Before It?")
    way = nodes.switch(sides[0], back, 1.0, "FLOAT", "After It?")
    return way, way * stride


def _projector(nodes: FieldBuilder, table: Value, number: Value) -> list[Value]:
    """The coefficients of a projector, from that of t⁰ on."""
    matrix = nodes.sample(
        table, nodes.attribute(PROJECTOR, "FLOAT4X4"), (number + 0.5).floor(), "FLOAT4X4", "Projector"
    )
    found = [nodes.point((0.0, 0.0, 0.0), matrix, "t⁰")]
    for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
        found.append(nodes.out("FunctionNodeTransformDirection", "Higher Power", {0: axis, 1: matrix}))
    return found
