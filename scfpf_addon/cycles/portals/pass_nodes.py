# SPDX-License-Identifier: GPL-3.0-or-later
"""AOVs that the portals write, from which the compositor makes t, depth and (u, v, t).

Each portal that a ray passes adds to an AOV the change since the previous one. The sum then describes the
chord on which the ray meets something. The far sheet takes everything away again.
"""

from __future__ import annotations

from ...scanline.nodes.field_nodes import FieldBuilder, Value
from ...scanline.nodes.geometry_nodes import GeometryBuilder
from .mapped_positions import OWN, RECTANGLE

# AOVs, all colours: the start of the chord; Q's change along it, by t; t at the start and the length so far;
# u, v, and 1 where the ray meets something.
AOV_START, AOV_RATE, AOV_ALONG, AOV_PLACE = "SCFPF Start", "SCFPF Rate", "SCFPF Along", "SCFPF UV"
AOVS = (AOV_START, AOV_RATE, AOV_ALONG, AOV_PLACE)
# Attributes of the sheets: what each adds to the first three; x, y in the table and whether it is polar.
ADDED = {AOV_START: "scfpf_add_start", AOV_RATE: "scfpf_add_rate", AOV_ALONG: "scfpf_add_along"}
PLACE = "scfpf_place"
# Attribute before the nodes: the result of ``mapped_positions``.
MAPPED = "scfpf_seen"
TURN = 6.283185307179586


def store_added(nodes: GeometryBuilder, geometry: Value, given: dict[str, Value]) -> Value:
    """Store each portal's additions on its vertices.

    given: Start and Chord, attributes already stored; t, Step (of the chord, in t), Far, Number (of the
    sheet), Sheet (vertices of one), Place (x, y, polar).
    """
    nodes.open_frame("The sheet before")
    number, far = given["Number"], given["Far"]
    index = nodes.index()
    before = index - given["Sheet"]
    behind = nodes.switch(number > 0.5, 0.0, 1.0, "FLOAT", "Is There One?")
    counts = nodes.switch(number < -0.5, 1.0 - far, 0.0, "FLOAT", "Begins a Chord")

    def change(value: Value) -> Value:
        earlier = nodes.at_index(value, before, "POINT", "FLOAT_VECTOR")
        return value * counts - earlier * behind

    nodes.open_frame("What changes from chord to chord")
    start, chord = given["Start"], given["Chord"]
    rate = chord * (1.0 / given["Step"])
    t = nodes.xyz(given["t"], 0.0, 0.0, "t")
    nodes.open_frame("The place that is seen, through image mappings if there are any")
    x, y, kind = nodes.attribute(MAPPED, "FLOAT_VECTOR").parts()
    through = nodes.xyz(x, y, kind - float(RECTANGLE), "x, y, polar")
    place = nodes.switch(kind > OWN + 0.5, given["Place"], through, "VECTOR", "Mapped?")
    nodes.open_frame("Length of the chords so far")
    length = nodes.xyz(0.0, chord.length() * counts, 0.0, "Length")
    _, same = divmod(index, given["Sheet"])
    inputs = {0: length.parts()[1], 1: same + 0.25}
    so_far = nodes.out("GeometryNodeAccumulateField", "So Far", inputs, "Trailing", data_type="FLOAT")
    last = nodes.at_index(length, before, "POINT", "FLOAT_VECTOR") * behind
    along = change(t) + last - nodes.xyz(0.0, so_far * far, 0.0, "All of It")
    for aov, value in ((AOV_START, change(start)), (AOV_RATE, change(rate)), (AOV_ALONG, along)):
        geometry = nodes.store(geometry, ADDED[aov], value, "FLOAT_VECTOR")
    return nodes.store(geometry, PLACE, place, "FLOAT_VECTOR")


def add_to_aovs(nodes: FieldBuilder, due, place: float, follow) -> None:
    """Let a material write into the AOVs.

    due: whether its portal turns the ray, a socket, or None. place: 1 where u and v begin to be known (the
    screen), -1 where they end (the far sheet), else 0. follow: (socket, property) drives it by the camera.
    """
    nodes.open_frame("Into AOVs, if the view layer has them")

    def write(aov: str, value: Value) -> None:
        if due is not None:
            value = value * Value(nodes, due)
        nodes.node("ShaderNodeOutputAOV", aov, {"Color": value}, aov_name=aov)

    for aov, name in ADDED.items():
        write(aov, nodes.shader_attribute(name))
    if place:
        u, v = _parameters(nodes, nodes.shader_attribute(PLACE), follow)
        write(AOV_PLACE, nodes.xyz(u, v, 1.0, "u, v, 1") * place)


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
