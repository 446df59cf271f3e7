# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that find a point of space on one sheet of a volume, or the nearest place of that sheet.

Where no solution exists, as beyond a fold, Newton's method leaps about and over to other sheets. Here a step
that would change the determinant's sign is taken back. Damped least squares come to rest on the fold's
crease; the damping grows with the distance that is left (Levenberg and Marquardt).
"""

from __future__ import annotations

from ..nodes.field_nodes import Value
from ..nodes.geometry_nodes import GeometryBuilder, defines_group
from ..nodes.solve_nodes import LONGEST_STEP, TABLE_INPUTS, bounded_step, look_up_group

# The damping is the first times the distance that is left over the least of the scales, at most the second.
# Less would lead astray along a smooth crease; more would be slow in a thin volume, or far away.
DAMPING, MOST_DAMPING = 1.0, 0.2
# The next step may be at most this many times as long after a step over a crease, and after another one.
SHORTER, LONGER = 0.25, 1.5


@defines_group(
    "SCFPF Approach",
    TABLE_INPUTS
    | {
        "Point": ("Vector", None, "A point in the table's space"),
        "Sample": ("Vector", None, "x, y and t of a place on the sheet"),
        "Start": ("Vector", None, "A first guess of x, y and t"),
        "Scale": ("Vector", (1.0, 1.0, 1.0), "How long derivatives by x, y and t are"),
        "Sign": ("Float", -1.0, "Of the determinant on the sheet"),
        "Steps": ("Int", 16, "Steps before the last"),
    },
    {"Position": "Vector", "Nearest": "Vector", "Last Step": "Float", "Missing": "Float"},
)
def approach_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """The (x, y, t) of a point on one sheet of a volume, and the nearest place that the sheet has."""

    def body(state: dict[str, Value]) -> dict[str, Value]:
        trial = bounded_step(nodes, state["Good"], state["Step"], given["Wrap"])
        made = nodes.call(damped_step_group(), "Step", {"Guess": trial}, given)
        right = made["Determinant"] * given["Sign"] > 0.0
        size = state["Step"].absolute()
        # Only its greatest part is taken back: the others go on along the crease.
        x, y, t = (size - (1.0, 1.0, 1.0) * size.largest()).parts()
        greatest = nodes.xyz(x > -1e-9, y > -1e-9, t > -1e-9, "The Greatest")
        shorter = nodes.mix(greatest, state["Longest"], size * SHORTER)
        longest = nodes.switch(right, shorter, state["Longest"] * LONGER, "VECTOR", "Longest")
        step = made["Step"].min(longest).max(longest * -1.0)
        again = state["Step"] - state["Step"] * greatest
        return {
            "Good": nodes.switch(right, state["Good"], trial, "VECTOR", "On the Sheet?"),
            "Step": nodes.switch(right, again, step, "VECTOR", "Next Step"),
            "Longest": longest,
        }

    state = {
        "Good": ("VECTOR", given["Sample"]),
        "Step": ("VECTOR", given["Start"] - given["Sample"]),
        "Longest": ("VECTOR", (LONGEST_STEP,) * 3),
    }
    good = nodes.repeat(given["Steps"], state, "Nearer", body)["Good"]
    nodes.open_frame("The last step, and what is missing then")
    last = nodes.call(damped_step_group(), "Last Step", {"Guess": good}, given)
    place = bounded_step(nodes, good, last["Step"], given["Wrap"])
    return {
        "Position": place - place.floor() * given["Wrap"],
        "Nearest": good - good.floor() * given["Wrap"],
        "Last Step": last["Step"].absolute().largest(),
        "Missing": last["Missing"],
    }


@defines_group(
    "SCFPF Damped Step",
    TABLE_INPUTS
    | {
        "Point": ("Vector", None, "The point to come near to"),
        "Guess": ("Vector", None, "x, y and t so far"),
        "Scale": ("Vector", (1.0, 1.0, 1.0), "How long derivatives by x, y and t are"),
    },
    {"Step": "Vector", "Determinant": "Float", "Missing": "Float"},
)
def damped_step_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """One damped step of least squares in (x, y, t) towards a point."""
    found = nodes.call(look_up_group(), "Where it is", {"Position": given["Guess"]}, given)
    nodes.open_frame("Columns to scale")
    missing = given["Point"] - found["Position"]
    scale = given["Scale"].parts()
    columns = [found[f"By {axis}"] * (1.0 / one) for axis, one in zip("xyt", scale, strict=True)]
    size = missing.length()
    least = scale[0].min(scale[1]).min(scale[2])
    damping = (size * DAMPING / least).min(MOST_DAMPING)
    nodes.open_frame("Solve (MᵀM + damping) y = Mᵀ missing")
    rows = []
    for number, column in enumerate(columns):
        parts = [column.dot(other) for other in columns]
        parts[number] = parts[number] + damping
        rows.append(nodes.xyz(*parts, "Row"))
    right = nodes.xyz(*(column.dot(missing) for column in columns), "Right Side")
    normal = rows[1].cross(rows[2])
    parts = (right.dot(normal), right.dot(rows[2].cross(rows[0])), right.dot(rows[0].cross(rows[1])))
    step = nodes.xyz(*parts, "times determinant") * (1.0 / rows[0].dot(normal)) / given["Scale"]
    determinant = found["By x"].dot(found["By y"].cross(found["By t"]))
    return {"Step": step, "Determinant": determinant, "Missing": size}
