# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials that the rig disturbs: their Raycast nodes meet its sheets, or they depend on camera or ray.

Rays of Cycles' Raycast node meet everything that any kind of ray sees (svm_raycast in kernel/svm/raycast.h),
and camera rays have to see the sheets. With Only Local they meet the material's own object alone.
"""

from __future__ import annotations

from collections.abc import Callable

import bpy

from ..bridge.blender.rig_mark import is_rig_part

# Outputs that depend on the camera's position, or on the ray's length or history.
OUTPUTS = {
    "ShaderNodeCameraData": ("View Vector", "View Z Depth", "View Distance"),
    "ShaderNodeTexCoord": ("Camera", "Window"),
    "ShaderNodeLightPath": ("Ray Length", "Transparent Depth", "Portal Depth"),
}


def raycasting(rig) -> str:
    """The name of a material whose Raycast node meets a rig's sheets; empty if the scene has none."""
    return _first(rig, lambda node: node.bl_idname == "ShaderNodeRaycast" and not node.only_local)


def asking_camera(rig) -> str:
    """The name of a material that depends on the camera or on the ray; empty if the rig's scene has none."""
    return _first(rig, _asks_camera)


def measuring_wires(rig) -> str:
    """The name of a material whose Wireframe node measures in pixels; empty if the rig's scene has none."""
    return _first(rig, lambda node: node.bl_idname == "ShaderNodeWireframe" and node.use_pixel_size)


def _asks_camera(node) -> bool:
    if node.bl_idname == "ShaderNodeVectorTransform":
        return "CAMERA" in (node.convert_from, node.convert_to)
    names = OUTPUTS.get(node.bl_idname, ())
    return any(output.is_linked for output in node.outputs if output.name in names)


def _first(rig, is_meant: Callable[[bpy.types.Node], bool]) -> str:
    settings, known = rig.scfpf_rig, {}
    found = {
        material
        for material in set(bpy.data.materials) - set(settings.portals.data.materials)
        if material.node_tree is not None and _has(material.node_tree, is_meant, known)
    }
    if not found:
        return ""
    users = (obj for obj in settings.scene.objects if not is_rig_part(obj))
    used = {slot.material for obj in users for slot in obj.material_slots} & found
    return min((material.name for material in used), default="")


def _has(tree, is_meant: Callable[[bpy.types.Node], bool], known: dict[int, bool]) -> bool:
    """Return whether a tree, or a group in it, has a node that is meant. known: results by its session id."""
    key = tree.session_uid
    if key not in known:
        groups = [
            node.node_tree for node in tree.nodes if node.bl_idname == "ShaderNodeGroup" and node.node_tree
        ]
        known[key] = any(map(is_meant, tree.nodes)) or any(_has(group, is_meant, known) for group in groups)
    return known[key]
