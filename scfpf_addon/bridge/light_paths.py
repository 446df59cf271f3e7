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


def unshown_settings(scene) -> tuple[str, ...]:
    """Warnings of an evaluated scene's settings that change Cycles' picture and not the engine's."""
    cycles = getattr(scene, "cycles", None)
    if cycles is None:
        return ()
    found = []
    if cycles.sample_clamp_direct > 0.0:
        found.append("Clamping of Direct Light")
    if cycles.film_transparent_glass and scene.render.film_transparent:
        found.append("Transparent Glass")
    return tuple(f"Not shown as it is: {name} (in the scene's settings for Cycles)" for name in found)
