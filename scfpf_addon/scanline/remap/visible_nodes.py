# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that tell what is out of the picture, or of the part of it that a branch shows."""

from __future__ import annotations

from math import pi

from ..nodes.field_nodes import FieldBuilder, Value, node_group
from ..table.table_branches import piece_at
from ..table.table_sheets import PIECE
from ..table.uv_pieces import OF_SURFACE, PIECES
from .place_nodes import VIEW_INPUTS, on_screen

# Faces that lie farther out of the picture than this share of it are left out.
FRAME_MARGIN = 0.01

# What is this near to a piece is on it, of the picture: twice what float32 leaves.
ON_PIECE = 1e-6
# Farther than anything in the picture.
FAR_OFF = 10.0

SIDES = ("Corners", "Face", "Any")


def all_on_one_side(nodes: FieldBuilder, given, box: Value, centre: Value | None = None) -> dict[str, Value]:
    """Whether a face lies beyond one side of what is shown.

    "Corners": all its corners do. "Face": its middle does as well. "Any": all of these that have a place.
    """
    view = {key: given[key] for key in ("From", "To", "Numbers", "Aspect")}
    inputs = view | {"Box": box} | ({} if centre is None else {"Middle": centre})
    return nodes.call(one_side_group(), "Beyond One Side", inputs)


def one_side_group():
    """Whether corners and middles of faces lie beyond one side of what is shown."""
    inputs = {key: VIEW_INPUTS[key] for key in ("From", "To", "Numbers", "Aspect")} | {
        "Box": ("Vector", None, "Places of vertices in the viewbox"),
        "Middle": ("Vector", None, "Places of faces' middles"),
    }

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        nodes.open_frame("What is shown")
        low, high = (on_screen(nodes, given, given[end]) for end in ("From", "To"))
        # Nearer is more: z runs from -1 to -2, and is above 0 where there is no place.
        margin = nodes.xyz(FRAME_MARGIN, FRAME_MARGIN, 0.0, "Margin")
        turned = (1.0, 1.0, -1.0)
        below, above = (low * turned - margin).parts(), (high * turned + margin).parts()
        box, middle = (given["Box"] * turned).parts(), (given["Middle"] * turned).parts()
        missing, none = box[2] < 0.0, middle[2] < 0.0
        result = dict.fromkeys(SIDES)
        for axis in range(3):
            for corner, own in (
                (box[axis] > above[axis], middle[axis] > above[axis]),
                (box[axis] < below[axis], middle[axis] < below[axis]),
            ):
                corners = nodes.evaluate_on(corner, "POINT", "BOOLEAN", "All Corners")
                present = nodes.evaluate_on(nodes.either(corner, missing), "POINT", "BOOLEAN", "All Corners")
                sides = (corners, nodes.both(corners, own), nodes.both(present, nodes.either(own, none)))
                for label, side in zip(SIDES, sides, strict=True):
                    result[label] = side if result[label] is None else nodes.either(result[label], side)
        return result

    text = "Whether faces lie beyond one side of what is shown"
    return node_group("SCFPF Beyond One Side", text, inputs, dict.fromkeys(SIDES, "Bool"), build)


def beyond_rim(nodes: FieldBuilder, given, place: Value) -> Value:
    """How far a place is beyond the rim of a polar picture's disc; -1 in other pictures."""
    polar = given["Numbers"].parts()[2]
    off = (place * (1.0, 1.0, 0.0)).length() - 0.5 / given["Aspect"].most(1.0)
    return nodes.mix(polar, -1.0 + polar * 0.0, off)


BORDER_INPUTS = ("Table", "Size", "Numbers", "Aspect", "In Pieces", "Piece", "Border")


def past_border(nodes: FieldBuilder, given, place: Value) -> Value:
    """Above 0 beyond the rim of a polar picture's disc, or off the piece that is shown."""
    inputs = {key: given[key] for key in BORDER_INPUTS} | {"Place": place}
    return nodes.call(beyond_group(), "Beyond", inputs)["Beyond"]


def across_border(nodes: FieldBuilder, given, middle: Value, radius: Value) -> Value:
    """Whether the border of the piece that is shown may run through a face of that middle and radius."""
    inputs = {key: given[key] for key in BORDER_INPUTS} | {"Place": middle, "Radius": radius}
    return nodes.call(across_group(), "Across a Border", inputs)["Across"]


def beyond_group():
    """Whether a place is beyond the rim of a polar picture, or off the piece that is shown."""
    inputs = {key: VIEW_INPUTS[key] for key in BORDER_INPUTS}
    inputs |= {"Place": ("Vector", None, "In the viewbox")}

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        nodes.open_frame("Beyond the rim?")
        rim = beyond_rim(nodes, given, given["Place"])
        nodes.open_frame("On another piece?")
        place, _ = _over_picture(nodes, given, given["Place"])
        own = {key: given[key] for key in ("Border", "Piece")} | {"Place": place}
        away = nodes.call(piece_distance_group(), "How Far from Its Piece", own)["Away"]
        nodes.open_frame("By the nearest point of the table, where there are no borders")
        x, y, _ = given["Place"].parts()
        polar, aspect = given["Numbers"].parts()[2], given["Aspect"]
        disc = 1.0 / aspect.most(1.0)
        across, up = x / nodes.mix(polar, 1.0, disc) + 0.5, y / nodes.mix(polar, 1.0 / aspect, disc) + 0.5
        nearest = piece_at(nodes, given["Table"], given["Size"], nodes.xyz(across, up, 0.0, "Place"))
        off_nearest = (nearest - given["Piece"]).absolute() > 0.25
        size = nodes.node(
            "GeometryNodeAttributeDomainSize", "Borders", {0: given["Border"]}, component="MESH"
        )
        any_border = Value(nodes, size.outputs["Face Count"]) > 0.5
        off = nodes.switch(any_border, off_nearest, away > ON_PIECE, "BOOLEAN", "Borders?")
        off_piece = nodes.switch(off, rim, 1.0, "FLOAT", "Off Its Piece?")
        return {"Beyond": nodes.switch(given["In Pieces"], rim, off_piece, "FLOAT", "In Pieces?")}

    text = "Above 0 beyond the rim of a polar picture, or off the piece that is shown"
    return node_group("SCFPF Beyond", text, inputs, {"Beyond": "Float"}, build)


def across_group():
    """Whether a border of the piece that is shown, or the rim of a polar picture, may run through a face."""
    inputs = {key: VIEW_INPUTS[key] for key in BORDER_INPUTS}
    inputs |= {"Place": ("Vector", None, "A face's middle"), "Radius": ("Float", None, "At least its own")}

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        polar = given["Numbers"].parts()[2]
        nodes.open_frame("The rim?")
        rim = beyond_rim(nodes, given, given["Place"]).absolute() < given["Radius"]
        rim = nodes.both(rim, polar > 0.5)
        nodes.open_frame("A border of the piece?")
        place, centre = _over_picture(nodes, given, given["Place"])
        own = {key: given[key] for key in ("Border", "Piece")} | {"Place": place}
        found = nodes.call(piece_distance_group(), "How Far from Its Border", own | {"Polar": polar})
        radius = given["Radius"] * given["Aspect"].most(1.0)
        # A polar picture's: what is that far along the radius, and round the centre.
        round_it = radius / ((centre - radius).most(1e-6) * (2 * pi))
        reach = nodes.mix(polar, radius, radius * 2.0 + round_it)
        near = nodes.both(found["To Border"] < reach, given["In Pieces"])
        return {"Across": nodes.either(rim, near)}

    text = "Whether the border of the piece that is shown may run through a face"
    return node_group("SCFPF Across a Border", text, inputs, {"Across": "Bool"}, build)


def _over_picture(nodes: FieldBuilder, given, place: Value) -> tuple[Value, Value]:
    """A place of the viewbox as borders have it, 0 to 1 across and up; how far it is from the centre.

    Of a polar picture that is the share of a turn, and of the radius.
    """
    x, y, _ = place.parts()
    polar, aspect = given["Numbers"].parts()[2], given["Aspect"]
    disc = 1.0 / aspect.most(1.0)
    across, up = x / nodes.mix(polar, 1.0, disc), y / nodes.mix(polar, 1.0 / aspect, disc)
    across, up = (one.most(-0.5).least(0.5) for one in (across, up))
    turn = nodes.combine("ARCTAN2", up, across) / (2 * pi)
    centre = nodes.combine("SQRT", across * across + up * up)
    u = nodes.mix(polar, across + 0.5, turn - turn.floor())
    v = nodes.mix(polar, up + 0.5, (centre * 2.0).least(1.0))
    return nodes.xyz(u, v, 0.0, "Over the Picture"), centre


def piece_distance_group():
    """How far a place over the picture is from a piece, and from its border; the greatest of all surfaces."""
    inputs = {key: VIEW_INPUTS[key] for key in ("Border", "Piece")}
    inputs |= {
        "Place": ("Vector", None, "0 to 1 across and up; of a polar picture turn and radius"),
        "Polar": ("Float", 0.0, ""),
    }
    outputs = {"Away": "Float", "To Border": "Float"}
    text = "How far a place is from a piece of the volume, and from that piece's border"
    return node_group("SCFPF To a Piece", text, inputs, outputs, _build_piece_distance)


def _build_piece_distance(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
    surface = nodes.attribute(OF_SURFACE)
    count = nodes.statistic(given["Border"], surface, "Max", "Last Surface") + 1.5

    def body(state: dict[str, Value]) -> dict[str, Value]:
        base = nodes.combine("POWER", PIECES, state["Surface"])
        number = given["Piece"] / base
        number = (number + 1e-3).floor() - (number / PIECES + 1e-5).floor() * PIECES
        own = nodes.both(
            (surface - state["Surface"]).absolute() < 0.5, (nodes.attribute(PIECE) - number).absolute() < 0.5
        )
        faces, _ = nodes.separate(given["Border"], own, "Its Faces")
        ends = nodes.out("GeometryNodeInputPosition", "Position", {})
        x, y, _ = nodes.evaluate_on(ends, "EDGE", "FLOAT_VECTOR", "Middle of the Edge").parts()
        # What runs along the picture's own border is none; that of a polar one is its seam.
        off_x = nodes.mix(given["Polar"], (x - 0.5).absolute(), 0.0)
        inside = off_x.most((y - 0.5).absolute()) < 0.5 - ON_PIECE
        sides = nodes.out("GeometryNodeInputMeshEdgeNeighbors", "Faces at the Edge", {}) + 0.0
        edges, _ = nodes.separate(faces, nodes.both(sides < 1.5, inside), "Its Border", "EDGE")
        # Round a polar picture the other way too.
        way = (given["Place"].parts()[0] < 0.5) * 2.0 - 1.0
        other = given["Place"] + nodes.xyz(way * given["Polar"], 0.0, 0.0, "Round the Other Way")
        found = []
        for target, what, place in (
            (faces, "FACES", given["Place"]),
            (edges, "EDGES", given["Place"]),
            (edges, "EDGES", other),
        ):
            near = nodes.node(
                "GeometryNodeProximity", "Nearest",
                {"Geometry": target, "Sample Position": place}, target_element=what,
            )  # fmt: skip
            found.append((Value(nodes, near.outputs["Distance"]), Value(nodes, near.outputs["Is Valid"])))
        (away, _), (to_border, any_border), (round_it, _) = found
        to_border = to_border.least(round_it)
        to_border = nodes.switch(any_border, FAR_OFF, to_border, "FLOAT", "Any?")
        return {
            "Surface": state["Surface"] + 1.0,
            "Away": state["Away"].most(away),
            "To Border": state["To Border"].least(to_border),
        }

    state = {"Surface": ("FLOAT", 0.0), "Away": ("FLOAT", 0.0), "To Border": ("FLOAT", FAR_OFF)}
    done = nodes.repeat(count, state, "Surfaces in Pieces", body)
    return {key: done[key] for key in ("Away", "To Border")}
