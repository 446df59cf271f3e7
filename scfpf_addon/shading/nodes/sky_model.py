# SPDX-License-Identifier: GPL-3.0-or-later
"""The light of a clear sky: sunlight that air and dust scatter once (Nishita et al. 1993), or several times.

Air scatters by Rayleigh's law for the refractive index of air, dust by Mie's in the approximation of
Cornette and Shanks 1992; ozone absorbs. Spectra are from 380 to 780 nm. Heights and lengths in metres.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...projection.typing import Array
from ..interpolation import bilinear
from .spectrum import XYZ_TO_RGB, observer

GROUND, TOP = 6.36e6, 6.42e6
AIR_HEIGHT, DUST_HEIGHT = 8e3, 1.2e3
WAVELENGTHS = np.arange(380.0, 781.0, 20.0)
# Molecules in a cubic metre of air, and its refractive index.
AIR_NUMBER, AIR_INDEX = 2.504e25, 1.0002926
AIR_SCATTERING = 8 * np.pi**3 * (AIR_INDEX**2 - 1) ** 2 / (3 * AIR_NUMBER * (WAVELENGTHS * 1e-9) ** 4)
# Scattering of dust at sea level, its extinction by its scattering, and the asymmetry of its phase function.
DUST_SCATTERING, DUST_LOSS, DUST_AHEAD = 2e-5, 1.11, 0.76
# The layer of ozone, 300 Dobson units, and its cross-sections by wavelength (University of Bremen).
OZONE_LOW, OZONE_PEAK, OZONE_HIGH = 10e3, 25e3, 40e3
OZONE_NUMBER = 300 * 2.687e20 / 15e3
OZONE_SECTION = 1e-27 * np.array(
    [
        0.28,
        1.53,
        5.52,
        15.8,
        36.7,
        77.5,
        148,
        214,
        309,
        427,
        440,
        502,
        374,
        266,
        185,
        121,
        74.6,
        51,
        42.3,
        24.5,
        25.3,
    ]
)
# A black body's sunlight outside of the atmosphere, W/m²/nm (Planck's law at the sun's size).
SUN_HEAT, SUN_SOLID_ANGLE = 5778.0, 6.8e-5
GROUND_ALBEDO = 0.3
# The ratio of Cycles' sky to this one with multiple scattering, with the sun at 15° to 45°.
MULTISCATTER_TINT = np.array([[0.9], [1.06], [1.15]])
# Steps along a view ray, and from each to the sun.
STEPS, LIGHT_STEPS = 32, 24
# Rows and columns of the table: elevations are denser near the horizon.
ROWS, COLUMNS = 64, 96


class Air(NamedTuple):
    """The parameters of a sky. elevation: the sun's, radians. altitude: metres. air, dust, ozone: 1 is usual.

    multiscatter: whether light is scattered more than once.
    """

    elevation: float
    altitude: float
    air: float
    dust: float
    ozone: float
    multiscatter: bool = False


def sunlight() -> Array:
    """Irradiance by wavelength outside of the atmosphere, W/m²/nm."""
    metres = WAVELENGTHS * 1e-9
    planck = 2 * 6.62607e-34 * 2.99792e8**2 / metres**5 / np.expm1(1.438777e-2 / (metres * SUN_HEAT))
    light: Array = planck * SUN_SOLID_ANGLE * 1e-9
    return light


def rgb_of(spectrum: Array) -> Array:
    """Scene-linear colours (3, ...) of spectra (..., WAVELENGTHS)."""
    step = WAVELENGTHS[1] - WAVELENGTHS[0]
    colors: Array = np.moveaxis(spectrum @ (observer(WAVELENGTHS).T * step) @ XYZ_TO_RGB.T, -1, 0)
    return colors


def _densities(height: Array, what: Air) -> Array:
    """Densities of air, dust and ozone at heights (...), (3, ...)."""
    ozone = np.interp(height, [OZONE_LOW, OZONE_PEAK, OZONE_HIGH], [0.0, 1.0, 0.0])
    height = np.maximum(height, 0.0)
    air, dust = what.air * np.exp(-height / AIR_HEIGHT), what.dust * np.exp(-height / DUST_HEIGHT)
    found: Array = np.stack([air, dust, what.ozone * ozone])
    return found


def _lost(depth: Array) -> Array:
    """Transmittance of depths (3, ...) of air, dust and ozone by wavelength, (..., W)."""
    extinction = np.stack(
        [
            AIR_SCATTERING,
            np.full_like(AIR_SCATTERING, DUST_SCATTERING * DUST_LOSS),
            OZONE_SECTION * OZONE_NUMBER,
        ]
    )
    share: Array = np.exp(-np.tensordot(np.moveaxis(depth, 0, -1), extinction, 1))
    return share


def _to_top(radius: Array, cosine: Array) -> Array:
    """Length of rays to the top of the atmosphere. radius: distance from the earth's centre."""
    length: Array = -radius * cosine + np.sqrt(np.maximum(TOP**2 - radius**2 * (1.0 - cosine**2), 0.0))
    return length


def _depth_to_sun(radius: Array, cosine: Array, what: Air) -> Array:
    """Depth of air, dust and ozone towards the sun, (3, ...). cosine: of the sun's zenith angle."""
    edges = np.linspace(0.0, 1.0, LIGHT_STEPS + 1) ** 2
    middle, width = 0.5 * (edges[1:] + edges[:-1]), np.diff(edges)
    length = _to_top(radius, cosine)[..., None]
    along = middle * length
    height = (
        np.sqrt(radius[..., None] ** 2 + along**2 + 2.0 * radius[..., None] * cosine[..., None] * along)
        - GROUND
    )
    depth: Array = (_densities(height, what) * (width * length)).sum(axis=-1)
    return depth


@lru_cache(maxsize=8)
def sky_table(what: Air) -> Array:
    """Radiance (3, ROWS, COLUMNS) of a sky.

    Rows go from the horizon up by the square root of the elevation, columns from the sun's side to the other.
    """
    elevation = (np.linspace(0.0, 1.0, ROWS) ** 2 * (np.pi / 2))[:, None]
    turn = np.linspace(0.0, np.pi, COLUMNS)
    way = np.stack(
        np.broadcast_arrays(
            np.cos(elevation) * np.cos(turn), np.cos(elevation) * np.sin(turn), np.sin(elevation) + 0.0 * turn
        )
    ).reshape(3, -1)
    sun = np.array([np.cos(what.elevation), 0.0, np.sin(what.elevation)])
    towards = sun @ way
    air_phase = 3 / (16 * np.pi) * (1 + towards**2)
    ahead = DUST_AHEAD
    dust_phase = 3 / (8 * np.pi) * (1 - ahead**2) * (1 + towards**2)
    dust_phase /= (2 + ahead**2) * (1 + ahead**2 - 2 * ahead * towards) ** 1.5
    eye = GROUND + max(what.altitude, 1.0)
    step = _to_top(np.full(way.shape[1], eye), way[2]) / STEPS
    depth = np.zeros((3, way.shape[1]))
    spectrum = np.zeros((way.shape[1], len(WAVELENGTHS)))
    light = sunlight()
    for number in range(STEPS):
        place = way * ((number + 0.5) * step)
        place[2] += eye
        radius = np.sqrt((place**2).sum(axis=0))
        density = _densities(radius - GROUND, what) * step
        depth += density
        cosine = sun @ place / radius
        # After sunset the earth blocks the sun.
        lit = (cosine > 0.0) | (radius * np.sqrt(1.0 - cosine**2) > GROUND)
        passed = _lost(depth + _depth_to_sun(radius, cosine, what)) * lit[:, None]
        scattered = np.outer(air_phase * density[0], AIR_SCATTERING)
        scattered += (dust_phase * density[1] * DUST_SCATTERING)[:, None]
        spectrum += passed * scattered * light
        if what.multiscatter:
            every = _scattering(density) * multiscattered(what, radius, cosine)
            spectrum += _lost(depth) * every * light
    color = np.maximum(rgb_of(spectrum), 0.0)
    return (color * MULTISCATTER_TINT if what.multiscatter else color).reshape(3, ROWS, COLUMNS)


def _scattering(density: Array) -> Array:
    """Scattering of air and dust of densities (3, ...) by wavelength, (..., W)."""
    found: Array = density[0][..., None] * AIR_SCATTERING + density[1][..., None] * DUST_SCATTERING
    return found


def multiscattered(what: Air, radius: Array, cosine: Array) -> Array:
    """Isotropic radiance of light scattered before, by the sun's irradiance, (n, W)."""
    table = _multiscatter_table(what._replace(elevation=0.0, altitude=0.0))
    row = np.sqrt(np.clip((radius - GROUND) / (TOP - GROUND), 0.0, 1.0)) * (table.shape[1] - 1)
    column = np.clip(0.5 + 0.5 * cosine, 0.0, 1.0) * (table.shape[2] - 1)
    return bilinear(table, row, column).T


@lru_cache(maxsize=4)
def _multiscatter_table(what: Air) -> Array:
    """A table of ``multiscattered`` by the root of the height and the sun's cosine, (W, H, C).

    After Hillaire 2020. All scattering after the first is isotropic, and each order a constant share of the
    one before.
    """
    heights, cosines, ways = 12, 25, 48
    eye = GROUND + np.maximum(np.linspace(0.0, 1.0, heights) ** 2 * (TOP - GROUND), 1.0)
    sun = np.linspace(-1.0, 1.0, cosines)
    up = 1.0 - 2.0 * (np.arange(ways) + 0.5) / ways
    turn = np.arange(ways) * (np.pi * (3.0 - np.sqrt(5.0)))
    eye, sun = eye[:, None, None], sun[:, None]
    flat = np.sqrt(1.0 - up**2) * np.cos(turn)
    towards = up * sun + flat * np.sqrt(1.0 - sun**2)
    down = eye**2 * (up**2 - 1.0) + GROUND**2
    to_ground = -eye * up - np.sqrt(np.maximum(down, 0.0))
    ends = np.where((up < 0.0) & (down > 0.0), to_ground, _to_top(eye, up)) + 0.0 * sun
    edges = np.linspace(0.0, 1.0, 17) ** 2
    depth = np.zeros((3, *ends.shape))
    once = on = np.zeros((heights, cosines, len(WAVELENGTHS)))
    for first, last in pairwise(edges):
        along, step = 0.5 * (first + last) * ends, (last - first) * ends
        radius = np.sqrt(eye**2 + along**2 + 2.0 * eye * up * along)
        density = _densities(radius - GROUND, what) * step
        depth += 0.5 * density
        cosine = np.clip((eye * sun + along * towards) / radius, -1.0, 1.0)
        lit = (cosine > 0.0) | (radius * np.sqrt(1.0 - cosine**2) > GROUND)
        reached = _scattering(density) * _lost(depth)
        on = on + reached.mean(axis=2)
        sunlit = _lost(_depth_to_sun(radius, cosine, what)) * lit[..., None]
        once = once + (reached * sunlit).mean(axis=2) / (4.0 * np.pi)
        depth += 0.5 * density
    met = (up < 0.0) & (down > 0.0)
    bright = GROUND_ALBEDO / np.pi * np.maximum((eye * sun + ends * towards) / GROUND, 0.0) * met
    sunlit = _lost(_depth_to_sun(np.full_like(towards, GROUND), np.maximum(sun + 0.0 * towards, 0.0), what))
    once = once + (_lost(depth) * sunlit * bright[..., None]).mean(axis=2)
    table: Array = np.ascontiguousarray(np.moveaxis(once / (1.0 - on), 2, 0))
    return table


def sun_color(what: Air, elevation: float) -> Array:
    """Irradiance (3,) of the sun at an elevation, facing it.

    Without ozone, whose layer the few steps of Cycles towards the sun miss.
    """
    eye = np.array([GROUND + max(what.altitude, 1.0)])
    passed = _lost(_depth_to_sun(eye, np.array([np.sin(elevation)]), what._replace(ozone=0.0)))[0]
    return np.maximum(rgb_of(passed * sunlight()), 0.0)
