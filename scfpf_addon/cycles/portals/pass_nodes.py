# SPDX-License-Identifier: GPL-3.0-or-later
"""AOVs that the portals write, from which the compositor makes t, depth and (u, v, t).

Each portal that a ray passes adds to an AOV the change since the previous one. The sum then describes the
chord on which the ray meets something. The far sheet takes everything away again.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

from ...scanline.nodes.field_nodes import FieldBuilder, Value
from ...scanline.nodes.geometry_nodes import GeometryBuilder, defines_group
from .mapped_positions import OWN, RECTANGLE

# AOVs, all colours. The start of the chord; Q's change along it, by t; t and depth at the start, and distance
# per depth; u, v, and 1 where the ray meets something. Where depth is along the camera's axis, the second is
# the part of the change along it: t and depth are exact wherever in the pixel the position was seen.
AOV_START, AOV_RATE, AOV_ALONG, AOV_PLACE = "SCFPF Start", "SCFPF Rate", "SCFPF Along", "SCFPF UV"
AOVS = (AOV_START, AOV_RATE, AOV_ALONG, AOV_PLACE)
# Attributes of the sheets: what each adds to the first three; x, y in the table and whether it is polar.
ADDED = {AOV_START: "scfpf_add_start", AOV_RATE: "scfpf_add_rate", AOV_ALONG: "scfpf_add_along"}
PLACE = "scfpf_place"
# What they add to the 1 of the fourth: 1 where a ray begins to be in the volume, -1 where it leaves.
INSIDE = "scfpf_inside"
# Attributes before the nodes: the result of ``mapped_positions``; ``Portals.length``.
MAPPED, LENGTH = "scfpf_seen", "scfpf_length"
TURN = 6.283185307179586
# Least divisor.
TINY = 1e-30


class Chord(NamedTuple):
    """A chord: its start, its change in place, t at the start, and its change in t."""

    start: Value
    along: Value
    t: Value
    step: Value


@defines_group(
    "SCFPF Portal Passes",
    {
        "Geometry": ("Geometry", None, "Sheets"),
        "Far": ("Float", 0.0, "1 where a ray leaves the volume"),
        "Number": ("Float", 0.0, "Of the sheet"),
        "Sheet": ("Int", 0, "Vertices of a whole sheet"),
        "Skips": ("Bool", False, "Do rays skip chords?"),
        "Place": ("Vector", None, "x, y, and 1 in a polar picture"),
        "Matrix": ("Matrix", None, "From the camera's space into the world"),
        "Along Axis": ("Bool", False, "Is depth measured along the camera's axis?"),
    }
    | {
        f"{part} {when}": (kind, None, f"{text} of the chord along which a ray {goes}")
        for when, goes in (("Before", "comes"), ("Onward", "goes on"))
        for part, kind, text in (
            ("Start", "Vector", "Start"),
            ("Chord", "Vector", "Start to end"),
            ("t", "Float", "t at the start"),
            ("Step", "Float", "Change of t"),
        )
    },
    {"Geometry": "Geometry"},
)
def passes_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """Store what each portal adds to the passes on its vertices."""
    geometry = given["Geometry"]
    before, onward = (
        Chord(*(given[f"{part} {when}"] for part in ("Start", "Chord", "t", "Step")))
        for when in ("Before", "Onward")
    )
    nodes.open_frame("What changes from chord to chord")
    number, far = given["Number"], given["Far"]
    behind = nodes.switch(number > 0.5, 0.0, 1.0, "FLOAT", "Is There One?")
    counts = nodes.switch(number < -0.5, 1.0 - far, 0.0, "FLOAT", "Begins a Chord")

    def change(value: Callable[[Chord], Value]) -> Value:
        return value(onward) * counts - value(before) * behind

    start = change(lambda chord: chord.start)
    t = change(lambda chord: chord.t)
    nodes.open_frame("Along the camera's axis, or along the chord")
    along_axis, matrix = given["Along Axis"], given["Matrix"]
    centre = nodes.point((0.0, 0.0, 0.0), matrix, "The Camera's Place")
    view = nodes.direction((0.0, 0.0, -1.0), matrix, "Its Axis")
    view = nodes.out("ShaderNodeVectorMath", "Unit", {0: view}, operation="NORMALIZE")

    def per_t(chord: Chord) -> Value:
        on_axis = view * chord.along.dot(view)
        part = nodes.switch(along_axis, chord.along, on_axis, "VECTOR", "Along the Axis?")
        return part * (1.0 / chord.step)

    rate = change(per_t)
    depth = change(lambda chord: (chord.start - centre).dot(view))
    nodes.open_frame("The place that is seen, through image mappings if there are any")
    x, y, kind = nodes.attribute(MAPPED, "FLOAT_VECTOR").parts()
    through = nodes.xyz(x, y, kind - float(RECTANGLE), "x, y, polar")
    place = nodes.switch(kind > OWN + 0.5, given["Place"], through, "VECTOR", "Mapped?")
    nodes.open_frame("Length of the chords that the ray is led past")
    _, same = divmod(nodes.index(), given["Sheet"])
    inputs = {0: onward.along.length() * counts, 1: same + 0.25}
    so_far = nodes.out("GeometryNodeAccumulateField", "So Far", inputs, "Trailing", data_type="FLOAT")
    length = before.along.length() * behind - so_far * far
    length = nodes.switch(given["Skips"], length, nodes.attribute(LENGTH), "FLOAT", "Skips?")
    depth = nodes.switch(along_axis, length, depth, "FLOAT", "Along the Axis?")
    along = nodes.xyz(t, depth, 0.0, "t, Depth")
    for aov, value in ((AOV_START, start), (AOV_RATE, rate), (AOV_ALONG, along)):
        geometry = nodes.store(geometry, ADDED[aov], value, "FLOAT_VECTOR")
    geometry = nodes.store(geometry, INSIDE, counts - behind, "FLOAT")
    return {"Geometry": nodes.store(geometry, PLACE, place, "FLOAT_VECTOR")}


def add_to_aovs(nodes: FieldBuilder, due, ray: Value | None, follow) -> None:
    """Let a material write into the AOVs.

    due: whether its portal turns the ray, a socket, or None. ray: the direction of the ray in the volume,
    forwards or backwards, where rays may enter or leave it; None elsewhere. follow: (socket, property) drives
    it by the camera.
    """
    nodes.open_frame("Into AOVs, if the view layer has them")

    def write(aov: str, value: Value) -> None:
        if due is not None:
            value = value * Value(nodes, due)
        nodes.node("ShaderNodeOutputAOV", aov, {"Color": value}, aov_name=aov)

    added = {aov: nodes.shader_attribute(name) for aov, name in ADDED.items()}
    if ray is not None:
        inside = nodes.shader_attribute(INSIDE, "Fac")
        u, v = _parameters(nodes, nodes.shader_attribute(PLACE), follow)
        write(AOV_PLACE, nodes.xyz(u, v, 1.0, "u, v, 1") * inside)
        nodes.open_frame("Distance per depth")
        rate = added[AOV_RATE]
        depth = ray.dot(rate).absolute().max(TINY)
        distance = ray.length() * rate.length() / depth
        added[AOV_ALONG] = added[AOV_ALONG] + nodes.xyz(0.0, 0.0, distance * inside, "Distance per Depth")
    for aov, value in added.items():
        write(aov, value)


def writes_place(material) -> bool:
    """Return whether a material writes u and v into AOVs."""
    nodes = () if material is None or material.node_tree is None else material.node_tree.nodes
    return any(node.type == "OUTPUT_AOV" and node.aov_name == AOV_PLACE for node in nodes)


def _parameters(nodes: FieldBuilder, place: Value, follow) -> tuple[Value, Value]:
    """u and v of a place in the table, also exact within a cell."""
    x, y, polar = place.parts()
    nodes.open_frame("A polar picture's angle and distance from the center")
    a, b = x * 2.0 - 1.0, y * 2.0 - 1.0
    turn = nodes.combine("ARCTAN2", b, a) * (1.0 / TURN)
    radius = (a * a + b * b).root()
    nodes.open_frame("u and v")
    result = []
    for part, name in ((nodes.mix(polar, x, turn - turn.floor()), "u"), (nodes.mix(polar, y, radius), "v")):
        ends = []
        for number, end in enumerate(("Start", "End")):
            value = nodes.out("ShaderNodeValue", f"{name.upper()} {end}", {})
            follow(value.socket, f"scfpf.{name}_range[{number}]")
            ends.append(value)
        result.append(nodes.mix(part, *ends))
    return result[0], result[1]
