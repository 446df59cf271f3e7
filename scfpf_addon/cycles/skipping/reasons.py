# SPDX-License-Identifier: GPL-3.0-or-later
"""Reasons why the rays of a rig must travel all chords, whatever the scene shows."""

from __future__ import annotations

import bpy

from ...bridge.blender.rig_mark import has_other_animation
from ..hidden_surfaces import hidden_from_rigs
from ..seen_data import links
from ..watched_volume import may_move
from .stillness import Motion, motion_of


def obstacle(rig, motion: Motion | None = None) -> str:
    """The reason as a sentence without its full stop, or an empty text.

    motion: of the rig's scene, None to find it.
    """
    if reason := setting_obstacle(rig):
        return reason
    if simulated := (motion or rig_motion(rig)).simulated:
        return f"'{simulated}' is simulated"
    return material_obstacle(rig)


def material_obstacle(rig) -> str:
    """The ``obstacle`` that is a material, or an empty text."""
    displaced = _displacing(rig.scfpf_rig.scene)
    return f"The displacement of '{displaced}' has no known bounds" if displaced else ""


def setting_obstacle(rig) -> str:
    """The ``obstacle`` that is a setting of the scene or its world, or an empty text."""
    scene, render = rig.scfpf_rig.scene, rig.scfpf_rig.scene.render
    if any(other != scene and rig in other.collection.children_recursive for other in bpy.data.scenes):
        return "Another scene renders through this rig, too"
    if has_volume(scene.world):
        return "The world is filled with a volume"
    if render.frame_map_old != render.frame_map_new:
        return "The scene's time is stretched"
    return ""


def rig_motion(rig) -> Motion:
    """The motion of what the rays of a rig may meet."""
    return motion_of(rig.scfpf_rig.scene, hidden_from_rigs())


def moves(rig) -> bool:
    """Return whether a rig's volume may change with the frame."""
    return rig.scfpf_rig.animated or may_move(rig.scfpf_rig.camera)


def movers_of(rig, motion: Motion | None = None) -> frozenset[int]:
    """Session ids of the objects of a rig's scene that may change with the frame.

    motion: see ``obstacle``.
    """
    if has_other_animation(rig.scfpf_rig.scene):
        # It may hide collections.
        return frozenset(obj.session_uid for obj in bpy.data.objects)
    return (motion or rig_motion(rig)).movers


def has_volume(world) -> bool:
    """Return whether a world is filled with a volume."""
    return links(world, "OUTPUT_WORLD", "Volume")


def _displacing(scene) -> str:
    """The name of a material that displaces surfaces; empty if the file has none."""
    overrides = [layer.material_override for layer in scene.view_layers]
    for material in (*overrides, *bpy.data.materials):
        if displaces(material):
            return material.name
    return ""


def displaces(material) -> bool:
    """Return whether a material, None for none, moves the faces that have it."""
    moves_faces = material is not None and material.displacement_method != "BUMP"
    return moves_faces and links(material, "OUTPUT_MATERIAL", "Displacement")
