# SPDX-License-Identifier: GPL-3.0-or-later
"""Textures: images, and the simple procedural ones."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ...projection.typing import Array
from ..vectors import unit
from .context import ShadingContext
from .graph import Evaluator, Inputs, Settings
from .image import sample

# Checker cells end just below whole numbers, so that a face in one of their planes has one colour.
CHECKER_SHIFT = 1e-6


def _flat(vector: Array) -> tuple[Array, Array]:
    return vector[0], vector[1]


def _sphere(vector: Array) -> tuple[Array, Array]:
    """Longitude and latitude about z around (½, ½, ½)."""
    x, y, z = vector * 2.0 - 1.0
    length = np.sqrt(x * x + y * y + z * z)
    around = np.where((x == 0.0) & (y == 0.0), 0.0, (1.0 - np.arctan2(x, y) / np.pi) / 2.0)
    safe = np.where(length > 0.0, length, 1.0)
    up = np.where(length > 0.0, 1.0 - np.arccos(np.clip(z / safe, -1.0, 1.0)) / np.pi, 0.0)
    return around, up


def _tube(vector: Array) -> tuple[Array, Array]:
    """Longitude about z, and height."""
    x, y, z = vector * 2.0 - 1.0
    around = np.where((x == 0.0) & (y == 0.0), 0.0, (1.0 - np.arctan2(x, y) / np.pi) / 2.0)
    return around, (z + 1.0) / 2.0


PROJECTIONS: dict[str, Callable[[Array], tuple[Array, Array]]] = {
    "FLAT": _flat,
    "SPHERE": _sphere,
    "TUBE": _tube,
}


def image(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Image Texture node: colour and alpha.

    Colours are premultiplied by alpha unless ``straight``, as in Cycles where alpha is used.
    """
    u, v = PROJECTIONS[settings["projection"]](inputs[0])
    data = context.images.get(settings["image"])
    values = sample(data, u, v, settings["interpolation"], settings["extension"], settings["straight"])
    return values[:3], values[3:]


def _equirectangular(vector: Array) -> tuple[Array, Array]:
    """Longitude and latitude about z; +X is in the middle."""
    x, y, z = vector
    return 0.5 - np.arctan2(y, x) / (2.0 * np.pi), 0.5 + np.arctan2(z, np.hypot(x, y)) / np.pi


def _mirror_ball(vector: Array) -> tuple[Array, Array]:
    """The place on a mirror ball, seen from far along +Y, that reflects the direction."""
    x, y, z = vector
    deep = 2.0 * np.sqrt(np.maximum(0.5 * (1.0 - y), 0.0))
    deep = np.where(deep > 0.0, deep, 1.0)
    return 0.5 * (x / deep + 1.0), 0.5 * (z / deep + 1.0)


PANORAMAS: dict[str, Callable[[Array], tuple[Array, Array]]] = {
    "EQUIRECTANGULAR": _equirectangular,
    "MIRROR_BALL": _mirror_ball,
}


def environment(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Environment Texture node: an image of all directions."""
    u, v = PANORAMAS[settings["projection"]](unit(inputs[0]))
    data = context.images.get(settings["image"])
    return (sample(data, u, v, settings["interpolation"], "REPEAT", False)[:3],)


def checker(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Checker Texture: vector, two colours, scale → colour, factor."""
    vector, one, other, scale = inputs
    shifted = (vector * scale + CHECKER_SHIFT) * (1.0 - CHECKER_SHIFT)
    cells = np.floor(np.nan_to_num(shifted)).sum(axis=0, keepdims=True)
    factor = (cells % 2.0 == 1.0).astype(np.float64)
    return np.where(factor > 0.0, one, other), factor


GRADIENTS: dict[str, Callable[[Array, Array, Array], Array]] = {
    "LINEAR": lambda x, y, z: x,
    "QUADRATIC": lambda x, y, z: np.maximum(x, 0.0) ** 2,
    "EASING": lambda x, y, z: np.clip(x, 0.0, 1.0) ** 2 * (3.0 - 2.0 * np.clip(x, 0.0, 1.0)),
    "DIAGONAL": lambda x, y, z: (x + y) / 2.0,
    "RADIAL": lambda x, y, z: np.arctan2(y, x) / (2.0 * np.pi) + 0.5,
    "QUADRATIC_SPHERE": lambda x, y, z: np.maximum(0.999999 - np.sqrt(x * x + y * y + z * z), 0.0) ** 2,
    "SPHERICAL": lambda x, y, z: np.maximum(0.999999 - np.sqrt(x * x + y * y + z * z), 0.0),
}


def gradient(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Gradient Texture: colour, factor."""
    factor = np.clip(GRADIENTS[settings["kind"]](*inputs[0]), 0.0, 1.0)[None]
    return np.repeat(factor, 3, axis=0), factor


OPERATIONS: dict[str, Evaluator] = {
    "CHECKER": checker,
    "ENVIRONMENT": environment,
    "GRADIENT": gradient,
    "IMAGE": image,
}
