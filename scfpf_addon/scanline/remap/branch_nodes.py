# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that draw a mesh through a volume that is not one-to-one: a copy for each branch.

The nearest t then is in front, as everything is. All copies are one mesh, whose vertices know their branch: a
node costs the same time for few vertices as for none, and there are a thousand nodes. Only pieces of a volume
are drawn one by one, since each sees a table of its own.
"""

from __future__ import annotations

from ..nodes.field_nodes import FieldBuilder, Value, node_group
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
from .place_nodes import BOX, BRANCH_NUMBER, VIEW_INPUTS, is_known, nearest_in_branch, store_places
from .refine_nodes import SPREAD, refine_group

OPTIONS = {
    "Mesh": ("Geometry", None, "What the camera looks at"),
    "Inverse": ("Matrix", None, "From the mesh's space into the table's"),
    "Pixel Error": ("Float", 0.5, ""),
    "Picture Width": ("Float", 1000.0, ""),
    "Rounds": ("Int", 12, ""),
}
# Towards a fold a face grows in the picture by its root only: it is divided more often.
MORE_ROUNDS = 6
# Where the nearest sample of a branch is looked for, those of others are this many sizes of the volume away.
APART = 2.0
OWN_FACE, OWN_VERTEX = "scfpf_own_face", "scfpf_own_vertex"
# What is true of a branch: input of the view → where it is kept, and of which kind.
OF_BRANCH = {
    "From": (BRANCH_FROM, "FLOAT_VECTOR"),
    "To": (BRANCH_TO, "FLOAT_VECTOR"),
    "Scale": (BRANCH_SCALE, "FLOAT_VECTOR"),
    "Sign": (BRANCH_SIGN, "FLOAT"),
}
# And of one that is of a piece.
OF_PIECE = OF_BRANCH | {
    "First Cell": (BRANCH_FIRST_CELL, "FLOAT_VECTOR"),
    "Last Cell": (BRANCH_LAST_CELL, "FLOAT_VECTOR"),
    "Piece": (BRANCH_PIECE, "FLOAT"),
}


def with_branches(nodes: FieldBuilder, view, given, single: dict[str, Value]) -> dict[str, Value]:
    """What is drawn of a mesh: by one branch, ``single``, where there is but one, else by each of them."""
    nodes.open_frame("A volume that is not one-to-one: the mesh once for each branch of its inverse")
    branches = nodes.attribute(BRANCHES, "FLOAT_VECTOR")
    count, cut, _ = nodes.sample(view["Cloud"], branches, 0, "FLOAT_VECTOR", "Branches").parts()
    sheets = nodes.call(every_branch_group(), "Every Branch", view | given | {"Count": count})
    pieces = nodes.call(every_piece_group(), "Every Piece", view | given | {"Count": count})
    drawn = {}
    for label, kind in (("Mesh", "GEOMETRY"), ("Left Out", "VECTOR")):
        whole = nodes.switch(count > 1.5, single[label], sheets[label], kind, "Several?")
        drawn[label] = nodes.switch(cut > 0.5, whole, pieces[label], kind, "In Pieces?")
    return drawn


def every_piece_group():
    """What is drawn of a mesh by all branches of a volume in pieces, one by one."""
    inputs = VIEW_INPUTS | OPTIONS | {"Count": ("Float", 0.0, "Of branches")}

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        own = {key: given[key] for key in VIEW_INPUTS | OPTIONS}

        def body(state: dict[str, Value]) -> dict[str, Value]:
            made = nodes.call(piece_group(), "Piece", own | {"Number": state["Number"]})
            return {
                "Number": state["Number"] + 1.0,
                "Mesh": nodes.join(state["Mesh"], made["Mesh"]),
                # What one piece leaves out another one draws: the faces are no count.
                "Left Out": state["Left Out"] + made["Left Out"] * (0.0, 1.0, 1.0),
            }

        state = {
            "Number": ("FLOAT", 0.0),
            "Mesh": ("GEOMETRY", None),
            "Left Out": ("VECTOR", (0.0, 0.0, 0.0)),
        }
        every = nodes.repeat(given["Count"] + 0.5, state, "Pieces", body)
        return {label: every[label] for label in ("Mesh", "Left Out")}

    text = "What is drawn of a mesh by all pieces of a volume"
    return node_group("SCFPF Every Piece", text, inputs, {"Mesh": "Geometry", "Left Out": "Vector"}, build)


def piece_group():
    """What is drawn of a mesh by one branch of a volume in pieces."""
    inputs = VIEW_INPUTS | OPTIONS | {"Number": ("Float", 0.0, "Of the branch")}

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        nodes.open_frame("What is true of it, its samples and its table")
        view = {key: given[key] for key in VIEW_INPUTS} | {"Branch": True, "In Pieces": True}
        number = (given["Number"] + 0.5).floor()
        for label, (name, kind) in OF_PIECE.items():
            view[label] = nodes.sample(given["Cloud"], nodes.attribute(name, kind), number, kind, label)
        here = (nodes.attribute(BRANCH) - number).absolute() < 0.5
        cloud, _ = nodes.separate(given["Cloud"], here, "Its Samples", "POINT")
        own = {"Table": given["Table"], "Size": given["Size"], "Piece": view["Piece"]}
        table = nodes.call(piece_table_group(), "Its Table", own)["Table"]
        view |= {"Cloud": cloud, "Search": cloud, "Table": table}
        nodes.open_frame("The mesh as it sees it")
        mesh = store_places(nodes, given["Mesh"], view | {"Point": _point(nodes, given)})
        options = {key: given[key] for key in OPTIONS}
        return nodes.call(refine_group(), "Refine", view | options | {"Mesh": mesh})

    text = "What is drawn of a mesh by one branch of a volume in pieces"
    return node_group("SCFPF Piece", text, inputs, {"Mesh": "Geometry", "Left Out": "Vector"}, build)


def every_branch_group():
    """What is drawn of a mesh by all branches of a folded volume."""
    inputs = VIEW_INPUTS | OPTIONS | {"Count": ("Float", 0.0, "Of branches")}
    text = "What is drawn of a mesh by all branches of a folded volume's inverse"
    outputs = {"Mesh": "Geometry", "Left Out": "Vector"}
    return node_group("SCFPF Every Branch", text, inputs, outputs, _build_every_branch)


def _build_every_branch(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
    mesh = _copies(nodes, given)
    nodes.open_frame("The samples, apart from those of other branches")
    spacing = nodes.xyz(given["Extent"].length() * APART, 0.0, 0.0, "Spacing")
    shift = nodes.out(
        "GeometryNodeSetPosition",
        "Samples Apart",
        {"Geometry": given["Cloud"], "Offset": spacing * nodes.attribute(BRANCH)},
    )
    view = {key: given[key] for key in VIEW_INPUTS} | {"Search": shift, "Spacing": spacing}
    view["Branch"] = True
    for label, (name, kind) in OF_BRANCH.items():
        view[label] = nodes.attribute(_own(name), kind)
    mesh = _near_faces(nodes, view, given, mesh)
    nodes.open_frame("The places of what is near")
    mesh = store_places(nodes, mesh, view | {"Point": _point(nodes, given)})
    unreachable = _unreachable(nodes, given, mesh)
    options = {key: given[key] for key in OPTIONS}
    options |= {"Mesh": mesh, "Rounds": nodes.integer("ADD", given["Rounds"], MORE_ROUNDS)}
    refined = nodes.call(refine_group(), "Refine", view | options)
    left = nodes.xyz(unreachable, refined["Left Out"].parts()[1], 0.0, "Left Out")
    return {"Mesh": refined["Mesh"], "Left Out": left}


def _own(name: str) -> str:
    """The mesh's attribute for what the cloud has under a name."""
    return f"scfpf_{name.replace(' ', '_')}"


def _point(nodes: FieldBuilder, given) -> Value:
    position = nodes.out("GeometryNodeInputPosition", "Position", {})
    return nodes.point(position, given["Inverse"], "In Camera's Space")


def _copies(nodes: FieldBuilder, given) -> Value:
    """A copy of the mesh for each branch; vertices know whose they are, and what is true of it."""
    nodes.open_frame("A copy for each branch")
    index = nodes.out("GeometryNodeInputIndex", "Index", {}) + 0.0
    mesh = nodes.store(given["Mesh"], OWN_FACE, index, "FLOAT", "FACE")
    mesh = nodes.store(mesh, OWN_VERTEX, index, "FLOAT")
    one = nodes.out("GeometryNodeGeometryToInstance", "One", {0: mesh})
    inputs = {"Geometry": one, "Amount": given["Count"] + 0.5}
    node = nodes.node("GeometryNodeDuplicateElements", "One for Each", inputs, domain="INSTANCE")
    copies = Value(nodes, node.outputs["Geometry"])
    number = Value(nodes, node.outputs["Duplicate Index"])
    copies = nodes.store(copies, BRANCH_NUMBER, number + 0.0, "FLOAT", "INSTANCE")
    mesh = nodes.out("GeometryNodeRealizeInstances", "One Mesh", {"Geometry": copies})
    nodes.open_frame("What is true of their branches")
    number = (nodes.attribute(BRANCH_NUMBER) + 0.5).floor()
    for label, (name, kind) in OF_BRANCH.items():
        value = nodes.sample(given["Cloud"], nodes.attribute(name, kind), number, kind, label)
        mesh = nodes.store(mesh, _own(name), value, kind)
    return mesh


def _near_faces(nodes: FieldBuilder, view, given, mesh: Value) -> Value:
    """The faces that are as near to their branch as its samples are to each other."""
    nodes.open_frame("Faces that are far from their branch go")
    position = nodes.out("GeometryNodeInputPosition", "Position", {})
    face = nodes.node("GeometryNodeFaceOfCorner", "Face of Corner", {}).outputs["Face Index"]
    middle = nodes.at_index(position, Value(nodes, face), "FACE", "FLOAT_VECTOR")
    square = nodes.evaluate_on((position - middle).dot(position - middle), "CORNER", "FLOAT", "At Corners")
    radius = nodes.combine("SQRT", square) * SPREAD
    point = _point(nodes, given)
    nearest = nearest_in_branch(nodes, view, point)
    there = nodes.sample(view["Cloud"], position, nearest, "FLOAT_VECTOR", "Where It Is")
    reach = nodes.sample(view["Cloud"], nodes.attribute(REACH), nearest, "FLOAT", "Its Reach")
    far = (point - there).length() - reach - radius
    return nodes.separate(mesh, far > 0.0, "Far")[1]


def _unreachable(nodes: FieldBuilder, given, mesh: Value) -> Value:
    """How many faces are in the picture with a corner and have another one without a place in any branch.

    The volume ends in a fold between them. What is out of the picture, or crosses its border, is not counted.
    """
    nodes.open_frame("Faces with a corner in the picture and one that no branch reaches")
    x, y, z = nodes.attribute(BOX, "FLOAT_VECTOR").parts()
    framed = nodes.both(x.absolute() < 0.5, y.absolute() * given["Aspect"] < 0.5)
    inside = nodes.both(framed, (z + 1.5).absolute() < 0.5)
    at_crease = nodes.both(nodes.both(framed, z > 0.0), is_known(z))

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
    lost = nodes.both(placed < 0.5, creased > 0.5)
    sides = [nodes.evaluate_on(side + 0.0, "POINT", "FLOAT", "Any Corner") for side in (inside, lost)]
    torn = nodes.evaluate_on(nodes.both(sides[0] > 0.0, sides[1] > 0.0) + 0.0, "FACE", "FLOAT", "Torn")
    # Once each, however many branches show it.
    share = torn / any_copy(torn, OWN_FACE, "FACE").most(1.0)
    return nodes.statistic(mesh, share, "Sum", "Unreachable", domain="FACE")
