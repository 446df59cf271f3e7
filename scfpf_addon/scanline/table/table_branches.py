# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that number the branches of a volume's inverse: parts that show a point once each.

A volume is one branch as long as its samples lie in space as they do in the volume. Where it is turned inside
out, it is taken apart into its sheets, on each of which the determinant has one sign. A sheet that passes
through itself is taken apart into blocks, so that a branch shows nearly every point once. A volume whose
surfaces are in pieces is taken apart into those too.
"""

from __future__ import annotations

from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group
from ..nodes.solve_nodes import (
    PLACE,
    TABLE_INPUTS,
    look_up_group,
    nearest_sample,
    nearest_start,
    solve_group,
)
from .table_sheets import (
    BLOCK,
    BRANCH,
    FIRST_CELL,
    FOLDED,
    LAST_CELL,
    LENGTHS,
    OWN_PIECE,
    SHEET,
    describe_group,
    sheets_group,
)
from .uv_pieces import NO_PIECE, PIECE

# Blocks across, up and along a volume that passes through itself.
BLOCKS = (2, 2, 3)
# A determinant below this share of the product of its columns' lengths is zero but for rounding.
FLAT = 1e-4
# A point is seen twice if it is also seen from this much farther along the volume.
TWICE = 0.2
# One more step of Newton's method moves a solution by less than this.
SOLVED = 2e-3
# Parts of the volume, along each axis, that are searched for points of the others.
PARTS = 3
# Steps from point to point of the cloud until every point knows the sheet that it is on.
SHEET_STEPS = 44


def _relative_determinant(found: dict[str, Value]) -> Value:
    """det[Qx Qy Qt] over the product of the columns' lengths."""
    x, y, t = (found[f"By {axis}"] for axis in "xyt")
    return x.dot(y.cross(t)) / (x.length() * y.length() * t.length()).max(1e-30)


def block_number(nodes: GeometryBuilder, x: Value, y: Value, share: Value) -> Value:
    """The number of the block of a place. share: of the cloud's layers, from the near surface on."""
    across, up, along = BLOCKS
    parts = ((x, across), (y, up), (share, along))
    numbers = [(value * float(count)).floor().max(0.0).min(count - 1.0) for value, count in parts]
    return numbers[0] + numbers[1] * float(across) + numbers[2] * float(across * up)


def piece_at(nodes: GeometryBuilder, table: Value, size: Value, place: Value) -> Value:
    """The piece of the point of the table that is nearest to a place."""
    nearest = (place.max((0.0, 0.0, 0.0)).min((1.0, 1.0, 1.0)) * (size - (1.0, 1.0, 0.0)) + 0.5).floor()
    x, y, _ = nearest.parts()
    return nodes.sample_attribute(table, PIECE, x + y * size.parts()[0], "Its Piece", "FLOAT")


def _pieces_of_cell(nodes: GeometryBuilder, table: Value, size: Value, place: Value) -> tuple[Value, Value]:
    """The least and the greatest number of the pieces at the corners of a place's cell."""
    cell = (place * (size - (1.0, 1.0, 0.0))).floor().max((0.0, 0.0, 0.0)).min(size - (2.0, 2.0, 0.0))
    x, y, _ = cell.parts()
    columns = size.parts()[0]
    # Half more: rounding must not make a whole number fall short.
    first = x + y * columns + 0.5
    found = [
        nodes.sample_attribute(table, PIECE, (first + step).floor(), "Piece of a Corner", "FLOAT")
        for step in (0.0, 1.0, columns, columns + 1.0)
    ]
    low, high = found[0], found[0]
    for other in found[1:]:
        low, high = low.min(other), high.max(other)
    return low, high


@defines_group(
    "SCFPF Pieces",
    {key: TABLE_INPUTS[key] for key in ("Table", "Size")} | {"Cloud": ("Geometry", None, "")},
    {"Cloud": "Geometry"},
)
def pieces_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The samples of a volume that lie on one of its pieces, with that piece's number and cells."""
    nodes.open_frame("Pieces of the volume; a cell of the table that is on two of them says nothing")
    table, size, cloud = given["Table"], given["Size"], given["Cloud"]
    least, most = _pieces_of_cell(nodes, table, size, nodes.attribute(PLACE, "FLOAT_VECTOR"))
    one = (most - least < 0.25) & (least > NO_PIECE + 0.25)
    number = nodes.switch(one, NO_PIECE, least * 2.0, "FLOAT", "One?")
    cloud = nodes.store(cloud, OWN_PIECE, number, "FLOAT")
    cloud, _ = nodes.separate(cloud, nodes.attribute(OWN_PIECE) > -0.5, "On a Piece", "POINT")
    cloud = _numbered(nodes, cloud, nodes.attribute(OWN_PIECE), PIECE)
    last = nodes.statistic(cloud, nodes.attribute(PIECE), "Max", "Last Piece")
    nodes.open_frame("Their first and last cells")
    index = nodes.index()
    columns, rows, spans = size.parts()
    row, column = divmod(index, columns)
    first_span, _ = nodes.separate(table, index + 0.0 < columns * rows - 0.5, "One Span", "POINT")
    flat = nodes.set_position(first_span, nodes.xyz(column, row, 0.0, "Column, Row"), "Column and Row")

    def body(state: dict[str, Value]) -> dict[str, Value]:
        here = nodes.attribute(PIECE).near(state["Number"])
        key = nodes.statistic(state["Cloud"], nodes.attribute(OWN_PIECE), "Max", "Its Key", here)
        same = (nodes.attribute(PIECE) * 2.0).near(key)
        own, _ = nodes.separate(flat, same, "Its Points", "POINT")
        box = nodes.outs("GeometryNodeBoundBox", "Its Box", {"Geometry": own}, "Min", "Max")
        # Rounded: the box has the points' radii around them.
        low, high = ((end + 0.5).floor() for end in box)
        high = (high - (1.0, 1.0, 0.0)).max(low) + nodes.xyz(0.0, 0.0, spans - 1.0, "Last Span")
        cloud = nodes.store(state["Cloud"], FIRST_CELL, low, "FLOAT_VECTOR", selection=here)
        cloud = nodes.store(cloud, LAST_CELL, high, "FLOAT_VECTOR", selection=here)
        return {"Number": state["Number"] + 1.0, "Cloud": cloud}

    state = {"Number": ("FLOAT", 0.0), "Cloud": ("GEOMETRY", cloud)}
    return {"Cloud": nodes.repeat(last + 1.5, state, "Pieces", body)["Cloud"]}


def cells_of_piece(nodes: GeometryBuilder, whole, cut: Value) -> dict[str, Value]:
    """The first and the last cell that a point of the cloud looks at: those of its piece."""
    return {
        label: nodes.switch(cut, whole[label], nodes.attribute(name, "FLOAT_VECTOR"), "VECTOR", label)
        for label, name in (("First Cell", FIRST_CELL), ("Last Cell", LAST_CELL))
    }


@defines_group(
    "SCFPF Branches",
    TABLE_INPUTS
    | {
        "Cloud": ("Geometry", None, "Points all over the volume"),
        "Cut": ("Bool", False, "Is the volume in pieces?"),
    },
    {"Cloud": "Geometry", "Turn": "Float", "Count": "Float", "Flat": "Float"},
)
def branches_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """Numbers the branches of a volume's inverse: one if the volume is one-to-one.

    The cloud must have ``PLACE`` and ``BLOCK``; it gets ``BRANCH`` and ``FOLDED``, and the order of its
    branches. Turn: the sign of the volume's determinant. Flat: 1 if all projectors lie in one surface.
    """
    cloud, cut = given["Cloud"], given["Cut"]
    nodes.open_frame("Where is the volume turned inside out?")
    place = nodes.attribute(PLACE, "FLOAT_VECTOR")
    found = nodes.call(look_up_group(), "Q(place)", {"Position": place}, given)
    determinant = _relative_determinant(found)
    sign = nodes.statistic(cloud, determinant, "Median", "Turn of the volume")
    flat = nodes.statistic(cloud, determinant.absolute(), "Max", "Greatest") < FLAT
    turn = (sign > 0.0) * 2.0 - 1.0
    cloud = nodes.store(cloud, FOLDED, determinant * turn < -FLAT, "FLOAT")
    lengths = nodes.xyz(*(found[f"By {axis}"].length() for axis in "xyt"), "Lengths")
    cloud = nodes.store(cloud, LENGTHS, lengths, "FLOAT_VECTOR")
    folds = nodes.statistic(cloud, nodes.attribute(FOLDED), "Sum", "Folded Samples")
    nodes.open_frame("Its sheets")
    spreads = (folds > 0.5) & ~(cut | flat)
    steps = nodes.switch(spreads, 0.0, SHEET_STEPS, "FLOAT", "Any Folds?")
    inputs = {"Cloud": cloud, "Steps": steps + 0.5}
    sheets = nodes.call(sheets_group(), "Sheets", inputs, given)["Cloud"]
    by_sign = nodes.store(cloud, SHEET, nodes.attribute(FOLDED), "FLOAT")
    cloud = nodes.switch(spreads, by_sign, sheets, "GEOMETRY", "Any Folds?")
    nodes.open_frame("Does a sheet pass through itself?")
    axes = [
        nodes.call(seen_twice_group(), "Seen Twice", {"Cloud": cloud, "Axis": axis}, given)["Count"]
        for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
    ]
    # Pieces do not overlap in the volume: only folded ones are taken apart into blocks.
    twice = nodes.switch(cut, axes[0] + axes[1] + axes[2], folds, "FLOAT", "In Pieces?")
    nodes.open_frame("Numbers of the branches")
    blocks = float(BLOCKS[0] * BLOCKS[1] * BLOCKS[2])
    key = nodes.attribute(SHEET) * blocks + nodes.attribute(BLOCK) * (twice > 0.5)
    piece = nodes.attribute(PIECE) * (2.0 * blocks)
    key = nodes.switch(cut, key, key + piece, "FLOAT", "In Pieces?")
    cloud = _numbered(nodes, cloud, key, BRANCH)
    last = nodes.statistic(cloud, nodes.attribute(BRANCH), "Max", "Last Branch")
    count = nodes.switch(flat, last + 1.0, 0.0, "FLOAT", "Any?")
    inputs = {"Cloud": cloud, "Count": count, "Turn": turn}
    described = nodes.call(describe_group(), "Describe Branches", inputs, given)["Cloud"]
    cloud = nodes.switch(count + cut > 1.5, cloud, described, "GEOMETRY", "Several?")
    return {"Cloud": cloud, "Turn": sign, "Count": count, "Flat": flat + 0.0}


def _numbered(nodes: GeometryBuilder, points: Value, key: Value, name: str) -> Value:
    """Points in order of a key, with the number of smaller keys as an attribute of that name."""
    points = nodes.store(points, name, key, "FLOAT")
    key = nodes.attribute(name)
    ordered = nodes.out("GeometryNodeSortElements", "In Order", {"Geometry": points, "Sort Weight": key})
    index = nodes.index() + 0.0
    before = nodes.at_index(key, (index - 0.5).floor().max(0.0), "POINT", "FLOAT")
    rank = nodes.out("GeometryNodeAccumulateField", "Rank", {"Value": (key - before).absolute() > 0.5})
    return nodes.store(ordered, name, rank, "FLOAT")


@defines_group(
    "SCFPF Seen Twice",
    TABLE_INPUTS
    | {
        "Cloud": ("Geometry", None, "Points all over the volume"),
        "Axis": ("Vector", None, "1 for x, y or t"),
    },
    {"Count": "Float"},
)
def seen_twice_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The number of a volume's points that are also seen from far along an axis of the same sheet."""
    place = nodes.attribute(PLACE, "FLOAT_VECTOR")
    point = nodes.position()
    wrap = given["Wrap"].dot(given["Axis"])
    total = None
    for number in range(PARTS):
        nodes.open_frame(f"From part {number + 1}")
        own_part = (place.dot(given["Axis"]) * float(PARTS)).floor().min(PARTS - 1.0)
        part, _ = nodes.separate(given["Cloud"], own_part.near(number), "Part", "POINT")
        nearest = nearest_sample(nodes, part, point)
        start, distance, reach = nearest_start(nodes, part, point, nearest)
        sheet = nodes.sample_attribute(part, SHEET, nearest, "Its Sheet", "FLOAT")
        away = _along(given["Axis"], start - place, wrap)
        same = sheet.near(nodes.attribute(SHEET))
        candidate = (distance < reach) & same & (away > TWICE)
        solved = nodes.call(solve_group(), "Solve", {"Point": point, "Start": start, "Steps": 6}, given)
        there = (solved["Position"] - (0.5, 0.5, 0.5)).absolute()
        inside = (there.largest() < 0.5) & (solved["Last Step"] < SOLVED)
        other = inside & (_along(given["Axis"], solved["Position"] - place, wrap) > TWICE)
        count = nodes.statistic(given["Cloud"], other + 0.0, "Sum", "Seen Twice", candidate)
        total = count if total is None else total + count
    return {"Count": total}


def _along(axis: Value, difference: Value, wrap: Value) -> Value:
    """The length of a difference along an axis: the shorter way round if the axis is periodic."""
    far = difference.dot(axis)
    return (far - (far + 0.5).floor() * wrap).absolute()
