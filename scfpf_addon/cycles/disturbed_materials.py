# SPDX-License-Identifier: GPL-3.0-or-later
"""Nodes that the rig disturbs: Raycast meets its sheets, others depend on camera or ray.

They may be those of a material, a lamp or the world.

Rays of Cycles' Raycast node meet everything that any kind of ray sees (svm_raycast in kernel/svm/raycast.h),
and camera rays have to see the sheets. With Only Local they meet the material's own object alone.
"""

from __future__ import annotations

from collections.abc import Callable

import bpy

from ..bridge.blender.shader_nodes import has_node
from .seen_data import seen_data

# Outputs that depend on the camera's position, or on the ray's history.
OUTPUTS = {
    "ShaderNodeCameraData": ("View Vector", "View Z Depth", "View Distance"),
    "ShaderNodeTexCoord": ("Camera", "Window"),
    "ShaderNodeLightPath": ("Transparent Depth", "Portal Depth"),
}
# Straight volumes have one chord: their rays are as long as an ordinary camera's. Lamps and worlds know none.
LENGTH = {"ShaderNodeLightPath": ("Ray Length",)}


def raycasting(rig) -> str:
    """The name of what has a Raycast node that meets a rig's sheets; empty if the scene has none."""
    return _first(rig, lambda node: node.bl_idname == "ShaderNodeRaycast" and not node.only_local)


def asking_camera(rig) -> str:
    """The name of what depends on the camera or on the ray; empty if the rig's scene has none."""
    if rig.scfpf_rig.chords == 1:
        return _first(rig, _asks_camera)
    return _first(rig, lambda node: _asks_camera(node) or _has_output(node, LENGTH), _asks_camera)


def measuring_wires(rig) -> str:
    """The name of a material whose Wireframe node measures in pixels; empty if the rig's scene has none."""
    return _first(rig, lambda node: node.bl_idname == "ShaderNodeWireframe" and node.use_pixel_size)


def reading_images(rig) -> str:
    """The name of what shows an image; empty if the rig's scene has none."""
    kinds = "ShaderNodeTexImage", "ShaderNodeTexEnvironment"
    return _first(rig, lambda node: node.bl_idname in kinds and node.image is not None)


def _asks_camera(node) -> bool:
    if node.bl_idname == "ShaderNodeVectorTransform":
        return "CAMERA" in (node.convert_from, node.convert_to) and node.outputs[0].is_linked
    return _has_output(node, OUTPUTS)


def _has_output(node, outputs: dict[str, tuple[str, ...]]) -> bool:
    names = outputs.get(node.bl_idname, ())
    return any(output.is_linked for output in node.outputs if output.name in names)


def _first(
    rig,
    is_meant: Callable[[bpy.types.Node], bool],
    in_light: Callable[[bpy.types.Node], bool] | None = None,
) -> str:
    """The name of a material, lamp or world of a rig's scene with a node that is meant, or an empty string.

    in_light: of lamps and worlds; None for the same.
    """
    settings, found = rig.scfpf_rig, set()
    own = set(settings.portals.data.materials)
    for owners, wanted in (
        ((bpy.data.materials,), is_meant),
        ((bpy.data.lights, bpy.data.worlds), in_light or is_meant),
    ):
        known: dict[int, bool] = {}
        found |= {
            each
            for each in (each for kind in owners for each in kind)
            if each.node_tree is not None and has_node(each.node_tree, wanted, known)
        }
    found -= own
    return min((each.name for each in seen_data(settings.scene) & found), default="") if found else ""
