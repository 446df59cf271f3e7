# SPDX-License-Identifier: GPL-3.0-or-later
"""The screen of a rig and the camera that looks at it: as large as the cones of the image's pixels ask for.

All depths are whole steps of float32 there. So a ray of the perspective camera begins exactly on its line,
although it begins far away from the scene and only one step before the screen.
"""

from __future__ import annotations

import math
from typing import NamedTuple

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


def is_about(one: Screen, other: Screen, share: float) -> bool:
    """Return whether two screens give nearly the same cones, within a share of their sizes."""
    if one.is_parallel != other.is_parallel or other.away < one.away:
        return False
    pairs = ((one.width, other.width), (one.distance, other.distance))
    return all(abs(math.log(a / b)) <= share for a, b in pairs)
