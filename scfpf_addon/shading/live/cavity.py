# SPDX-License-Identifier: GPL-3.0-or-later
"""Cavity: ridges brighter and valleys darker, from the normals of neighbouring pixels.

The formula is Workbench's curvature (Blender's source, ``workbench_curvature.bsl.hh``).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..typing import Single
from .live_hits import LiveHits

# Workbench's scales of the two factors, and the least square of a factor.
RIDGE_SCALE, VALLEY_SCALE = 0.5, 0.7
LEAST_SQUARE = 1e-4


@dataclass(frozen=True)
class Cavity:
    """The factors of ridges and valleys, as in Blender's Shading popover."""

    ridge: float
    valley: float


def cavity_factor(cavity: Cavity, normal: Single, hits: LiveHits) -> Single:
    """Factors (n,) of the colours of an image. normal: (3, n) in view space."""
    shape = hits.height, hits.width
    factor = np.ones(shape, np.float32)
    if min(shape) < 3:
        return factor.ravel()
    right, up = normal[0].reshape(shape), normal[1].reshape(shape)
    objects = hits.object.reshape(shape)
    # Rows of the image grow upwards.
    bend = (up[2:, 1:-1] - up[:-2, 1:-1]) + (right[1:-1, 2:] - right[1:-1, :-2])
    ridge, valley = (
        np.float32(scale / max(value * value, LEAST_SQUARE))
        for scale, value in ((RIDGE_SCALE, cavity.ridge), (VALLEY_SCALE, cavity.valley))
    )
    strength = np.where(bend < 0, valley, ridge)
    size = np.abs(bend)
    soft = np.where(size < 0.5 / strength, size * (1 - size * strength), 0.25 / strength)
    # Borders of objects are no cavities.
    inside = (objects[2:, 1:-1] == objects[:-2, 1:-1]) & (objects[1:-1, 2:] == objects[1:-1, :-2])
    inside &= (objects[2:, 1:-1] >= 0) | (objects[1:-1, 2:] >= 0)
    factor[1:-1, 1:-1] += np.where(inside, np.copysign(2 * soft, bend), 0)
    return np.clip(factor, 0, 4).ravel()
