# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that number the sheets of a folded volume, and describe each branch of its inverse."""

from __future__ import annotations

from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group
from ..nodes.solve_nodes import PLACE, TABLE_INPUTS
from .uv_pieces import NO_PIECE

# Points of the cloud across, up and along the volume.
CLOUD = (12, 12, 16)

# Attribute of the whole table: the number of branches, whether it is in pieces, and whether it is flat.
BRANCHES = "branches"
# Attributes of the cloud's points.
LAYER, LAYER_AHEAD = "layer", "layer ahead"
SHEET, BLOCK, OWN_PIECE = "sheet", "block", "own piece"
BRANCH, FOLDED, LENGTHS = "branch", "folded", "lengths"
# The cells of the table that a piece of the volume is in.
FIRST_CELL, LAST_CELL = "first cell", "last cell"
# Attributes of a branch, on the cloud's point of its number.
BRANCH_FROM, BRANCH_TO, BRANCH_SCALE = "branch from", "branch to", "branch scale"
BRANCH_SIGN, BRANCH_PIECE = "branch sign", "branch piece"
BRANCH_FIRST_CELL, BRANCH_LAST_CELL = "branch first cell", "branch last cell"


@defines_group(
    "SCFPF Sheets",
    {
        "Cloud": ("Geometry", None, "Points all over the volume, which know whether they are folded"),
        "Wrap": TABLE_INPUTS["Wrap"],
        "Steps": ("Int", 0, "From point to neighboring point"),
    },
    {"Cloud": "Geometry"},
)
def sheets_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """Numbers the sheets of a volume: neighboring points of one sign are of one sheet."""
    nodes.open_frame("Neighbors across, up and along the volume")
    index = nodes.index() + 0.0
    wrap, stride, neighbours = given["Wrap"].parts(), 1.0, []
    for axis, count in enumerate(CLOUD):
        row, _ = divmod(index, stride)
        _, number = divmod(row, float(count))
        for way in (-1.0, 1.0):
            moved = number + way
            _, round_ = divmod(moved, float(count))
            there = nodes.mix(wrap[axis], moved.max(0.0).min(count - 1.0), round_)
            neighbours.append((index + (there - number) * stride + 0.5).floor())
        stride *= count
    cloud = nodes.store(given["Cloud"], SHEET, index, "FLOAT")

    def body(state: dict[str, Value]) -> dict[str, Value]:
        sheet, folded = nodes.attribute(SHEET), nodes.attribute(FOLDED)
        most = sheet
        for neighbour in neighbours:
            theirs = nodes.at_index(sheet, neighbour, "POINT", "FLOAT")
            other = (nodes.at_index(folded, neighbour, "POINT", "FLOAT") - folded).absolute() > 0.5
            most = most.max(nodes.switch(other, theirs, sheet, "FLOAT", "Another Sheet?"))
        return {"Cloud": nodes.store(state["Cloud"], SHEET, most, "FLOAT")}

    state = {"Cloud": ("GEOMETRY", cloud)}
    return nodes.repeat(given["Steps"], state, "The greatest number spreads", body)


@defines_group(
    "SCFPF Describe Branches",
    {
        "Cloud": ("Geometry", None, "The cloud, whose points know their branches"),
        "Size": TABLE_INPUTS["Size"],
        "Cut": ("Bool", False, "Is the volume in pieces?"),
        "Count": ("Float", None, "Of branches"),
        "Turn": ("Float", None, "The sign of the volume's determinant"),
    },
    {"Cloud": "Geometry"},
)
def describe_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """Stores the properties of each branch of a volume's inverse on the cloud's point of its number."""
    index = nodes.index() + 0.0

    def body(state: dict[str, Value]) -> dict[str, Value]:
        cloud, number = state["Cloud"], state["Number"]
        mine = nodes.attribute(BRANCH).near(number)
        place = nodes.attribute(PLACE, "FLOAT_VECTOR")

        def of_mine(value: Value, which: str) -> Value:
            return nodes.statistic(state["Cloud"], value, which, which, mine)

        margin = nodes.xyz(1.0 / CLOUD[0], 1.0 / CLOUD[1], of_mine(nodes.attribute(LAYER), "Max"), "A Cell")
        folded = of_mine(nodes.attribute(FOLDED), "Max")
        own = of_mine(nodes.attribute(OWN_PIECE), "Max") * 0.5
        values = {
            BRANCH_FROM: (of_mine(place, "Min") - margin).max((0.0, 0.0, 0.0)),
            BRANCH_TO: (of_mine(place, "Max") + margin).min((1.0, 1.0, 1.0)),
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
        here = index.near(number)
        for name, value in values.items():
            kind = "FLOAT_VECTOR" if value.is_vector else "FLOAT"
            cloud = nodes.store(cloud, name, value, kind, selection=here)
        return {"Cloud": cloud, "Number": number + 1.0}

    state = {"Cloud": ("GEOMETRY", given["Cloud"]), "Number": ("FLOAT", 0.0)}
    return {"Cloud": nodes.repeat(given["Count"] + 0.5, state, "Branches", body)["Cloud"]}
