# SPDX-License-Identifier: GPL-3.0-or-later
"""How often light is sent on and how bright the film is, as Cycles' settings of the scene have it."""

from __future__ import annotations

from ..shading.scene import LightPaths
from . import versions


def read_bounces(scene) -> LightPaths:
    """The limits of a scene's light paths; Cycles' defaults where Cycles is switched off."""
    cycles = getattr(scene, "cycles", None)
    if cycles is None:
        return LightPaths()
    return LightPaths(
        cycles.max_bounces,
        cycles.glossy_bounces,
        cycles.transmission_bounces,
        versions.lit_behind_transparent(cycles.transparent_max_bounces),
    )


def read_exposure(scene) -> float:
    """What a scene's film multiplies light with; 1 where Cycles is switched off."""
    cycles = getattr(scene, "cycles", None)
    return 1.0 if cycles is None else cycles.film_exposure
