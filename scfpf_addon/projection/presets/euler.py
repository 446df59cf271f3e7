# SPDX-License-Identifier: GPL-3.0-or-later
"""Rotations as Blender's XYZ Euler angles, and back."""

from __future__ import annotations

import numpy as np

from ..typing import Array

# Cosine of the Y angle below which X and Z are one rotation: what float32 leaves of a right angle.
GIMBAL_TOLERANCE = 1e-6


def euler_matrix(angles: Array) -> Array:
    """Rotation about X, then Y, then Z (Blender's XYZ order), (3, 3). angles: (3,) radians."""
    (sx, sy, sz), (cx, cy, cz) = np.sin(angles), np.cos(angles)
    about_x = np.array([[1, 0, 0], [0, cx, -sx], [0, sx, cx]])
    about_y = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]])
    about_z = np.array([[cz, -sz, 0], [sz, cz, 0], [0, 0, 1]])
    return np.asarray(about_z @ about_y @ about_x, np.float64)


def euler_angles(rotation: Array) -> tuple[float, float, float]:
    """The inverse of ``euler_matrix``; with Y at a right angle, Z is 0."""
    across = float(np.hypot(rotation[0, 0], rotation[1, 0]))
    y = np.arctan2(-rotation[2, 0], across)
    if across > GIMBAL_TOLERANCE:
        x = np.arctan2(rotation[2, 1], rotation[2, 2])
        z = np.arctan2(rotation[1, 0], rotation[0, 0])
    else:
        x, z = np.arctan2(-rotation[1, 2], rotation[1, 1]), 0.0
    return float(x), float(y), float(z)
