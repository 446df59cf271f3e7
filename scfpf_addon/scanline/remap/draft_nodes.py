# SPDX-License-Identifier: GPL-3.0-or-later
"""The node group of a draft: the view of a flexible camera that is quick enough to follow a drag.

Each vertex is placed once. No face is divided by how far it is off, the volume counts as one branch, and
faces outside of the image go. Faces that are large beside the volume are cut into even parts beforehand,
because a face without one of its corners is left out.
"""

from __future__ import annotations

from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group
from .divide_nodes import SPREAD
from .place_nodes import BOX, VIEW_INPUTS, own_point, store_places
from .refine_nodes import at_both_ends, trimmed
from .visible_nodes import all_on_one_side

# Faces with a standard deviation of their corners above this share of the volume's size are cut.
LARGE = 1 / 50
# Cuts of a face's edges: two to the power of LEVELS each time, as often as TIMES; faces in all, at most.
LEVELS, TIMES, MOST_NEW = 2.0, 5, 24_000.0

DRAFT_INPUTS = VIEW_INPUTS | {
    "Mesh": ("Geometry", None, "The scene's mesh"),
    "Inverse": ("Matrix", None, "From the mesh's space into the table's"),
}


@defines_group("SCFPF Draft", DRAFT_INPUTS, {"Mesh": "Geometry"})
def draft_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The mesh with the places of its vertices, less what is not wholly in the viewbox."""
    mesh = _cut(nodes, given)
    nodes.open_frame("Where its vertices are")
    mesh = store_places(nodes, mesh, given | {"Point": own_point(nodes, given)})
    nodes.open_frame("Faces without a place, or out of the picture, go")
    box = nodes.attribute(BOX, "FLOAT_VECTOR")
    nowhere = nodes.evaluate_on((box.parts()[2] > 0.0) + 0.0, "POINT", "FLOAT", "Any Corner") > 0.0
    gone = nowhere | all_on_one_side(nodes, given, box)["Corners"]
    _, mesh = nodes.separate(mesh, gone, "Not Shown")
    nodes.open_frame("The seam of a periodic picture, and the rim of a polar one")
    for axis in range(2):
        wraps = given["Wrap"].parts()[axis] > 0.5
        mesh = nodes.switch(wraps, mesh, at_both_ends(nodes, given, mesh, axis), "GEOMETRY", "Periodic?")
    polar = given["Numbers"].parts()[2] > 0.5
    return {"Mesh": nodes.switch(polar, mesh, trimmed(nodes, given, mesh), "GEOMETRY", "Polar?")}


def _cut(nodes: GeometryBuilder, given: dict[str, Value]) -> Value:
    """The mesh with its large faces cut into even parts, again and again where they are near the volume."""
    nodes.open_frame("Large faces are cut")
    large, small = nodes.separate(given["Mesh"], _is_large(nodes, given), "Large")

    def body(state: dict[str, Value]) -> dict[str, Value]:
        count = nodes.domain_size(state["Large"], "Face Count")
        levels = nodes.combine("LOGARITHM", MOST_NEW / count.max(1.0), 2.0) * 0.5
        levels = levels.max(0.0).min(LEVELS).floor()
        cut = nodes.out("GeometryNodeSubdivideMesh", "Cut", {"Mesh": state["Large"], "Level": levels})
        _, near = nodes.separate(cut, _is_far(nodes, given), "Far")
        again, done = nodes.separate(near, _is_large(nodes, given), "Large")
        return {"Large": again, "Done": nodes.join(state["Done"], done)}

    def any_left(state: dict[str, Value]) -> Value:
        return nodes.domain_size(state["Large"], "Face Count") > 0.5

    state = {"Large": ("GEOMETRY", large), "Done": ("GEOMETRY", None)}
    cut = nodes.repeat(TIMES, state, "Cut", body, any_left)
    parts = nodes.join(small, cut["Done"], cut["Large"])
    some = nodes.domain_size(large, "Face Count") > 0.5
    return nodes.switch(some, given["Mesh"], parts, "GEOMETRY", "Any Large?")


def _is_large(nodes: GeometryBuilder, given: dict[str, Value]) -> Value:
    """Return whether a face is large beside the volume."""
    limit = given["Extent"].length() * LARGE
    return _variance(nodes) > limit * limit


def _variance(nodes: GeometryBuilder) -> Value:
    """The variance of a face's corners."""
    position = nodes.position()
    square = nodes.evaluate_on(position.dot(position), "POINT", "FLOAT", "At Vertices")
    middle = nodes.evaluate_on(position, "POINT", "FLOAT_VECTOR", "Middle")
    return square - middle.dot(middle)


def _is_far(nodes: GeometryBuilder, given: dict[str, Value]) -> Value:
    """Return whether a face lies outside of the box around the volume."""
    half = given["Extent"] * 0.5
    point = nodes.evaluate_on(own_point(nodes, given), "FACE", "FLOAT_VECTOR", "Middle")
    away = ((point - given["Low"] - half).absolute() - half).max((0.0, 0.0, 0.0))
    return away.length() > _variance(nodes).max(0.0).root() * SPREAD
