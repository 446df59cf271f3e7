# SPDX-License-Identifier: GPL-3.0-or-later
"""A node group that extends the table of a volume in pieces from one of them, wherever its border runs.

Nothing can be interpolated between the projectors of two pieces. So the points of other pieces, and of holes,
get the projectors that the piece would have there: that of the nearest of its own points, continued by the
change from there to that point's neighbours inside.
"""

from __future__ import annotations

from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group
from ..nodes.solve_nodes import PROJECTOR, TABLE_INPUTS, nearest_sample
from .uv_pieces import PIECE

# Attribute of a piece's points: their index in the table.
NUMBER = "number"


@defines_group(
    "SCFPF Piece of the Table",
    {key: TABLE_INPUTS[key] for key in ("Table", "Size")} | {"Piece": ("Float", 0.0, "")},
    {"Table": "Geometry"},
)
def piece_table_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The table of a volume in pieces, extended from one of them."""
    table, (columns, rows, spans) = given["Table"], given["Size"].parts()
    nodes.open_frame("Points of one span, as columns and rows, and those of the piece among them")
    index = nodes.index() + 0.0
    cells = columns * rows
    span, within = divmod(index, cells)
    row, column = divmod(within, columns)
    place = nodes.xyz(column, row, 0.0, "Column, Row")
    own = nodes.attribute(PIECE).near(given["Piece"], 0.25)
    numbered = nodes.store(table, NUMBER, index, "FLOAT")
    numbered, _ = nodes.separate(numbered, (index < cells - 0.5) & own, "Its Points", "POINT")
    number = nodes.attribute(NUMBER)
    row, column = divmod(number, columns)
    flat = nodes.set_position(numbered, nodes.xyz(column, row, 0.0, "Column, Row"), "As Columns and Rows")
    nodes.open_frame("The nearest of them, and its neighbors inside")
    nearest = nearest_sample(nodes, flat, place)
    start = nodes.sample(flat, number, nearest, "FLOAT", "Its Number")
    row, column = divmod(start, columns)
    start_place = nodes.xyz(column, row, 0.0, "Its Column, Row")
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
    other = ~own & (index < cells * spans - 0.5)
    return {"Table": nodes.store(table, PROJECTOR, extended, "FLOAT4X4", selection=other)}


def _way_inside(
    nodes: GeometryBuilder, given, start: Value, at: Value, count: Value, stride
) -> tuple[Value, Value]:
    """The way along columns or rows to a neighbour of the same piece: +1, -1 or 0; the same by index."""
    sides = []
    for way in (1.0, -1.0):
        neighbour = (start + stride * way + 0.5).floor()
        piece = nodes.sample_attribute(given["Table"], PIECE, neighbour, "Neighbor's Piece", "FLOAT")
        there = (at + way > -0.5) & (at + way < count - 0.5)
        sides.append(there & piece.near(given["Piece"], 0.25))
    back = nodes.switch(sides[1], 0.0, -1.0, "FLOAT", "Before It?")
    way = nodes.switch(sides[0], back, 1.0, "FLOAT", "After It?")
    return way, way * stride


def _projector(nodes: GeometryBuilder, table: Value, number: Value) -> list[Value]:
    """The coefficients of a projector in ascending powers of t."""
    matrix = nodes.sample_attribute(table, PROJECTOR, (number + 0.5).floor(), "Projector", "FLOAT4X4")
    found = [nodes.point((0.0, 0.0, 0.0), matrix, "t⁰")]
    for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
        found.append(nodes.direction(axis, matrix, "Higher Power"))
    return found
