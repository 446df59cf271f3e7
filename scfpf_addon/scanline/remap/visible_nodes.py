# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that tell faces and places outside the image, or outside the part of it that a branch shows."""

from __future__ import annotations

from math import pi

from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group
from ..table.table_branches import piece_at
from ..table.uv_pieces import OF_SURFACE, PIECE, PIECES
from .place_nodes import VIEW_INPUTS, on_screen

# Faces that lie farther out of the image than this share of it are left out.
FRAME_MARGIN = 0.01

# A place this near to a piece is on it, as a share of the image: twice the error of float32.
ON_PIECE = 1e-6
# Farther than anything in the image.
FAR_OFF = 10.0

SIDES = ("Corners", "Face", "Any")
# The most corners of a face that is divided: triangles become quads.
MOST_CORNERS = 4.0


def all_on_one_side(
    nodes: GeometryBuilder, given, box: Value, centre: Value | None = None
) -> dict[str, Value]:
    """Return whether a face lies beyond one side of the visible part of the volume.

    "Corners": all its corners do. "Face": its middle does as well. "Any": all of these that have a place do.
    "Least Outside": at most how far any that has a place lies outside, along an axis of the image; 0 inside.
    """
    inputs = {"Box": box} | ({} if centre is None else {"Middle": centre})
    return nodes.call(one_side_group(), "Beyond One Side", inputs, given)


@defines_group(
    "SCFPF Beyond One Side",
    {key: VIEW_INPUTS[key] for key in ("From", "To", "Numbers", "Aspect")}
    | {
        "Box": ("Vector", None, "Places of vertices in the viewbox"),
        "Middle": ("Vector", None, "Places of faces' middles"),
    },
    dict.fromkeys(SIDES, "Bool") | {"Least Outside": "Float"},
)
def one_side_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """Return whether corners and middles of faces lie beyond one side of the visible part of the volume."""
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
            present = nodes.evaluate_on(corner | missing, "POINT", "BOOLEAN", "All Corners")
            sides = (corners, corners & own, present & (own | none))
            for label, side in zip(SIDES, sides, strict=True):
                result[label] = side if result[label] is None else result[label] | side
    nodes.open_frame("How far outside of the picture? The mean of inverse squares bounds the least")
    outside = [
        _outside(nodes, place, low * turned, high * turned).max(1e-6)
        for place in (given["Box"], given["Middle"])
    ]
    crowd = nodes.evaluate_on(1.0 / (outside[0] * outside[0]), "POINT", "FLOAT", "At Corners")
    least = (1.0 / (crowd * MOST_CORNERS)).root()
    return result | {"Least Outside": least.min(outside[1])}


def _outside(nodes: GeometryBuilder, place: Value, low: Value, high: Value) -> Value:
    """The distance of a place from what is shown, across or up the image; below 0 inside, large for none."""
    x, y, _ = (low - place).max(place - high).parts()
    return nodes.switch(place.parts()[2] > 0.0, x.max(y), FAR_OFF, "FLOAT", "Nowhere?")


def beyond_rim(nodes: GeometryBuilder, given, place: Value) -> Value:
    """The distance of a place beyond the rim of a polar image's disc; -1 in other images."""
    polar = given["Numbers"].parts()[2]
    off = (place * (1.0, 1.0, 0.0)).length() - 0.5 / given["Aspect"].max(1.0)
    return nodes.mix(polar, -1.0 + polar * 0.0, off)


BORDER_INPUTS = {
    key: VIEW_INPUTS[key] for key in ("Table", "Size", "Numbers", "Aspect", "In Pieces", "Piece", "Border")
}


def past_border(nodes: GeometryBuilder, given, place: Value) -> Value:
    """Above 0 beyond the rim of a polar image's disc, or off the piece that is shown."""
    return nodes.call(beyond_group(), "Beyond", {"Place": place}, given)["Beyond"]


def across_border(nodes: GeometryBuilder, given, middle: Value, radius: Value) -> Value:
    """Return whether the border of the shown piece may run through a face of that middle and radius."""
    inputs = {"Place": middle, "Radius": radius}
    return nodes.call(across_group(), "Across a Border", inputs, given)["Across"]


@defines_group(
    "SCFPF Beyond",
    BORDER_INPUTS | {"Place": ("Vector", None, "In the viewbox")},
    {"Beyond": "Float"},
)
def beyond_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """Above 0 beyond the rim of a polar image, or off the piece that is shown."""
    nodes.open_frame("Beyond the rim?")
    rim = beyond_rim(nodes, given, given["Place"])
    off = nodes.call(off_piece_group(), "Off Its Piece", {"Place": given["Place"]}, given)["Off"]
    return {"Beyond": nodes.switch(given["In Pieces"], rim, rim.max(off), "FLOAT", "In Pieces?")}


@defines_group(
    "SCFPF Off Its Piece",
    BORDER_INPUTS | {"Place": ("Vector", None, "In the viewbox")},
    {"Off": "Float"},
)
def off_piece_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """1 off the piece that is shown, -1 on it."""
    place, _ = _over_image(nodes, given, given["Place"])
    away = nodes.call(piece_distance_group(), "How Far from Its Piece", {"Place": place}, given)["Away"]
    nodes.open_frame("By the nearest point of the table, where there are no borders")
    across, up = _from_centre(nodes, given, given["Place"])
    place = nodes.xyz(across + 0.5, up + 0.5, 0.0, "Place")
    nearest = piece_at(nodes, given["Table"], given["Size"], place)
    off_nearest = (nearest - given["Piece"]).absolute() > 0.25
    any_border = nodes.domain_size(given["Border"], "Face Count") > 0.5
    off = nodes.switch(any_border, off_nearest, away > ON_PIECE, "BOOLEAN", "Borders?")
    return {"Off": off * 2.0 - 1.0}


@defines_group(
    "SCFPF Across a Border",
    BORDER_INPUTS
    | {"Place": ("Vector", None, "A face's middle"), "Radius": ("Float", None, "At least its own")},
    {"Across": "Bool"},
)
def across_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """Return whether a border of the shown piece, or the rim of a polar image, may run through a face."""
    polar = given["Numbers"].parts()[2]
    nodes.open_frame("The rim?")
    rim = beyond_rim(nodes, given, given["Place"]).absolute() < given["Radius"]
    rim = rim & (polar > 0.5)
    nodes.open_frame("A border of the piece?")
    place, centre = _over_image(nodes, given, given["Place"])
    inputs = {"Place": place, "Polar": polar}
    found = nodes.call(piece_distance_group(), "How Far from Its Border", inputs, given)
    radius = given["Radius"] * given["Aspect"].max(1.0)
    # In a polar image, along the radius and round the centre.
    round_it = radius / ((centre - radius).max(1e-6) * (2 * pi))
    reach = nodes.mix(polar, radius, radius * 2.0 + round_it)
    near = (found["To Border"] < reach) & given["In Pieces"]
    return {"Across": rim | near}


def _from_centre(nodes: GeometryBuilder, given, place: Value) -> tuple[Value, Value]:
    """A place of the viewbox, -½ to ½ across and up the image, or the square around a polar image's disc."""
    x, y, _ = place.parts()
    polar, aspect = given["Numbers"].parts()[2], given["Aspect"]
    disc = 1.0 / aspect.max(1.0)
    return x / nodes.mix(polar, 1.0, disc), y / nodes.mix(polar, 1.0 / aspect, disc)


def _over_image(nodes: GeometryBuilder, given, place: Value) -> tuple[Value, Value]:
    """A place of the viewbox in the borders' coordinates, and its distance from the image's centre.

    The coordinates run from 0 to 1 across and up, or are shares of a polar image's turn and radius.
    """
    polar = given["Numbers"].parts()[2]
    across, up = _from_centre(nodes, given, place)
    across, up = (one.max(-0.5).min(0.5) for one in (across, up))
    turn, centre = nodes.polar(across, up)
    u = nodes.mix(polar, across + 0.5, turn)
    v = nodes.mix(polar, up + 0.5, (centre * 2.0).min(1.0))
    return nodes.xyz(u, v, 0.0, "Over the Image"), centre


@defines_group(
    "SCFPF To a Piece",
    {
        "Border": VIEW_INPUTS["Border"],
        "Piece": VIEW_INPUTS["Piece"],
        "Place": ("Vector", None, "0 to 1 across and up; of a polar picture turn and radius"),
        "Polar": ("Float", 0.0, ""),
    },
    {"Away": "Float", "To Border": "Float"},
)
def piece_distance_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The distance of a place from a piece of the volume, and from that piece's border.

    Of all surfaces that are in pieces, the greatest distance and the nearest border.
    """
    surface = nodes.attribute(OF_SURFACE)
    count = nodes.statistic(given["Border"], surface, "Max", "Last Surface") + 1.5

    def body(state: dict[str, Value]) -> dict[str, Value]:
        base = nodes.combine("POWER", PIECES, state["Surface"])
        number = given["Piece"] / base
        number = (number + 1e-3).floor() - (number / PIECES + 1e-5).floor() * PIECES
        own = surface.near(state["Surface"]) & nodes.attribute(PIECE).near(number)
        faces, _ = nodes.separate(given["Border"], own, "Its Faces")
        ends = nodes.position()
        x, y, _ = nodes.evaluate_on(ends, "EDGE", "FLOAT_VECTOR", "Middle of the Edge").parts()
        # Edges along the image's own border do not count; in a polar image those are the seam.
        off_x = nodes.mix(given["Polar"], (x - 0.5).absolute(), 0.0)
        inside = off_x.max((y - 0.5).absolute()) < 0.5 - ON_PIECE
        sides = nodes.faces_at_edge()
        edges, _ = nodes.separate(faces, (sides < 1.5) & inside, "Its Border", "EDGE")
        # Also the other way round a polar image.
        way = (given["Place"].parts()[0] < 0.5) * 2.0 - 1.0
        other = given["Place"] + nodes.xyz(way * given["Polar"], 0.0, 0.0, "Round the Other Way")
        away, to_border, round_it = (
            nodes.outs(
                "GeometryNodeProximity",
                "Nearest",
                {"Geometry": target, "Sample Position": place},
                *("Distance", "Is Valid"),
                target_element=what,
            )
            for target, what, place in (
                (faces, "FACES", given["Place"]),
                (edges, "EDGES", given["Place"]),
                (edges, "EDGES", other),
            )
        )
        nearer = to_border[0].min(round_it[0])
        to_border = nodes.switch(to_border[1], FAR_OFF, nearer, "FLOAT", "Any?")
        return {
            "Surface": state["Surface"] + 1.0,
            "Away": state["Away"].max(away[0]),
            "To Border": state["To Border"].min(to_border),
        }

    state = {"Surface": ("FLOAT", 0.0), "Away": ("FLOAT", 0.0), "To Border": ("FLOAT", FAR_OFF)}
    done = nodes.repeat(count, state, "Surfaces in Pieces", body)
    return {key: done[key] for key in ("Away", "To Border")}
