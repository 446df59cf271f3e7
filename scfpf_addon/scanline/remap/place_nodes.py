# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that find the place of a point of the scene in the viewbox.

A place is x and y over the image, and z from -1 (near surface) to -2 (far surface).
"""

from __future__ import annotations

from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group
from ..nodes.solve_nodes import (
    FAR_AWAY,
    PLACE,
    PROJECTOR,
    TABLE_INPUTS,
    nearest_sample,
    nearest_start,
    solve_group,
    whole_table,
)
from ..table.table_nodes import LATTICE
from ..table.uv_pieces import NO_PIECE
from .approach_nodes import approach_group

# The attribute that holds a vertex' place in the viewbox.
BOX = "scfpf_box"
# The z of a point without a place in the volume; points in the viewbox have a z below 0. Its x is then the
# least distance from the volume, and its y the reach of the volume there.
NOWHERE = 9.0
# The z of a point that the lattice knows to be out of the volume.
SURELY_NOWHERE = 10.0
# A solution is accepted if one more step of Newton's method would move it by less, in (x, y, t). That step
# is made as well, so that the square of this remains.
ACCEPTED = 2e-3
# Steps before the last, from a guess by the lattice, and from one by the cloud if that was not enough.
LATTICE_STEPS, CLOUD_STEPS = 1, 6
# Guesses start at most this far outside of the volume.
START_OUTSIDE = 0.25
# Steps before the last on a branch, and for points that are put onto its crease.
BRANCH_STEPS, CREASE_STEPS = 16, 32
# A solution on a branch misses its point by less than this share of the least scale, before the last step.
MISSED = 1e-3
# The z of a point near to a branch, but beyond its crease, runs from the one to the other. It grows by the
# distance from the branch as a share of the volume's size. Its x and y are those of the crease.
BEYOND_CREASE, UNKNOWN = 4.0, 5.0
# Attribute: the branch that a vertex is drawn by.
BRANCH_NUMBER = "scfpf_branch"
# Nearer to the volume than this, points may be turned inside out: by a fold, not by the mirror image beyond
# an apex.
INSIDE = 1e-3

# Where the near surface is in the viewbox.
NEAR_Z = -1.0

VIEW_INPUTS = TABLE_INPUTS | {
    "Cloud": ("Geometry", None, "The table's cloud"),
    "Numbers": ("Vector", None, "Near size over far size, turn of the volume, whether it is polar"),
    "Low": ("Vector", None, "Lower corner of the lattice"),
    "Extent": ("Vector", None, "Size of the lattice"),
    "Aspect": ("Float", 1.0, "Width over height of the picture"),
    "From": ("Vector", (0.0, 0.0, 0.0), "Least x, y and t that are shown"),
    "To": ("Vector", (1.0, 1.0, 1.0), "Greatest x, y and t that are shown"),
    "Branch": ("Bool", False, "Is it one of several branches of the inverse?"),
    "In Pieces": ("Bool", False, "Is the volume in pieces?"),
    "Piece": ("Float", NO_PIECE, "Of a volume in pieces, the one that is shown"),
    "Scale": ("Vector", (1.0, 1.0, 1.0), "Of a branch: how long its samples' derivatives are"),
    "Border": ("Geometry", None, "Of a volume in pieces: all pieces of its surfaces, flat over the picture"),
    "Sign": ("Float", -1.0, "Of a branch: the sign of its determinant"),
    "Search": ("Geometry", None, "The cloud, samples of each branch apart from others"),
    "Spacing": ("Vector", None, "How far apart"),
}
POINT_INPUTS = VIEW_INPUTS | {"Point": ("Vector", None, "A point in the table's space")}
PLACED = {"Position": "Vector"}


def view_inputs(nodes: GeometryBuilder, table: Value, aspect: Value) -> dict[str, Value]:
    """The values of ``VIEW_INPUTS`` for a table's geometry, except for defaults: the volume is one branch."""
    cloud, points, borders = nodes.outs(
        "GeometryNodeSeparateComponents",
        "Cloud and Table",
        {"Geometry": table},
        *("Mesh", "Point Cloud", "Instances"),
    )
    border = nodes.out("GeometryNodeRealizeInstances", "Borders", {0: borders})
    given = {
        "Table": points,
        "Cloud": cloud,
        "Aspect": aspect,
        "Border": border,
        "Search": cloud,
        "Branch": False,
    }
    for label, name in (
        ("Size", "size"),
        ("Wrap", "wrap"),
        ("Numbers", "ratio, turn, polar"),
        ("Low", "low"),
        ("Extent", "extent"),
    ):
        given[label] = nodes.sample_attribute(cloud, name, 0, label)
    return whole_table(points, given["Size"], given["Wrap"]) | given


@defines_group(
    "SCFPF On Screen",
    {"Place": ("Vector", None, "x, y and t")} | {key: VIEW_INPUTS[key] for key in ("Numbers", "Aspect")},
    PLACED,
)
def on_screen_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The place of an (x, y, t) in the viewbox."""
    ratio, _, polar = given["Numbers"].parts()
    x, y, t = given["Place"].parts()
    nodes.open_frame("Perspective depth: straight in straight views, so that faces cut each other right")
    spread = ratio + t * (1.0 - ratio)
    least = ratio.min(1.0) * 0.25
    depth = t / spread.max(least)
    nodes.open_frame("Over the picture's width; a polar picture's disk touches the nearer borders")
    disc = 1.0 / given["Aspect"].max(1.0)
    across = (x - 0.5) * nodes.mix(polar, 1.0, disc)
    up = (y - 0.5) * nodes.mix(polar, 1.0 / given["Aspect"], disc)
    return {"Position": nodes.xyz(across, up, NEAR_Z - depth, "In the Viewbox")}


def on_screen(nodes: GeometryBuilder, given: dict[str, Value], place: Value) -> Value:
    """The place of an (x, y, t) in the viewbox."""
    return nodes.call(on_screen_group(), "On Screen", {"Place": place}, given)["Position"]


@defines_group(
    "SCFPF Into Viewbox",
    {
        "Place": ("Vector", None, "x, y and t"),
        "Last Step": ("Float", None, "What Newton's method moved last"),
        "Determinant": ("Float", None, "Of the volume there"),
        "Numbers": VIEW_INPUTS["Numbers"],
        "Aspect": VIEW_INPUTS["Aspect"],
    },
    PLACED,
)
def viewbox_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The place of an (x, y, t) in the viewbox; z = 9 if it is not a solution."""
    place, turn = given["Place"], given["Numbers"].parts()[1]
    there = on_screen(nodes, given, place)
    nodes.open_frame("Is it a solution, and on the viewer's side of an apex?")
    inside = (place - (0.5, 0.5, 0.5)).absolute().largest() < 0.5 + INSIDE
    upright = given["Determinant"] * turn > 0.0
    found = (given["Last Step"] < ACCEPTED) & (inside | upright)
    nodes.close_frame()
    nowhere = nodes.xyz(0.0, 0.0, NOWHERE, "Nowhere")
    return {"Position": nodes.switch(found, nowhere, there, "VECTOR", "Found")}


def _solved(nodes: GeometryBuilder, given: dict[str, Value], start: Value, steps: int) -> Value:
    """The place of a point by Newton's method from a first guess of (x, y, t)."""
    solved = nodes.call(solve_group(), "Solve", {"Start": start, "Steps": steps}, given)
    inputs = {"Place": solved.pop("Position")} | solved
    return nodes.call(viewbox_group(), "Into Viewbox", inputs, given)["Position"]


@defines_group("SCFPF Quick Place", POINT_INPUTS, PLACED)
def quick_place_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The place of a point in the viewbox, from a guess by the lattice: cheap, but some fail."""
    nodes.open_frame("Nearest point of the lattice")
    ahead = (given["Point"] - given["Low"]) / given["Extent"] * float(LATTICE - 1)
    cell = (ahead + 0.5).floor().max((0.0,) * 3).min((LATTICE - 1.0,) * 3)
    columns, rows, spans = given["Size"].parts()
    index = cell.dot((1.0, float(LATTICE), float(LATTICE**2))) + columns * rows * spans
    inverse = nodes.sample_attribute(given["Table"], PROJECTOR, index, "Its Inverse Map", "FLOAT4X4")
    guess = nodes.point(given["Point"], inverse, "First Guess")
    start = guess.max((-START_OUTSIDE,) * 3).min((1.0 + START_OUTSIDE,) * 3)
    nodes.close_frame()
    solved = _solved(nodes, given, start, LATTICE_STEPS)
    nodes.open_frame("Out of the lattice, or in one of its cells that are out of the volume?")
    x, away, reach = guess.parts()
    beyond = ((ahead - cell).absolute() - (1.0, 1.0, 1.0)).max((0.0, 0.0, 0.0))
    off_lattice = (beyond * given["Extent"]).length() * (1.0 / (LATTICE - 1))
    empty = x > FAR_AWAY * 0.5
    out = empty | (off_lattice > 0.0)
    failed = solved.parts()[2] > 0.0
    far = nodes.switch(empty, off_lattice, away, "FLOAT", "How Far")
    nowhere = nodes.xyz(far, nodes.switch(empty, 0.0, reach, "FLOAT", "Reach"), SURELY_NOWHERE, "Nowhere")
    return {"Position": nodes.switch(out & failed, solved, nowhere, "VECTOR", "Place")}


def own_point(nodes: GeometryBuilder, given) -> Value:
    """The position of an element of the mesh in the table's space. given: Inverse."""
    return nodes.point(nodes.position(), given["Inverse"], "In Camera's Space")


def is_known(z: Value) -> Value:
    """Return whether a point has a place, or is beyond the crease of a near branch."""
    return z < UNKNOWN


def nearest_in_branch(nodes: GeometryBuilder, given, point: Value) -> Value:
    """The index of the sample that is nearest to a point: of the branch of its vertex, if it has one."""
    apart = given["Spacing"] * (nodes.attribute(BRANCH_NUMBER) + 0.5).floor()
    return nearest_sample(nodes, given["Search"], point + apart)


@defines_group("SCFPF Sure Place", POINT_INPUTS, PLACED)
def sure_place_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The place of a point in the viewbox, from a guess by the cloud: used where Quick Place failed."""
    nearest = nearest_in_branch(nodes, given, given["Point"])
    start, distance, reach = nearest_start(nodes, given["Cloud"], given["Point"], nearest)
    solved = _solved(nodes, given, start, CLOUD_STEPS)
    inputs = {"Nearest": nearest, "Start": start, "Distance": distance, "Reach": reach}
    of_branch = nodes.call(place_on_branch_group(), "On the Branch", inputs, given)["Position"]
    solved = nodes.switch(given["Branch"], solved, of_branch, "VECTOR", "Branch?")
    nowhere = nodes.xyz(distance - reach, reach, NOWHERE, "Nowhere, and How Far")
    known = is_known(solved.parts()[2])
    return {"Position": nodes.switch(known, nowhere, solved, "VECTOR", "Place")}


@defines_group(
    "SCFPF Place on Branch",
    POINT_INPUTS
    | {
        "Nearest": ("Int", 0, "The sample that is nearest to the point"),
        "Start": ("Vector", None, "A first guess of x, y and t"),
        "Distance": ("Float", None, "From that sample"),
        "Reach": ("Float", None, "That sample's distance from its neighbors"),
    },
    PLACED,
)
def place_on_branch_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The place of a point on a branch; beyond a fold, how far the point is from its crease.

    A group of its own: Blender evaluates the sides of a Switch behind another one, needed or not.
    """
    by_branch = _on_branch(nodes, given, given["Nearest"], given["Start"], BRANCH_STEPS)
    x, y, t = given["Scale"].parts()
    least = x.min(y).min(t)
    found = (by_branch["Last Step"] < ACCEPTED) & (by_branch["Missing"] < least * MISSED)
    there = on_screen(nodes, given, by_branch["Position"])
    across, up, _ = on_screen(nodes, given, by_branch["Nearest"]).parts()
    away = (by_branch["Missing"] / given["Extent"].length()).min(0.9)
    crease = nodes.xyz(across, up, away + BEYOND_CREASE, "Beyond the Crease")
    is_near = given["Distance"] < given["Reach"]
    crease = nodes.switch(is_near, (0.0, 0.0, NOWHERE), crease, "VECTOR", "Near It?")
    return {"Position": nodes.switch(found, crease, there, "VECTOR", "Found?")}


def _on_branch(nodes: GeometryBuilder, given, nearest: Value, start: Value, steps: int) -> dict[str, Value]:
    """The outputs of ``approach_group`` on the branch of the nearest sample."""
    sample = nodes.sample_attribute(given["Cloud"], PLACE, nearest, "Its x, y, t")
    inputs = {"Sample": sample, "Start": start, "Steps": steps}
    return nodes.call(approach_group(), "Approach", inputs, given)


@defines_group("SCFPF Onto the Crease", POINT_INPUTS, PLACED)
def crease_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The place on a fold's crease that is nearest to a point beyond it."""
    nearest = nearest_in_branch(nodes, given, given["Point"])
    start, _, _ = nearest_start(nodes, given["Cloud"], given["Point"], nearest)
    found = _on_branch(nodes, given, nearest, start, CREASE_STEPS)
    return {"Position": on_screen(nodes, given, found["Nearest"])}


def store_places(
    nodes: GeometryBuilder, mesh: Value, given: dict[str, Value], name: str = BOX, domain: str = "POINT"
) -> Value:
    """Store the places of a mesh' elements: first by the lattice, then by the cloud for those that failed."""
    quick = nodes.call(quick_place_group(), "Quick Place", {}, given)["Position"]
    # A branch has no lattice of its own.
    quick = nodes.switch(given["Branch"], quick, (0.0, 0.0, NOWHERE), "VECTOR", "Branch?")
    mesh = nodes.store(mesh, name, quick, "FLOAT_VECTOR", domain)
    z = nodes.attribute(name, "FLOAT_VECTOR").parts()[2]
    open_still = (z > 0.0) & (z < (NOWHERE + SURELY_NOWHERE) / 2)
    sure = nodes.call(sure_place_group(), "Sure Place", {}, given)["Position"]
    return nodes.store(mesh, name, sure, "FLOAT_VECTOR", domain, open_still)
