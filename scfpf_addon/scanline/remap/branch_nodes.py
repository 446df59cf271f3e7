# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that draw a mesh through a volume that is not one-to-one: a copy for each branch.

Depth decides between the copies: the nearest t is in front. All copies are one mesh, whose vertices know
their branch: a node takes the same time for few vertices as for none, and there are a thousand nodes. Only
the pieces of a volume are drawn one by one, since each sees a table of its own.
"""

from __future__ import annotations

from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group
from ..nodes.solve_nodes import REACH
from ..table.piece_table_nodes import piece_table_group
from ..table.table_sheets import (
    BRANCH,
    BRANCH_FIRST_CELL,
    BRANCH_FROM,
    BRANCH_LAST_CELL,
    BRANCH_PIECE,
    BRANCH_SCALE,
    BRANCH_SIGN,
    BRANCH_TO,
    BRANCHES,
)
from .divide_nodes import face_radius
from .place_nodes import BOX, BRANCH_NUMBER, is_known, nearest_in_branch, own_point, store_places
from .refine_nodes import REFINE_INPUTS, REFINED, refine_group

BRANCH_INPUTS = REFINE_INPUTS | {"Count": ("Float", 0.0, "Of branches")}
# A face that comes near to a fold grows in the image by its square root only: it is divided more often.
MORE_ROUNDS = 6
# To search among the samples of one branch only, those of branches stand this many sizes of the volume apart.
APART = 2.0
OWN_FACE, OWN_VERTEX = "scfpf_own_face", "scfpf_own_vertex"
# The properties of a branch: input of the view → attribute and its type.
OF_BRANCH = {
    "From": (BRANCH_FROM, "FLOAT_VECTOR"),
    "To": (BRANCH_TO, "FLOAT_VECTOR"),
    "Scale": (BRANCH_SCALE, "FLOAT_VECTOR"),
    "Sign": (BRANCH_SIGN, "FLOAT"),
}
# Those of a branch of a piece.
OF_PIECE = OF_BRANCH | {
    "First Cell": (BRANCH_FIRST_CELL, "FLOAT_VECTOR"),
    "Last Cell": (BRANCH_LAST_CELL, "FLOAT_VECTOR"),
    "Piece": (BRANCH_PIECE, "FLOAT"),
}


def with_branches(
    nodes: GeometryBuilder, given: dict[str, Value], single: dict[str, Value]
) -> dict[str, Value]:
    """The drawn mesh: ``single`` if the volume has one branch, else the mesh as all its branches draw it."""
    nodes.open_frame("A volume that is not one-to-one: the mesh once for each branch of its inverse")
    count, cut, _ = nodes.sample_attribute(given["Cloud"], BRANCHES, 0, "Branches").parts()
    sheets = nodes.call(every_branch_group(), "Every Branch", {"Count": count}, given)
    pieces = nodes.call(every_piece_group(), "Every Piece", {"Count": count}, given)
    # One choice of three: the sides of a Switch behind another one are evaluated even if none needs them.
    several = nodes.switch(count > 1.5, 0.0, 1.0, "FLOAT", "Several?")
    which = nodes.switch(cut > 0.5, several, 2.0, "FLOAT", "In Pieces?")
    drawn = {}
    for label, kind in (("Mesh", "GEOMETRY"), ("Left Out", "VECTOR")):
        choices = [one[label].socket for one in (single, sheets, pieces)]
        drawn[label] = nodes.choose(which.socket, choices, kind, "Drawn")
    return drawn


@defines_group("SCFPF Every Piece", BRANCH_INPUTS, REFINED)
def every_piece_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The mesh as all branches of a volume in pieces draw it, one by one."""

    def body(state: dict[str, Value]) -> dict[str, Value]:
        made = nodes.call(piece_group(), "Piece", {"Number": state["Number"]}, given)
        return {
            "Number": state["Number"] + 1.0,
            "Mesh": nodes.join(state["Mesh"], made["Mesh"]),
            # Another piece may draw the faces that one leaves out: their number means nothing.
            "Left Out": state["Left Out"] + made["Left Out"] * (0.0, 1.0, 1.0),
        }

    state = {
        "Number": ("FLOAT", 0.0),
        "Mesh": ("GEOMETRY", None),
        "Left Out": ("VECTOR", (0.0, 0.0, 0.0)),
    }
    every = nodes.repeat(given["Count"] + 0.5, state, "Pieces", body)
    return {label: every[label] for label in ("Mesh", "Left Out")}


@defines_group("SCFPF Piece", REFINE_INPUTS | {"Number": ("Float", 0.0, "Of the branch")}, REFINED)
def piece_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The mesh as one branch of a volume in pieces draws it."""
    nodes.open_frame("What is true of it, its samples and its table")
    view = given | {"Branch": True, "In Pieces": True}
    number = (given["Number"] + 0.5).floor()
    for label, (name, kind) in OF_PIECE.items():
        view[label] = nodes.sample_attribute(given["Cloud"], name, number, label, kind)
    here = nodes.attribute(BRANCH).near(number)
    cloud, _ = nodes.separate(given["Cloud"], here, "Its Samples", "POINT")
    table = nodes.call(piece_table_group(), "Its Table", {}, view)["Table"]
    view |= {"Cloud": cloud, "Search": cloud, "Table": table}
    nodes.open_frame("The mesh as it sees it")
    mesh = store_places(nodes, given["Mesh"], view | {"Point": own_point(nodes, given)})
    return nodes.call(refine_group(), "Refine", {"Mesh": mesh}, view)


@defines_group("SCFPF Every Branch", BRANCH_INPUTS, REFINED)
def every_branch_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The mesh as all branches of a folded volume draw it."""
    mesh = _copies(nodes, given)
    nodes.open_frame("The samples, apart from those of other branches")
    spacing = nodes.xyz(given["Extent"].length() * APART, 0.0, 0.0, "Spacing")
    shift = nodes.out(
        "GeometryNodeSetPosition",
        "Samples Apart",
        {"Geometry": given["Cloud"], "Offset": spacing * nodes.attribute(BRANCH)},
    )
    view = given | {"Search": shift, "Spacing": spacing, "Branch": True}
    for label, (name, kind) in OF_BRANCH.items():
        view[label] = nodes.attribute(_own(name), kind)
    mesh = _near_faces(nodes, view, given, mesh)
    nodes.open_frame("The places of what is near")
    mesh = store_places(nodes, mesh, view | {"Point": own_point(nodes, given)})
    unreachable = _unreachable(nodes, given, mesh)
    inputs = {"Mesh": mesh, "Rounds": nodes.integer("ADD", given["Rounds"], MORE_ROUNDS)}
    refined = nodes.call(refine_group(), "Refine", inputs, view)
    left = nodes.xyz(unreachable, refined["Left Out"].parts()[1], 0.0, "Left Out")
    return {"Mesh": refined["Mesh"], "Left Out": left}


def _own(name: str) -> str:
    """The mesh's attribute for an attribute of the cloud."""
    return f"scfpf_{name.replace(' ', '_')}"


def _copies(nodes: GeometryBuilder, given) -> Value:
    """A copy of the mesh for each branch; its vertices know their branch and its properties."""
    nodes.open_frame("A copy for each branch")
    index = nodes.index() + 0.0
    mesh = nodes.store(given["Mesh"], OWN_FACE, index, "FLOAT", "FACE")
    mesh = nodes.store(mesh, OWN_VERTEX, index, "FLOAT")
    one = nodes.out("GeometryNodeGeometryToInstance", "One", {0: mesh})
    inputs = {"Geometry": one, "Amount": given["Count"] + 0.5}
    outputs = ("Geometry", "Duplicate Index")
    duplicate = "GeometryNodeDuplicateElements"
    copies, number = nodes.outs(duplicate, "One for Each", inputs, *outputs, domain="INSTANCE")
    copies = nodes.store(copies, BRANCH_NUMBER, number + 0.0, "FLOAT", "INSTANCE")
    mesh = nodes.out("GeometryNodeRealizeInstances", "One Mesh", {"Geometry": copies})
    nodes.open_frame("What is true of their branches")
    number = (nodes.attribute(BRANCH_NUMBER) + 0.5).floor()
    for label, (name, kind) in OF_BRANCH.items():
        value = nodes.sample_attribute(given["Cloud"], name, number, label, kind)
        mesh = nodes.store(mesh, _own(name), value, kind)
    return mesh


def _near_faces(nodes: GeometryBuilder, view, given, mesh: Value) -> Value:
    """The faces that are as near to their branch as its samples are to each other."""
    nodes.open_frame("Faces that are far from their branch go")
    position = nodes.position()
    radius = face_radius(nodes, position)
    point = own_point(nodes, given)
    nearest = nearest_in_branch(nodes, view, point)
    there = nodes.sample(view["Cloud"], position, nearest, "FLOAT_VECTOR", "Where It Is")
    reach = nodes.sample_attribute(view["Cloud"], REACH, nearest, "Its Reach", "FLOAT")
    far = (point - there).length() - reach - radius
    return nodes.separate(mesh, far > 0.0, "Far")[1]


def _unreachable(nodes: GeometryBuilder, given, mesh: Value) -> Value:
    """The number of faces with a corner in the image and another one that has no place in any branch.

    The volume ends in a fold between the two. Faces out of the image, or across its border, do not count.
    """
    nodes.open_frame("Faces with a corner in the picture and one that no branch reaches")
    x, y, z = nodes.attribute(BOX, "FLOAT_VECTOR").parts()
    framed = (x.absolute() < 0.5) & (y.absolute() * given["Aspect"] < 0.5)
    inside = framed & ((z + 1.5).absolute() < 0.5)
    at_crease = framed & (z > 0.0) & is_known(z)

    def any_copy(value: Value, group: str, domain: str) -> Value:
        total = nodes.out(
            "GeometryNodeAccumulateField",
            "Over the Copies",
            {"Value": value + 0.0, "Group ID": (nodes.attribute(group) + 0.5).floor()},
            "Total",
            domain=domain,
        )
        return nodes.evaluate_on(total, domain, "FLOAT", "Of All Copies")

    placed = any_copy(z < 0.0, OWN_VERTEX, "POINT")
    creased = any_copy(at_crease, OWN_VERTEX, "POINT")
    lost = (placed < 0.5) & (creased > 0.5)
    sides = [nodes.evaluate_on(side + 0.0, "POINT", "FLOAT", "Any Corner") for side in (inside, lost)]
    torn = nodes.evaluate_on(((sides[0] > 0.0) & (sides[1] > 0.0)) + 0.0, "FACE", "FLOAT", "Torn")
    # Once each, however many branches show it.
    share = torn / any_copy(torn, OWN_FACE, "FACE").max(1.0)
    return nodes.statistic(mesh, share, "Sum", "Unreachable", domain="FACE")
