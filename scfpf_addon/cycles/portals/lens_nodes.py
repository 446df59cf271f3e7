# SPDX-License-Identifier: GPL-3.0-or-later
"""Depth of field of straight projectors: the rig's camera draws a place on its lens, the screen aims the ray.

The rig's camera is in focus at the screen, which stays sharp; only the tilt of the ray there tells its place
on the lens. Rays then go on through the point of their projector that is in focus. As in Blender's ordinary
cameras, this is at a distance along the view. If projectors go all around, as in Blender's panoramas, it is
at a distance along the ray, with the lens across it.
"""

from __future__ import annotations

from ...bridge.blender.drivers import add_property, new_driver
from ...bridge.blender.modifier_inputs import input_property
from ...scanline.nodes.field_nodes import FieldBuilder, Value
from ...scanline.nodes.geometry_nodes import GeometryBuilder, defines_group
from .screen import LENS_SHARE

# Attributes of the screen's vertices: directions across the lens, and their factors for a ray's origin and
# direction.
LENS_X, LENS_Y, LENS = "scfpf_lens_x", "scfpf_lens_y", "scfpf_lens"
# The tilt of a ray through the middle of the lens.
TILT = "scfpf_tilt"
# A lens looks ahead if all projectors go along the view by at least this share.
AHEAD = 0.05
# Blender's own least distance of a focused object.
NEAREST = 1e-5
# Variables of the expression below: the camera's settings.
_LENS = {
    "on": "data.dof.use_dof",
    "stop": "data.dof.aperture_fstop",
    "lens": "data.lens",
    "kind": "data.type",
}
# As in Cycles: an orthographic camera (kind 1) has its lens in scene units.
RADIUS_EXPRESSION = "on * (0.5 if kind == 1 else 0.0005 * lens) / max(stop, 0.00001)"
INPUTS = {
    "Lens Radius": ("Float", 0.0, "Half the width of the lens; 0 without depth of field"),
    "Focus Distance": ("Float", 10.0, "How far what is sharp is from the camera"),
    "Focus Object": ("Object", None, "An object that is sharp, instead of a distance"),
    "Has Focus Object": ("Bool", False, "Is there one?"),
    "Straight": ("Bool", True, "Is there one chord only?"),
    "Distance": ("Float", 1.0, "How far the screen is from the rig's camera"),
    "Parallel": ("Bool", True, "Is that camera orthographic?"),
}


@defines_group(
    "SCFPF Portal Lens",
    {
        "Geometry": ("Geometry", None, "Sheets"),
        "Matrix": ("Matrix", None, "From the camera's space into the world"),
        "Start": ("Vector", None, "Where the chord of a vertex starts in the world"),
        "Chord": ("Vector", None, "From there to its end"),
        "Screen": ("Vector", None, "Where it is on the screen"),
    }
    | INPUTS,
    {"Geometry": "Geometry"},
)
def lens_group(nodes: GeometryBuilder, given: dict[str, Value]) -> dict:
    """Store the lens of each vertex."""
    geometry, matrix = given["Geometry"], given["Matrix"]
    nodes.open_frame("The camera")
    centre = nodes.point((0.0, 0.0, 0.0), matrix, "Its Place")

    def axis(direction, label: str) -> Value:
        return _unit(nodes, nodes.direction(direction, matrix, label))

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
    nodes.open_frame("The middle of the rig's own lens")
    per_distance = nodes.switch(given["Parallel"], 1.0 / given["Distance"], 0.0, "FLOAT", "Tilted?")
    return {"Geometry": nodes.store(geometry, TILT, given["Screen"] * per_distance, "FLOAT_VECTOR")}


def _unit(nodes: FieldBuilder, vector: Value) -> Value:
    return nodes.out("ShaderNodeVectorMath", "Normalized", {0: vector}, operation="NORMALIZE")


def aimed(nodes: FieldBuilder, position: Value, direction: Value) -> tuple[Value, Value]:
    """Position and direction of the ray that a place on the lens asks for.

    Without the attributes, as in curved volumes, both stay as they are.
    """
    nodes.open_frame("The place on the lens, from the ray's tilt")
    ray = nodes.out("ShaderNodeNewGeometry", "Ray", {}, "Incoming")
    a, b, c = ray.parts()
    along_x, along_y, _ = nodes.shader_attribute(TILT).parts()
    x, y = (a / c + along_x) * (1.0 / LENS_SHARE), (b / c + along_y) * (1.0 / LENS_SHARE)
    nodes.open_frame("From there through what is in focus")
    offset = nodes.shader_attribute(LENS_X) * x + nodes.shader_attribute(LENS_Y) * y
    begins, goes, _ = nodes.shader_attribute(LENS).parts()
    return position + offset * begins, direction - offset * goes


def follow_lens(modifier, camera, lens) -> None:
    """Drive a rig by a camera's depth of field. lens: the rig camera's data."""
    driver = new_driver(*input_property(modifier, "Lens Radius"), RADIUS_EXPRESSION)
    for name, path in _LENS.items():
        add_property(driver, camera, path, name)
    followed = [(*input_property(modifier, "Focus Distance"), "focus_distance")]
    for setting in ("use_dof", "aperture_blades", "aperture_rotation", "aperture_ratio"):
        followed.append((lens.dof, setting, setting))
    for owner, name, setting in followed:
        add_property(new_driver(owner, name), camera, f"data.dof.{setting}")
