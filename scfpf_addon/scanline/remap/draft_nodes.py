# SPDX-License-Identifier: GPL-3.0-or-later
"""The node group of a draft: the view of a flexible camera that is quick enough to follow a drag.

Each vertex is placed once. No face is divided by how far it is off, the volume counts as one branch, and
faces outside of the image go. Faces that are large beside the volume are cut into even parts beforehand,
because a face without one of its corners is left out.
"""

from __future__ import annotations

from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group
from .divide_nodes import face_radius
from .place_nodes import BOX, VIEW_INPUTS, own_point, store_places
from .refine_nodes import at_both_ends, trimmed
from .visible_nodes import all_on_one_side

# Faces with a radius above this share of the volume's size are cut, into this many parts at most together.
LARGE = 1 / 24
MOST_NEW = 16_000.0
# Cuts of one face along each edge: two to the power of this at most.
MOST_LEVELS = 5.0

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
    """The mesh with its large faces cut into even parts: fewer parts each if there are many such faces."""
    nodes.open_frame("Large faces are cut")
    limit = given["Extent"].length() * LARGE
    large, small = nodes.separate(given["Mesh"], face_radius(nodes, nodes.position()) > limit, "Large")
    count = nodes.domain_size(large, "Face Count")
    levels = nodes.combine("LOGARITHM", MOST_NEW / count.max(1.0), 2.0) * 0.5
    levels = levels.max(0.0).min(MOST_LEVELS).floor()
    cut = nodes.out("GeometryNodeSubdivideMesh", "Cut", {"Mesh": large, "Level": levels})
    return nodes.switch(count > 0.5, given["Mesh"], nodes.join(small, cut), "GEOMETRY", "Any Large?")
