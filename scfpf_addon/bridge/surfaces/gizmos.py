# SPDX-License-Identifier: GPL-3.0-or-later
"""Handles in the viewport for the parametric kinds: gizmo nodes in their node groups.

Blender traces a gizmo's value backwards through Math nodes, by their first
input, to the modifier's input. Half an extent that is centred on the origin is
the value of its handle, so that the edge stays under the mouse. The gizmos'
geometry outputs stay unlinked: what the group makes is the same with and without.
"""

from __future__ import annotations

# The ring of the lower latitude is this much smaller, so that both can be grasped.
INNER_RING = 0.85

ACROSS, UP, AHEAD, FACING = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, -1.0), (0.0, 0.0, 1.0)


def _half(nodes, extent, label: str):
    return nodes.math("MULTIPLY", extent, 0.5, label)


def _arrow(nodes, name: str, value, place, direction, colour: str) -> None:
    """A handle that is drawn at ``place`` (x, y, z: numbers or sockets) and moves along ``direction``."""
    position = nodes.vector(*place, f"{name} Handle Position")
    inputs = {"Value": value, "Position": position, "Direction": direction}
    nodes.node("GeometryNodeGizmoLinear", f"{name} Handle", inputs, color_id=colour)


def _dial(nodes, name: str, value, axis, radius, colour: str) -> None:
    """A ring about the origin; turning it about ``axis``, right-handed, adds to ``value``."""
    inputs = {"Value": value, "Up": axis, "Screen Space": False, "Radius": radius}
    nodes.node("GeometryNodeGizmoDial", f"{name} Handle", inputs, color_id=colour)


def _arc_about_y(nodes, given, radius) -> None:
    down = (0.0, -1.0, 0.0)  # from straight ahead towards the end at u = 1
    _dial(nodes, "Arc", _half(nodes, given["arc"], "Half Arc"), down, radius, "PRIMARY")


def _plane(nodes, given) -> None:
    x, y = _half(nodes, given["width"], "Half Width"), _half(nodes, given["height"], "Half Height")
    _arrow(nodes, "Width", x, (x, 0.0, 0.0), ACROSS, "X")
    _arrow(nodes, "Height", y, (0.0, y, 0.0), UP, "Y")


def _disc(nodes, given) -> None:
    _arrow(nodes, "Radius", given["radius"], (given["radius"], 0.0, 0.0), ACROSS, "X")
    _dial(nodes, "Arc", given["arc"], FACING, given["radius"], "PRIMARY")


def _ahead(nodes, radius, name: str):
    """The z of what is ``radius`` straight ahead."""
    return nodes.math("MULTIPLY", radius, -1.0, f"{name} Ahead")


def _cylinder(nodes, given) -> None:
    z = _ahead(nodes, given["radius"], "Radius")
    y = _half(nodes, given["height"], "Half Height")
    _arrow(nodes, "Radius", given["radius"], (0.0, 0.0, z), AHEAD, "Z")
    _arrow(nodes, "Height", y, (0.0, y, z), UP, "Y")
    _arc_about_y(nodes, given, given["radius"])


def _cone(nodes, given) -> None:
    start, end = (
        _ahead(nodes, given[f"radius_{which}"], f"Radius {which.title()}") for which in ("start", "end")
    )
    y = _half(nodes, given["height"], "Half Height")
    below = nodes.math("MULTIPLY", y, -1.0, "Lower Edge")
    _arrow(nodes, "Radius Start", given["radius_start"], (0.0, below, start), AHEAD, "Z")
    _arrow(nodes, "Radius End", given["radius_end"], (0.0, y, end), AHEAD, "Z")
    _arrow(nodes, "Height", y, (0.0, y, end), UP, "Y")
    widest = nodes.math("MAXIMUM", given["radius_start"], given["radius_end"], "Widest")
    _arc_about_y(nodes, given, widest)


def _sphere(nodes, given) -> None:
    z = _ahead(nodes, given["radius"], "Radius")
    _arrow(nodes, "Radius", given["radius"], (0.0, 0.0, z), AHEAD, "Z")
    _arc_about_y(nodes, given, given["radius"])
    inner = nodes.math("MULTIPLY", given["radius"], INNER_RING, "Inner Ring")
    _dial(nodes, "Latitude Start", given["latitude_start"], ACROSS, inner, "SECONDARY")
    _dial(nodes, "Latitude End", given["latitude_end"], ACROSS, given["radius"], "SECONDARY")


_GIZMOS = {"PLANE": _plane, "DISC": _disc, "CYLINDER": _cylinder, "CONE": _cone, "SPHERE": _sphere}


def add_gizmos(nodes, kind: str, given: dict) -> None:
    """Add the handles of a kind to its node group. given: the group's inputs by key."""
    build = _GIZMOS.get(kind)
    if build is None:
        return
    nodes.open_frame("Handles in the viewport")
    build(nodes, given)
    nodes.close_frame()
