# SPDX-License-Identifier: GPL-3.0-or-later
"""The cameras of a rig: one looks at its screen, adaptive subdivision is as fine as the other asks for."""

from __future__ import annotations

import bpy
from mathutils import Vector

from .portals.pixel_cone import PixelCone
from .portals.screen import Screen

SENSOR = 36.0


def new_camera(name: str):
    """A new camera object, in no collection."""
    return bpy.data.objects.new(name, bpy.data.cameras.new(name))


def place_camera(view_camera, screen: Screen) -> None:
    """Put a rig's camera before its screen, in focus there."""
    view_camera.location = 0.0, 0.0, -screen.away
    lens = view_camera.data
    lens.sensor_fit = "HORIZONTAL"
    if screen.is_parallel:
        lens.type, lens.ortho_scale = "ORTHO", screen.width
        lens.dof.aperture_fstop = 0.5 / screen.lens_radius
    else:
        _set_perspective(lens, screen.width / screen.distance)
        lens.dof.aperture_fstop = 0.0005 * lens.lens / screen.lens_radius
    lens.dof.focus_distance = screen.distance
    lens.clip_start, lens.clip_end = screen.distance - screen.step, screen.away
    # Eyes apart would look past the screen.
    lens.stereo.interocular_distance = 0.0


def screen_of(view_camera) -> Screen:
    """The screen before a rig's camera."""
    lens = view_camera.data
    distance, is_parallel = lens.dof.focus_distance, lens.type == "ORTHO"
    width = lens.ortho_scale if is_parallel else distance * lens.sensor_width / lens.lens
    return Screen(width, distance, -view_camera.location.z, is_parallel)


def place_dicing_camera(dicing_camera, camera, cone: PixelCone) -> None:
    """Put a camera where the cones of the pixels begin, so that it sees pixels as wide, in all directions."""
    dicing_camera.parent = camera
    dicing_camera.location = camera.matrix_world.inverted_safe() @ Vector(cone.apex)
    lens = dicing_camera.data
    lens.sensor_fit = "HORIZONTAL"
    if cone.is_parallel:
        lens.type, lens.ortho_scale = "ORTHO", cone.width
    else:
        _set_perspective(lens, cone.width / cone.distance)


def _set_perspective(lens, angle: float) -> None:
    """Let a lens see the image as wide as ``angle`` times its distance."""
    lens.type, lens.sensor_width = "PERSP", SENSOR
    lens.lens = SENSOR / angle
