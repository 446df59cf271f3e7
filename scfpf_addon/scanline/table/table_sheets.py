# SPDX-License-Identifier: GPL-3.0-or-later
"""The sheets of a folded volume, and what is true of each branch of its inverse."""

from __future__ import annotations

from ..nodes.field_nodes import FieldBuilder, Value, node_group
from ..nodes.solve_nodes import TABLE_INPUTS
from .uv_pieces import NO_PIECE

# Points of the cloud across, up and along the volume.
CLOUD = (12, 12, 16)

# What the whole table says of branches: how many, whether the volume is in pieces, and whether it is flat.
BRANCHES = "branches"
SHEET = "sheet"
BRANCH, FOLDED, LENGTHS = "branch", "folded", "lengths"
# Of points of the table and the cloud: which piece of a volume in pieces they are of; and its cells.
PIECE, FIRST_CELL, LAST_CELL = "piece", "first cell", "last cell"
# What is true of a branch stands on the cloud's point of its number.
BRANCH_FROM, BRANCH_TO, BRANCH_SCALE = "branch from", "branch to", "branch scale"
BRANCH_SIGN, BRANCH_PIECE = "branch sign", "branch piece"
BRANCH_FIRST_CELL, BRANCH_LAST_CELL = "branch first cell", "branch last cell"


def store_sheets(nodes: FieldBuilder, cloud: Value, wrap: Value, steps: Value) -> Value:
    """A whole cloud with the number of the sheet of each point: neighbours of one sign are of one sheet."""
    inputs = {"Cloud": cloud, "Wrap": wrap, "Steps": steps}
    return nodes.call(sheets_group(), "Sheets", inputs)["Cloud"]


def sheets_group():
    """Numbers the sheets of a volume."""
    inputs = {
        "Cloud": ("Geometry", None, "Points all over the volume, which know whether they are folded"),
        "Wrap": TABLE_INPUTS["Wrap"],
        "Steps": ("Int", 0, "From point to neighboring point"),
    }

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        nodes.open_frame("Neighbors across, up and along the volume")
        index = nodes.out("GeometryNodeInputIndex", "Index", {}) + 0.0
        wrap, stride, neighbours = given["Wrap"].parts(), 1.0, []
        for axis, count in enumerate(CLOUD):
            row = ((index + 0.5) / stride).floor()
            number = row - ((row + 0.5) / float(count)).floor() * float(count)
            for way in (-1.0, 1.0):
                moved = number + way
                round_ = moved - ((moved + 0.5) / float(count)).floor() * float(count)
                there = nodes.mix(wrap[axis], moved.most(0.0).least(count - 1.0), round_)
                neighbours.append((index + (there - number) * stride + 0.5).floor())
            stride *= count
        cloud = nodes.store(given["Cloud"], SHEET, index, "FLOAT")

        def body(state: dict[str, Value]) -> dict[str, Value]:
            sheet, folded = nodes.attribute(SHEET), nodes.attribute(FOLDED)
            most = sheet
            for neighbour in neighbours:
                theirs = nodes.at_index(sheet, neighbour, "POINT", "FLOAT")
                other = (nodes.at_index(folded, neighbour, "POINT", "FLOAT") - folded).absolute() > 0.5
                most = most.most(nodes.switch(other, theirs, sheet, "FLOAT", "Another Sheet?"))
            return {"Cloud": nodes.store(state["Cloud"], SHEET, most, "FLOAT")}

        state = {"Cloud": ("GEOMETRY", cloud)}
        return nodes.repeat(given["Steps"], state, "The greatest number spreads", body)

    text = "Numbers the sheets of a volume: what hangs together and is turned the same way"
    return node_group("SCFPF Sheets", text, inputs, {"Cloud": "Geometry"}, build)


def describe_branches(nodes: FieldBuilder, size: Value, cloud: Value, cut, count, turn) -> Value:
    """The cloud, whose first points say what is true of the branches of their numbers."""
    inputs = {"Size": size, "Cloud": cloud, "Cut": cut, "Count": count, "Turn": turn}
    return nodes.call(describe_group(), "Describe Branches", inputs)["Cloud"]


def describe_group():
    """What is true of each branch, on the cloud's point of its number."""
    inputs = {
        "Cloud": ("Geometry", None, "The cloud, whose points know their branches"),
        "Size": TABLE_INPUTS["Size"],
        "Cut": ("Bool", False, "Is the volume in pieces?"),
        "Count": ("Float", None, "Of branches"),
        "Turn": ("Float", None, "The sign of the volume's determinant"),
    }

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        index = nodes.out("GeometryNodeInputIndex", "Index", {}) + 0.0

        def body(state: dict[str, Value]) -> dict[str, Value]:
            cloud, number = state["Cloud"], state["Number"]
            mine = (nodes.attribute(BRANCH) - number).absolute() < 0.5
            place = nodes.attribute("place", "FLOAT_VECTOR")

            def of_mine(value: Value, which: str) -> Value:
                return nodes.statistic(state["Cloud"], value, which, which, mine)

            margin = nodes.xyz(
                1.0 / CLOUD[0], 1.0 / CLOUD[1], of_mine(nodes.attribute("layer"), "Max"), "A Cell"
            )
            folded = of_mine(nodes.attribute(FOLDED), "Max")
            own = of_mine(nodes.attribute("own piece"), "Max") * 0.5
            values = {
                BRANCH_FROM: (of_mine(place, "Min") - margin).most((0.0, 0.0, 0.0)),
                BRANCH_TO: (of_mine(place, "Max") + margin).least((1.0, 1.0, 1.0)),
                BRANCH_SCALE: of_mine(nodes.attribute(LENGTHS, "FLOAT_VECTOR"), "Mean"),
                BRANCH_SIGN: given["Turn"] * (1.0 - folded * 2.0),
                BRANCH_PIECE: nodes.switch(given["Cut"], NO_PIECE, own, "FLOAT", "Piece"),
            }
            last = given["Size"] - (2.0, 2.0, 1.0)
            for name, own_name, whole in (
                (BRANCH_FIRST_CELL, FIRST_CELL, (0.0, 0.0, 0.0)),
                (BRANCH_LAST_CELL, LAST_CELL, last),
            ):
                cells = of_mine(nodes.attribute(own_name, "FLOAT_VECTOR"), "Max")
                values[name] = nodes.switch(given["Cut"], whole, cells, "VECTOR", "Cells")
            here = (index - number).absolute() < 0.5
            for name, value in values.items():
                kind = "FLOAT_VECTOR" if value.is_vector else "FLOAT"
                cloud = nodes.store(cloud, name, value, kind, selection=here)
            return {"Cloud": cloud, "Number": number + 1.0}

        state = {"Cloud": ("GEOMETRY", given["Cloud"]), "Number": ("FLOAT", 0.0)}
        return {"Cloud": nodes.repeat(given["Count"] + 0.5, state, "Branches", body)["Cloud"]}

    text = "What is true of each branch of a volume's inverse"
    return node_group("SCFPF Describe Branches", text, inputs, {"Cloud": "Geometry"}, build)
