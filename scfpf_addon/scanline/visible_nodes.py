# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that tell what is out of the picture, or of the part of it that a branch shows."""

from __future__ import annotations

from .field_nodes import FieldBuilder, Value, node_group
from .place_nodes import VIEW_INPUTS, on_screen
from .table_branches import piece_at

# Faces that lie farther out of the picture than this share of it are left out.
FRAME_MARGIN = 0.01

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


def past_border(nodes: FieldBuilder, given, place: Value) -> Value:
    """Above 0 beyond the rim of a polar picture's disc, or off the piece that is shown."""
    labels = ("Table", "Size", "Numbers", "Aspect", "In Pieces", "Piece")
    inputs = {key: given[key] for key in labels} | {"Place": place}
    return nodes.call(beyond_group(), "Beyond", inputs)["Beyond"]


def beyond_group():
    """Whether a place is beyond the rim of a polar picture, or off the piece that is shown."""
    inputs = {key: VIEW_INPUTS[key] for key in ("Table", "Size", "Numbers", "Aspect", "In Pieces", "Piece")}
    inputs |= {"Place": ("Vector", None, "In the viewbox")}

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        nodes.open_frame("Beyond the rim?")
        rim = beyond_rim(nodes, given, given["Place"])
        nodes.open_frame("On another piece?")
        x, y, _ = given["Place"].parts()
        polar, aspect = given["Numbers"].parts()[2], given["Aspect"]
        disc = 1.0 / aspect.most(1.0)
        across, up = x / nodes.mix(polar, 1.0, disc) + 0.5, y / nodes.mix(polar, 1.0 / aspect, disc) + 0.5
        own = piece_at(nodes, given["Table"], given["Size"], nodes.xyz(across, up, 0.0, "Place"))
        off = (own - given["Piece"]).absolute() > 0.25
        off_piece = nodes.switch(off, rim, 1.0, "FLOAT", "Off Its Piece?")
        return {"Beyond": nodes.switch(given["In Pieces"], rim, off_piece, "FLOAT", "In Pieces?")}

    text = "Above 0 beyond the rim of a polar picture, or off the piece that is shown"
    return node_group("SCFPF Beyond", text, inputs, {"Beyond": "Float"}, build)
