# SPDX-License-Identifier: GPL-3.0-or-later
"""Daylight by an analytic model: Preetham, Shirley, Smits, A Practical Analytic Model for Daylight (1999).

Luminance and chromaticities follow Perez' formula, with coefficients linear in the turbidity T, relative to
their values at the zenith.
"""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array
from ..vectors import unit
from .context import ShadingContext
from .graph import Evaluator, Inputs, Settings
from .spectrum import XYZ_TO_RGB

# The five coefficients of Y, x and y, each as (a, b) of a T + b (the paper's appendix A.2).
PEREZ = np.array(
    [
        [(0.1787, -1.4630), (-0.3554, 0.4275), (-0.0227, 5.3251), (0.1206, -2.5771), (-0.0670, 0.3703)],
        [(-0.0193, -0.2592), (-0.0665, 0.0008), (-0.0004, 0.2125), (-0.0641, -0.8989), (-0.0033, 0.0452)],
        [(-0.0167, -0.2608), (-0.0950, 0.0092), (-0.0079, 0.2102), (-0.0441, -1.6537), (-0.0109, 0.0529)],
    ]
)
# x and y at the zenith: rows for T², T and 1, columns for the powers 3 to 0 of the sun's zenith angle.
ZENITH = np.array(
    [
        [
            (0.00166, -0.00375, 0.00209, 0.0),
            (-0.02903, 0.06377, -0.03202, 0.00394),
            (0.11693, -0.21196, 0.06052, 0.25886),
        ],
        [
            (0.00275, -0.00610, 0.00317, 0.0),
            (-0.04214, 0.08970, -0.04153, 0.00516),
            (0.15346, -0.26756, 0.06670, 0.26688),
        ],
    ]
)
# Cycles' radiance of one kilocandela per square metre.
SCALE = 0.06
# Below this elevation, in radians, the sky is constant.
LOWEST = 1e-3


def daylight(inputs: Inputs, settings: Settings, _context: ShadingContext) -> tuple[Array, ...]:
    """Vector → colour. settings: sun (3,) towards it, unit; turbidity; scale."""
    way, sun = unit(inputs[0]), np.asarray(settings["sun"], np.float64)
    turbidity = settings["turbidity"]
    zenith = np.arccos(np.clip(sun[2], -1.0, 1.0))
    apart = np.arccos(np.clip(sun @ way, -1.0, 1.0))
    height = np.maximum(way[2], np.sin(LOWEST))
    coefficients = PEREZ @ (turbidity, 1.0)
    at_zenith = (luminance_at_zenith(turbidity, zenith), *chromaticities_at_zenith(turbidity, zenith))
    bright, x, y = (
        value * perez(each, height, apart) / perez(each, np.ones(1), np.full(1, zenith))
        for value, each in zip(at_zenith, coefficients, strict=True)
    )
    share = np.divide(bright * SCALE, y, out=np.zeros_like(bright), where=y != 0.0)
    color = XYZ_TO_RGB @ np.stack([x * share, y * share, (1.0 - x - y) * share])
    return (np.maximum(color, 0.0) * settings["scale"],)


def perez(coefficients: Array, cosine: Array, apart: Array) -> Array:
    """Perez' formula by the cosine to the zenith and the angle to the sun, (n,) each."""
    a, b, c, d, e = coefficients
    value: Array = (1.0 + a * np.exp(b / cosine)) * (1.0 + c * np.exp(d * apart) + e * np.cos(apart) ** 2)
    return value


def luminance_at_zenith(turbidity: float, zenith: float) -> float:
    """Luminance at the zenith in kcd/m². zenith: the sun's angle to it."""
    chi = (4.0 / 9.0 - turbidity / 120.0) * (np.pi - 2.0 * zenith)
    return float((4.0453 * turbidity - 4.9710) * np.tan(chi) - 0.2155 * turbidity + 2.4192)


def chromaticities_at_zenith(turbidity: float, zenith: float) -> Array:
    """CIE x and y at the zenith, (2,)."""
    found: Array = ZENITH @ (zenith**3, zenith**2, zenith, 1.0) @ (turbidity**2, turbidity, 1.0)
    return found


OPERATIONS: dict[str, Evaluator] = {"DAYLIGHT": daylight}
