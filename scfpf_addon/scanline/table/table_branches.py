# SPDX-License-Identifier: GPL-3.0-or-later
"""Which parts of a volume a point may be seen through more than once: the branches of its inverse.

A volume is one branch as long as its samples lie in space as they do in the volume. Where it is turned inside
out somewhere it is taken apart into its sheets, which have one sign of the determinant each; where a sheet
passes through where it has been already, into blocks, so that a branch has one place for a point
nearly everywhere. A volume whose surfaces are in pieces is taken apart into those too.
"""

from __future__ import annotations

from ..nodes.field_nodes import FieldBuilder, Value, node_group
from ..nodes.solve_nodes import TABLE_INPUTS, look_up_group, nearest_sample, nearest_start, solve_group
from .table_sheets import (
    BRANCH,
    FIRST_CELL,
    FOLDED,
    LAST_CELL,
    LENGTHS,
    PIECE,
    SHEET,
    describe_branches,
    store_sheets,
)
from .uv_pieces import NO_PIECE

# Blocks across, up and along a volume that passes through itself.
BLOCKS = (2, 2, 3)
# Below this share of the product of its columns' lengths a determinant is nought but for rounding.
FLAT = 1e-4
# A point that is also seen from this much farther along the volume is seen twice.
TWICE = 0.2
# Nor is a solution that one more step would move by more than this one.
SOLVED = 2e-3
# Parts of the volume, along each axis, that are looked at for points of the other ones.
PARTS = 3
# From point to point of the cloud until every point knows the sheet that it is on.
SHEET_STEPS = 44

BLOCK = "block"


def relative_determinant(nodes: FieldBuilder, found: dict[str, Value]) -> Value:
    """det[Qx Qy Qt] over the product of the columns' lengths."""
    x, y, t = (found[f"By {axis}"] for axis in "xyt")
    return x.dot(y.cross(t)) / (x.length() * y.length() * t.length()).most(1e-30)


def block_number(nodes: FieldBuilder, x: Value, y: Value, share: Value) -> Value:
    """The number of the block of a place; share: how far along the volume, by layers of the cloud."""
    across, up, along = BLOCKS
    parts = ((x, across), (y, up), (share, along))
    numbers = [(value * float(count)).floor().most(0.0).least(count - 1.0) for value, count in parts]
    return numbers[0] + numbers[1] * float(across) + numbers[2] * float(across * up)


def piece_at(nodes: FieldBuilder, table: Value, size: Value, place: Value) -> Value:
    """The piece of the point of the table that is nearest to a place."""
    nearest = (place.most((0.0, 0.0, 0.0)).least((1.0, 1.0, 1.0)) * (size - (1.0, 1.0, 0.0)) + 0.5).floor()
    x, y, _ = nearest.parts()
    return nodes.sample(table, nodes.attribute(PIECE), x + y * size.parts()[0], "FLOAT", "Its Piece")


def pieces_of_cell(nodes: FieldBuilder, table: Value, size: Value, place: Value) -> tuple[Value, Value]:
    """The least and the greatest number of a piece at the corners of the cell that a place is in."""
    cell = (place * (size - (1.0, 1.0, 0.0))).floor().most((0.0, 0.0, 0.0)).least(size - (2.0, 2.0, 0.0))
    x, y, _ = cell.parts()
    columns = size.parts()[0]
    # Half more: whole numbers must not fall short by rounding.
    first = x + y * columns + 0.5
    found = [
        nodes.sample(table, nodes.attribute(PIECE), (first + step).floor(), "FLOAT", "Piece of a Corner")
        for step in (0.0, 1.0, columns, columns + 1.0)
    ]
    low, high = found[0], found[0]
    for other in found[1:]:
        low, high = low.least(other), high.most(other)
    return low, high


def with_pieces(nodes: FieldBuilder, whole, cloud: Value) -> Value:
    """Of a cloud, what is on a piece of the volume, with its number and its cells."""
    inputs = {key: whole[key] for key in ("Table", "Size")} | {"Cloud": cloud}
    return nodes.call(pieces_group(), "Pieces", inputs)["Cloud"]


def pieces_group():
    """Of a cloud, what is on a piece of the volume, with its number and its cells."""
    inputs = {key: TABLE_INPUTS[key] for key in ("Table", "Size")} | {"Cloud": ("Geometry", None, "")}
    text = "Of the samples of a volume in pieces those that are on one, with its number and its cells"
    return node_group("SCFPF Pieces", text, inputs, {"Cloud": "Geometry"}, _build_pieces)


def _build_pieces(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
    nodes.open_frame("Pieces of the volume; a cell of the table that is on two of them says nothing")
    table, size, cloud = given["Table"], given["Size"], given["Cloud"]
    least, most = pieces_of_cell(nodes, table, size, nodes.attribute("place", "FLOAT_VECTOR"))
    one = nodes.both(most - least < 0.25, least > NO_PIECE + 0.25)
    cloud = nodes.store(
        cloud, "own piece", nodes.switch(one, NO_PIECE, least * 2.0, "FLOAT", "One?"), "FLOAT"
    )
    cloud, _ = nodes.separate(cloud, nodes.attribute("own piece") > -0.5, "On a Piece", "POINT")
    cloud = numbered(nodes, cloud, nodes.attribute("own piece"), PIECE)
    last = nodes.statistic(cloud, nodes.attribute(PIECE), "Max", "Last Piece")
    nodes.open_frame("Their first and last cells")
    index = nodes.out("GeometryNodeInputIndex", "Index", {})
    columns, rows, spans = size.parts()
    row = ((index + 0.5) / columns).floor()
    first_span, _ = nodes.separate(table, index + 0.0 < columns * rows - 0.5, "One Span", "POINT")
    flat = nodes.out(
        "GeometryNodeSetPosition",
        "Column and Row",
        {"Geometry": first_span, "Position": nodes.xyz(index - row * columns, row, 0.0, "Column, Row")},
    )

    def body(state: dict[str, Value]) -> dict[str, Value]:
        here = (nodes.attribute(PIECE) - state["Number"]).absolute() < 0.5
        key = nodes.statistic(state["Cloud"], nodes.attribute("own piece"), "Max", "Its Key", here)
        same = (nodes.attribute(PIECE) * 2.0 - key).absolute() < 0.5
        own, _ = nodes.separate(flat, same, "Its Points", "POINT")
        box = nodes.node("GeometryNodeBoundBox", "Its Box", {"Geometry": own})
        # Rounded: the box has the points' radii around them.
        low, high = ((Value(nodes, box.outputs[name]) + 0.5).floor() for name in ("Min", "Max"))
        high = (high - (1.0, 1.0, 0.0)).most(low) + nodes.xyz(0.0, 0.0, spans - 1.0, "Last Span")
        cloud = nodes.store(state["Cloud"], FIRST_CELL, low, "FLOAT_VECTOR", selection=here)
        cloud = nodes.store(cloud, LAST_CELL, high, "FLOAT_VECTOR", selection=here)
        return {"Number": state["Number"] + 1.0, "Cloud": cloud}

    state = {"Number": ("FLOAT", 0.0), "Cloud": ("GEOMETRY", cloud)}
    return {"Cloud": nodes.repeat(last + 1.5, state, "Pieces", body)["Cloud"]}


def cells_of_piece(nodes: FieldBuilder, whole, cut: Value) -> dict[str, Value]:
    """The cells that a point of the cloud looks at: those of its piece."""
    return {
        label: nodes.switch(cut, whole[label], nodes.attribute(name, "FLOAT_VECTOR"), "VECTOR", label)
        for label, name in (("First Cell", FIRST_CELL), ("Last Cell", LAST_CELL))
    }


def store_branches(nodes: FieldBuilder, whole, cloud: Value, cut: Value) -> dict[str, Value]:
    """The cloud in order of its branches ("Cloud"), and what ``branches_group`` says of them.

    The cloud must have "place" and ``BLOCK``; it gets ``BRANCH`` and ``FOLDED``.
    """
    return nodes.call(branches_group(), "Branches", whole | {"Cloud": cloud, "Cut": cut})


def branches_group():
    """Numbers the branches of a volume's inverse."""
    inputs = TABLE_INPUTS | {
        "Cloud": ("Geometry", None, "Points all over the volume"),
        "Cut": ("Bool", False, "Is the volume in pieces?"),
    }
    # Turn: the sign of the volume's determinant. Flat: 1 where all projectors lie in one surface, else 0.
    outputs = {"Cloud": "Geometry", "Turn": "Float", "Count": "Float", "Flat": "Float"}
    text = "Numbers the branches of a volume's inverse, one for a volume that is one-to-one"
    return node_group("SCFPF Branches", text, inputs, outputs, _build_branches)


def _build_branches(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
    whole = {key: given[key] for key in TABLE_INPUTS}
    cloud, cut = given["Cloud"], given["Cut"]
    nodes.open_frame("Where is the volume turned inside out?")
    place = nodes.attribute("place", "FLOAT_VECTOR")
    found = nodes.call(look_up_group(), "Q(place)", whole | {"Position": place})
    determinant = relative_determinant(nodes, found)
    sign = nodes.statistic(cloud, determinant, "Median", "Turn of the volume")
    flat = nodes.statistic(cloud, determinant.absolute(), "Max", "Greatest") < FLAT
    turn = (sign > 0.0) * 2.0 - 1.0
    cloud = nodes.store(cloud, FOLDED, determinant * turn < -FLAT, "FLOAT")
    lengths = nodes.xyz(*(found[f"By {axis}"].length() for axis in "xyt"), "Lengths")
    cloud = nodes.store(cloud, LENGTHS, lengths, "FLOAT_VECTOR")
    folds = nodes.statistic(cloud, nodes.attribute(FOLDED), "Sum", "Folded Samples")
    nodes.open_frame("Its sheets")
    spreads = nodes.both(folds > 0.5, nodes.negate(nodes.either(cut, flat)))
    steps = nodes.switch(spreads, 0.0, SHEET_STEPS, "FLOAT", "Any Folds?")
    sheets = store_sheets(nodes, cloud, given["Wrap"], steps + 0.5)
    by_sign = nodes.store(cloud, SHEET, nodes.attribute(FOLDED), "FLOAT")
    cloud = nodes.switch(spreads, by_sign, sheets, "GEOMETRY", "Any Folds?")
    nodes.open_frame("Does a sheet pass through itself?")
    axes = []
    for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)):
        axes.append(
            nodes.call(seen_twice_group(), "Seen Twice", whole | {"Cloud": cloud, "Axis": axis})["Count"]
        )
    # Pieces have their own places; only where they are folded as well they are taken apart into blocks.
    twice = nodes.switch(cut, axes[0] + axes[1] + axes[2], folds, "FLOAT", "In Pieces?")
    nodes.open_frame("Numbers of the branches")
    blocks = float(BLOCKS[0] * BLOCKS[1] * BLOCKS[2])
    key = nodes.attribute(SHEET) * blocks + nodes.attribute(BLOCK) * (twice > 0.5)
    piece = nodes.attribute(PIECE) * (2.0 * blocks)
    key = nodes.switch(cut, key, key + piece, "FLOAT", "In Pieces?")
    cloud = numbered(nodes, cloud, key, BRANCH)
    last = nodes.statistic(cloud, nodes.attribute(BRANCH), "Max", "Last Branch")
    count = nodes.switch(flat, last + 1.0, 0.0, "FLOAT", "Any?")
    described = describe_branches(nodes, whole["Size"], cloud, cut, count, turn)
    cloud = nodes.switch(count + cut > 1.5, cloud, described, "GEOMETRY", "Several?")
    return {"Cloud": cloud, "Turn": sign, "Count": count, "Flat": flat + 0.0}


def numbered(nodes: FieldBuilder, points: Value, key: Value, name: str) -> Value:
    """Points in order of a key; as an attribute, how many smaller keys there are."""
    points = nodes.store(points, name, key, "FLOAT")
    key = nodes.attribute(name)
    ordered = nodes.out("GeometryNodeSortElements", "In Order", {"Geometry": points, "Sort Weight": key})
    index = nodes.out("GeometryNodeInputIndex", "Index", {}) + 0.0
    before = nodes.at_index(key, (index - 0.5).floor().most(0.0), "POINT", "FLOAT")
    rank = nodes.out("GeometryNodeAccumulateField", "Rank", {"Value": (key - before).absolute() > 0.5})
    return nodes.store(ordered, name, rank, "FLOAT")


def seen_twice_group():
    """How many of a cloud's points are also seen from far along an axis of the same sheet."""
    inputs = TABLE_INPUTS | {
        "Cloud": ("Geometry", None, "Points all over the volume"),
        "Axis": ("Vector", None, "1 for x, y or t"),
    }

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        table = {key: given[key] for key in TABLE_INPUTS}
        place = nodes.attribute("place", "FLOAT_VECTOR")
        point = nodes.out("GeometryNodeInputPosition", "Position", {})
        wrap = given["Wrap"].dot(given["Axis"])
        total = None
        for number in range(PARTS):
            nodes.open_frame(f"From part {number + 1}")
            own_part = (place.dot(given["Axis"]) * float(PARTS)).floor().least(PARTS - 1.0)
            part, _ = nodes.separate(given["Cloud"], (own_part - number).absolute() < 0.5, "Part", "POINT")
            start, distance, reach = nearest_start(nodes, part, point)
            sheet = nodes.sample(
                part, nodes.attribute(SHEET), nearest_sample(nodes, part, point), "FLOAT", "Its Sheet"
            )
            away = _along(given["Axis"], start - place, wrap)
            same = (sheet - nodes.attribute(SHEET)).absolute() < 0.5
            candidate = nodes.both(nodes.both(distance < reach, same), away > TWICE)
            solved = nodes.call(solve_group(), "Solve", table | {"Point": point, "Start": start, "Steps": 6})
            there = (solved["Position"] - (0.5, 0.5, 0.5)).absolute()
            a, b, c = there.parts()
            inside = nodes.both(a.most(b).most(c) < 0.5, solved["Last Step"] < SOLVED)
            other = nodes.both(inside, _along(given["Axis"], solved["Position"] - place, wrap) > TWICE)
            count = nodes.statistic(given["Cloud"], other + 0.0, "Sum", "Seen Twice", candidate)
            total = count if total is None else total + count
        return {"Count": total}

    text = "How many points of a volume are also seen from far along an axis of the same sheet"
    return node_group("SCFPF Seen Twice", text, inputs, {"Count": "Float"}, build)


def _along(axis: Value, difference: Value, wrap: Value) -> Value:
    """How far along an axis, the short way round where it is periodic."""
    far = difference.dot(axis)
    return (far - (far + 0.5).floor() * wrap).absolute()
