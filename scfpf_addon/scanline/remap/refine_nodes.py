# SPDX-License-Identifier: GPL-3.0-or-later
"""The node group that divides large faces until they are right in the viewbox, and crops the mesh.

``divide_nodes`` judges and divides once. Small faces, nearly all of a dense mesh, are passed by.
"""

from __future__ import annotations

from ...bridge.blender import versions
from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group
from ..table.table_sheets import FOLDED
from .divide_nodes import (
    DIVIDE_INPUTS,
    SPREAD,
    all_nowhere,
    all_there,
    beyond_crease,
    face_radius,
    is_sheet,
    period,
    round_group,
)
from .place_nodes import BOX, UNKNOWN, crease_group, is_known, own_point
from .visible_nodes import across_border, all_on_one_side, beyond_rim, past_border

# For a pixel error of 1, faces whose vertices lie within this many pixels are passed by. For other errors the
# limit goes by the square root: a straight edge's error grows with the square of its length.
SMALL = 16.0
# Parts of an edge are below float32's resolution after so many rounds; a file may ask for any number.
MOST_ROUNDS = 24
# A mesh so many times as large as the volume is divided more often: by so many rounds, and by one for each
# doubling of its size. Volumes of several branches, whose faces often have no place, are slow to divide.
LARGE, LARGE_OF_BRANCHES, MORE_ROUNDS = 1.0, 4.0, 3.0
# A face without a place stays so if it is smaller than this share of the distance of the cloud's points.
SMALL_SHARE = 0.5

REFINE_INPUTS = DIVIDE_INPUTS | {"Rounds": ("Int", 12, "")}
REFINED = {"Mesh": "Geometry", "Left Out": "Vector"}


@defines_group("SCFPF Refine", REFINE_INPUTS, REFINED)
def refine_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """Divides large faces until they are right in the viewbox, and leaves out faces outside of it.

    Left Out: the numbers of faces without a place, and of folded samples of the volume.
    """
    nodes.open_frame("Small faces that are wholly there stay as they are")
    has_border = (given["Numbers"].parts()[2] > 0.5) | given["In Pieces"]
    small_part, rest, large = _split(nodes, given, has_border)
    end = _rounds(nodes, given, _to_divide(nodes, given, rest))
    nodes.open_frame("What is still too large stays if it is wholly there")
    whole, torn = nodes.separate(end["Active"], all_there(nodes), "Wholly There")
    lost = end["Left"] + nodes.domain_size(torn, "Face Count")
    left = nodes.switch(large > 0.5, 0.0, lost, "FLOAT", "Any Large?")
    mesh = _onto_creases(nodes, given, nodes.join(end["Done"], whole))
    nodes.open_frame("Faces across the seam of a periodic picture stand at both of its ends")
    for axis in range(2):
        wraps = given["Wrap"].parts()[axis] > 0.5
        mesh = nodes.switch(wraps, mesh, at_both_ends(nodes, given, mesh, axis), "GEOMETRY", "Periodic?")
    folded = nodes.statistic(given["Cloud"], nodes.attribute(FOLDED), "Sum", "Folded Samples")
    # Where all faces are small, as in dense meshes, the mesh is not even copied.
    mesh = nodes.switch(large > 0.5, given["Mesh"], nodes.join(small_part, mesh), "GEOMETRY", "Any Large?")
    nodes.open_frame("A polar picture ends at its rim")
    mesh = nodes.switch(has_border, mesh, trimmed(nodes, given, mesh), "GEOMETRY", "Polar?")
    return {"Mesh": mesh, "Left Out": nodes.xyz(left, folded, 0.0, "Left Out")}


def _split(nodes: GeometryBuilder, given, has_border: Value) -> tuple[Value, Value, Value]:
    """The small faces that need no look, the others, and above 0 if there are any others."""
    box = nodes.attribute(BOX, "FLOAT_VECTOR")
    square = nodes.evaluate_on(box.dot(box), "POINT", "FLOAT", "At Vertices")
    limit = SMALL / given["Picture Width"]
    spread = limit * limit * given["Pixel Error"] * (1 / 3)
    there = box.parts()[2] < 0.0
    variance = square - box.dot(box)
    # Not the maximum: Blender sorts for it. As little as possible about faces: there are most of them.
    large = nodes.statistic(given["Mesh"], variance > spread, "Sum", "Large Faces", domain="FACE")
    nowhere = nodes.statistic(given["Mesh"], box.parts()[2] > 0.0, "Sum", "Vertices without a Place")
    large = large + nowhere + given["Branch"]
    small, rest = nodes.separate(given["Mesh"], (variance < spread) & there, "Small Faces")
    _, shown = nodes.separate(small, all_on_one_side(nodes, given, box)["Corners"], "Out of the Branch")
    small = nodes.switch(given["Branch"], small, shown, "GEOMETRY", "Branch?")
    middle = nodes.evaluate_on(box, "FACE", "FLOAT_VECTOR", "Middle")
    radius = (square - middle.dot(middle)).max(0.0).root() * SPREAD
    crossing = across_border(nodes, given, middle, radius)
    at_rim, within = nodes.separate(small, crossing, "At the Rim")
    rest = nodes.switch(has_border, rest, nodes.join(rest, at_rim), "GEOMETRY", "Polar?")
    return nodes.switch(has_border, small, within, "GEOMETRY", "Polar?"), rest, large + has_border


def _to_divide(nodes: GeometryBuilder, given: dict[str, Value], rest: Value) -> Value:
    """The triangles of a mesh, except for faces that cannot be seen."""
    nodes.open_frame("Faces that are out of the volume, or small there and without a place, go")
    away, reach, z = nodes.attribute(BOX, "FLOAT_VECTOR").parts()
    beyond = beyond_crease(given, z)
    away = nodes.switch(is_known(z), away.max(reach * SMALL_SHARE), beyond, "FLOAT", "How Far")
    certain = is_known(z) | (z > UNKNOWN + 3.5)
    gone = all_nowhere(nodes) & certain & (face_radius(nodes, nodes.position()) < away)
    _, rest = nodes.separate(rest, gone, "Out of the Volume")
    triangulate = nodes.node("GeometryNodeTriangulate", "Triangles", {"Mesh": rest})
    versions.set_node_menu(triangulate, "Quad Method", "quad_method", "FIXED")
    nodes.close_frame()
    return Value(nodes, triangulate.outputs[0])


def _rounds(nodes: GeometryBuilder, given, triangles: Value) -> dict[str, Value]:
    """Divide as often as it takes.

    Active: the faces that are still to be divided. Done: the others. Left: how many faces are left out.
    """

    def body(state: dict[str, Value]) -> dict[str, Value]:
        made = nodes.call(round_group(), "Divide Once", {"Mesh": state["Active"]}, given)
        return {
            "Active": made["Active"],
            "Done": nodes.join(state["Done"], made["Done"]),
            "Left": state["Left"] + made["Left"],
        }

    def any_left(state: dict[str, Value]) -> Value:
        return nodes.domain_size(state["Active"], "Face Count") > 0.5

    state = {"Active": ("GEOMETRY", triangles), "Done": ("GEOMETRY", None), "Left": ("FLOAT", 0.0)}
    rounds = nodes.integer("ADD", given["Rounds"], _more_rounds(nodes, given, triangles))
    rounds = nodes.integer("MINIMUM", rounds, MOST_ROUNDS)
    return nodes.repeat(rounds, state, "Divide", body, any_left)


def _more_rounds(nodes: GeometryBuilder, given, triangles: Value) -> Value:
    """The rounds that faces larger than the volume need besides, such as a ground or a dome of the sky."""
    low, high = nodes.outs("GeometryNodeBoundBox", "Faces", {"Geometry": triangles}, "Min", "Max")
    least, most = nodes.outs("GeometryNodeBoundBox", "Volume", {"Geometry": given["Cloud"]}, "Min", "Max")
    times = (high - low).largest() * (1.0 / (most - least).largest().max(1e-30))
    more = nodes.combine("LOGARITHM", times.max(1.0), 2.0) + MORE_ROUNDS
    limit = nodes.switch(given["Branch"], LARGE, LARGE_OF_BRANCHES, "FLOAT", "Large")
    return nodes.switch(times > limit, 0.0, more, "FLOAT", "Larger?")


def _onto_creases(nodes: GeometryBuilder, given, mesh: Value) -> Value:
    """The mesh with the vertices beyond the creases of sheets put onto them."""
    nodes.open_frame("Of sheets, what is beyond a crease is put onto it")
    point = own_point(nodes, given)
    crease = nodes.call(crease_group(), "Onto the Crease", {"Point": point}, given)["Position"]
    beyond = nodes.attribute(BOX, "FLOAT_VECTOR").parts()[2] > 0.0
    at_crease = nodes.store(mesh, BOX, crease, "FLOAT_VECTOR", selection=beyond)
    return nodes.switch(is_sheet(given), mesh, at_crease, "GEOMETRY", "Sheets?")


def at_both_ends(nodes: GeometryBuilder, given, mesh: Value, axis: int) -> Value:
    """The mesh with two copies of the faces across the seam, one at each end of the image."""
    box = nodes.attribute(BOX, "FLOAT_VECTOR")
    along, whole = box.parts()[axis], period(nodes, given).parts()[axis]
    shares = [
        nodes.evaluate_on(side, "POINT", "FLOAT", "At Vertices")
        for side in (along > whole * 0.25, along < whole * -0.25)
    ]
    crossing, other = nodes.separate(mesh, (shares[0] > 0.0) & (shares[1] > 0.0), "Across the Seam")
    copies = []
    for side, way in ((along < 0.0, 1.0), (along > 0.0, -1.0)):
        shift = side * whole * way
        moved = box + nodes.xyz(*(shift if i == axis else 0.0 for i in range(3)), "Round")
        copies.append(nodes.store(crossing, BOX, moved, "FLOAT_VECTOR"))
    return nodes.join(other, *copies)


def trimmed(nodes: GeometryBuilder, given, mesh: Value) -> Value:
    """The mesh cropped at the rim of a polar image: faces beyond it go, corners beyond it move onto it."""
    box = nodes.attribute(BOX, "FLOAT_VECTOR")
    beyond = beyond_rim(nodes, given, box)
    off = past_border(nodes, given, box) > 0.0
    every = nodes.evaluate_on(off, "POINT", "BOOLEAN", "All Corners")
    _, shown = nodes.separate(mesh, every, "Beyond the Rim")
    rim = 0.5 / given["Aspect"].max(1.0)
    share = rim / (rim + beyond.max(0.0))
    moved = box * nodes.xyz(share, share, 1.0, "Onto the Rim")
    return nodes.store(shown, BOX, moved, "FLOAT_VECTOR")
