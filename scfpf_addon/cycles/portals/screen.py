# SPDX-License-Identifier: GPL-3.0-or-later
"""The screen of a rig and the camera that looks at it: as large as the cones of the image's pixels ask for.

All depths are whole steps of float32 there. So a ray of the perspective camera begins exactly on its line,
although it begins far away from the scene and only one step before the screen.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from mathutils import Vector

from .pixel_cone import PixelCone

# How far the camera is below the scene, at most if the volume is small.
FAR = 2.0**18
# It is below everything in the volume by at least this factor.
BEYOND = 4.0
# The share of a number that is a step of float32.
STEP = 2.0**-23
# Steps from the camera to the screen, at least: one to begin a ray at, and if possible enough for a distance.
FEWEST_STEPS, ENOUGH_STEPS = 2, 16
# Blender's least clip distance, twice.
CLOSEST = 2e-6
SENSOR = 36.0
# The lens of the camera, as a share of its distance from the screen: places on it are tilts of rays.
LENS_SHARE = 1.0 / 2000.0


class Screen(NamedTuple):
    """A screen ``width`` wide, ``distance`` from its camera, which is ``away`` below the scene."""

    width: float
    distance: float
    away: float
    is_parallel: bool

    @property
    def step(self) -> float:
        """A step of float32 at the screen."""
        return STEP * 2.0 ** math.floor(math.log2(self.away))

    @property
    def lens_radius(self) -> float:
        """Half the width of the camera's lens."""
        return LENS_SHARE * self.distance


def screen_for(cone: PixelCone) -> Screen:
    """The screen for the cones of an image's pixels."""
    wanted = max(cone.width if cone.is_parallel else cone.distance, CLOSEST)
    away = min(FAR, 2.0 ** math.floor(math.log2(wanted)) / (STEP * ENOUGH_STEPS))
    if cone.reach > 0.0:
        away = max(away, 2.0 ** math.ceil(math.log2(BEYOND * cone.reach)))
    step = STEP * away
    distance = step * max(FEWEST_STEPS, round(wanted / step))
    width = cone.width if cone.is_parallel else cone.width * distance / cone.distance
    return Screen(width, distance, away, cone.is_parallel)


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


def is_about(one: Screen, other: Screen, share: float) -> bool:
    """Return whether two screens give nearly the same cones, within a share of their sizes."""
    if one.is_parallel != other.is_parallel or other.away < one.away:
        return False
    pairs = ((one.width, other.width), (one.distance, other.distance))
    return all(abs(math.log(a / b)) <= share for a, b in pairs)


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
