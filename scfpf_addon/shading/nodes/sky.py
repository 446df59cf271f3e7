# SPDX-License-Identifier: GPL-3.0-or-later
"""The Sky Texture node: radiance of the sky and of the sun by direction."""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array
from ..interpolation import bilinear
from ..vectors import unit
from .context import ShadingContext
from .graph import Evaluator, Inputs, Settings
from .sky_model import COLUMNS, ROWS, Air, sky_table, sun_color

# Limb darkening: how much darker the sun is at its rim, and its mean radiance relative to the middle.
LIMB, LIMB_MEAN = 0.6, 0.8
# Fading of the light below the horizon with the depth; or by the air in between, per metre of altitude.
FADE, NEAR_AIR = 2.5, 2e-5


def sky(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """Vector → colour. settings: air (``Air``), rotation of the sun about Z from +Y to +X, size (the
    sun's angle, 0 for none), scale of the sky and intensity of its disc.
    """
    way = unit(inputs[0])
    what, rotation = settings["air"], settings["rotation"]
    turn = np.arctan2(way[0], way[1]) - rotation
    turn = np.abs((turn + np.pi) % (2.0 * np.pi) - np.pi)
    row = np.sqrt(np.arcsin(np.clip(way[2], 0.0, 1.0)) / (np.pi / 2)) * (ROWS - 1)
    light = bilinear(sky_table(what), row, turn / np.pi * (COLUMNS - 1))
    light *= _below(way[2], what) * settings["scale"]
    if settings["size"] > 0.0:
        _add_sun(light, way, settings, context.blur)
    return (light,)


def _below(up: Array, what: Air) -> Array:
    """The share of the horizon's light below it, 1 above."""
    deep = np.maximum(-up, 0.0)
    faded: Array
    if what.multiscatter:
        # The light of the air between the eye and a black ground.
        faded = np.minimum(1.0, NEAR_AIR * what.altitude / np.maximum(deep, 1e-9))
        return np.where(deep > 0.0, faded, 1.0)
    faded = np.maximum(1.0 - FADE * deep, 0.0) ** 3
    return faded


def _add_sun(light: Array, way: Array, settings: Settings, blur: float) -> None:
    """Add the sun's disc to the light (3, n), in place. blur: its least width, with a soft rim."""
    what: Air = settings["air"]
    half = settings["size"] / 2.0
    height, rotation = what.elevation, settings["rotation"]
    sun = np.array([np.cos(height) * np.sin(rotation), np.cos(height) * np.cos(rotation), np.sin(height)])
    apart = np.linalg.norm(way - sun[:, None], axis=0)
    radius = max(half, blur)
    near = np.flatnonzero(apart < radius + 0.5 * blur)
    if not len(near) or height + half <= 0.0:
        return
    brightness = settings["intensity"] / (2.0 * np.pi * (1.0 - np.cos(half)))
    if blur > 0.0:
        share = np.clip((radius - apart[near]) / blur + 0.5, 0.0, 1.0)
        color = sun_color(what, max(height, 0.0)) * (
            LIMB_MEAN * brightness * half**2 / (radius**2 + blur**2 / 12)
        )
        light[:, near] += color[:, None] * share
        return
    seen = np.arcsin(np.clip(way[2, near], -1.0, 1.0))
    ends = np.stack([sun_color(what, max(height + end, 0.0)) for end in (-half, half)], axis=1)
    up = np.clip((seen - height) / half * 0.5 + 0.5, 0.0, 1.0)
    rim = np.sqrt(np.maximum(1.0 - (apart[near] / half) ** 2, 0.0))
    color = ends[:, :1] + (ends[:, 1:] - ends[:, :1]) * up
    light[:, near] = np.where(seen > 0.0, color * brightness * (1.0 - LIMB * (1.0 - rim)), light[:, near])


OPERATIONS: dict[str, Evaluator] = {"SKY": sky}
