# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that evaluate Q(x, y, t) from a table of projectors and invert it by Newton's method.

Everywhere here (x, y, t) is a position in the table: x and y run over the picture,
or over the square around the disc of a polar one.
"""

from __future__ import annotations

from .field_nodes import FieldBuilder, Value, node_group

# Names of attributes. On the table's points: coefficients of a projector, or of an inverse map.
PROJECTOR = "projector"
# On the cloud's points: how far it is to their neighbours.
REACH = "reach"
# The x of the lattice's "guess" where there is no volume near; y and z are how far it is, and its reach.
FAR_AWAY = 1000.0
# No step of Newton's method goes farther than this in x, y or t, nor farther out of the volume.
LONGEST_STEP = 0.5
OUTSIDE = 0.5
# How far from a point of the cloud its inverse map is trusted, in x, y and t.
GUESS = 0.25

TABLE_INPUTS = {
    "Table": ("Geometry", None, "Points of the table"),
    "Size": ("Vector", None, "Columns, rows and spans of the table"),
    "Wrap": ("Vector", None, "1 where x or y is periodic, else 0"),
    "First Cell": ("Vector", None, "Column, row and span of the first cell that is looked at"),
    "Last Cell": ("Vector", None, "Column, row and span of the last one; beyond, these two go on"),
}


def whole_table(table: Value, size: Value, wrap: Value) -> dict[str, Value | tuple]:
    """What ``TABLE_INPUTS`` ask for, to look at all cells of a table."""
    last = size - (2.0, 2.0, 1.0)
    return {"Table": table, "Size": size, "Wrap": wrap, "First Cell": (0.0, 0.0, 0.0), "Last Cell": last}


def look_up_group():
    """Q and its derivatives at (x, y, t): bilinear between the four projectors around it."""

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        nodes.open_frame("Cell, and place in the cell")
        size, place = given["Size"], given["Position"]
        wrapped = place - place.floor() * given["Wrap"]
        in_cells = wrapped * (size - (1.0, 1.0, 0.0))
        cell = in_cells.floor().most(given["First Cell"]).least(given["Last Cell"])
        a, b, t = (in_cells - cell).parts()
        columns, rows, spans = size.parts()
        first = cell.dot(nodes.xyz(1.0, columns, columns * rows, "Index Steps"))
        nodes.open_frame("Points and tangents of the four projectors")
        t2 = t * t
        powers = nodes.xyz(t, t2, t2 * t, "t, t², t³")
        slopes = nodes.xyz(spans, spans * 2.0 * t, spans * 3.0 * t2, "Their slopes")
        projector = nodes.attribute(PROJECTOR, "FLOAT4X4")
        points, tangents = [], []
        for label, index in (
            ("lower left", first),
            ("lower right", first + 1.0),
            ("upper left", first + columns),
            ("upper right", first + columns + 1.0),
        ):
            matrix = nodes.sample(given["Table"], projector, index, "FLOAT4X4", f"Projector {label}")
            # Weights of surfaces would stand in the matrix's last row: Project Point, and its quotient rule.
            points.append(nodes.point(powers, matrix, f"Point {label}"))
            tangents.append(nodes.out("FunctionNodeTransformDirection", "Tangent", {0: slopes, 1: matrix}))
        nodes.open_frame("Blended")
        bottom, top = points[1] - points[0], points[3] - points[2]
        left = points[2] - points[0]
        position = points[0] + bottom * a
        twist = top - bottom
        across = bottom + twist * b
        up = left + twist * a
        low, high = (tangents[i] + (tangents[i + 1] - tangents[i]) * a for i in (0, 2))
        return {
            "Position": position + up * b,
            "By x": across * (columns - 1.0),
            "By y": up * (rows - 1.0),
            "By t": low + (high - low) * b,
        }

    inputs = TABLE_INPUTS | {"Position": ("Vector", None, "x, y and t")}
    outputs = dict.fromkeys(("Position", "By x", "By y", "By t"), "Vector")
    text = "A point of the viewing volume and its derivatives, from the table of projectors"
    return node_group("SCFPF Look Up", text, inputs, outputs, build)


def step_group():
    """One step of Newton's method towards a point."""

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        table = {key: given[key] for key in TABLE_INPUTS}
        found = nodes.call(look_up_group(), "Where it is", table | {"Position": given["Guess"]})
        nodes.open_frame("Solve [Qx Qy Qt] step = what is missing")
        missing = given["Point"] - found["Position"]
        by_x, by_y, by_t = (found[f"By {key}"] for key in "xyt")
        normal = by_y.cross(by_t)
        determinant = by_x.dot(normal)
        parts = (missing.dot(normal), missing.dot(by_t.cross(by_x)), missing.dot(by_x.cross(by_y)))
        step = nodes.xyz(*parts, "times determinant") * (1.0 / determinant)
        return {"Step": step, "Determinant": determinant}

    inputs = TABLE_INPUTS | {
        "Point": ("Vector", None, "The point that Q(x, y, t) shall become"),
        "Guess": ("Vector", None, "x, y and t so far"),
    }
    text = "The step in (x, y, t) that the linear part of the volume asks for"
    return node_group("SCFPF Newton Step", text, inputs, {"Step": "Vector", "Determinant": "Float"}, build)


def solve_group():
    """Newton's method: the (x, y, t) of a point from a first guess."""

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        table = {key: given[key] for key in TABLE_INPUTS} | {"Point": given["Point"]}
        nodes.open_frame("Steps, none of them too long")

        def body(state: dict[str, Value]) -> dict[str, Value]:
            guess = state["Guess"]
            step = nodes.call(step_group(), "Step", table | {"Guess": guess})["Step"]
            return {"Guess": bounded_step(nodes, guess, step, given["Wrap"])}

        state = {"Guess": ("VECTOR", given["Start"])}
        guess = nodes.repeat(given["Steps"], state, "Newton", body)["Guess"]
        nodes.open_frame("The last step is made too; its length tells what is reached")
        last = nodes.call(step_group(), "Last Step", table | {"Guess": guess})
        size = last["Step"].absolute()
        x, y, t = size.parts()
        place = guess + last["Step"].most((-LONGEST_STEP,) * 3).least((LONGEST_STEP,) * 3)
        return {
            "Position": place - place.floor() * given["Wrap"],
            "Last Step": x.most(y).most(t),
            "Determinant": last["Determinant"],
        }

    inputs = TABLE_INPUTS | {
        "Point": ("Vector", None, "A point in the table's space"),
        "Start": ("Vector", None, "A first guess of x, y and t"),
        "Steps": ("Int", 3, "Steps before the last"),
    }
    outputs = {"Position": "Vector", "Last Step": "Float", "Determinant": "Float"}
    text = "The (x, y, t) of a point in the viewing volume, by Newton's method"
    return node_group("SCFPF Solve", text, inputs, outputs, build)


def bounded_step(nodes: FieldBuilder, guess: Value, step: Value, wrap: Value) -> Value:
    """A guess after a step, neither too long nor too far out of the volume."""
    moved = guess + step.most((-LONGEST_STEP,) * 3).least((LONGEST_STEP,) * 3)
    # A periodic x goes round; else far outside there is nothing to find.
    inside = moved.most((-OUTSIDE,) * 3).least((1.0 + OUTSIDE,) * 3)
    return nodes.mix(wrap, inside, moved)


def nearest_sample(nodes: FieldBuilder, cloud: Value, point: Value) -> Value:
    """The index of the nearest point of the cloud."""
    inputs = {"Geometry": cloud, "Sample Position": point}
    return nodes.out("GeometryNodeSampleNearest", "Nearest of the Cloud", inputs, domain="POINT")


def nearest_start(
    nodes: FieldBuilder, cloud: Value, point: Value, nearest: Value | None = None
) -> tuple[Value, Value, Value]:
    """A first guess of (x, y, t) by the nearest point of the cloud and its inverse map.

    Also how far that point is, and how far from its neighbours it is. nearest: its index, if it is known.
    """
    nearest = nearest_sample(nodes, cloud, point) if nearest is None else nearest
    inverse = nodes.sample(cloud, nodes.attribute(PROJECTOR, "FLOAT4X4"), nearest, "FLOAT4X4", "Inverse Map")
    place, there = (
        nodes.sample(cloud, field, nearest, "FLOAT_VECTOR", label)
        for field, label in (
            (nodes.attribute("place", "FLOAT_VECTOR"), "Its x, y, t"),
            (nodes.out("GeometryNodeInputPosition", "Position", {}), "Where it is"),
        )
    )
    reach = nodes.sample(cloud, nodes.attribute(REACH), nearest, "FLOAT", "Its Reach")
    away = (nodes.point(point, inverse) - place).most((-GUESS,) * 3).least((GUESS,) * 3)
    return place + away, (point - there).length(), reach


def inverse_map(nodes: FieldBuilder, found: dict[str, Value], place: Value) -> Value:
    """The matrix of the affine map from points near Q(place) to (x, y, t)."""
    columns = [found["By x"], found["By y"], found["By t"]]
    x, y, t = place.parts()
    columns.append(found["Position"] - columns[0] * x - columns[1] * y - columns[2] * t)
    return nodes.out("FunctionNodeInvertMatrix", "Inverse Map", {0: nodes.matrix(columns)})
