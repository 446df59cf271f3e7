# SPDX-License-Identifier: GPL-3.0-or-later
"""The node group of a camera's table: every projector's coefficients, and first guesses for the inversion.

Its point cloud holds the projectors, span by span and row by row, and after them the lattice: inverse maps
on a regular grid of the space. Its mesh is the cloud: points all over the volume with
their (x, y, t), inverse maps, and on each what is true of the whole table.
"""

from __future__ import annotations

from math import pi

from ..nodes.field_nodes import FieldBuilder, Value, node_group
from ..nodes.solve_nodes import (
    FAR_AWAY,
    PROJECTOR,
    REACH,
    TABLE_INPUTS,
    inverse_map,
    look_up_group,
    nearest_start,
    solve_group,
    whole_table,
)
from .cubic_spans import power_spans
from .surface_point import surface_point_group
from .table_branches import BLOCK, block_number, cells_of_piece, store_branches, with_pieces
from .table_sheets import BRANCHES, CLOUD, PIECE
from .uv_pieces import NO_PIECE, OF_SURFACE, PIECES

# Points of the cloud if the volume is in pieces, each of which needs some.
CLOUD_OF_PIECES = (24, 24, 8)
# A gap between two rows that is this many times the next one is a leap.
LEAP = 4.0
# Points of the lattice along an axis: a guess by the nearest one leaves Newton's method few steps.
LATTICE = 32
# The box of the lattice is larger than the cloud by this share on each side.
LATTICE_MARGIN = 0.1
# Ends that are nearer than this share of half the turn are one: float32 leaves 1e-6.
PERIODIC = 1e-3
# The near surface's size over the far one's, at least, and at most its inverse: what a depth buffer can bear.
SMALLEST_RATIO = 1e-4
# Below this difference from 1 a ratio's powers are those of 1.
EVEN_RATIO = 1e-3
# What one more step of Newton's method may still move a guess that is right, in (x, y, t).
LATTICE_ACCEPTED = 0.02


def table_group(basis: str, count: int, weights: tuple[float, ...] | None = None):
    """The group "SCFPF Table" of a basis and a number of surfaces; weights: of NURBS projectors, (count,)."""
    inputs = {"Picture": ("Geometry", None, "u, v and what is shown of the table's corners, as positions")}
    for number in range(1, count + 1):
        inputs[f"Surface {number}"] = ("Object", None, "A control surface, from near to far")
        inputs[f"UV Map {number}"] = ("String", "UVMap", "The UV map of a surface that is a mesh")
        inputs[f"Net {number}"] = ("Vector", None, "Of a surface patch: points drawn along u and v, closed")
    inputs |= {
        "Columns": ("Int", 129, "Projectors across the picture"),
        "Rows": ("Int", 129, "Projectors up the picture"),
        "Polar": ("Int", 0, "1: u is an angle and v the distance from the picture's center"),
        "Pictured": ("Int", 0, "1: u and v are those of the picture's points, 2: which have holes or a seam"),
        "Disc": ("Int", 1, "0: a polar picture is no disk, because of what its points say"),
        "U Start": ("Float", 0.0, "u at the picture's left border"),
        "U End": ("Float", 1.0, "u at the picture's right border"),
        "V Start": ("Float", 0.0, "v at the picture's lower border"),
        "V End": ("Float", 1.0, "v at the picture's upper border"),
    }
    powers = power_spans(basis, count, weights)

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        polar = given["Polar"] * given["Disc"]
        table, size, cut, border = _projectors(nodes, given, powers, polar)
        wrap = nodes.call(_periodic_group(), "Periodic", {"Table": table, "Size": size})["Wrap"]
        whole = whole_table(table, size, wrap)
        ratio = nodes.call(_ratio_group(), "Near over Far", whole)["Ratio"]
        cloud = _places(nodes, whole, cut, ratio, polar)
        cloud = nodes.switch(cut, cloud, with_pieces(nodes, whole, cloud), "GEOMETRY", "In Pieces?")
        whole |= cells_of_piece(nodes, whole, cut)
        cloud = _cloud(nodes, whole, cloud, cut)
        branches = store_branches(nodes, whole, cloud, cut)
        cloud = branches["Cloud"]
        box, low, extent = _box(nodes, cloud)
        lattice = _lattice(nodes, whole, cloud, box, extent)
        nodes.open_frame("What is true of the whole table")
        for name, value in (
            ("size", size),
            ("wrap", wrap),
            ("ratio, turn, polar", nodes.xyz(ratio, branches["Turn"], polar, "Numbers")),
            ("low", low),
            ("extent", extent),
            (BRANCHES, nodes.xyz(branches["Count"], cut + 0.0, branches["Flat"], "Branches")),
        ):
            cloud = nodes.store(cloud, name, value, "FLOAT_VECTOR")
        nodes.close_frame()
        return {"Table": nodes.join(table, lattice, cloud, border)}

    weighted = "" if weights is None else " " + ":".join(f"{weight:.4g}" for weight in weights)
    text = f"The projectors of a flexible camera: {count} surfaces, {basis.replace('_', '-').title()}"
    return node_group(
        f"SCFPF Table {basis} {count}{weighted}", text, inputs, {"Table": "Geometry"}, build, modifier=True
    )


def _projectors(nodes: FieldBuilder, given, powers, polar: Value) -> tuple[Value, Value, Value, Value]:
    """The table's points and size, whether the volume is in pieces, and these, flat, as an instance."""
    spans, _, count = powers.shape
    nodes.open_frame("A point a projector, row by row, span by span")
    columns, rows = given["Columns"], given["Rows"]
    cells = columns * rows
    points = nodes.out("GeometryNodePoints", "Points of the Table", {"Count": cells * float(spans)})
    index = nodes.out("GeometryNodeInputIndex", "Index", {})
    # Half a point more: whole numbers must not fall short by rounding.
    span = ((index + 0.5) / cells).floor()
    within = index - span * cells
    row = ((within + 0.5) / columns).floor()
    x, y = (within - row * columns) / (columns - 1.0), row / (rows - 1.0)
    nodes.open_frame("(u, v) of the picture's x and y")
    a, b = x * 2.0 - 1.0, y * 2.0 - 1.0
    turn = nodes.combine("ARCTAN2", b, a) / (2 * pi)
    radius = nodes.combine("SQRT", a * a + b * b)
    u = nodes.mix(polar, x, turn - turn.floor())
    v = nodes.mix(polar, y, radius)
    u, v = (
        nodes.mix(part, given[f"{axis} Start"], given[f"{axis} End"]) for part, axis in ((u, "U"), (v, "V"))
    )
    nodes.open_frame("Those of the picture's points, where it has mappings")
    here = nodes.out("GeometryNodeInputPosition", "u, v, Shown", {})
    pictured = given["Pictured"] > 0.5
    own = nodes.sample(given["Picture"], here, within, "FLOAT_VECTOR", "The Picture's")
    u, v, shown = nodes.switch(pictured, nodes.xyz(u, v, 1.0, "Plain"), own, "VECTOR", "Mapped?").parts()
    nodes.open_frame("Control points of the projector")
    controls, borders, piece, cut, none = [], [], 0.0, False, False
    # Of the surfaces in pieces: how many there are so far, and what the next one's numbers count.
    several, base = 0.0, 1.0
    for number in range(1, count + 1):
        along_u, along_v, closed = given[f"Net {number}"].parts()
        inputs = {
            "Surface": given[f"Surface {number}"],
            "UV Map": given[f"UV Map {number}"],
            "Columns": along_u,
            "Rows": along_v,
            "Cyclic U": closed - (closed * 0.5).floor() * 2.0,
            "Cyclic V": (closed * 0.5).floor(),
            "U": u,
            "V": v,
        }
        on_surface = nodes.call(surface_point_group(), f"On Surface {number}", inputs)
        controls.append(on_surface["Position"])
        borders.append(nodes.store(on_surface["Border"], OF_SURFACE, several, "FLOAT"))
        piece = on_surface["Piece"] * base + piece
        several = on_surface["Cut"] + several
        base = nodes.switch(on_surface["Cut"], 1.0, PIECES, "FLOAT", "In Pieces?") * base
        cut = nodes.either(on_surface["Cut"], cut)
        none = nodes.either(on_surface["Piece"] < NO_PIECE + 0.5, none)
    nodes.open_frame("Holes and the seam of the picture's points")
    holed = given["Pictured"] > 1.5
    cut = nodes.either(cut, holed)
    none = nodes.either(none, nodes.both(holed, shown < 0.5))
    piece = piece + nodes.both(holed, shown > 1.25) * 0.5
    nodes.open_frame("Coefficients of its powers of t")
    coefficients = [_combined(nodes, span, powers[:, power], controls) for power in range(4)]
    matrix = nodes.matrix([*coefficients[1:], coefficients[0]])
    size = nodes.xyz(columns, rows, float(spans), "Columns, Rows, Spans")
    table = nodes.store(points, PROJECTOR, matrix, "FLOAT4X4")
    nodes.open_frame("Does a polar picture of a part of a turn leap where it begins and ends?")
    plain = nodes.both(polar > 0.5, nodes.negate(pictured))
    leap = nodes.both(plain, nodes.call(_leap_group(), "Leap", {"Table": table, "Size": size})["Leap"])
    piece = nodes.both(leap, b < -1e-5) * base + piece
    cut = nodes.either(cut, leap)
    border = _border(nodes, given, borders, leap, several)
    nodes.open_frame("In pieces? Their numbers")
    pieces = nodes.store(table, PIECE, nodes.switch(none, piece, NO_PIECE, "FLOAT", "Hole?"), "FLOAT")
    table = nodes.switch(cut, table, pieces, "GEOMETRY", "In Pieces?")
    # Through image mappings borders run as nothing but the table's points can tell.
    flat = nodes.both(cut, nodes.negate(pictured))
    return table, size, cut, nodes.switch(flat, None, border, "GEOMETRY", "In Pieces?")


def _border(nodes: FieldBuilder, given, borders, leap: Value, several: Value) -> Value:
    """All pieces of surfaces, flat over the picture, as one instance; the halves of a polar one that leaps.

    0 to 1 across and up are the picture's; of a polar one a whole turn and its radius.
    """
    nodes.open_frame("Their borders, flat over the picture")
    starts, ends = (nodes.xyz(given[f"U {end}"], given[f"V {end}"], 0.0, end) for end in ("Start", "End"))
    position = nodes.out("GeometryNodeInputPosition", "Position", {})
    place = (position - starts) / (ends - starts + (0.0, 0.0, 1.0))
    flat = nodes.out(
        "GeometryNodeSetPosition", "Over the Picture", {"Geometry": nodes.join(*borders), "Position": place}
    )
    halves = []
    for number in range(2):
        size = {"Size X": 0.5, "Size Y": 1.0, "Vertices X": 2, "Vertices Y": 2}
        half = nodes.out("GeometryNodeMeshGrid", "Half a Turn", size)
        moved = {"Geometry": half, "Translation": (0.25 + 0.5 * number, 0.5, 0.0)}
        half = nodes.out("GeometryNodeTransform", "In Its Place", moved)
        half = nodes.store(half, PIECE, float(number), "FLOAT")
        halves.append(nodes.store(half, OF_SURFACE, several, "FLOAT"))
    both = nodes.switch(leap, None, nodes.join(*halves), "GEOMETRY", "Leaps?")
    return nodes.out("GeometryNodeGeometryToInstance", "Borders", {"Geometry": nodes.join(flat, both)})


def _leap_group():
    """Whether the picture's middle row, right of its middle, leaps to the row below it."""
    inputs = {key: TABLE_INPUTS[key] for key in ("Table", "Size")}
    text = "Whether a table leaps between the middle row's right half and the row below it"
    return node_group("SCFPF Leap", text, inputs, {"Leap": "Bool"}, _build_leap)


def _build_leap(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
    table, size = given["Table"], given["Size"]
    points = nodes.out("GeometryNodePoints", "64 Samples", {"Count": 64})
    across = (nodes.out("GeometryNodeInputIndex", "Index", {}) + 1.0) / 128.0 + 0.5
    row = 1.0 / (size.parts()[1] - 1.0)
    whole = whole_table(table, size, (0.0, 0.0, 0.0))
    result = None
    for t in (0.25, 1.0):
        below, middle, above = (
            nodes.call(look_up_group(), "Place", whole | {"Position": nodes.xyz(across, y, t, "Place")})[
                "Position"
            ]
            for y in (0.5 - row, 0.5 + row * 0.0, 0.5 + row)
        )
        down = nodes.statistic(points, (middle - below).length(), "Max", "Down")
        up = nodes.statistic(points, (above - middle).length(), "Max", "Up")
        result = down > up * LEAP if result is None else nodes.either(result, down > up * LEAP)
    return {"Leap": result}


def _combined(nodes: FieldBuilder, span: Value, weights, controls) -> Value:
    """Σ weights[span, i] · controls[i]. weights: (S, count)."""
    total = None
    for column, control in zip(weights.T.tolist(), controls, strict=True):
        if not any(column):
            continue
        if len(set(column)) == 1:
            weight = column[0]
        else:
            node = nodes.node("GeometryNodeIndexSwitch", "Weight by Span", {"Index": span}, data_type="FLOAT")
            while len(node.index_switch_items) < len(column):
                node.index_switch_items.new()
            for number, each in enumerate(column):
                node.inputs[str(number)].default_value = each
            weight = Value(nodes, node.outputs[0])
        term = control * weight
        total = term if total is None else total + term
    return nodes.xyz(0.0, 0.0, 0.0, "Nothing") if total is None else total


def _periodic_group():
    """1 where the volume's left and right, or lower and upper, ends are one; else 0."""
    inputs = {key: TABLE_INPUTS[key] for key in ("Table", "Size")}
    text = "1 where the left and right, or lower and upper, ends of the volume are one"
    return node_group("SCFPF Periodic", text, inputs, {"Wrap": "Vector"}, _build_periodic)


def _build_periodic(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
    table, size = given["Table"], given["Size"]
    nodes.open_frame("Do the ends of the picture meet?")
    index = nodes.out("GeometryNodeInputIndex", "Index", {})
    points = nodes.out("GeometryNodePoints", "65 Samples", {"Count": 65})
    along = index / 64.0
    tests = []
    for axis in range(2):
        gaps = []
        for t in (0.25, 1.0):
            places = [
                nodes.xyz(*((end, along) if axis == 0 else (along, end)), t, "End") for end in (0.0, 1.0, 0.5)
            ]
            none = whole_table(table, size, (0.0, 0.0, 0.0))
            start, end, middle = (
                nodes.call(look_up_group(), "At an End", none | {"Position": place})["Position"]
                for place in places
            )
            gap = nodes.statistic(points, (end - start).length(), "Max", "Gap")
            turn = nodes.statistic(points, (middle - start).length(), "Max", "Half a Turn")
            gaps.append(gap < turn * PERIODIC)
        tests.append(nodes.both(*gaps))
    return {"Wrap": nodes.xyz(*tests, 0.0, "Wrap")}


def _ratio_group():
    """How large the near surface is beside the far one, by the square root of their areas."""
    text = "Near surface's size over the far one's"
    return node_group("SCFPF Near over Far", text, TABLE_INPUTS, {"Ratio": "Float"}, _build_ratio)


def _build_ratio(nodes: FieldBuilder, whole: dict[str, Value]) -> dict:
    nodes.open_frame("Near surface's size over the far one's")
    index = nodes.out("GeometryNodeInputIndex", "Index", {})
    row = ((index + 0.5) / 16.0).floor()
    x, y = (index - row * 16.0 + 0.5) / 16.0, (row + 0.5) / 16.0
    areas = []
    for t in (0.0, 1.0):
        found = nodes.call(look_up_group(), "Sample", whole | {"Position": nodes.xyz(x, y, t, "Place")})
        area = found["By x"].cross(found["By y"]).length()
        points = nodes.out("GeometryNodePoints", "256 Samples", {"Count": 256})
        areas.append(nodes.statistic(points, area, "Mean", "Area"))
    ratio = nodes.combine("SQRT", areas[0] / areas[1])
    return {"Ratio": ratio.most(SMALLEST_RATIO).least(1 / SMALLEST_RATIO)}


def _sides(nodes: FieldBuilder, cut: Value) -> tuple[Value, ...]:
    """Points of the cloud across, up and along the volume."""
    counts = zip(["across", "up", "along"], CLOUD, CLOUD_OF_PIECES, strict=True)
    return tuple(nodes.switch(cut, float(one), float(other), "FLOAT", label) for label, one, other in counts)


def _places(nodes: FieldBuilder, whole, cut: Value, ratio: Value, polar: Value) -> Value:
    """Points that know their (x, y, t), all over the volume."""
    nodes.open_frame("Places of the cloud")
    across, up, along = _sides(nodes, cut)
    points = nodes.out("GeometryNodePoints", "Points of the Cloud", {"Count": across * up * along + 0.5})
    cloud = nodes.out("GeometryNodePointsToVertices", "Vertices", {"Points": points})
    index = nodes.out("GeometryNodeInputIndex", "Index", {})
    layer = ((index + 0.5) / (across * up)).floor()
    within = index - layer * (across * up)
    row = ((within + 0.5) / across).floor()
    x, y = (within - row * across + 0.5) / across, (row + 0.5) / up
    # A square of places pressed into the disc of a polar picture.
    a, b = x * 2.0 - 1.0, y * 2.0 - 1.0
    pressed = a.absolute().most(b.absolute()) / nodes.combine("SQRT", a * a + b * b)
    press = nodes.mix(polar, 1.0 + polar * 0.0, pressed)
    x, y = a * press * 0.5 + 0.5, b * press * 0.5 + 0.5
    # Evenly by the size of the volume: a wide far end does not take all places from a small near one.
    # The last layer is the far surface; the near one may be a point, where nothing can be inverted.
    part = (layer + 0.5) / (along - 0.5)
    even = (ratio - 1.0).absolute() < EVEN_RATIO
    step = 1.0 / (along - 0.5)
    t, before, after = (
        nodes.switch(
            even,
            (nodes.combine("POWER", ratio, 1.0 - share) - ratio) / (1.0 - ratio),
            share,
            "FLOAT",
            "t",
        )
        for share in (part, part - step, (part + step).least(1.0))
    )
    cloud = nodes.store(cloud, "layer", t - before, "FLOAT")
    cloud = nodes.store(cloud, "layer ahead", after - t, "FLOAT")
    cloud = nodes.store(cloud, BLOCK, block_number(nodes, x, y, layer / along), "FLOAT")
    place = nodes.xyz(x, y, t, "Place")
    return nodes.store(cloud, "place", place, "FLOAT_VECTOR")


def _cloud(nodes: FieldBuilder, whole, cloud: Value, cut: Value) -> Value:
    """Points that know their (x, y, t), moved to where they are, with the inverse map around them."""
    nodes.open_frame("Where they are, and the inverse map around them")
    across, up, _ = _sides(nodes, cut)
    place = nodes.attribute("place", "FLOAT_VECTOR")
    found = nodes.call(look_up_group(), "Q(place)", whole | {"Position": place})
    cloud = nodes.store(cloud, PROJECTOR, inverse_map(nodes, found, place), "FLOAT4X4")
    nodes.open_frame("How far neighbors are: where they are, since a volume may stretch between layers")
    layer, ahead = nodes.attribute("layer"), nodes.attribute("layer ahead")
    reach = None
    for before, after in (
        (nodes.xyz(-1.0 / across, 0.0, 0.0, "Left"), nodes.xyz(1.0 / across, 0.0, 0.0, "Right")),
        (nodes.xyz(0.0, -1.0 / up, 0.0, "Down"), nodes.xyz(0.0, 1.0 / up, 0.0, "Up")),
        (nodes.xyz(0.0, 0.0, layer * -1.0, "Nearer"), nodes.xyz(0.0, 0.0, ahead, "Farther")),
    ):
        gaps = [
            (nodes.call(look_up_group(), "Neighbor", whole | {"Position": place + way})["Position"]
             - found["Position"]).length()
            for way in (before, after)
        ]  # fmt: skip
        side = gaps[0].most(gaps[1])
        reach = side if reach is None else reach + side
    cloud = nodes.store(cloud, REACH, reach, "FLOAT")
    return nodes.out("GeometryNodeSetPosition", "Cloud", {"Geometry": cloud, "Position": found["Position"]})


def _box(nodes: FieldBuilder, cloud: Value):
    """The box of the lattice: its index → position field, low corner and size."""
    nodes.open_frame("Box of the lattice")
    node = nodes.node("GeometryNodeBoundBox", "Box", {"Geometry": cloud})
    low, high = Value(nodes, node.outputs["Min"]), Value(nodes, node.outputs["Max"])
    margin = (high - low) * LATTICE_MARGIN
    low, extent = low - margin, high - low + margin * 2.0
    index = nodes.out("GeometryNodeInputIndex", "Index", {})
    layer = ((index + 0.5) / float(LATTICE**2)).floor()
    within = index - layer * float(LATTICE**2)
    row = ((within + 0.5) / float(LATTICE)).floor()
    cell = nodes.xyz(within - row * float(LATTICE), row, layer, "Cell")
    return low + extent * (cell * (1.0 / (LATTICE - 1))), low, extent


def _lattice(nodes: FieldBuilder, whole, cloud: Value, position: Value, extent: Value) -> Value:
    """Inverse maps on a grid of the space: a first guess by arithmetic, for whole meshes."""
    nodes.open_frame("Lattice of inverse maps")
    points = nodes.out(
        "GeometryNodePoints", "Points of the Lattice", {"Count": LATTICE**3, "Position": position}
    )
    here = nodes.out("GeometryNodeInputPosition", "Position", {})
    start, distance, reach = nearest_start(nodes, cloud, here)
    solved = nodes.call(solve_group(), "Solve", whole | {"Point": here, "Start": start, "Steps": 4})
    reached = solved["Last Step"] < LATTICE_ACCEPTED
    place = nodes.switch(reached, start, solved["Position"], "VECTOR", "Place")
    found = nodes.call(look_up_group(), "Q(place)", whole | {"Position": place})
    nodes.open_frame("A cell that is out of the volume tells how far, instead of a guess")
    cell = extent.length() * (1.0 / (LATTICE - 1))
    away = distance - cell - reach
    nought = nodes.xyz(0.0, 0.0, 0.0, "Nought")
    far = nodes.matrix([nought, nought, nought, nodes.xyz(FAR_AWAY, away, reach, "How Far")])
    inverse = nodes.switch(away > 0.0, inverse_map(nodes, found, place), far, "MATRIX", "In or Out")
    return nodes.store(points, PROJECTOR, inverse, "FLOAT4X4")
