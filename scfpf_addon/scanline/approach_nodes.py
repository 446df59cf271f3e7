# SPDX-License-Identifier: GPL-3.0-or-later
"""A node group that finds the point of a branch of a volume that is nearest to a point of space.

Newton's method leaps about where there is no solution, as beyond a fold; least squares with a damping
that goes with what is missing (Levenberg and Marquardt) come to rest on the fold's crease.
"""

from __future__ import annotations

from .field_nodes import FieldBuilder, Value, node_group
from .solve_nodes import TABLE_INPUTS, bounded_step, look_up_group

STEPS = 10
# Damping: this times what is missing over the least of the scales. Near a fold, where Q goes with a square, 4
# halves the way to the crease with each step; more than the second would be slow far away from it.
DAMPING, MOST_DAMPING = 4.0, 0.2


def approach_group():
    """The (x, y, t) whose point is nearest to a point, from a first guess."""

    def build(nodes: FieldBuilder, given: dict[str, Value]) -> dict:
        table = {key: given[key] for key in TABLE_INPUTS} | {"Point": given["Point"], "Scale": given["Scale"]}

        def body(state: dict[str, Value]) -> dict[str, Value]:
            made = nodes.call(damped_step_group(), "Step", table | {"Guess": state["Guess"]})
            return {"Guess": bounded_step(nodes, state["Guess"], made["Step"], given["Wrap"])}

        guess = nodes.repeat(STEPS, {"Guess": ("VECTOR", given["Start"])}, "Nearer", body)["Guess"]
        nodes.open_frame("The last step, and what is missing then")
        last = nodes.call(damped_step_group(), "Last Step", table | {"Guess": guess})
        x, y, t = last["Step"].absolute().parts()
        place = bounded_step(nodes, guess, last["Step"], given["Wrap"])
        return {
            "Position": place - place.floor() * given["Wrap"],
            "Last Step": x.most(y).most(t),
            "Determinant": last["Determinant"],
            "Missing": last["Missing"],
        }

    inputs = TABLE_INPUTS | {
        "Point": ("Vector", None, "A point in the table's space"),
        "Start": ("Vector", None, "A first guess of x, y and t"),
        "Scale": ("Vector", (1.0, 1.0, 1.0), "How long derivatives by x, y and t are"),
    }
    outputs = {"Position": "Vector", "Last Step": "Float", "Determinant": "Float", "Missing": "Float"}
    text = "The (x, y, t) of a volume whose point is nearest to a point"
    return node_group("SCFPF Approach", text, inputs, outputs, build)


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
