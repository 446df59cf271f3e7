# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps and the world → ``Light`` and a colour."""

from __future__ import annotations

from math import pi, sin

import numpy as np

from ..projection.typing import Array
from ..shading.scene import Light
from . import versions
from .shader_nodes import color_input, output_shaders, value_input


def read_light(lamp, matrix: Array) -> Light | None:
    """One evaluated lamp (a bpy.types.Light) placed by ``matrix`` (4, 4) float64.

    None for a lamp that gives no light or that a zero or non-finite matrix has
    flattened. The light's matrix is a rotation and a place; the object's scale goes
    into the extents of an AREA.
    """
    if not np.isfinite(matrix).all():
        return None
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    size = _extents(lamp, scale)
    color = _color(lamp) * _normalization(lamp, size)
    if not scale.all() or not color.any() or not np.isfinite(color).all():
        return None
    placed = np.array(matrix, np.float64)
    placed[:3, :3] /= scale
    return Light(
        kind=lamp.type,
        color=color,
        matrix=placed,
        casts_shadow=lamp.use_shadow,
        radius=lamp.shadow_soft_size if lamp.type in {"POINT", "SPOT"} else 0.0,
        angle=lamp.angle if lamp.type == "SUN" else 0.0,
        size=size,
        ellipse=lamp.type == "AREA" and lamp.shape in {"DISK", "ELLIPSE"},
        spot_angle=lamp.spot_size if lamp.type == "SPOT" else 0.0,
        spot_blend=lamp.spot_blend if lamp.type == "SPOT" else 0.0,
    )


def _color(lamp) -> Array:
    """Colour times power: watts, for SUN W/m²."""
    color = np.array(lamp.color, np.float64) * lamp.energy * 2.0**lamp.exposure
    if lamp.use_temperature:
        color *= np.array(lamp.temperature_color)
    if versions.uses_nodes(lamp):
        color *= _emission(lamp.node_tree, "EMISSION", np.ones(3))[0]
    return color


def _extents(lamp, scale: Array) -> tuple[float, float]:
    """Size of an AREA along its X and Y in world units; (0, 0) for other lamps."""
    if lamp.type != "AREA":
        return 0.0, 0.0
    height = lamp.size_y if lamp.shape in {"RECTANGLE", "ELLIPSE"} else lamp.size
    return float(lamp.size * scale[0]), float(height * scale[1])


def _normalization(lamp, size: tuple[float, float]) -> float:
    """What turns the power of a lamp with 'Normalize' off into watts.

    Such a lamp's power is per unit of its emitting area, which Cycles takes as
    the sphere of a POINT or SPOT, the rectangle or ellipse of an AREA and the
    solid disc of a SUN. Lamps without an extent are not scaled.
    """
    if lamp.normalize:
        return 1.0
    if lamp.type == "AREA":
        return size[0] * size[1] * (pi / 4 if lamp.shape in {"DISK", "ELLIPSE"} else 1.0)
    if lamp.type == "SUN":
        return pi * sin(lamp.angle / 2) ** 2 or 1.0
    return 4 * pi * lamp.shadow_soft_size**2 or 1.0


def _emission(tree, kind: str, otherwise: Array) -> tuple[Array, bool]:
    """Colour × strength of the first node of a kind, and whether it is all constants.

    A texture counts as the colour ``otherwise``.
    """
    for node, groups in output_shaders(tree):
        if node.type == kind:
            color = color_input(node, groups, "Color")
            strength = value_input(node, groups, "Strength")
            whole = color is not None and strength is not None
            color = otherwise if color is None else color
            return color * (1.0 if strength is None else strength), whole
    return np.zeros(3), True
