# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that divide large faces until straight edges and flat faces in the viewbox are right.

A face is divided where an edge's or its own middle would be farther from where it
belongs than the pixel error, in the picture, in depth or along itself (there what is painted on it
would be off). An edge is judged by its own ends and middle alone, so both of its
faces judge it alike: where it need not bend, a divided face's new vertex stays on the straight
edge and the edge's parts stay straight for ever, so that there are no cracks.
"""

from __future__ import annotations

from ...bridge.blender import versions
from ..nodes.field_nodes import FieldBuilder, Value, node_group
from ..nodes.solve_nodes import PROJECTOR
from .place_nodes import (
    BEYOND_CREASE,
    BOX,
    UNKNOWN,
    VIEW_INPUTS,
    crease_group,
    is_known,
    nearest_in_branch,
    store_places,
)
from .visible_nodes import across_border, all_on_one_side, beyond_rim, past_border

# Faces whose vertices lie within this many pixels are not looked at, for a pixel error of 1; by the
# square root of others, since what a straight edge is off by grows with the square of its length.
SMALL = 16.0
# Parts of an edge are below float32's after so many; a file may say thousands of millions.
MOST_ROUNDS = 24
# Edges shorter than this, in pixels, are not divided.
SHORTEST = 2.0
# Across the rim of a polar picture they are; what stands out beyond it is pushed in by as much.
SHORTEST_AT_RIM = 0.75
# So are faces across a border whose corners are farther from their middle than this, in pixels, at least.
SMALLEST_ACROSS = 1.0
# A divided face overlaps one that is not by this, in pixels: more than Workbench rounds places to.
OVERLAP = 0.02
# What depth counts beside the picture: it decides only which of two faces is in front.
DEPTH_WEIGHT = 0.25
# By linear guess; nothing is left out for being near to the volume: share of its width, and of its
# size at that t.
GUESS_MARGIN = 0.25
GUESS_MARGIN_T = 0.1
# From the root mean square of the corners' distances from the middle to more than the largest.
SPREAD = 2.0
# A face without a place that is smaller than this share of the distance between points of the cloud stays so.
SMALL_SHARE = 0.5
# A face without a place, as large as this in (x, y, t) by linear guess, is not looked at more closely.
NOTHING_SIZE = 0.01
# A face that is smaller than this by linear guess, in pixels, is not divided; near a fold it may be larger
# in the picture, up to this: a larger one spans two sheets.
TINY, LEAP = 0.125, 16.0
# Of a branch, faces grow towards a crease: they are tiny when smaller than this.
TINY_OF_BRANCH = 1 / 8
# A face across a crease is cut off there when its corners, those beyond put onto it, are this near to its
# middle, in pixels.
TORN = 1.5
# A torn face that is smaller than this in (x, y, t) is judged by the corners that have a place.
CELL = 0.08
# A face that covers less than this of a pixel is not divided. Of a triangle, the area is 2.6 times the root
# of the determinant of its corners' second moments.
THIN = 0.25
# With more faces than this nothing more is divided: memory must stay bounded.
MOST_FACES, MOST_FACES_OF_SHEETS, MOST_FACES_OF_PIECE = 400_000.0, 100_000.0, 20_000.0

EDGE_BOX, FACE_BOX = "scfpf_edge_box", "scfpf_face_box"
NEED, MARK, FROZEN, FATE = "scfpf_need", "scfpf_mark", "scfpf_frozen", "scfpf_fate"
LEAVE, KEEP, DIVIDE = 0.0, 1.0, 2.0


def refine_group():
    """Divide and crop: the mesh with its places in the viewbox, and how many faces have none."""
    inputs = VIEW_INPUTS | {
        "Mesh": ("Geometry", None, "A mesh whose vertices know their places"),
        "Inverse": ("Matrix", None, "From the mesh's space into the table's"),
        "Pixel Error": ("Float", 0.5, ""),
        "Picture Width": ("Float", 1000.0, ""),
        "Rounds": ("Int", 12, ""),
    }
    outputs = {"Mesh": "Geometry", "Left Out": "Vector"}
    text = "Divides large faces until they are right in the viewbox; leaves out what is outside of it"
    return node_group("SCFPF Refine", text, inputs, outputs, _build_refine)


def _build_refine(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
    nodes.open_frame("Small faces that are wholly there stay as they are")
    box = nodes.attribute(BOX, "FLOAT_VECTOR")
    square = nodes.evaluate_on(box.dot(box), "POINT", "FLOAT", "At Vertices")
    limit = SMALL / given["Picture Width"]
    spread = limit * limit * given["Pixel Error"] * (1 / 3)
    there = box.parts()[2] < 0.0
    variance = square - box.dot(box)
    small = nodes.both(variance < spread, there)
    # Not the maximum: Blender sorts for it. Of faces only what must be: there are most of them.
    large = nodes.statistic(given["Mesh"], variance > spread, "Sum", "Large Faces", domain="FACE")
    nowhere = nodes.statistic(given["Mesh"], box.parts()[2] > 0.0, "Sum", "Vertices without a Place")
    large = large + nowhere + given["Branch"]
    small_part, rest = nodes.separate(given["Mesh"], small, "Small Faces")
    _, shown = nodes.separate(small_part, all_on_one_side(nodes, given, box)["Corners"], "Out of the Branch")
    small_part = nodes.switch(given["Branch"], small_part, shown, "GEOMETRY", "Branch?")
    middle = nodes.evaluate_on(box, "FACE", "FLOAT_VECTOR", "Middle")
    radius = nodes.combine("SQRT", (square - middle.dot(middle)).most(0.0)) * SPREAD
    crossing = across_border(nodes, given, middle, radius)
    at_rim, within = nodes.separate(small_part, crossing, "At the Rim")
    is_polar = nodes.either(given["Numbers"].parts()[2] > 0.5, given["In Pieces"])
    large = large + is_polar
    rest = nodes.switch(is_polar, rest, nodes.join(rest, at_rim), "GEOMETRY", "Polar?")
    small_part = nodes.switch(is_polar, small_part, within, "GEOMETRY", "Polar?")
    position, triangles = _to_divide(nodes, given, box, rest)
    view = {key: given[key] for key in VIEW_INPUTS}
    options = {key: given[key] for key in ("Inverse", "Pixel Error", "Picture Width")}

    def body(state: dict[str, Value]) -> dict[str, Value]:
        made = nodes.call(round_group(), "Divide Once", view | options | {"Mesh": state["Active"]})
        after = {
            "Active": made["Active"],
            "Done": nodes.join(state["Done"], made["Done"]),
            "Left": state["Left"] + made["Left"],
        }
        # Rounds with nothing left to do cost nothing: a Switch evaluates only the side that is asked for.
        some = _faces(nodes, state["Active"]) > 0.5
        return {
            name: nodes.switch(
                some, state[name], value, "FLOAT" if name == "Left" else "GEOMETRY", "Any Left?"
            )
            for name, value in after.items()
        }

    state = {
        "Active": ("GEOMETRY", triangles),
        "Done": ("GEOMETRY", None),
        "Left": ("FLOAT", 0.0),
    }
    rounds = nodes.integer("MINIMUM", given["Rounds"], MOST_ROUNDS)
    end = nodes.repeat(rounds, state, "Divide", body)
    nodes.open_frame("What is still too large stays if it is wholly there")
    whole, torn = nodes.separate(end["Active"], _all_there(nodes), "Wholly There")
    left = nodes.switch(large > 0.5, 0.0, end["Left"] + _faces(nodes, torn), "FLOAT", "Any Large?")
    mesh = nodes.join(end["Done"], whole)
    nodes.open_frame("Of sheets, what is beyond a crease is put onto it")
    point = nodes.point(position, given["Inverse"], "In Camera's Space")
    crease = nodes.call(crease_group(), "Onto the Crease", view | {"Point": point})["Position"]
    at_crease = nodes.store(mesh, BOX, crease, "FLOAT_VECTOR", selection=box.parts()[2] > 0.0)
    mesh = nodes.switch(_is_sheet(nodes, given), mesh, at_crease, "GEOMETRY", "Sheets?")
    nodes.open_frame("Faces across the seam of a periodic picture stand at both of its ends")
    period = nodes.xyz(1.0, 1.0 / given["Aspect"], 1.0, "Period")
    for axis in range(2):
        wraps = given["Wrap"].parts()[axis] > 0.5
        mesh = nodes.switch(wraps, mesh, _at_both_ends(nodes, mesh, axis, period), "GEOMETRY", "Periodic?")
    folded = nodes.statistic(given["Cloud"], nodes.attribute("folded"), "Sum", "Folded Samples")
    # Where all faces are small, as in dense meshes, the mesh is not even copied.
    mesh = nodes.switch(large > 0.5, given["Mesh"], nodes.join(small_part, mesh), "GEOMETRY", "Any Large?")
    nodes.open_frame("A polar picture ends at its rim")
    mesh = nodes.switch(is_polar, mesh, _trimmed(nodes, given, mesh), "GEOMETRY", "Polar?")
    return {"Mesh": mesh, "Left Out": nodes.xyz(left, folded, 0.0, "Left Out")}


def _to_divide(nodes: FieldBuilder, given: dict[str, Value], box: Value, rest: Value) -> tuple[Value, Value]:
    """The field of positions, and the triangles of a mesh but for faces that cannot be seen."""
    nodes.open_frame("Faces that are out of the volume, or small there and without a place, go")
    position = nodes.out("GeometryNodeInputPosition", "Position", {})
    corner = nodes.node("GeometryNodeFaceOfCorner", "Face of Corner", {})
    middle = nodes.at_index(position, Value(nodes, corner.outputs["Face Index"]), "FACE", "FLOAT_VECTOR")
    square = nodes.evaluate_on((position - middle).dot(position - middle), "CORNER", "FLOAT", "At Corners")
    radius = nodes.combine("SQRT", square) * SPREAD
    away, reach, z = box.parts()
    away = nodes.switch(is_known(z), away.most(reach * SMALL_SHARE), _beyond(given, z), "FLOAT", "How Far")
    certain = nodes.either(is_known(z), z > UNKNOWN + 3.5)
    gone = nodes.both(nodes.both(_all_nowhere(nodes), certain), radius < away)
    _, rest = nodes.separate(rest, gone, "Out of the Volume")
    triangulate = nodes.node("GeometryNodeTriangulate", "Triangles", {"Mesh": rest})
    versions.set_node_menu(triangulate, "Quad Method", "quad_method", "FIXED")
    nodes.close_frame()
    return position, Value(nodes, triangulate.outputs[0])


def _all_there(nodes: FieldBuilder) -> Value:
    """Whether all corners of a face have a place."""
    there = nodes.attribute(BOX, "FLOAT_VECTOR").parts()[2] < 0.0
    return nodes.evaluate_on(there, "POINT", "BOOLEAN", "All Corners")


def _all_nowhere(nodes: FieldBuilder) -> Value:
    """Whether no corner of a face has a place."""
    nowhere = nodes.attribute(BOX, "FLOAT_VECTOR").parts()[2] > 0.0
    return nodes.evaluate_on(nowhere, "POINT", "BOOLEAN", "No Corner")


def _beyond(given, z: Value) -> Value:
    """How far from its branch a point is that lies beyond its crease."""
    return (z - BEYOND_CREASE) * given["Extent"].length()


def _is_sheet(nodes: FieldBuilder, given) -> Value:
    """Whether what is drawn is sheets of a folded volume: of one in pieces nothing is put onto creases."""
    return nodes.both(given["Branch"], nodes.negate(given["In Pieces"]))


def _faces(nodes: FieldBuilder, mesh: Value) -> Value:
    return nodes.out("GeometryNodeAttributeDomainSize", "Faces", {0: mesh}, "Face Count", component="MESH")


def _at_both_ends(nodes: FieldBuilder, mesh: Value, axis: int, period: Value) -> Value:
    box = nodes.attribute(BOX, "FLOAT_VECTOR")
    along, whole = box.parts()[axis], period.parts()[axis]
    shares = [
        nodes.evaluate_on(side, "POINT", "FLOAT", "At Vertices")
        for side in (along > whole * 0.25, along < whole * -0.25)
    ]
    crossing, other = nodes.separate(mesh, nodes.both(shares[0] > 0.0, shares[1] > 0.0), "Across the Seam")
    copies = []
    for side, way in ((along < 0.0, 1.0), (along > 0.0, -1.0)):
        shift = side * whole * way
        moved = box + nodes.xyz(*(shift if i == axis else 0.0 for i in range(3)), "Round")
        copies.append(nodes.store(crossing, BOX, moved, "FLOAT_VECTOR"))
    return nodes.join(other, *copies)


def round_group():
    """One round: judge edges and faces, keep, leave out, or divide."""
    inputs = VIEW_INPUTS | {
        "Mesh": ("Geometry", None, ""),
        "Inverse": ("Matrix", None, ""),
        "Pixel Error": ("Float", 0.5, ""),
        "Picture Width": ("Float", 1000.0, ""),
    }

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        nodes.open_frame("Where the middles of edges and faces belong")
        view = {key: given[key] for key in VIEW_INPUTS}
        position = nodes.out("GeometryNodeInputPosition", "Position", {})
        point = nodes.point(position, given["Inverse"], "In Camera's Space")
        mesh = store_places(nodes, given["Mesh"], view | {"Point": point}, EDGE_BOX, "EDGE")
        mesh = store_places(nodes, mesh, view | {"Point": point}, FACE_BOX, "FACE")
        period = nodes.xyz(1.0, 1.0 / given["Aspect"], 1.0, "Period")
        mesh = _judge_edges(nodes, given, mesh, period)
        mesh, left = _judge_faces(nodes, given, mesh, period, point)
        nodes.open_frame("Kept, or divided")
        fate = nodes.attribute(FATE)
        done, other = nodes.separate(mesh, nodes.both(fate > 0.5, fate < 1.5), "Kept")
        before, _ = nodes.separate(other, fate > 1.5, "Divided")
        before = _straight_middles(nodes, given, before, period)
        return {"Active": _divided(nodes, before), "Done": done, "Left": left}

    outputs = {"Active": "Geometry", "Done": "Geometry", "Left": "Float"}
    text = "Judges large faces once: some are kept, some left out, the others divided"
    return node_group("SCFPF Divide Once", text, inputs, outputs, build)


def _trimmed(nodes: FieldBuilder, given, mesh: Value) -> Value:
    """Faces beyond the rim of a polar picture left out, the corners of those across it moved onto it."""
    box = nodes.attribute(BOX, "FLOAT_VECTOR")
    beyond = beyond_rim(nodes, given, box)
    off = past_border(nodes, given, box) > 0.0
    every = nodes.evaluate_on(off, "POINT", "BOOLEAN", "All Corners")
    _, shown = nodes.separate(mesh, every, "Beyond the Rim")
    rim = 0.5 / given["Aspect"].most(1.0)
    share = rim / (rim + beyond.most(0.0))
    moved = box * nodes.xyz(share, share, 1.0, "Onto the Rim")
    return nodes.store(shown, BOX, moved, "FLOAT_VECTOR")


def _nearest_turn(nodes: FieldBuilder, given, difference: Value, period: Value) -> Value:
    """A difference without whole turns of a periodic picture."""
    return difference - (difference / period + 0.5).floor() * given["Wrap"] * period


def _ends(nodes: FieldBuilder, given, period: Value) -> tuple[Value, Value, Value]:
    """The places of an edge's ends, and the way from the one to the other, the short way round."""
    box = nodes.attribute(BOX, "FLOAT_VECTOR")
    ends = nodes.node("GeometryNodeInputMeshEdgeVertices", "Ends", {})
    first, last = (
        nodes.at_index(box, Value(nodes, ends.outputs[i]), "POINT", "FLOAT_VECTOR") for i in range(2)
    )
    return first, last, _nearest_turn(nodes, given, last - first, period)


def _judge_edges(nodes: FieldBuilder, given, mesh: Value, period: Value) -> Value:
    nodes.open_frame("Edges: is the middle where a straight line has it?")
    weights = (1.0, 1.0, DEPTH_WEIGHT)
    first, last, straight = _ends(nodes, given, period)
    middle = nodes.attribute(EDGE_BOX, "FLOAT_VECTOR")
    off = _nearest_turn(nodes, given, middle - first - straight * 0.5, period) * weights
    pixel = 1.0 / given["Picture Width"]
    bent = nodes.both(
        off.length() > pixel * given["Pixel Error"], (straight * weights).length() > pixel * SHORTEST
    )
    nowhere = first.parts()[2].most(last.parts()[2]).most(middle.parts()[2]) > 0.0
    free = nodes.negate(nodes.attribute(FROZEN, "BOOLEAN"))
    mark = nodes.both(free, nodes.either(bent, nowhere))
    # Across the rim of a polar picture even straight edges are divided, and stay straight.
    beyond = past_border(nodes, given, first) * past_border(nodes, given, last)
    at_rim = nodes.both(beyond < 0.0, straight.length() > pixel * SHORTEST_AT_RIM)
    need = nodes.either(mark, at_rim)
    mesh = nodes.store(mesh, NEED, need, "FLOAT", "EDGE")
    return nodes.store(mesh, MARK, mark, "BOOLEAN", "EDGE")


def _judge_faces(nodes: FieldBuilder, given, mesh: Value, period: Value, point: Value):
    """The mesh with each face's fate, and the number of faces that are left out for having no place."""
    nodes.open_frame("Faces: is the middle where a flat face has it?")
    box, centre = nodes.attribute(BOX, "FLOAT_VECTOR"), nodes.attribute(FACE_BOX, "FLOAT_VECTOR")
    corner = nodes.node("GeometryNodeFaceOfCorner", "Face of Corner", {})
    face = Value(nodes, corner.outputs["Face Index"])
    own_centre = nodes.at_index(centre, face, "FACE", "FLOAT_VECTOR")
    away = _nearest_turn(nodes, given, box - own_centre, period)
    off = nodes.evaluate_on(away, "CORNER", "FLOAT_VECTOR", "At Corners") * (1.0, 1.0, DEPTH_WEIGHT)
    pixel = 1.0 / given["Picture Width"]
    there = nodes.both(_all_there(nodes), centre.parts()[2] < 0.0)
    wanted = nodes.either(
        nodes.either(nodes.attribute(NEED) > 0.0, off.length() > pixel * given["Pixel Error"]),
        nodes.negate(there),
    )
    nodes.open_frame("Across the rim of a polar picture, or the border of a piece?")
    flat = away * (1.0, 1.0, 0.0)
    spread = nodes.evaluate_on(flat.dot(flat), "CORNER", "FLOAT", "At Corners")
    radius = nodes.combine("SQRT", spread) * SPREAD
    across = across_border(nodes, given, centre, radius)
    across = nodes.both(nodes.both(there, across), radius > pixel * SMALLEST_ACROSS)
    has_border = nodes.either(given["Numbers"].parts()[2] > 0.5, given["In Pieces"])
    wanted = nodes.either(wanted, nodes.switch(has_border, False, across, "BOOLEAN", "Any Border?"))
    nodes.open_frame("Out of the picture?")
    sides = all_on_one_side(nodes, given, box, centre)
    out = nodes.both(there, sides["Face"])
    nodes.open_frame("Without a place: out of the picture by linear guess?")
    away_guess, guess = _guess(nodes, given, point, face)
    ratio = given["Numbers"].parts()[0]
    size_there = (ratio + guess.parts()[2] * (1.0 - ratio)).most(0.0)
    margin = nodes.xyz(GUESS_MARGIN, GUESS_MARGIN, size_there * GUESS_MARGIN_T, "Margin")
    beyond = (given["From"] - guess).most(guess - given["To"]) - margin - away_guess
    x, y, t = (beyond - given["Wrap"] * 1e9).parts()
    torn = nodes.negate(there)
    # Near a crease linear guesses lead astray.
    unsure = nodes.negate(nodes.both(given["Branch"], is_known(centre.parts()[2])))
    out = nodes.either(out, nodes.both(nodes.both(torn, unsure), x.most(y).most(t) > 0.0))
    across, up, along = away_guess.parts()
    nowhere = nodes.both(_all_nowhere(nodes), centre.parts()[2] > 0.0)
    out = nodes.either(out, nodes.both(nowhere, across.most(up).most(along) < NOTHING_SIZE))
    nodes.open_frame("A branch: what of it there is, is out of it; or all of it is beyond the crease")
    gone = nodes.both(torn, nodes.both(sides["Any"], across.most(up).most(along) < CELL))
    spread = nodes.combine("SQRT", nodes.evaluate_on(_square(away), "CORNER", "FLOAT", "At Corners"))
    at_crease, some = _at_crease(nodes, centre)
    smallest = across.most(up) < pixel * TINY_OF_BRANCH
    near = nodes.either(spread < pixel * TORN, nodes.both(smallest, spread < pixel * LEAP))
    at_crease = nodes.both(nodes.both(torn, at_crease), near)
    z = centre.parts()[2]
    radius = across * given["Scale"].parts()[0]
    beyond = nodes.both(nodes.negate(some), nodes.both(is_known(z), _beyond(given, z) > radius))
    gone = nodes.either(gone, nodes.either(beyond, nodes.both(at_crease, nodes.negate(some))))
    out = nodes.either(out, nodes.switch(given["Branch"], False, gone, "BOOLEAN", "Branch?"))
    sheets = _is_sheet(nodes, given)
    at_crease = nodes.switch(sheets, False, at_crease, "BOOLEAN", "Sheets?")
    nodes.open_frame("Too small to be divided: torn at a border of the volume, or between two of its sheets")
    x, y, _ = away.parts()
    moments = nodes.evaluate_on(
        nodes.xyz(x * x, y * y, x * y, "Moments"), "CORNER", "FLOAT_VECTOR", "At Corners"
    )
    xx, yy, xy = moments.parts()
    thin = (xx * yy - xy * xy) < pixel * pixel * (pixel * pixel * (THIN / 2.6) ** 2)
    tiny_size = nodes.switch(given["Branch"], TINY, TINY_OF_BRANCH, "FLOAT", "Tiny")
    tiny = nodes.either(across.most(up) < pixel * tiny_size, nodes.both(there, thin))
    leap = nodes.both(tiny, off.length() > pixel * LEAP)
    torn_size = nodes.switch(sheets, 1.0, TINY_OF_BRANCH, "FLOAT", "Tiny if Torn")
    hopeless = nodes.either(tiny, nodes.both(torn, across.most(up) < pixel * torn_size))
    hopeless = nodes.either(hopeless, at_crease)
    nodes.open_frame("Their fate")
    most = nodes.switch(given["Branch"], MOST_FACES, MOST_FACES_OF_SHEETS, "FLOAT", "Most Faces")
    most = nodes.switch(given["In Pieces"], most, MOST_FACES_OF_PIECE, "FLOAT", "Most Faces")
    few = _faces(nodes, mesh) < most
    divide = nodes.both(nodes.both(wanted, few), nodes.negate(nodes.either(out, hopeless)))
    whole = nodes.either(nodes.both(there, nodes.negate(leap)), at_crease)
    keep = nodes.both(whole, nodes.negate(nodes.either(out, divide)))
    lost = nodes.negate(nodes.either(out, nodes.either(divide, keep)))
    left = nodes.statistic(mesh, lost * 1.0, "Sum", "Left Out", domain="FACE")
    return nodes.store(mesh, FATE, divide * DIVIDE + keep * KEEP, "FLOAT", "FACE"), left


def _square(away: Value) -> Value:
    flat = away * (1.0, 1.0, 0.0)
    return flat.dot(flat)


def _at_crease(nodes: FieldBuilder, centre: Value) -> tuple[Value, Value]:
    """Whether all of a face has a place or is beyond a near crease; whether some of it has a place."""
    z, edge = (nodes.attribute(name, "FLOAT_VECTOR").parts()[2] for name in (BOX, EDGE_BOX))
    known = nodes.evaluate_on(is_known(z), "POINT", "BOOLEAN", "All Corners")
    some = [centre.parts()[2] < 0.0]
    for there, domain in ((z < 0.0, "POINT"), (edge < 0.0, "EDGE")):
        some.append(nodes.evaluate_on(there + 0.0, domain, "FLOAT", "Any") > 0.0)
    every = nodes.either(nodes.either(some[0], some[1]), some[2])
    return nodes.both(known, is_known(centre.parts()[2])), every


def _guess(nodes: FieldBuilder, given, point: Value, face: Value) -> tuple[Value, Value]:
    """By the inverse map of the cloud's nearest point: how far corners are from the middle, and that."""
    nearest = nearest_in_branch(nodes, given, point)
    inverse = nodes.sample(
        given["Cloud"], nodes.attribute(PROJECTOR, "FLOAT4X4"), nearest, "FLOAT4X4", "Its Inverse Map"
    )
    inverse = nodes.evaluate_on(inverse, "FACE", "FLOAT4X4", "Of the Face")
    middle = nodes.evaluate_on(nodes.point(point, inverse, "Middle"), "FACE", "FLOAT_VECTOR", "Of the Face")
    own = nodes.at_index(inverse, face, "FACE", "FLOAT4X4")
    away = nodes.point(point, own, "Corner") - nodes.at_index(middle, face, "FACE", "FLOAT_VECTOR")
    square = nodes.evaluate_on(away * away, "CORNER", "FLOAT_VECTOR", "At Corners")
    root = nodes.xyz(*(nodes.combine("SQRT", part) for part in square.parts()), "Root Mean Square")
    # A branch ends where inverse maps are without bounds.
    middle_point = nodes.evaluate_on(point, "FACE", "FLOAT_VECTOR", "Middle of the Face")
    off = point - nodes.at_index(middle_point, face, "FACE", "FLOAT_VECTOR")
    radius = nodes.combine("SQRT", nodes.evaluate_on(off.dot(off), "CORNER", "FLOAT", "At Corners"))
    by_scale = nodes.xyz(radius, radius, radius, "Radius") / given["Scale"]
    return nodes.switch(given["Branch"], root, by_scale, "VECTOR", "Branch?") * SPREAD, middle


def _straight_middles(nodes: FieldBuilder, given, before: Value, period: Value) -> Value:
    """Edges that need not bend get a middle on the straight line.

    At the border of what is divided it overlaps the other side a little: a vertex on the straight
    edge of a face that is not divided would let single pixels through.
    """
    nodes.open_frame("Middles of straight edges; no pixel between a divided face and its neighbor")
    first, _, straight = _ends(nodes, given, period)
    middle = _nearest_turn(nodes, given, first + straight * 0.5, period)
    index = nodes.out("GeometryNodeInputIndex", "Index", {})
    corner = nodes.out("GeometryNodeCornersOfEdge", "A Corner", {"Edge Index": index}, "Corner Index")
    face = nodes.out("GeometryNodeFaceOfCorner", "Its Face", {"Corner Index": corner}, "Face Index")
    centre = nodes.at_index(nodes.attribute(FACE_BOX, "FLOAT_VECTOR"), face, "FACE", "FLOAT_VECTOR")
    outward = _nearest_turn(nodes, given, middle - centre, period) * (1.0, 1.0, 0.0)
    sides = nodes.out("GeometryNodeInputMeshEdgeNeighbors", "Faces at the Edge", {}) + 0.0
    overlap = (sides < 1.5) * OVERLAP / given["Picture Width"] / outward.length()
    is_straight = nodes.negate(nodes.attribute(MARK, "BOOLEAN"))
    return nodes.store(before, EDGE_BOX, middle + outward * overlap, "FLOAT_VECTOR", "EDGE", is_straight)


def _divided(nodes: FieldBuilder, before: Value) -> Value:
    """The mesh with each face divided into quads; new vertices where they belong.

    Subdivide Mesh numbers the old vertices first, then a middle for each edge, then one for each
    face; each edge becomes two, in order, before those inside of the faces.
    """
    nodes.open_frame("Divided; new vertices take the places of the middles")
    sizes = nodes.node("GeometryNodeAttributeDomainSize", "Sizes", {0: before}, component="MESH")
    vertices, edges = Value(nodes, sizes.outputs["Point Count"]), Value(nodes, sizes.outputs["Edge Count"])
    after = nodes.out("GeometryNodeSubdivideMesh", "Divide", {"Mesh": before, "Level": 1})
    index = nodes.out("GeometryNodeInputIndex", "Index", {}) + 0.0
    of_edge = index - vertices
    of_face = of_edge - edges
    in_face = of_face > -0.5
    mark = nodes.attribute(MARK, "BOOLEAN")
    edge_place = nodes.sample(
        before, nodes.attribute(EDGE_BOX, "FLOAT_VECTOR"), of_edge, "FLOAT_VECTOR", "Edge's Middle", "EDGE"
    )
    face_place = nodes.sample(
        before, nodes.attribute(FACE_BOX, "FLOAT_VECTOR"), of_face, "FLOAT_VECTOR", "Face's Middle", "FACE"
    )
    place = nodes.switch(in_face, edge_place, face_place, "VECTOR", "Edge or Face")
    after = nodes.store(after, BOX, place, "FLOAT_VECTOR", selection=of_edge > -0.5)
    part_of_edge = index < edges * 2.0 - 0.5
    frozen = nodes.both(part_of_edge, nodes.either(nodes.attribute(FROZEN, "BOOLEAN"), nodes.negate(mark)))
    return nodes.store(after, FROZEN, frozen, "BOOLEAN", "EDGE")
