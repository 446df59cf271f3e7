# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits of bounces and of light, and film exposure, from Cycles' settings of the scene."""

from __future__ import annotations

from ...projection.user_error import Message
from ...shading.scene.shading_scene import LightPaths
from ..blender import versions


def read_bounces(scene) -> LightPaths:
    """The limits of a scene's light paths; Cycles' defaults if Cycles is disabled."""
    cycles = getattr(scene, "cycles", None)
    if cycles is None:
        return LightPaths()
    return LightPaths(
        total=cycles.max_bounces,
        glossy=cycles.glossy_bounces,
        transmission=cycles.transmission_bounces,
        transparent=versions.lit_behind_transparent(cycles.transparent_max_bounces),
        clamp=cycles.sample_clamp_indirect,
    )


def read_exposure(scene) -> float:
    """Return the factor of a scene's film exposure, 1 if Cycles is disabled."""
    cycles = getattr(scene, "cycles", None)
    return 1.0 if cycles is None else cycles.film_exposure


def unshown_settings(scene) -> tuple[str, ...]:
    """Warnings about settings of an evaluated scene that change Cycles' image but not the engine's."""
    cycles = getattr(scene, "cycles", None)
    if cycles is None:
        return ()
    render = scene.render
    names = {
        Message("Clamping of Direct Light"): cycles.sample_clamp_direct > 0.0,
        Message("Transparent Glass"): cycles.film_transparent_glass and render.film_transparent,
        Message("Rolling Shutter"): render.use_motion_blur and cycles.rolling_shutter_type != "NONE",
        Message("Culling of Simplify"): render.use_simplify and _culls(scene),
        Message("Textures of Simplify"): render.use_simplify and _shrinks_textures(cycles),
        Message("Fast GI that is added"): cycles.use_fast_gi and cycles.fast_gi_method == "ADD",
    }
    return tuple(
        Message("Not shown as it is: {0} (in the scene's settings for Cycles)", name)
        for name, on in names.items()
        if on
    )


def _culls(scene) -> bool:
    """Return whether Simplify may remove objects."""
    kinds = [name for name in ("use_camera_cull", "use_distance_cull") if getattr(scene.cycles, name)]
    return any(getattr(obj.cycles, name) for name in kinds for obj in scene.objects)


def _shrinks_textures(cycles) -> bool:
    """Return whether Simplify reduces the size of textures in renders."""
    return cycles.texture_limit_render != "OFF" or getattr(cycles, "texture_resolution_render", 1.0) < 1.0


def ends_early(owner, scene) -> bool:
    """Return whether the Max Bounces of a lamp or a world keep its light from mirrors and glass."""
    limits = getattr(owner, "cycles", None)
    return limits is not None and limits.max_bounces < read_bounces(scene).total
