# SPDX-License-Identifier: GPL-3.0-or-later
"""A calibrated camera: its lens, the frame around what it sees, and the control points of its volume."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from ..mappings.calibrated import CalibratedLens
from ..typing import Array
from ..user_error import UserError

# Pixels along each side of the image, border included, whose directions the frame holds.
MEASURES = 65
# The largest frame of a lens, as a multiple of the image, and the largest tangent of half an angle in one:
# 346° across. What lies beyond is not shown.
MOST_OVERSCAN, MOST_HALF_TANGENT = 8.0, 16.0
# Rounding errors do not add a pixel to a frame.
ROUNDING = 1e-6
# A round frame's half width is a multiple of this, so that its control points are float32 numbers.
ROUND_STEP = 1 / 64
SEES_NOTHING = "The lens sees nothing: check its numbers and the size of its picture"


@dataclass(frozen=True)
class Calibration:
    """A calibrated camera.

    pose: (4, 4), the camera's space, x to the right, y up, looking along -z, to the world; None if the file
    has none. unknown_size: whether the file lacks the image size, which is a guess.
    """

    name: str
    lens: CalibratedLens
    pose: Array | None = field(default=None, compare=False)
    unknown_size: bool = False


def framed(lens: CalibratedLens, overscan: float = 0.0) -> tuple[CalibratedLens, float]:
    """The lens with a frame around what its image sees, and the overscan of the frame.

    overscan: width and height of a flat frame as a multiple of the image of the pinhole camera with the same
    focal lengths and centre; 0 for the least whole number of pixels that holds the image. A round frame is as
    large as needed, and its overscan 1. Raises UserError if the image sees nothing.
    """
    width, height = lens.size
    line = np.linspace(0.0, 1.0, MEASURES)
    x, y = (axis.ravel() for axis in np.meshgrid(line * width, line * height))
    (a, b), found = lens.directions(x, y)
    if not found.any():
        raise UserError(SEES_NOTHING)
    a, b = a[found], b[found]
    if lens.is_round:
        reach = min(float(np.abs([a, b]).max()), MOST_HALF_TANGENT)
        half = float(np.ceil(reach / ROUND_STEP)) * ROUND_STEP
        return _with_frame(lens, (0.0, 0.0, 2 * half, 2 * half)), 1.0
    fx, _skew, _shear, fy = lens.matrix
    cx, cy = lens.centre
    if overscan <= 0:
        across = np.abs(fx * a + cx - width / 2).max() * 2 / width
        down = np.abs(fy * b + cy - height / 2).max() * 2 / height
        pixels = np.ceil(max(across, down) * width / 2 - ROUNDING) * 2
        overscan = min(float(pixels / width), MOST_OVERSCAN)
    frame = (width / 2 - cx) / fx, (cy - height / 2) / fy, overscan * width / fx, overscan * height / fy
    return _with_frame(lens, frame), overscan


def _with_frame(lens: CalibratedLens, frame: tuple[float, ...]) -> CalibratedLens:
    """The lens with another frame, in float32 as Blender keeps it. Raises UserError for one without size."""
    with np.errstate(over="ignore"):
        x, y, width, height = (float(np.float32(number)) for number in frame)
    # Extreme numbers leave a single point that is seen, or place it beyond float32.
    if not (min(width, height) > 0 and np.isfinite([x, y, width, height]).all()):
        raise UserError(SEES_NOTHING)
    return replace(lens, frame=(x, y, width, height))


def round_net(lens: CalibratedLens, distance: float) -> Array:
    """The control points (3, 3, 3) of a round frame's surface: a paraboloid about the axis.

    Biquadratic, rows along v, in camera space. A place (u, v) lies along the direction of the frame's
    coordinates there, ``distance`` away on the axis. With a distance that is a power of two, all points are
    exact in float32.
    """
    half = lens.frame[2] / 2
    # The control points of the polynomials 2a and a² over [-half, half].
    along, square = np.array([-2 * half, 0.0, 2 * half]), np.array([half**2, -(half**2), half**2])
    net = np.empty((3, 3, 3))
    net[..., 0], net[..., 1] = along[None, :], along[:, None]
    net[..., 2] = square[None, :] + square[:, None] - 1.0
    return net * distance
