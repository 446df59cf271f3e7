# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that evaluate Q(x, y, t) from a table of projectors and invert it by Newton's method.

Everywhere here (x, y, t) is a position in the table: x and y run over the image, or over the square around
the disc of a polar image.
"""

from __future__ import annotations

from .field_nodes import Value
from .geometry_nodes import GeometryBuilder, defines_group

# Attribute of the table's points: the coefficients of a projector; of the cloud's points: an inverse map.
PROJECTOR = "projector"
# Attribute of the cloud's points: the distance to their neighbours.
REACH = "reach"
# Attribute of the cloud's points: (x, y, t).
PLACE = "place"
# The x of the lattice's guess where no volume is near; y and z are then the volume's distance and its reach.
FAR_AWAY = 1000.0
# The longest step of Newton's method in x, y or t, and the farthest that a guess may be out of the volume.
LONGEST_STEP = 0.5
OUTSIDE = 0.5
# The inverse map of a point of the cloud is trusted up to this distance in x, y and t.
GUESS = 0.25

TABLE_INPUTS = {
    "Table": ("Geometry", None, "Points of the table"),
    "Size": ("Vector", None, "Columns, rows and spans of the table"),
    "Wrap": ("Vector", None, "1 where x or y is periodic, else 0"),
    "First Cell": ("Vector", None, "Column, row and span of the first cell that is looked at"),
    "Last Cell": ("Vector", None, "Column, row and span of the last one; beyond, these two go on"),
}


def whole_table(table: Value, size: Value, wrap: Value) -> dict[str, Value | tuple]:
    """The values of ``TABLE_INPUTS`` that look at all cells of a table."""
    last = size - (2.0, 2.0, 1.0)
    return {"Table": table, "Size": size, "Wrap": wrap, "First Cell": (0.0, 0.0, 0.0), "Last Cell": last}


def find_cell(nodes: GeometryBuilder, given: dict[str, Value]) -> tuple[Value, Value]:
    """The cell of a table that holds (x, y, t): the index of its first projector, and the place in the cell.

    given: ``TABLE_INPUTS`` and Position. The place runs from 0 to 1 across, up and along the cell.
    """
    nodes.open_frame("Cell, and place in the cell")
    size, place = given["Size"], given["Position"]
    in_cells = _wrapped(place, given["Wrap"]) * (size - (1.0, 1.0, 0.0))
    cell = in_cells.floor().max(given["First Cell"]).min(given["Last Cell"])
    columns, rows, _ = size.parts()
    return cell.dot(nodes.xyz(1.0, columns, columns * rows, "Index Steps")), in_cells - cell


def corner_projectors(
    nodes: GeometryBuilder, given: dict[str, Value], first: Value
) -> list[tuple[str, Value]]:
    """The four projectors around a cell, lower left to upper right: labels and 4 × 4 matrices."""
    columns = given["Size"].parts()[0]
    return [
        (label, nodes.sample_attribute(given["Table"], PROJECTOR, index, f"Projector {label}", "FLOAT4X4"))
        for label, index in (
            ("lower left", first),
            ("lower right", first + 1.0),
            ("upper left", first + columns),
            ("upper right", first + columns + 1.0),
        )
    ]


@defines_group(
    "SCFPF Look Up",
    TABLE_INPUTS | {"Position": ("Vector", None, "x, y and t")},
    dict.fromkeys(("Position", "By x", "By y", "By t"), "Vector"),
)
def look_up_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """A point Q of the viewing volume and its derivatives at (x, y, t), bilinear between four projectors."""
    first, place = find_cell(nodes, given)
    a, b, t = place.parts()
    columns, rows, spans = given["Size"].parts()
    nodes.open_frame("Points and tangents of the four projectors")
    t2 = t * t
    powers = nodes.xyz(t, t2, t2 * t, "t, t², t³")
    slopes = nodes.xyz(spans, spans * 2.0 * t, spans * 3.0 * t2, "Their slopes")
    points, tangents = [], []
    for label, matrix in corner_projectors(nodes, given, first):
        # Weights of surfaces would stand in the matrix's last row: Project Point, and its quotient rule.
        points.append(nodes.point(powers, matrix, f"Point {label}"))
        tangents.append(nodes.direction(slopes, matrix, "Tangent"))
    nodes.open_frame("Blended")
    bottom, top = points[1] - points[0], points[3] - points[2]
    left = points[2] - points[0]
    twist = top - bottom
    up = left + twist * a
    low, high = (nodes.mix(a, *tangents[i : i + 2]) for i in (0, 2))
    return {
        "Position": points[0] + bottom * a + up * b,
        "By x": (bottom + twist * b) * (columns - 1.0),
        "By y": up * (rows - 1.0),
        "By t": nodes.mix(b, low, high),
    }


@defines_group(
    "SCFPF Newton Step",
    TABLE_INPUTS
    | {
        "Point": ("Vector", None, "The point that Q(x, y, t) shall become"),
        "Guess": ("Vector", None, "x, y and t so far"),
    },
    {"Step": "Vector", "Determinant": "Float"},
)
def step_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """One step of Newton's method in (x, y, t) towards a point."""
    found = nodes.call(look_up_group(), "Where it is", {"Position": given["Guess"]}, given)
    nodes.open_frame("Solve [Qx Qy Qt] step = what is missing")
    missing = given["Point"] - found["Position"]
    by_x, by_y, by_t = (found[f"By {key}"] for key in "xyt")
    normal = by_y.cross(by_t)
    determinant = by_x.dot(normal)
    parts = (missing.dot(normal), missing.dot(by_t.cross(by_x)), missing.dot(by_x.cross(by_y)))
    step = nodes.xyz(*parts, "times determinant") * (1.0 / determinant)
    return {"Step": step, "Determinant": determinant}


@defines_group(
    "SCFPF Solve",
    TABLE_INPUTS
    | {
        "Point": ("Vector", None, "A point in the table's space"),
        "Start": ("Vector", None, "A first guess of x, y and t"),
        "Steps": ("Int", 3, "Steps before the last"),
    },
    {"Position": "Vector", "Last Step": "Float", "Determinant": "Float"},
)
def solve_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The (x, y, t) of a point in the viewing volume, by Newton's method."""
    nodes.open_frame("Steps, none of them too long")

    def body(state: dict[str, Value]) -> dict[str, Value]:
        step = nodes.call(step_group(), "Step", state, given)["Step"]
        return {"Guess": bounded_step(nodes, state["Guess"], step, given["Wrap"])}

    state = {"Guess": ("VECTOR", given["Start"])}
    guess = nodes.repeat(given["Steps"], state, "Newton", body)["Guess"]
    nodes.open_frame("The last step is made too; its length tells what is reached")
    last = nodes.call(step_group(), "Last Step", {"Guess": guess}, given)
    return {
        "Position": _wrapped(guess + _short(last["Step"]), given["Wrap"]),
        "Last Step": last["Step"].absolute().largest(),
        "Determinant": last["Determinant"],
    }


def _wrapped(place: Value, wrap: Value) -> Value:
    """(x, y, t) without whole turns of a periodic x or y."""
    return place - place.floor() * wrap


def _short(step: Value) -> Value:
    return step.max((-LONGEST_STEP,) * 3).min((LONGEST_STEP,) * 3)


def bounded_step(nodes: GeometryBuilder, guess: Value, step: Value, wrap: Value) -> Value:
    """A guess after a step, neither too long nor too far out of the volume."""
    moved = guess + _short(step)
    # A periodic x goes round. Otherwise nothing is to be found far outside.
    inside = moved.max((-OUTSIDE,) * 3).min((1.0 + OUTSIDE,) * 3)
    return nodes.mix(wrap, inside, moved)


def nearest_sample(nodes: GeometryBuilder, cloud: Value, point: Value) -> Value:
    """The index of the nearest point of the cloud."""
    inputs = {"Geometry": cloud, "Sample Position": point}
    return nodes.out("GeometryNodeSampleNearest", "Nearest of the Cloud", inputs, domain="POINT")


def nearest_start(
    nodes: GeometryBuilder, cloud: Value, point: Value, nearest: Value | None = None
) -> tuple[Value, Value, Value]:
    """A first guess of (x, y, t) by the nearest point of the cloud and its inverse map.

    Also the distance of that point, and its distance from its neighbours. nearest: its index, if known.
    """
    nearest = nearest_sample(nodes, cloud, point) if nearest is None else nearest
    inverse = nodes.sample_attribute(cloud, PROJECTOR, nearest, "Inverse Map", "FLOAT4X4")
    place = nodes.sample_attribute(cloud, PLACE, nearest, "Its x, y, t")
    there = nodes.sample(cloud, nodes.position(), nearest, "FLOAT_VECTOR", "Where it is")
    reach = nodes.sample_attribute(cloud, REACH, nearest, "Its Reach", "FLOAT")
    away = (nodes.point(point, inverse) - place).max((-GUESS,) * 3).min((GUESS,) * 3)
    return place + away, (point - there).length(), reach


def inverse_map(nodes: GeometryBuilder, found: dict[str, Value], place: Value) -> Value:
    """The matrix of the affine map from points near Q(place) to (x, y, t)."""
    columns = [found["By x"], found["By y"], found["By t"]]
    x, y, t = place.parts()
    columns.append(found["Position"] - columns[0] * x - columns[1] * y - columns[2] * t)
    return nodes.out("FunctionNodeInvertMatrix", "Inverse Map", {0: nodes.matrix(columns)})
