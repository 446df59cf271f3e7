# SPDX-License-Identifier: GPL-3.0-or-later
"""A node group that judges a mesh' edges and faces once: it keeps, leaves out, or divides faces.

An edge or a face is wrong if its middle is farther than the pixel error from its place: across the image,
in depth, or along itself, where a texture on it would be off. An edge is judged by its own ends and middle
alone, so that both of its faces judge it alike. The new vertex of an edge that need not bend stays on the
straight edge, and so do those of its parts: that leaves no cracks.
"""

from __future__ import annotations

from typing import NamedTuple

from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group
from ..nodes.solve_nodes import PROJECTOR
from .place_nodes import BEYOND_CREASE, BOX, VIEW_INPUTS, is_known, nearest_in_branch, own_point, store_places
from .visible_nodes import across_border, all_on_one_side, past_border

# Edges shorter than this, in pixels, are not divided.
SHORTEST = 2.0
# The same across the rim of a polar image; the part of an edge beyond the rim is pushed in by as much.
SHORTEST_AT_RIM = 0.75
# Faces across a border are divided if a corner is at least this far from their middle, in pixels.
SMALLEST_ACROSS = 1.0
# A divided face overlaps an undivided one by this, in pixels: more than Workbench rounds places to.
OVERLAP = 0.02
# Weight of depth beside the image: depth only decides which of two faces is in front.
DEPTH_WEIGHT = 0.25
# Faces this near to the volume by linear guess stay: shares of its width, and of its size at that t.
GUESS_MARGIN = 0.25
GUESS_MARGIN_T = 0.1
# Factor from the root mean square of corners' distances from the middle to more than the largest.
SPREAD = 2.0
# A face without a place that is smaller than this in (x, y, t) by linear guess is left out.
NOTHING_SIZE = 0.01
# A face that is smaller than the first by linear guess, in pixels, is not divided. Near a fold it may have up
# to the second in the image; a larger one spans two sheets.
TINY, LEAP = 0.125, 16.0
# On a branch, faces grow towards a crease: they are tiny when smaller than this.
TINY_OF_BRANCH = 1 / 8
# A face across a crease is cut off there if its corners, put onto the crease, are this near to its middle, in
# pixels.
TORN = 1.5
# A torn face that is smaller than this in (x, y, t) is judged by the corners that have a place.
CELL = 0.08
# A face is out of the image if its middle by linear guess, and those of its middle and corners that have a
# place, lie farther outside than this many times its size by linear guess. They may lie on different sides:
# beyond both ends of a view all round.
ALL_OUTSIDE = 4.0
# A face that covers less than this share of a pixel is not divided. The area of a triangle is 2.6 times the
# root of the determinant of its corners' second moments.
THIN = 0.25
# With more faces than this no face is divided: memory must stay bounded.
MOST_FACES, MOST_FACES_OF_SHEETS, MOST_FACES_OF_PIECE = 400_000.0, 100_000.0, 20_000.0

EDGE_BOX, FACE_BOX = "scfpf_edge_box", "scfpf_face_box"
NEED, MARK, FROZEN, FATE = "scfpf_need", "scfpf_mark", "scfpf_frozen", "scfpf_fate"
# Fates of faces; 0 is that of those out of the image.
LOST, KEEP, DIVIDE = -1.0, 1.0, 2.0

DIVIDE_INPUTS = VIEW_INPUTS | {
    "Mesh": ("Geometry", None, "A mesh whose vertices know their places"),
    "Inverse": ("Matrix", None, "From the mesh's space into the table's"),
    "Pixel Error": ("Float", 0.5, ""),
    "Picture Width": ("Float", 1000.0, ""),
}


@defines_group(
    "SCFPF Divide Once", DIVIDE_INPUTS, {"Active": "Geometry", "Done": "Geometry", "Left": "Float"}
)
def round_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """Judges large faces once: some are kept, some left out, the others divided."""
    nodes.open_frame("Where the middles of edges and faces belong")
    point = own_point(nodes, given)
    view = given | {"Point": point}
    mesh = store_places(nodes, given["Mesh"], view, EDGE_BOX, "EDGE")
    mesh = store_places(nodes, mesh, view, FACE_BOX, "FACE")
    mesh = nodes.call(judge_edges_group(), "Judge Edges", {"Mesh": mesh}, given)["Mesh"]
    judged = nodes.call(judge_faces_group(), "Judge Faces", {"Mesh": mesh}, given)
    mesh, left = judged["Mesh"], judged["Left"]
    turn = period(nodes, given)
    nodes.open_frame("Kept, or divided")
    fate = nodes.attribute(FATE)
    done, other = nodes.separate(mesh, (fate > 0.5) & (fate < 1.5), "Kept")
    before, _ = nodes.separate(other, fate > 1.5, "Divided")
    before = _straight_middles(nodes, given, before, turn)
    return {"Active": _divided(nodes, before), "Done": done, "Left": left}


def period(nodes: GeometryBuilder, given: dict[str, Value]) -> Value:
    """The size of a periodic image in the viewbox."""
    return nodes.xyz(1.0, 1.0 / given["Aspect"], 1.0, "Period")


def all_there(nodes: GeometryBuilder) -> Value:
    """Return whether all corners of a face have a place."""
    there = nodes.attribute(BOX, "FLOAT_VECTOR").parts()[2] < 0.0
    return nodes.evaluate_on(there, "POINT", "BOOLEAN", "All Corners")


def all_nowhere(nodes: GeometryBuilder) -> Value:
    """Return whether no corner of a face has a place."""
    nowhere = nodes.attribute(BOX, "FLOAT_VECTOR").parts()[2] > 0.0
    return nodes.evaluate_on(nowhere, "POINT", "BOOLEAN", "No Corner")


def beyond_crease(given, z: Value) -> Value:
    """The distance from its branch of a point beyond the branch's crease."""
    return (z - BEYOND_CREASE) * given["Extent"].length()


def is_sheet(given) -> Value:
    """Return whether sheets of a folded volume are drawn; a volume in pieces has none on its creases."""
    return given["Branch"] & ~given["In Pieces"]


def face_radius(nodes: GeometryBuilder, position: Value) -> Value:
    """At least the radius of a face in the mesh's space."""
    middle = nodes.at_index(position, nodes.face_of_corner(), "FACE", "FLOAT_VECTOR")
    away = position - middle
    return nodes.evaluate_on(away.dot(away), "CORNER", "FLOAT", "At Corners").root() * SPREAD


def _nearest_turn(nodes: GeometryBuilder, given, difference: Value, period: Value) -> Value:
    """A difference of places without whole turns of a periodic image."""
    return difference - (difference / period + 0.5).floor() * given["Wrap"] * period


def _ends(nodes: GeometryBuilder, given, period: Value) -> tuple[Value, Value, Value]:
    """The places of an edge's ends, and the shorter way from the one to the other."""
    box = nodes.attribute(BOX, "FLOAT_VECTOR")
    ends = nodes.outs("GeometryNodeInputMeshEdgeVertices", "Ends", {}, 0, 1)
    first, last = (nodes.at_index(box, end, "POINT", "FLOAT_VECTOR") for end in ends)
    return first, last, _nearest_turn(nodes, given, last - first, period)


@defines_group("SCFPF Judge Edges", DIVIDE_INPUTS, {"Mesh": "Geometry"})
def judge_edges_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """Stores which edges must bend, and which are divided at least."""
    nodes.open_frame("Edges: is the middle where a straight line has it?")
    mesh, turn = given["Mesh"], period(nodes, given)
    weights = (1.0, 1.0, DEPTH_WEIGHT)
    first, last, straight = _ends(nodes, given, turn)
    middle = nodes.attribute(EDGE_BOX, "FLOAT_VECTOR")
    off = _nearest_turn(nodes, given, middle - first - straight * 0.5, turn) * weights
    pixel = 1.0 / given["Picture Width"]
    bent = (off.length() > pixel * given["Pixel Error"]) & ((straight * weights).length() > pixel * SHORTEST)
    nowhere = first.parts()[2].max(last.parts()[2]).max(middle.parts()[2]) > 0.0
    free = ~nodes.attribute(FROZEN, "BOOLEAN")
    mark = free & (bent | nowhere)
    # Across the rim of a polar image even straight edges are divided, and stay straight.
    beyond = past_border(nodes, given, first) * past_border(nodes, given, last)
    at_rim = (beyond < 0.0) & (straight.length() > pixel * SHORTEST_AT_RIM)
    mesh = nodes.store(mesh, MARK, mark, "BOOLEAN", "EDGE")
    need = nodes.attribute(MARK, "BOOLEAN") | at_rim
    return {"Mesh": nodes.store(mesh, NEED, need, "FLOAT", "EDGE")}


class _Faces(NamedTuple):
    """Fields about the faces, to be judged by.

    centre: the place of the middle. away: from there to each corner, without whole turns. there: all corners
    and the middle have a place. guess, size: of the middle and of the face in (x, y, t), by linear guess.
    pixel: its width.
    """

    centre: Value
    away: Value
    there: Value
    guess: Value
    size: Value
    pixel: Value


@defines_group("SCFPF Judge Faces", DIVIDE_INPUTS, {"Mesh": "Geometry", "Left": "Float"})
def judge_faces_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """Stores each face's fate, and counts the faces that are left out for having no place."""
    mesh, point = given["Mesh"], own_point(nodes, given)
    nodes.open_frame("Faces: is the middle where a flat face has it?")
    centre = nodes.attribute(FACE_BOX, "FLOAT_VECTOR")
    face = nodes.face_of_corner()
    own_centre = nodes.at_index(centre, face, "FACE", "FLOAT_VECTOR")
    away = _nearest_turn(
        nodes, given, nodes.attribute(BOX, "FLOAT_VECTOR") - own_centre, period(nodes, given)
    )
    off = nodes.evaluate_on(away, "CORNER", "FLOAT_VECTOR", "At Corners") * (1.0, 1.0, DEPTH_WEIGHT)
    pixel = 1.0 / given["Picture Width"]
    there = all_there(nodes) & (centre.parts()[2] < 0.0)
    guess, size = _guess(nodes, given, point, face)
    faces = _Faces(centre=centre, away=away, there=there, guess=guess, size=size, pixel=pixel)
    bent = off.length() > pixel * given["Pixel Error"]
    wanted = (nodes.attribute(NEED) > 0.0) | bent | ~there | _crosses_border(nodes, given, faces)
    at_crease, gone = _judge_on_branch(nodes, given, faces)
    sides = _sides(nodes, given, faces)
    gone = ~there & (sides["Any"] & (size.largest() < CELL)) | gone
    out = _is_out(nodes, given, faces, sides)
    out = out | nodes.switch(given["Branch"], False, gone, "BOOLEAN", "Branch?")
    at_crease = nodes.switch(is_sheet(given), False, at_crease, "BOOLEAN", "Sheets?")
    tiny, too_small = _is_tiny(nodes, given, faces)
    leap = tiny & (off.length() > pixel * LEAP)
    nodes.open_frame("Their fate")
    most = nodes.switch(given["Branch"], MOST_FACES, MOST_FACES_OF_SHEETS, "FLOAT", "Most Faces")
    most = nodes.switch(given["In Pieces"], most, MOST_FACES_OF_PIECE, "FLOAT", "Most Faces")
    few = nodes.domain_size(mesh, "Face Count") < most
    divide = wanted & few & ~(out | (too_small | at_crease))
    keep = ((there & ~leap) | at_crease) & ~(out | divide)
    lost = ~(out | (divide | keep))
    mesh = nodes.store(mesh, FATE, divide * DIVIDE + keep * KEEP + lost * LOST, "FLOAT", "FACE")
    # By the attribute: each use of a field computes it anew.
    are_lost = nodes.attribute(FATE) < LOST / 2
    return {"Mesh": mesh, "Left": nodes.statistic(mesh, are_lost * 1.0, "Sum", "Left Out", domain="FACE")}


def _sides(nodes: GeometryBuilder, given, faces: _Faces) -> dict[str, Value]:
    nodes.open_frame("Out of the picture?")
    return all_on_one_side(nodes, given, nodes.attribute(BOX, "FLOAT_VECTOR"), faces.centre)


def _crosses_border(nodes: GeometryBuilder, given, faces: _Faces) -> Value:
    """Return whether a face may lie across the rim of a polar image, or the border of a piece."""
    nodes.open_frame("Across the rim of a polar picture, or the border of a piece?")
    radius = _spread(nodes, faces) * SPREAD
    across = faces.there & across_border(nodes, given, faces.centre, radius)
    across = across & (radius > faces.pixel * SMALLEST_ACROSS)
    has_border = (given["Numbers"].parts()[2] > 0.5) | given["In Pieces"]
    return nodes.switch(has_border, False, across, "BOOLEAN", "Any Border?")


def _spread(nodes: GeometryBuilder, faces: _Faces) -> Value:
    """The root mean square of the corners' distances from the middle, across the image."""
    flat = faces.away * (1.0, 1.0, 0.0)
    return nodes.evaluate_on(flat.dot(flat), "CORNER", "FLOAT", "At Corners").root()


def _is_out(nodes: GeometryBuilder, given, faces: _Faces, sides: dict[str, Value]) -> Value:
    """Return whether a face is out of the image, or by linear guess so if it has no place."""
    nodes.open_frame("Out of the picture? By linear guess without a place")
    ratio, guess, size = given["Numbers"].parts()[0], faces.guess, faces.size
    size_there = (ratio + guess.parts()[2] * (1.0 - ratio)).max(0.0)
    margin = nodes.xyz(GUESS_MARGIN, GUESS_MARGIN, size_there * GUESS_MARGIN_T, "Margin")
    off = (given["From"] - guess).max(guess - given["To"]) - given["Wrap"] * 1e9
    far = (off - margin - size).largest() > 0.0
    largest, (x, y, _) = size.largest(), off.parts()
    tall = (1.0 / given["Aspect"]).max(1.0)
    apart = (sides["Least Outside"] / tall).min(x.max(y)) > largest * ALL_OUTSIDE
    around = apart & (largest < CELL) & ~all_nowhere(nodes)
    z = faces.centre.parts()[2]
    # Near a crease linear guesses lead astray.
    unsure = ~(given["Branch"] & is_known(z))
    nowhere = all_nowhere(nodes) & (z > 0.0) & (size.largest() < NOTHING_SIZE)
    return (faces.there & sides["Face"]) | (~faces.there & unsure & far) | (nowhere | around)


def _judge_on_branch(nodes: GeometryBuilder, given, faces: _Faces) -> tuple[Value, Value]:
    """Return whether a face of a branch is cut off at a crease, and whether all of it is beyond it."""
    nodes.open_frame("A branch: what of it there is, is out of it; or all of it is beyond the crease")
    z = faces.centre.parts()[2]
    across, up, _ = faces.size.parts()
    edge_z, corner_z = (nodes.attribute(name, "FLOAT_VECTOR").parts()[2] for name in (EDGE_BOX, BOX))
    known = nodes.evaluate_on(is_known(corner_z), "POINT", "BOOLEAN", "All Corners") & is_known(z)
    some = z < 0.0
    for there, domain in ((corner_z < 0.0, "POINT"), (edge_z < 0.0, "EDGE")):
        some = some | (nodes.evaluate_on(there + 0.0, domain, "FLOAT", "Any") > 0.0)
    spread = _spread(nodes, faces)
    smallest = across.max(up) < faces.pixel * TINY_OF_BRANCH
    near = (spread < faces.pixel * TORN) | (smallest & (spread < faces.pixel * LEAP))
    at_crease = ~faces.there & known & near
    radius = across * given["Scale"].parts()[0]
    beyond = ~some & (is_known(z) & (beyond_crease(given, z) > radius))
    return at_crease, beyond | (at_crease & ~some)


def _is_tiny(nodes: GeometryBuilder, given, faces: _Faces) -> tuple[Value, Value]:
    """Return whether a face covers nothing of a pixel, and whether it is too small to be divided."""
    nodes.open_frame("Too small to be divided: torn at a border of the volume, or between two of its sheets")
    across, up, _ = faces.size.parts()
    pixel = faces.pixel
    x, y, _ = faces.away.parts()
    moments = nodes.xyz(x * x, y * y, x * y, "Moments")
    xx, yy, xy = nodes.evaluate_on(moments, "CORNER", "FLOAT_VECTOR", "At Corners").parts()
    thin = (xx * yy - xy * xy) < pixel * pixel * (pixel * pixel * (THIN / 2.6) ** 2)
    tiny_size = nodes.switch(given["Branch"], TINY, TINY_OF_BRANCH, "FLOAT", "Tiny")
    tiny = (across.max(up) < pixel * tiny_size) | (faces.there & thin)
    torn_size = nodes.switch(is_sheet(given), 1.0, TINY_OF_BRANCH, "FLOAT", "Tiny if Torn")
    return tiny, tiny | (~faces.there & (across.max(up) < pixel * torn_size))


def _guess(nodes: GeometryBuilder, given, point: Value, face: Value) -> tuple[Value, Value]:
    """A face's middle and size in (x, y, t), by the inverse map of the cloud's nearest point."""
    nearest = nearest_in_branch(nodes, given, point)
    inverse = nodes.sample_attribute(given["Cloud"], PROJECTOR, nearest, "Its Inverse Map", "FLOAT4X4")
    inverse = nodes.evaluate_on(inverse, "FACE", "FLOAT4X4", "Of the Face")
    middle = nodes.evaluate_on(nodes.point(point, inverse, "Middle"), "FACE", "FLOAT_VECTOR", "Of the Face")
    own = nodes.at_index(inverse, face, "FACE", "FLOAT4X4")
    away = nodes.point(point, own, "Corner") - nodes.at_index(middle, face, "FACE", "FLOAT_VECTOR")
    square = nodes.evaluate_on(away * away, "CORNER", "FLOAT_VECTOR", "At Corners")
    root = nodes.xyz(*(part.root() for part in square.parts()), "Root Mean Square")
    # A branch ends where inverse maps are without bounds.
    middle_point = nodes.evaluate_on(point, "FACE", "FLOAT_VECTOR", "Middle of the Face")
    off = point - nodes.at_index(middle_point, face, "FACE", "FLOAT_VECTOR")
    radius = nodes.evaluate_on(off.dot(off), "CORNER", "FLOAT", "At Corners").root()
    by_scale = nodes.xyz(radius, radius, radius, "Radius") / given["Scale"]
    return middle, nodes.switch(given["Branch"], root, by_scale, "VECTOR", "Branch?") * SPREAD


def _straight_middles(nodes: GeometryBuilder, given, before: Value, period: Value) -> Value:
    """Put the middles of edges that need not bend onto the straight line.

    Towards an undivided face the middle overlaps a little: a vertex on the face's straight edge would let
    single pixels through.
    """
    nodes.open_frame("Middles of straight edges; no pixel between a divided face and its neighbor")
    first, _, straight = _ends(nodes, given, period)
    middle = _nearest_turn(nodes, given, first + straight * 0.5, period)
    index = nodes.index()
    corner = nodes.out("GeometryNodeCornersOfEdge", "A Corner", {"Edge Index": index}, "Corner Index")
    face = nodes.out("GeometryNodeFaceOfCorner", "Its Face", {"Corner Index": corner}, "Face Index")
    centre = nodes.at_index(nodes.attribute(FACE_BOX, "FLOAT_VECTOR"), face, "FACE", "FLOAT_VECTOR")
    outward = _nearest_turn(nodes, given, middle - centre, period) * (1.0, 1.0, 0.0)
    overlap = (nodes.faces_at_edge() < 1.5) * OVERLAP / given["Picture Width"] / outward.length()
    is_straight = ~nodes.attribute(MARK, "BOOLEAN")
    return nodes.store(before, EDGE_BOX, middle + outward * overlap, "FLOAT_VECTOR", "EDGE", is_straight)


def _divided(nodes: GeometryBuilder, before: Value) -> Value:
    """The mesh with each face divided into quads, and the new vertices in their places.

    Subdivide Mesh numbers the old vertices first, then a middle for each edge, then one for each face. The
    two parts of each edge come in order, before the edges inside the faces.
    """
    nodes.open_frame("Divided; new vertices take the places of the middles")
    vertices, edges = (nodes.domain_size(before, which) for which in ("Point Count", "Edge Count"))
    after = nodes.out("GeometryNodeSubdivideMesh", "Divide", {"Mesh": before, "Level": 1})
    index = nodes.index() + 0.0
    of_edge = index - vertices
    of_face = of_edge - edges
    in_face = of_face > -0.5
    mark = nodes.attribute(MARK, "BOOLEAN")
    edge_place, face_place = (
        nodes.sample_attribute(before, name, number, label, domain=domain)
        for name, number, label, domain in (
            (EDGE_BOX, of_edge, "Edge's Middle", "EDGE"),
            (FACE_BOX, of_face, "Face's Middle", "FACE"),
        )
    )
    place = nodes.switch(in_face, edge_place, face_place, "VECTOR", "Edge or Face")
    after = nodes.store(after, BOX, place, "FLOAT_VECTOR", selection=of_edge > -0.5)
    part_of_edge = index < edges * 2.0 - 0.5
    frozen = part_of_edge & (nodes.attribute(FROZEN, "BOOLEAN") | ~mark)
    return nodes.store(after, FROZEN, frozen, "BOOLEAN", "EDGE")
