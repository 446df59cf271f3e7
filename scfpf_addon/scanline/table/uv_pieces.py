# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that tell the pieces of a UV map apart: islands, and what none of them covers."""

from __future__ import annotations

from ..nodes.field_nodes import FieldBuilder, Value, node_group

# UVs that are nearer than this are one, as in projection/surfaces/uv_chart.py.
SAME_UV = 4e-7
# A map whose faces cover this share of the square has no holes: float32 leaves 1e-5.
WHOLE = 0.999
# The number of a piece where there is none.
NO_PIECE = -1.0
# Pieces that a surface may have, so that numbers of pieces of several surfaces do not meet; float32 holds
# those of three surfaces.
PIECES = 101.0
# Of the pieces of surfaces, flat over the picture: which of the surfaces in pieces they are of.
OF_SURFACE = "surface"


def uv_pieces_group():
    """A mesh split along the seams of its UV map; whether that has several pieces, or holes."""
    inputs = {"Mesh": ("Geometry", None, ""), "UV": ("Vector", None, "The UV map")}
    outputs = {"Mesh": "Geometry", "Cut": "Bool"}

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        nodes.open_frame("Edges that are somewhere else in the UV map on either side")
        edge = nodes.out("GeometryNodeInputIndex", "Edge", {})
        sides = []
        for number in range(2):
            corner = nodes.out(
                "GeometryNodeCornersOfEdge",
                "Corner",
                {"Edge Index": edge, "Sort Index": number},
                "Corner Index",
            )
            following = nodes.out(
                "GeometryNodeOffsetCornerInFace", "Next", {"Corner Index": corner, "Offset": 1}
            )
            sides.append(
                [nodes.at_index(given["UV"], one, "CORNER", "FLOAT_VECTOR") for one in (corner, following)]
            )
        (a, b), (c, d) = sides
        # Faces of one orientation run along their edge in opposite directions.
        opposite, same = (
            first.length().most(last.length()) for first, last in ((a - d, b - c), (a - c, b - d))
        )
        faces = nodes.out("GeometryNodeInputMeshEdgeNeighbors", "Faces at the Edge", {}) + 0.0
        seam = nodes.both(opposite.least(same) > SAME_UV, faces > 1.5)
        split = nodes.out(
            "GeometryNodeSplitEdges", "Along the Seams", {"Mesh": given["Mesh"], "Selection": seam}
        )
        nodes.open_frame("Is it one piece over the whole square?")
        island = nodes.out("GeometryNodeInputMeshIsland", "Island", {}) + 0.0
        last = nodes.statistic(split, island, "Max", "Last Island")
        corner = nodes.out("GeometryNodeInputIndex", "Corner", {})
        following = nodes.out("GeometryNodeOffsetCornerInFace", "Next", {"Corner Index": corner, "Offset": 1})
        after = nodes.at_index(given["UV"], following, "CORNER", "FLOAT_VECTOR")
        double = given["UV"].cross(after).parts()[2]
        covered = nodes.statistic(split, double, "Sum", "Covered", domain="CORNER").absolute() * 0.5
        mesh = nodes.store(split, "piece", island, "FLOAT")
        return {"Mesh": mesh, "Cut": nodes.either(last > 0.5, covered < WHOLE)}

    text = "A mesh split along the seams of its UV map, and whether that is in pieces"
    return node_group("SCFPF UV Pieces", text, inputs, outputs, build)
