# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that draw a mesh through a volume that is not one-to-one: once for each branch of its inverse.

The nearest t then is in front, as everything is.
"""

from __future__ import annotations

from .field_nodes import FieldBuilder, Value, node_group
from .piece_table_nodes import piece_table_group
from .place_nodes import VIEW_INPUTS, store_places
from .refine_nodes import refine_group
from .table_branches import BRANCH, FIRST_CELL, LAST_CELL, LENGTHS
from .table_nodes import CLOUD
from .uv_pieces import NO_PIECE

OPTIONS = {
    "Mesh": ("Geometry", None, "What the camera looks at"),
    "Inverse": ("Matrix", None, "From the mesh's space into the table's"),
    "Pixel Error": ("Float", 0.5, ""),
    "Picture Width": ("Float", 1000.0, ""),
    "Rounds": ("Int", 12, ""),
}


def with_branches(nodes: FieldBuilder, view, given, single: dict[str, Value]) -> dict[str, Value]:
    """What is drawn of a mesh: by one branch, ``single``, where there is but one, else by each of them."""
    nodes.open_frame("A volume that is not one-to-one: a mesh for each branch of its inverse")
    cloud = view["Cloud"]
    branches = nodes.attribute("branches", "FLOAT_VECTOR")
    count, cut, _ = nodes.sample(cloud, branches, 0, "FLOAT_VECTOR", "Branches").parts()

    def body(state: dict[str, Value]) -> dict[str, Value]:
        own = given | {"Number": state["Number"]}
        point = own.pop("Point")
        made = nodes.call(branch_group(), "Branch", view | own | {"Point": point})
        return {
            "Number": state["Number"] + 1.0,
            "Mesh": nodes.join(state["Mesh"], made["Mesh"]),
            # What one branch leaves out another one draws: the faces are no count.
            "Left Out": state["Left Out"] + made["Left Out"] * (0.0, 1.0, 1.0),
        }

    state = {
        "Number": ("FLOAT", 0.0),
        "Mesh": ("GEOMETRY", None),
        "Left Out": ("VECTOR", (0.0, 0.0, 0.0)),
    }
    every = nodes.repeat(count, state, "Branches", body)
    several = count + cut > 1.5
    return {
        "Mesh": nodes.switch(several, single["Mesh"], every["Mesh"], "GEOMETRY", "Several?"),
        "Left Out": nodes.switch(several, single["Left Out"], every["Left Out"], "VECTOR", "Several?"),
    }


def branch_group():
    """What is drawn of a mesh by one branch."""
    inputs = VIEW_INPUTS | OPTIONS | {
        "Point": ("Vector", None, "Where its vertices are, in the table's space"),
        "Number": ("Float", 0.0, "Of the branch"),
    }  # fmt: skip

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        nodes.open_frame("The samples of the branch")
        number = nodes.attribute(BRANCH) - given["Number"]
        cloud, _ = nodes.separate(given["Cloud"], number.absolute() < 0.5, "Its Samples", "POINT")
        place = nodes.attribute("place", "FLOAT_VECTOR")
        layer = nodes.statistic(cloud, nodes.attribute("layer"), "Max", "Thickest Layer")
        margin = nodes.xyz(1.0 / CLOUD[0], 1.0 / CLOUD[1], layer, "A Cell")
        ends = {
            "From": (nodes.statistic(cloud, place, "Min", "Least") - margin).most((0.0, 0.0, 0.0)),
            "To": (nodes.statistic(cloud, place, "Max", "Greatest") + margin).least((1.0, 1.0, 1.0)),
        }
        view = {key: given[key] for key in VIEW_INPUTS} | ends | {"Cloud": cloud, "Branch": True}
        scale = nodes.statistic(cloud, nodes.attribute(LENGTHS, "FLOAT_VECTOR"), "Mean", "Scale")
        view["Scale"] = scale
        nodes.open_frame("In pieces: its cells of the table, and its piece")
        branches = nodes.attribute("branches", "FLOAT_VECTOR")
        cut = nodes.sample(given["Cloud"], branches, 0, "FLOAT_VECTOR", "Branches").parts()[1] > 0.5
        for label, name in (("First Cell", FIRST_CELL), ("Last Cell", LAST_CELL)):
            own = nodes.sample(cloud, nodes.attribute(name, "FLOAT_VECTOR"), 0, "FLOAT_VECTOR", label)
            view[label] = nodes.switch(cut, given[label], own, "VECTOR", label)
        own = nodes.sample(cloud, nodes.attribute("own piece"), 0, "FLOAT", "Piece") * 0.5
        view["Piece"] = nodes.switch(cut, NO_PIECE, own, "FLOAT", "Piece")
        extended = nodes.call(
            piece_table_group(), "Its Table", {"Table": given["Table"], "Size": given["Size"], "Piece": own}
        )
        view["Table"] = nodes.switch(cut, given["Table"], extended["Table"], "GEOMETRY", "Table")
        nodes.open_frame("The mesh as it sees it")
        mesh = store_places(nodes, given["Mesh"], view | {"Point": given["Point"]})
        options = {key: given[key] for key in OPTIONS}
        return nodes.call(refine_group(), "Refine", view | options | {"Mesh": mesh})

    outputs = {"Mesh": "Geometry", "Left Out": "Vector"}
    text = "What is drawn of a mesh by one branch of a volume's inverse"
    return node_group("SCFPF Branch", text, inputs, outputs, build)
