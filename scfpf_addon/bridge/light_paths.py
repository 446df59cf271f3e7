# SPDX-License-Identifier: GPL-3.0-or-later
"""How often light is sent on, as Cycles' settings of the scene have it."""

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
