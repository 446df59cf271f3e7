# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps as ``Light``, and notes on settings that are not shown."""

from __future__ import annotations

from collections.abc import Iterator
from math import pi, sin

import numpy as np

from ...projection.typing import Array
from ...shading.nodes.light_path import LAMP_LIGHT
from ...shading.scene.shading_scene import Light
from ..blender import versions
from ..blender.shader_nodes import color_input, output_shaders, value_input
from .light_paths import ends_early
from .read_graph import read_graph
from .read_world import uniform_radiance

# The note about a lamp with an image, a pattern or a falloff of its own.
UNEVEN = "nodes that vary a light by direction or distance: it is even instead"


def read_light(lamp, matrix: Array, tint: Array | None = None) -> Light | None:
    """Read one evaluated lamp (a bpy.types.Light) placed by ``matrix`` (4, 4) float64.

    tint: of ``read_tint``, read if not given. None for a lamp that gives no light, such as a portal, or whose
    matrix is zero or not finite. The light's matrix is a rotation and a position, for a SPOT with the
    object's scale, which bends its cone; the scale of an AREA goes into its extents. As in Cycles a POINT has
    only a position and a SUN only a direction.
    """
    if not np.isfinite(matrix).all() or _is_portal(lamp):
        return None
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    size = _extents(lamp, scale)
    color = _color(lamp, read_tint(lamp)[0] if tint is None else tint) * _normalization(lamp, size)
    needed = {"POINT": slice(0), "SUN": slice(2, 3)}.get(lamp.type, slice(3))
    if not scale[needed].all() or not color.any() or not np.isfinite(color).all():
        return None
    placed = np.array(matrix, np.float64)
    if not scale.all():
        placed[:3, :3] = _turned_to(matrix[:3, 2])
    elif lamp.type != "SPOT":
        placed[:3, :3] /= scale
    round_ = lamp.type in {"POINT", "SPOT"}
    return Light(
        kind=lamp.type,
        color=color,
        matrix=placed,
        casts_shadow=lamp.use_shadow,
        radius=lamp.shadow_soft_size if round_ else 0.0,
        sphere=round_ and not lamp.use_soft_falloff,
        angle=lamp.angle if lamp.type == "SUN" else 0.0,
        size=size,
        ellipse=lamp.type == "AREA" and lamp.shape in {"DISK", "ELLIPSE"},
        spread=lamp.spread if lamp.type == "AREA" else pi,
        spot_angle=lamp.spot_size if lamp.type == "SPOT" else 0.0,
        spot_blend=lamp.spot_blend if lamp.type == "SPOT" else 0.0,
    )


def _is_portal(lamp) -> bool:
    """Return whether an area lamp is a light portal of Cycles."""
    cycles = getattr(lamp, "cycles", None)
    return lamp.type == "AREA" and cycles is not None and cycles.is_portal


def _turned_to(axis: Array) -> Array:
    """A rotation (3, 3) whose Z is along an axis (3,); the identity if that has no length."""
    z = axis / (np.linalg.norm(axis) or 1.0)
    if not z.any():
        return np.eye(3)
    x = np.cross(z, np.eye(3)[np.abs(z).argmin()])
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(z, x), z], axis=1)


def read_tint(lamp) -> tuple[Array, tuple[str, ...]]:
    """Return the factor (3,) of an evaluated lamp's nodes, and notes on nodes that the engine leaves out.

    If the factor varies by direction or position, the first Emission's constants are taken.
    """
    if not versions.uses_nodes(lamp):
        return np.ones(3), ()
    reading = read_graph(lamp.node_tree)
    if reading.graph is None:
        return np.zeros(3), reading.notes
    radiance = None if reading.graph.images else uniform_radiance(reading.graph, LAMP_LIGHT)
    return (_emission(lamp.node_tree), (UNEVEN,)) if radiance is None else (radiance, reading.notes)


def unshown_parts(lamp, scene) -> Iterator[str]:
    """Notes on settings of an evaluated lamp that change Cycles' image but not the engine's."""
    cycles = getattr(lamp, "cycles", None)
    if cycles is not None and cycles.is_caustics_light:
        yield "Shadow Caustics"
    if ends_early(lamp, scene):
        yield "Max Bounces"


def _color(lamp, tint: Array) -> Array:
    """Colour times power: watts, for SUN W/m²."""
    color = np.array(lamp.color, np.float64) * lamp.energy * 2.0**lamp.exposure
    if lamp.use_temperature:
        color *= np.array(lamp.temperature_color)
    return color * tint


def _extents(lamp, scale: Array) -> tuple[float, float]:
    """Size of an AREA along its X and Y in world units; (0, 0) for other lamps."""
    if lamp.type != "AREA":
        return 0.0, 0.0
    height = lamp.size_y if lamp.shape in {"RECTANGLE", "ELLIPSE"} else lamp.size
    return float(lamp.size * scale[0]), float(height * scale[1])


def _normalization(lamp, size: tuple[float, float]) -> float:
    """The factor from the power of a lamp with 'Normalize' off to watts.

    Such a lamp's power is per unit of its emitting area. In Cycles that is the sphere of a POINT or SPOT, the
    rectangle or ellipse of an AREA and the solid disc of a SUN. Lamps without an extent are not scaled.
    """
    if lamp.normalize:
        return 1.0
    if lamp.type == "AREA":
        return size[0] * size[1] * (pi / 4 if lamp.shape in {"DISK", "ELLIPSE"} else 1.0)
    if lamp.type == "SUN":
        return pi * sin(lamp.angle / 2) ** 2 or 1.0
    return 4 * pi * lamp.shadow_soft_size**2 or 1.0


def _emission(tree) -> Array:
    """Colour × strength of the first Emission node; an input that varies counts as 1."""
    for node, groups in output_shaders(tree):
        if node.type == "EMISSION":
            color = color_input(node, groups, "Color")
            strength = value_input(node, groups, "Strength")
            return (np.ones(3) if color is None else color) * (1.0 if strength is None else strength)
    return np.zeros(3)
