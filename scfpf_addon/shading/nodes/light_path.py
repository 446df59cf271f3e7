# SPDX-License-Identifier: GPL-3.0-or-later
"""The Light Path node: the kind of ray that meets a place, and how often its path has been scattered.

Rays are columns of numbers, (ROWS, n), or (ROWS, 1) if all are alike; float64. The meanings are those of
Cycles (path_state_next in kernel/integrator/path_state.h): a ray has the kind of the last scattering that was
not transparent, and mirrors, sharp ones too, and glass are glossy.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray
from .context import ShadingContext
from .graph import Evaluator, Inputs, Settings

CAMERA, SHADOW, DIFFUSE, GLOSSY, SINGULAR, REFLECTION, TRANSMISSION = range(7)
DEPTH, DIFFUSE_DEPTH, GLOSSY_DEPTH, TRANSPARENT_DEPTH, TRANSMISSION_DEPTH = range(7, 12)
ROWS = 12
# The row of each output of the node.
OUTPUTS = {
    "Is Camera Ray": CAMERA,
    "Is Shadow Ray": SHADOW,
    "Is Diffuse Ray": DIFFUSE,
    "Is Glossy Ray": GLOSSY,
    "Is Singular Ray": SINGULAR,
    "Is Reflection Ray": REFLECTION,
    "Is Transmission Ray": TRANSMISSION,
    "Ray Depth": DEPTH,
    "Diffuse Depth": DIFFUSE_DEPTH,
    "Glossy Depth": GLOSSY_DEPTH,
    "Transparent Depth": TRANSPARENT_DEPTH,
    "Transmission Depth": TRANSMISSION_DEPTH,
}


def _ray(numbers: Mapping[int, float]) -> Array:
    """One kind of ray, (ROWS, 1), by the rows that are not 0."""
    return np.array([[numbers.get(row, 0.0)] for row in range(ROWS)])


CAMERA_RAY = _ray({CAMERA: 1.0})
# A lamp or the world is one step further than the surface that it lights.
LAMP_LIGHT = _ray({DEPTH: 1.0})
WORLD_LIGHT = _ray({DIFFUSE: 1.0, REFLECTION: 1.0, DEPTH: 2.0, DIFFUSE_DEPTH: 1.0})
WORLD_SEEN = _ray({CAMERA: 1.0, DEPTH: 1.0})


def path_rays(
    on_ray: BoolArray, from_glass: BoolArray, singular: BoolArray, depth: NDArray[np.int16]
) -> Array:
    """The rays of paths, (ROWS, n); the arguments as in ``PathWave``."""
    total, glossy, transmission, transparent = depth
    nothing = np.zeros(len(on_ray))
    rows = {
        CAMERA: ~on_ray,
        GLOSSY: on_ray,
        SINGULAR: on_ray & singular,
        REFLECTION: on_ray & ~from_glass,
        TRANSMISSION: on_ray & from_glass,
        DEPTH: total,
        GLOSSY_DEPTH: glossy,
        TRANSPARENT_DEPTH: transparent,
        TRANSMISSION_DEPTH: transmission,
    }
    return np.stack([np.asarray(rows.get(row, nothing), np.float64) for row in range(ROWS)])


def light_path(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """One output of the Light Path node."""
    rays = CAMERA_RAY if context.rays is None else context.rays
    return (rays[settings["row"]][None],)


OPERATIONS: dict[str, Evaluator] = {"LIGHT_PATH": light_path}
