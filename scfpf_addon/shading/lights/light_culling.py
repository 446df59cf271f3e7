# SPDX-License-Identifier: GPL-3.0-or-later
"""Light culling: lights that reach nothing in the image need no lamp and no shadow rays.

Conservative. Blender's point lamps and suns shine on everything; a spot's cone may miss the scene, and an
area lamp lights only the half-space in front of it.
"""

from __future__ import annotations

import math

import numpy as np

from ...projection.typing import Array
from ..scene.shading_scene import Light

# Cones and planes are widened by this share of the scene's size, for rounding.
SLACK = 1e-3

# The kinds of lights that do not shine in all directions.
CONFINED = ("AREA", "SPOT")


def cull_lights(lights: tuple[Light, ...], vertices: Array) -> list[Light]:
    """The lights that have power and may reach the bounding box of the vertices (V, 3), in world space."""
    shining = [light for light in lights if np.any(light.color)]
    if not any(light.kind in CONFINED for light in shining):
        return shining
    # Axis by axis: NumPy takes fifty times as long for all three at once.
    lower, upper = (np.array([end(axis) for axis in vertices.T]) for end in (np.min, np.max))
    if not np.isfinite(lower + upper).all():
        return shining
    corners = np.stack(np.meshgrid(*zip(lower, upper, strict=True)), axis=-1).reshape(-1, 3)
    return [light for light in shining if _reaches(light, corners)]


def _reaches(light: Light, corners: Array) -> bool:
    """Return whether a light may reach the box with the corners (8, 3)."""
    matrix = np.asarray(light.matrix, np.float64)
    position, axis = matrix[:3, 3], -matrix[:3, 2]
    length = float(np.linalg.norm(axis))
    if light.kind not in CONFINED or length == 0.0:
        return True
    axis = axis / length
    size = float(np.linalg.norm(corners[7] - corners[0]))
    margin = SLACK * size
    if light.kind == "AREA":
        return bool(((corners - position) @ axis > -margin).any())
    # The box's bounding sphere, against the cone widened by the spot's own size. A spot scaled unevenly has
    # no round cone, and is kept.
    axes = matrix[:3, :3].T @ matrix[:3, :3]
    if np.abs(axes - np.eye(3) * axes[0, 0]).max() > SLACK * abs(axes[0, 0]):
        return True
    radius = size / 2 + margin + light.radius
    middle = corners.mean(axis=0) - position
    distance = float(np.linalg.norm(middle))
    if distance <= radius:
        return True
    between = math.acos(float(np.clip(middle @ axis / distance, -1.0, 1.0)))
    return between <= light.spot_angle / 2 + math.asin(radius / distance)
