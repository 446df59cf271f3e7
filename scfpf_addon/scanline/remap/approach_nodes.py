# SPDX-License-Identifier: GPL-3.0-or-later
"""A node group that finds a point of space on one sheet of a volume, or where the sheet is nearest to it.

Newton's method leaps about where there is no solution, as beyond a fold, and over to other sheets. Here a
step that would change the determinant's sign is taken back; least squares with a
damping that goes with what is missing (Levenberg and Marquardt) come to rest on the fold's crease.
"""

from __future__ import annotations

from ..nodes.field_nodes import FieldBuilder, Value, node_group
from ..nodes.solve_nodes import LONGEST_STEP, TABLE_INPUTS, bounded_step, look_up_group

# Damping: this times what is missing over the least of the scales. Less would
# lead astray along a smooth crease, more be slow where the volume is thin; more than the second, far away.
DAMPING, MOST_DAMPING = 1.0, 0.2
# After a step over a crease the next one is shorter, after one that is taken it may be longer.
SHORTER, LONGER = 0.25, 1.5


def approach_group():
    """The (x, y, t) on a sheet whose point is a given one, and the place nearest to it that was found."""

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        table = {key: given[key] for key in TABLE_INPUTS} | {"Point": given["Point"], "Scale": given["Scale"]}

        def body(state: dict[str, Value]) -> dict[str, Value]:
            trial = bounded_step(nodes, state["Good"], state["Step"], given["Wrap"])
            made = nodes.call(damped_step_group(), "Step", table | {"Guess": trial})
            right = made["Determinant"] * given["Sign"] > 0.0
            size = state["Step"].absolute()
            # Only its greatest part is taken back: along the crease the others go on.
            x, y, t = (size - (1.0, 1.0, 1.0) * _greatest(size)).parts()
            greatest = nodes.xyz(x > -1e-9, y > -1e-9, t > -1e-9, "The Greatest")
            shorter = nodes.mix(greatest, state["Longest"], size * SHORTER)
            longest = nodes.switch(right, shorter, state["Longest"] * LONGER, "VECTOR", "Longest")
            step = made["Step"].least(longest).most(longest * -1.0)
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
        last = nodes.call(damped_step_group(), "Last Step", table | {"Guess": good})
        place = bounded_step(nodes, good, last["Step"], given["Wrap"])
        return {
            "Position": place - place.floor() * given["Wrap"],
            "Nearest": good - good.floor() * given["Wrap"],
            "Last Step": _greatest(last["Step"]),
            "Missing": last["Missing"],
        }

    inputs = TABLE_INPUTS | {
        "Point": ("Vector", None, "A point in the table's space"),
        "Sample": ("Vector", None, "x, y and t of a place on the sheet"),
        "Start": ("Vector", None, "A first guess of x, y and t"),
        "Scale": ("Vector", (1.0, 1.0, 1.0), "How long derivatives by x, y and t are"),
        "Sign": ("Float", -1.0, "Of the determinant on the sheet"),
        "Steps": ("Int", 16, "Steps before the last"),
    }
    outputs = {"Position": "Vector", "Nearest": "Vector", "Last Step": "Float", "Missing": "Float"}
    text = "The (x, y, t) of a point on one sheet of a volume, and the nearest place that it has"
    return node_group("SCFPF Approach", text, inputs, outputs, build)


def _greatest(vector: Value) -> Value:
    x, y, z = vector.absolute().parts()
    return x.most(y).most(z)


def damped_step_group():
    """One damped step of least squares towards a point."""

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        table = {key: given[key] for key in TABLE_INPUTS}
        found = nodes.call(look_up_group(), "Where it is", table | {"Position": given["Guess"]})
        nodes.open_frame("Columns to scale")
        missing = given["Point"] - found["Position"]
        scale = given["Scale"].parts()
        columns = [found[f"By {axis}"] * (1.0 / one) for axis, one in zip("xyt", scale, strict=True)]
        size = missing.length()
        least = scale[0].least(scale[1]).least(scale[2])
        damping = (size * DAMPING / least).least(MOST_DAMPING)
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

    inputs = TABLE_INPUTS | {
        "Point": ("Vector", None, "The point to come near to"),
        "Guess": ("Vector", None, "x, y and t so far"),
        "Scale": ("Vector", (1.0, 1.0, 1.0), "How long derivatives by x, y and t are"),
    }
    outputs = {"Step": "Vector", "Determinant": "Float", "Missing": "Float"}
    text = "A damped step in (x, y, t) towards the nearest point of the volume"
    return node_group("SCFPF Damped Step", text, inputs, outputs, build)
