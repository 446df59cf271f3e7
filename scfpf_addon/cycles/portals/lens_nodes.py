# SPDX-License-Identifier: GPL-3.0-or-later
"""Depth of field of straight projectors: the rig's camera draws a place on its lens, the screen aims.

The rig's camera is in focus at the screen, which stays sharp; what is left of the place on the lens is the
tilt of the ray there. Rays then go on through the point of their projector that is in focus: as in
Blender's ordinary cameras at a distance along the view, as in its panoramas, where projectors go all
around, along the ray, with the lens across it.
"""

from __future__ import annotations

import bpy

from ...bridge.blender import versions
from ...scanline.nodes.field_nodes import FieldBuilder, Value
from ...scanline.preview.preview_data import group_input

# The rig's lens: as wide as Blender lets it be, since places on it are told by tilts of 1 in 2000.
STOP = 0.1
RADIUS = 0.5 / STOP
# On the screen's vertices: directions across the lens, and what they are multiplied with where rays begin and
# in what they go along.
LENS_X, LENS_Y, LENS = "scfpf_lens_x", "scfpf_lens_y", "scfpf_lens"
# Least share of a projector's direction that goes along the view, for a lens that looks ahead.
AHEAD = 0.05
# Blender's own least distance of a focused object.
NEAREST = 1e-5
# The camera's settings that the expression below is made of.
_LENS = {
    "on": "data.dof.use_dof",
    "stop": "data.dof.aperture_fstop",
    "lens": "data.lens",
    "kind": "data.type",
}
# As Cycles has it: an orthographic camera's lens is measured in scene units; 1 is its number.
RADIUS_EXPRESSION = "on * (0.5 if kind == 1 else 0.0005 * lens) / max(stop, 0.00001)"
INPUTS = {
    "Lens Radius": ("Float", 0.0, "Half the width of the lens; 0 without depth of field"),
    "Focus Distance": ("Float", 10.0, "How far what is sharp is from the camera"),
    "Focus Object": ("Object", None, "An object that is sharp, instead of a distance"),
    "Has Focus Object": ("Bool", False, "Is there one?"),
    "Straight": ("Bool", True, "Is there one chord only?"),
}


def store_lens(nodes: FieldBuilder, geometry: Value, given: dict[str, Value], matrix: Value) -> Value:
    """Store the lens of each vertex. given: INPUTS, and Start and Chord in world space."""
    nodes.open_frame("The camera")
    centre = nodes.point((0.0, 0.0, 0.0), matrix, "Its Place")

    def axis(direction, label: str) -> Value:
        turned = nodes.direction(direction, matrix, label)
        return _unit(nodes, turned)

    across, up, view = axis((1, 0, 0), "Right"), axis((0, 1, 0), "Up"), axis((0, 0, -1), "View")
    start, chord = given["Start"], given["Chord"]
    nodes.open_frame("What is in focus")
    info = nodes.out(
        "GeometryNodeObjectInfo",
        "Focus",
        {"Object": given["Focus Object"]},
        "Location",
        transform_space="RELATIVE",
    )
    to_object = (info - centre).dot(view).absolute()
    focus = nodes.switch(given["Has Focus Object"], given["Focus Distance"], to_object, "FLOAT", "Focus")
    focus = focus.max(NEAREST)
    nodes.open_frame("Do all projectors go ahead?")
    along = _unit(nodes, chord)
    ahead = nodes.statistic(geometry, along.dot(view), "Min", "Least") > AHEAD
    nodes.open_frame("Across the view, or across the ray")
    ray_x = _unit(nodes, across - along * across.dot(along))
    lens_x = nodes.switch(ahead, ray_x, across, "VECTOR", "Lens X")
    lens_y = nodes.switch(ahead, along.cross(ray_x), up, "VECTOR", "Lens Y")
    depth = nodes.switch(ahead, (start - centre).length(), (start - centre).dot(view), "FLOAT", "Depth")
    reach = nodes.switch(ahead, chord.length(), chord.dot(view), "FLOAT", "Reach")
    radius = given["Lens Radius"]
    factors = nodes.xyz(radius - radius * depth / focus, radius * reach / focus, 0.0, "Factors")
    for name, value in ((LENS_X, lens_x), (LENS_Y, lens_y), (LENS, factors)):
        geometry = nodes.store(geometry, name, value, "FLOAT_VECTOR")
    return geometry


def _unit(nodes: FieldBuilder, vector: Value) -> Value:
    return nodes.out("ShaderNodeVectorMath", "Normalized", {0: vector}, operation="NORMALIZE")


def aimed(nodes: FieldBuilder, position: Value, direction: Value, distance: float) -> tuple[Value, Value]:
    """Position and direction of the ray that a place on the lens asks for; distance: camera to screen.

    Without the attributes, as in curved volumes, both stay as they are.
    """
    nodes.open_frame("The place on the lens, from the ray's tilt")
    tilt = nodes.out("ShaderNodeNewGeometry", "Ray", {}, "Incoming")
    a, b, c = tilt.parts()
    scale = distance / RADIUS
    x, y = a / c * scale, b / c * scale

    def attribute(name: str) -> Value:
        return nodes.out("ShaderNodeAttribute", name, {}, "Vector", attribute_name=name)

    nodes.open_frame("From there through what is in focus")
    offset = attribute(LENS_X) * x + attribute(LENS_Y) * y
    begins, goes, _ = attribute(LENS).parts()
    return position + offset * begins, direction - offset * goes


def follow_lens(modifier, group, camera, lens, distance: float) -> None:
    """Drive a rig by a camera's depth of field. lens: the rig camera's data; distance: to the screen."""
    owner, name = versions.modifier_input_property(modifier, group_input(group, "Lens Radius"))
    driver = owner.driver_add(name).driver
    driver.expression = RADIUS_EXPRESSION
    _clear(driver)
    for variable_name, path in _LENS.items():
        _variable(driver, camera, path, variable_name)
    owner, name = versions.modifier_input_property(modifier, group_input(group, "Focus Distance"))
    _follow(owner, name, camera, "data.dof.focus_distance")
    dof = lens.dof
    dof.aperture_fstop, dof.focus_distance = STOP, distance
    for setting in ("use_dof", "aperture_blades", "aperture_rotation", "aperture_ratio"):
        _follow(dof, setting, camera, f"data.dof.{setting}")


def set_focus(modifier, group, camera) -> None:
    """Let a rig focus on what its camera focuses on; what nodes do not follow by themselves."""
    focus = camera.data.dof.focus_object
    for label, value in (("Focus Object", focus), ("Has Focus Object", focus is not None)):
        identifier = group_input(group, label)
        if versions.modifier_input(modifier, identifier) != value:
            versions.set_modifier_input(modifier, identifier, value)


def _clear(driver) -> None:
    for old in list(driver.variables):
        driver.variables.remove(old)


def _variable(driver, camera, path: str, name: str = "value") -> None:
    variable = driver.variables.new()
    variable.name, variable.type = name, "SINGLE_PROP"
    variable.targets[0].id, variable.targets[0].data_path = camera, path


def _follow(owner: bpy.types.bpy_struct, name: str, camera, path: str) -> None:
    driver = owner.driver_add(name).driver
    driver.type = "AVERAGE"
    _clear(driver)
    _variable(driver, camera, path)
