# SPDX-License-Identifier: GPL-3.0-or-later
"""The node group of a camera's table: every projector's coefficients, and first guesses for the inversion.

Its point cloud holds the projectors, span by span and row by row, and after them the lattice: inverse maps
on a regular grid of the space. Its mesh is the cloud: points all over the volume with their (x, y, t) and
inverse maps, and the properties of the whole table on each.
"""

from __future__ import annotations

from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group, node_group
from ..nodes.solve_nodes import (
    FAR_AWAY,
    PLACE,
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
from .projector_nodes import store_projectors
from .table_branches import block_number, branches_group, cells_of_piece, pieces_group
from .table_sheets import BLOCK, BRANCHES, CLOUD, LAYER, LAYER_AHEAD

# Points of the cloud if the volume is in pieces, each of which needs some.
CLOUD_OF_PIECES = (24, 24, 8)
# Points of the lattice along an axis: a guess by the nearest one leaves Newton's method few steps.
LATTICE = 32
# The box of the lattice is larger than the cloud by this share on each side.
LATTICE_MARGIN = 0.1
# Ends nearer than this share of half the turn are one: float32 leaves 1e-6.
PERIODIC = 1e-3
# The least ratio of the near surface's size to the far one's; its inverse is the greatest. A depth buffer can
# bear no more.
SMALLEST_RATIO = 1e-4
# A ratio this near to 1 counts as 1.
EVEN_RATIO = 1e-3
# One more step of Newton's method moves the lattice's guesses by less than this in (x, y, t).
LATTICE_ACCEPTED = 0.02


def table_group(basis: str, count: int, weights: tuple[float, ...] | None = None, with_inverse: bool = True):
    """Return the group "SCFPF Table" of a basis and a number of surfaces.

    weights: of NURBS projectors, (count,). with_inverse: False for projectors alone, which is much quicker.
    """
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

    def build(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
        polar = given["Polar"] * given["Disc"]
        table, size, cut, border = store_projectors(nodes, given, powers, polar)
        wrap = nodes.call(_periodic_group(), "Periodic", {"Table": table, "Size": size})["Wrap"]
        if not with_inverse:
            return {"Table": nodes.join(table, _properties(nodes, size, wrap, polar))}
        whole = whole_table(table, size, wrap)
        ratio = nodes.call(_ratio_group(), "Near over Far", whole)["Ratio"]
        inputs = {"Cut": cut, "Ratio": ratio, "Polar": polar}
        cloud = nodes.call(_places_group(), "Places", inputs)["Cloud"]
        pieces = nodes.call(pieces_group(), "Pieces", {"Cloud": cloud}, whole)["Cloud"]
        cloud = nodes.switch(cut, cloud, pieces, "GEOMETRY", "In Pieces?")
        whole |= cells_of_piece(nodes, whole, cut)
        cloud = nodes.call(_cloud_group(), "Cloud", {"Cloud": cloud, "Cut": cut}, whole)["Cloud"]
        branches = nodes.call(branches_group(), "Branches", {"Cloud": cloud, "Cut": cut}, whole)
        cloud = branches["Cloud"]
        made = nodes.call(_lattice_group(), "Lattice", {"Cloud": cloud}, whole)
        lattice, low, extent = made["Lattice"], made["Low"], made["Extent"]
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

    kind = "Table" if with_inverse else "Projectors"
    weighted = "" if weights is None else " " + ":".join(f"{weight:.4g}" for weight in weights)
    name = f"SCFPF {kind} {basis} {count}{weighted}"
    text = f"The projectors of a flexible camera: {count} surfaces, {basis.replace('_', '-').title()}"
    return node_group(name, text, inputs, {"Table": "Geometry"}, build, modifier=True)


def _properties(nodes: GeometryBuilder, size: Value, wrap: Value, polar: Value) -> Value:
    """A mesh of a single vertex with the properties of a table without an inverse."""
    nodes.open_frame("What is true of the whole table")
    vertex = nodes.out("GeometryNodeMeshLine", "A Vertex", {"Count": 1})
    numbers = nodes.xyz(0.0, 0.0, polar, "Numbers")
    for name, value in (("size", size), ("wrap", wrap), ("ratio, turn, polar", numbers)):
        vertex = nodes.store(vertex, name, value, "FLOAT_VECTOR")
    nodes.close_frame()
    return vertex


@defines_group("SCFPF Periodic", {key: TABLE_INPUTS[key] for key in ("Table", "Size")}, {"Wrap": "Vector"})
def _periodic_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """1 where the volume's left and right, or lower and upper, ends are one; else 0."""
    table, size = given["Table"], given["Size"]
    nodes.open_frame("Do the ends of the picture meet?")
    points = nodes.out("GeometryNodePoints", "65 Samples", {"Count": 65})
    along = nodes.index() / 64.0
    whole = whole_table(table, size, (0.0, 0.0, 0.0))

    def meets(axis: int, t: float) -> Value:
        places = (
            nodes.xyz(*((end, along) if axis == 0 else (along, end)), t, "End") for end in (0.0, 1.0, 0.5)
        )
        start, end, middle = (
            nodes.call(look_up_group(), "At an End", {"Position": place}, whole)["Position"]
            for place in places
        )
        gap = nodes.statistic(points, (end - start).length(), "Max", "Gap")
        turn = nodes.statistic(points, (middle - start).length(), "Max", "Half a Turn")
        return gap < turn * PERIODIC

    tests = [meets(axis, 0.25) & meets(axis, 1.0) for axis in range(2)]
    return {"Wrap": nodes.xyz(*tests, 0.0, "Wrap")}


@defines_group("SCFPF Near over Far", TABLE_INPUTS, {"Ratio": "Float"})
def _ratio_group(nodes: GeometryBuilder, whole: dict[str, Value]) -> dict:
    """The near surface's size over the far one's: the square root of the ratio of their areas."""
    nodes.open_frame("Near surface's size over the far one's")
    row, column = divmod(nodes.index(), 16.0)
    x, y = (column + 0.5) / 16.0, (row + 0.5) / 16.0
    areas = []
    for t in (0.0, 1.0):
        found = nodes.call(look_up_group(), "Sample", {"Position": nodes.xyz(x, y, t, "Place")}, whole)
        area = found["By x"].cross(found["By y"]).length()
        points = nodes.out("GeometryNodePoints", "256 Samples", {"Count": 256})
        areas.append(nodes.statistic(points, area, "Mean", "Area"))
    ratio = (areas[0] / areas[1]).root()
    return {"Ratio": ratio.max(SMALLEST_RATIO).min(1 / SMALLEST_RATIO)}


def _sides(nodes: GeometryBuilder, cut: Value) -> tuple[Value, ...]:
    """The numbers of the cloud's points across, up and along the volume."""
    counts = zip(["across", "up", "along"], CLOUD, CLOUD_OF_PIECES, strict=True)
    return tuple(nodes.switch(cut, float(one), float(other), "FLOAT", label) for label, one, other in counts)


@defines_group(
    "SCFPF Cloud Places",
    {
        "Cut": ("Bool", False, "Is the volume in pieces?"),
        "Ratio": ("Float", 1.0, "Near size over far size"),
        "Polar": ("Float", 0.0, "1 in a polar picture"),
    },
    {"Cloud": "Geometry"},
)
def _places_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The cloud's points all over the volume, with their (x, y, t)."""
    cut, ratio, polar = given["Cut"], given["Ratio"], given["Polar"]
    nodes.open_frame("Places of the cloud")
    across, up, along = _sides(nodes, cut)
    points = nodes.out("GeometryNodePoints", "Points of the Cloud", {"Count": across * up * along + 0.5})
    cloud = nodes.out("GeometryNodePointsToVertices", "Vertices", {"Points": points})
    layer, within = divmod(nodes.index(), across * up)
    row, column = divmod(within, across)
    x, y = (column + 0.5) / across, (row + 0.5) / up
    # A polar image's square of places is pressed into its disc.
    a, b = x * 2.0 - 1.0, y * 2.0 - 1.0
    pressed = a.absolute().max(b.absolute()) / (a * a + b * b).root()
    press = nodes.mix(polar, 1.0 + polar * 0.0, pressed)
    x, y = a * press * 0.5 + 0.5, b * press * 0.5 + 0.5
    # Even by the size of the volume: a wide far end does not take all places from a small near one.
    # The last layer is the far surface; the near one may be a point, where nothing can be inverted.
    part = (layer + 0.5) / (along - 0.5)
    even = ratio.near(1.0, EVEN_RATIO)
    step = 1.0 / (along - 0.5)

    def t_of(share: Value) -> Value:
        by_powers = (nodes.combine("POWER", ratio, 1.0 - share) - ratio) / (1.0 - ratio)
        return nodes.switch(even, by_powers, share, "FLOAT", "t")

    t, before, after = (t_of(share) for share in (part, part - step, (part + step).min(1.0)))
    cloud = nodes.store(cloud, LAYER, t - before, "FLOAT")
    cloud = nodes.store(cloud, LAYER_AHEAD, after - t, "FLOAT")
    cloud = nodes.store(cloud, BLOCK, block_number(nodes, x, y, layer / along), "FLOAT")
    place = nodes.xyz(x, y, t, "Place")
    return {"Cloud": nodes.store(cloud, PLACE, place, "FLOAT_VECTOR")}


CLOUD_INPUTS = TABLE_INPUTS | {"Cloud": ("Geometry", None, "Points all over the volume")}


@defines_group(
    "SCFPF Cloud", CLOUD_INPUTS | {"Cut": ("Bool", False, "Is the volume in pieces?")}, {"Cloud": "Geometry"}
)
def _cloud_group(nodes: GeometryBuilder, whole: dict[str, Value]) -> dict:
    """The cloud with its points moved to Q(x, y, t), and with their inverse maps."""
    cloud, cut = whole["Cloud"], whole["Cut"]
    nodes.open_frame("Where they are, and the inverse map around them")
    across, up, _ = _sides(nodes, cut)
    place = nodes.attribute(PLACE, "FLOAT_VECTOR")
    found = nodes.call(look_up_group(), "Q(place)", {"Position": place}, whole)
    cloud = nodes.store(cloud, PROJECTOR, inverse_map(nodes, found, place), "FLOAT4X4")
    nodes.open_frame("How far neighbors are: where they are, since a volume may stretch between layers")
    layer, ahead = nodes.attribute(LAYER), nodes.attribute(LAYER_AHEAD)

    def gap(way: Value) -> Value:
        there = nodes.call(look_up_group(), "Neighbor", {"Position": place + way}, whole)["Position"]
        return (there - found["Position"]).length()

    reach = None
    for before, after in (
        (nodes.xyz(-1.0 / across, 0.0, 0.0, "Left"), nodes.xyz(1.0 / across, 0.0, 0.0, "Right")),
        (nodes.xyz(0.0, -1.0 / up, 0.0, "Down"), nodes.xyz(0.0, 1.0 / up, 0.0, "Up")),
        (nodes.xyz(0.0, 0.0, layer * -1.0, "Nearer"), nodes.xyz(0.0, 0.0, ahead, "Farther")),
    ):
        side = gap(before).max(gap(after))
        reach = side if reach is None else reach + side
    cloud = nodes.store(cloud, REACH, reach, "FLOAT")
    return {"Cloud": nodes.set_position(cloud, found["Position"], "Cloud")}


def _box(nodes: GeometryBuilder, cloud: Value) -> tuple[Value, Value, Value]:
    """The box of the lattice: the field of its points' positions, its low corner and its size."""
    nodes.open_frame("Box of the lattice")
    low, high = nodes.outs("GeometryNodeBoundBox", "Box", {"Geometry": cloud}, "Min", "Max")
    margin = (high - low) * LATTICE_MARGIN
    low, extent = low - margin, high - low + margin * 2.0
    layer, within = divmod(nodes.index(), float(LATTICE**2))
    row, column = divmod(within, float(LATTICE))
    cell = nodes.xyz(column, row, layer, "Cell")
    return low + extent * (cell * (1.0 / (LATTICE - 1))), low, extent


@defines_group("SCFPF Lattice", CLOUD_INPUTS, {"Lattice": "Geometry", "Low": "Vector", "Extent": "Vector"})
def _lattice_group(nodes: GeometryBuilder, whole: dict[str, Value]) -> dict:
    """Inverse maps on a grid of the space: a first guess by arithmetic, for whole meshes."""
    cloud = whole["Cloud"]
    position, low, extent = _box(nodes, cloud)
    nodes.open_frame("Lattice of inverse maps")
    points = nodes.out(
        "GeometryNodePoints", "Points of the Lattice", {"Count": LATTICE**3, "Position": position}
    )
    here = nodes.position()
    start, distance, reach = nearest_start(nodes, cloud, here)
    solved = nodes.call(solve_group(), "Solve", {"Point": here, "Start": start, "Steps": 4}, whole)
    reached = solved["Last Step"] < LATTICE_ACCEPTED
    place = nodes.switch(reached, start, solved["Position"], "VECTOR", "Place")
    found = nodes.call(look_up_group(), "Q(place)", {"Position": place}, whole)
    nodes.open_frame("A cell that is out of the volume tells how far, instead of a guess")
    cell = extent.length() * (1.0 / (LATTICE - 1))
    away = distance - cell - reach
    zero = nodes.xyz(0.0, 0.0, 0.0, "Zero")
    far = nodes.matrix([zero, zero, zero, nodes.xyz(FAR_AWAY, away, reach, "How Far")])
    inverse = nodes.switch(away > 0.0, inverse_map(nodes, found, place), far, "MATRIX", "In or Out")
    lattice = nodes.store(points, PROJECTOR, inverse, "FLOAT4X4")
    return {"Lattice": lattice, "Low": low, "Extent": extent}
