# SPDX-License-Identifier: GPL-3.0-or-later
"""A node group that tells the pieces of a UV map apart: islands, and holes between them."""

from __future__ import annotations

from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group

# UVs nearer than this are one, as in projection/surfaces/uv_chart.py.
SAME_UV = 4e-7
# A map whose faces cover this share of the square has no holes: float32 leaves 1e-5.
WHOLE = 0.999
# Attribute of points of a surface, of the table and of the cloud: the number of their piece.
PIECE = "piece"
# The number of a missing piece.
NO_PIECE = -1.0
# A surface may have fewer pieces than this, so that the numbers of several surfaces' pieces can be combined:
# float32 holds those of three surfaces.
PIECES = 101.0
# Attribute of the surfaces' pieces, flat over the image: the number of their surface among those in pieces.
OF_SURFACE = "surface"


@defines_group(
    "SCFPF UV Pieces",
    {"Mesh": ("Geometry", None, ""), "UV": ("Vector", None, "The UV map")},
    {"Mesh": "Geometry", "Cut": "Bool"},
)
def uv_pieces_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """A mesh split along the seams of its UV map, and whether the map has several pieces, or holes."""
    nodes.open_frame("Edges that are somewhere else in the UV map on either side")
    edge = nodes.index()

    def uv_at(corner: Value) -> Value:
        return nodes.at_index(given["UV"], corner, "CORNER", "FLOAT_VECTOR")

    def following(corner: Value) -> Value:
        inputs = {"Corner Index": corner, "Offset": 1}
        return nodes.out("GeometryNodeOffsetCornerInFace", "Next", inputs)

    corners = [
        nodes.out(
            "GeometryNodeCornersOfEdge",
            "Corner",
            {"Edge Index": edge, "Sort Index": number},
            "Corner Index",
        )
        for number in range(2)
    ]
    (a, b), (c, d) = ((uv_at(corner), uv_at(following(corner))) for corner in corners)
    # Faces of one orientation run along their edge in opposite directions.
    opposite, same = (first.length().max(last.length()) for first, last in ((a - d, b - c), (a - c, b - d)))
    seam = (opposite.min(same) > SAME_UV) & (nodes.faces_at_edge() > 1.5)
    split = nodes.out("GeometryNodeSplitEdges", "Along the Seams", {"Mesh": given["Mesh"], "Selection": seam})
    nodes.open_frame("Is it one piece over the whole square?")
    island = nodes.out("GeometryNodeInputMeshIsland", "Island", {}) + 0.0
    last = nodes.statistic(split, island, "Max", "Last Island")
    double = given["UV"].cross(uv_at(following(nodes.index()))).parts()[2]
    covered = nodes.statistic(split, double, "Sum", "Covered", domain="CORNER").absolute() * 0.5
    mesh = nodes.store(split, PIECE, island, "FLOAT")
    return {"Mesh": mesh, "Cut": (last > 0.5) | (covered < WHOLE)}
