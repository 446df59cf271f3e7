# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups from a point of the scene to its place in the viewbox."""

from __future__ import annotations

from ..nodes.field_nodes import FieldBuilder, Value, node_group
from ..nodes.solve_nodes import (
    FAR_AWAY,
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
# The z of a point without a place in the volume; what is in the viewbox has a z below 0. Its x is then
# how far it is from the volume, at least, and its y how far that reaches there.
NOWHERE = 9.0
# The z of a point that the lattice knows to be out of the volume.
SURELY_NOWHERE = 10.0
# A solution is accepted when one more step of Newton's method would move it by less, in (x, y, t); the
# step itself is made as well, so that the square of this remains.
ACCEPTED = 2e-3
# Steps before the last, from a guess by the lattice, and from the cloud where that was not enough.
LATTICE_STEPS, CLOUD_STEPS = 1, 6
# Guesses start at most this far outside of the volume.
START_OUTSIDE = 0.25
# Of a branch: steps before the last, and for what is drawn on its crease.
BRANCH_STEPS, CREASE_STEPS = 16, 32
# A solution of a branch misses its point by less than this share of the least scale, before the last step.
MISSED = 1e-3
# The z of a point that is near to a branch, beyond its crease, from here on: more by what it is away from
# it, as a share of the volume's size. Its x and y are those of the crease.
BEYOND_CREASE, UNKNOWN = 4.0, 5.0
# The branch that a vertex is drawn by.
BRANCH_NUMBER = "scfpf_branch"
# What is this near to the volume may be turned inside out: it is a fold, no mirror image beyond an apex.
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
PLACED = {"Position": "Vector"}


def view_inputs(nodes: FieldBuilder, table: Value, aspect: Value) -> dict[str, Value]:
    """What ``VIEW_INPUTS`` ask for, from a table's geometry."""
    parts = nodes.node("GeometryNodeSeparateComponents", "Cloud and Table", {"Geometry": table})
    cloud, points = Value(nodes, parts.outputs["Mesh"]), Value(nodes, parts.outputs["Point Cloud"])
    border = nodes.out(
        "GeometryNodeRealizeInstances", "Borders", {0: Value(nodes, parts.outputs["Instances"])}
    )
    given = {"Table": points, "Cloud": cloud, "Aspect": aspect, "Border": border}
    given |= {
        "From": (0.0, 0.0, 0.0),
        "To": (1.0, 1.0, 1.0),
        "Branch": False,
        "In Pieces": False,
        "Piece": NO_PIECE,
        "Scale": (1.0, 1.0, 1.0),
        "Sign": -1.0,
        "Search": cloud,
        "Spacing": (0.0, 0.0, 0.0),
    }
    for label, name in (
        ("Size", "size"),
        ("Wrap", "wrap"),
        ("Numbers", "ratio, turn, polar"),
        ("Low", "low"),
        ("Extent", "extent"),
    ):
        given[label] = nodes.sample(cloud, nodes.attribute(name, "FLOAT_VECTOR"), 0, "FLOAT_VECTOR", label)
    return whole_table(points, given["Size"], given["Wrap"]) | given


def on_screen_group():
    """(x, y, t) as a place in the viewbox."""

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        ratio, _, polar = given["Numbers"].parts()
        x, y, t = given["Place"].parts()
        nodes.open_frame("Perspective depth: straight in straight views, so that faces cut each other right")
        spread = ratio + t * (1.0 - ratio)
        least = ratio.least(1.0) * 0.25
        depth = t / spread.most(least)
        nodes.open_frame("Over the picture's width; a polar picture's disk touches the nearer borders")
        disc = 1.0 / given["Aspect"].most(1.0)
        across = (x - 0.5) * nodes.mix(polar, 1.0, disc)
        up = (y - 0.5) * nodes.mix(polar, 1.0 / given["Aspect"], disc)
        return {"Position": nodes.xyz(across, up, NEAR_Z - depth, "In the Viewbox")}

    inputs = {"Place": ("Vector", None, "x, y and t")} | {
        key: VIEW_INPUTS[key] for key in ("Numbers", "Aspect")
    }
    return node_group("SCFPF On Screen", "From (x, y, t) to the viewbox", inputs, PLACED, build)


def on_screen(nodes: FieldBuilder, given: dict[str, Value], place: Value) -> Value:
    """(x, y, t) as a place in the viewbox."""
    inputs = {"Place": place, "Numbers": given["Numbers"], "Aspect": given["Aspect"]}
    return nodes.call(on_screen_group(), "On Screen", inputs)["Position"]


def viewbox_group():
    """From (x, y, t) to the viewbox, or to nowhere if it is no solution."""

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        place, turn = given["Place"], given["Numbers"].parts()[1]
        there = on_screen(nodes, given, place)
        nodes.open_frame("Is it a solution, and on the viewer's side of an apex?")
        half = (place - (0.5, 0.5, 0.5)).absolute()
        a, b, c = half.parts()
        inside = a.most(b).most(c) < 0.5 + INSIDE
        upright = given["Determinant"] * turn > 0.0
        found = nodes.both(given["Last Step"] < ACCEPTED, nodes.either(inside, upright))
        nodes.close_frame()
        nowhere = nodes.xyz(0.0, 0.0, NOWHERE, "Nowhere")
        return {"Position": nodes.switch(found, nowhere, there, "VECTOR", "Found")}

    inputs = {
        "Place": ("Vector", None, "x, y and t"),
        "Last Step": ("Float", None, "What Newton's method moved last"),
        "Determinant": ("Float", None, "Of the volume there"),
        "Numbers": VIEW_INPUTS["Numbers"],
        "Aspect": VIEW_INPUTS["Aspect"],
    }
    text = "From (x, y, t) to the viewbox; z = 9 where there is no solution"
    return node_group("SCFPF Into Viewbox", text, inputs, PLACED, build)


def _solved(nodes: FieldBuilder, given: dict[str, Value], start: Value, steps: int) -> dict[str, Value]:
    table = {key: given[key] for key in TABLE_INPUTS}
    solved = nodes.call(
        solve_group(), "Solve", table | {"Point": given["Point"], "Start": start, "Steps": steps}
    )
    return _in_viewbox(nodes, given, solved)


def _in_viewbox(nodes: FieldBuilder, given: dict[str, Value], solved: dict[str, Value]) -> dict[str, Value]:
    inputs = {
        "Place": solved["Position"],
        "Last Step": solved["Last Step"],
        "Determinant": solved["Determinant"],
        "Numbers": given["Numbers"],
        "Aspect": given["Aspect"],
    }
    return nodes.call(viewbox_group(), "Into Viewbox", inputs)


def quick_place_group():
    """The place of a point, guessed by arithmetic in the lattice: cheap, for whole meshes."""

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        nodes.open_frame("Nearest point of the lattice")
        ahead = (given["Point"] - given["Low"]) / given["Extent"] * float(LATTICE - 1)
        cell = (ahead + 0.5).floor().most((0.0,) * 3).least((LATTICE - 1.0,) * 3)
        columns, rows, spans = given["Size"].parts()
        index = cell.dot((1.0, float(LATTICE), float(LATTICE**2))) + columns * rows * spans
        inverse = nodes.sample(
            given["Table"], nodes.attribute(PROJECTOR, "FLOAT4X4"), index, "FLOAT4X4", "Its Inverse Map"
        )
        guess = nodes.point(given["Point"], inverse, "First Guess")
        start = guess.most((-START_OUTSIDE,) * 3).least((1.0 + START_OUTSIDE,) * 3)
        nodes.close_frame()
        solved = _solved(nodes, given, start, LATTICE_STEPS)["Position"]
        nodes.open_frame("Out of the lattice, or in one of its cells that are out of the volume?")
        x, away, reach = guess.parts()
        beyond = ((ahead - cell).absolute() - (1.0, 1.0, 1.0)).most((0.0, 0.0, 0.0))
        off_lattice = (beyond * given["Extent"]).length() * (1.0 / (LATTICE - 1))
        empty = x > FAR_AWAY * 0.5
        out = nodes.either(empty, off_lattice > 0.0)
        failed = solved.parts()[2] > 0.0
        far = nodes.switch(empty, off_lattice, away, "FLOAT", "How Far")
        nowhere = nodes.xyz(far, nodes.switch(empty, 0.0, reach, "FLOAT", "Reach"), SURELY_NOWHERE, "Nowhere")
        return {"Position": nodes.switch(nodes.both(out, failed), solved, nowhere, "VECTOR", "Place")}

    inputs = VIEW_INPUTS | {"Point": ("Vector", None, "A point in the table's space")}
    text = "The place of a point in the viewbox, from a guess by the lattice; some fail"
    return node_group("SCFPF Quick Place", text, inputs, PLACED, build)


def is_known(z: Value) -> Value:
    """Whether a point has a place, or is beyond the crease of a near branch."""
    return z < UNKNOWN


def nearest_in_branch(nodes: FieldBuilder, given, point: Value) -> Value:
    """The index of the sample that is nearest to a point: of its vertex' branch, if there are any."""
    apart = given["Spacing"] * (nodes.attribute(BRANCH_NUMBER) + 0.5).floor()
    return nearest_sample(nodes, given["Search"], point + apart)


def sure_place_group():
    """The place of a point, guessed by the nearest point of the cloud: for what the quick way has left."""

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        nearest = nearest_in_branch(nodes, given, given["Point"])
        start, distance, reach = nearest_start(nodes, given["Cloud"], given["Point"], nearest)
        solved = _solved(nodes, given, start, CLOUD_STEPS)["Position"]
        nodes.open_frame("Of a branch, where it is; beyond a fold, how far that is from its crease")
        by_branch = _on_branch(nodes, given, nearest, start, BRANCH_STEPS)
        least = _least(given["Scale"])
        found = nodes.both(by_branch["Last Step"] < ACCEPTED, by_branch["Missing"] < least * MISSED)
        there = on_screen(nodes, given, by_branch["Position"])
        across, up, _ = on_screen(nodes, given, by_branch["Nearest"]).parts()
        away = (by_branch["Missing"] / given["Extent"].length()).least(0.9)
        crease = nodes.xyz(across, up, away + BEYOND_CREASE, "Beyond the Crease")
        crease = nodes.switch(distance < reach, (0.0, 0.0, NOWHERE), crease, "VECTOR", "Near It?")
        of_branch = nodes.switch(found, crease, there, "VECTOR", "Found?")
        solved = nodes.switch(given["Branch"], solved, of_branch, "VECTOR", "Branch?")
        nodes.close_frame()
        nowhere = nodes.xyz(distance - reach, reach, NOWHERE, "Nowhere, and How Far")
        known = is_known(solved.parts()[2])
        return {"Position": nodes.switch(known, nowhere, solved, "VECTOR", "Place")}

    inputs = VIEW_INPUTS | {"Point": ("Vector", None, "A point in the table's space")}
    text = "The place of a point in the viewbox, from a guess by the cloud"
    return node_group("SCFPF Sure Place", text, inputs, PLACED, build)


def _least(scale: Value) -> Value:
    x, y, t = scale.parts()
    return x.least(y).least(t)


def _on_branch(nodes: FieldBuilder, given, nearest: Value, start: Value, steps: int) -> dict[str, Value]:
    sample = nodes.sample(
        given["Cloud"], nodes.attribute("place", "FLOAT_VECTOR"), nearest, "FLOAT_VECTOR", "Its x, y, t"
    )
    table = {key: given[key] for key in (*TABLE_INPUTS, "Point", "Scale", "Sign")}
    inputs = {"Sample": sample, "Start": start, "Steps": steps}
    return nodes.call(approach_group(), "Approach", table | inputs)


def crease_group():
    """The place on the crease of a vertex' branch that is nearest to a point beyond it."""

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        nearest = nearest_in_branch(nodes, given, given["Point"])
        start, _, _ = nearest_start(nodes, given["Cloud"], given["Point"], nearest)
        found = _on_branch(nodes, given, nearest, start, CREASE_STEPS)
        return {"Position": on_screen(nodes, given, found["Nearest"])}

    inputs = VIEW_INPUTS | {"Point": ("Vector", None, "A point in the table's space")}
    text = "The place on a fold's crease that is nearest to a point beyond it"
    return node_group("SCFPF Onto the Crease", text, inputs, PLACED, build)


def store_places(
    nodes: FieldBuilder, mesh: Value, given: dict[str, Value], name: str = BOX, domain: str = "POINT"
) -> Value:
    """The mesh with the places of its elements: quickly, and once more what that left open."""
    quick = nodes.call(quick_place_group(), "Quick Place", given)["Position"]
    # A branch has no lattice of its own.
    quick = nodes.switch(given["Branch"], quick, (0.0, 0.0, NOWHERE), "VECTOR", "Branch?")
    mesh = nodes.store(mesh, name, quick, "FLOAT_VECTOR", domain)
    z = nodes.attribute(name, "FLOAT_VECTOR").parts()[2]
    open_still = nodes.both(z > 0.0, z < (NOWHERE + SURELY_NOWHERE) / 2)
    sure = nodes.call(sure_place_group(), "Sure Place", given)["Position"]
    return nodes.store(mesh, name, sure, "FLOAT_VECTOR", domain, open_still)
