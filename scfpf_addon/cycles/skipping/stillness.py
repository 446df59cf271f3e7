# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether anything in a scene may change from frame to frame, by what Blender's data say.

In case of doubt it may.
"""

from __future__ import annotations

import bpy

from ...bridge.blender import versions
from ...bridge.blender.modifier_inputs import input_identifiers
from ...bridge.blender.rig_mark import has_other_animation, is_rig_part

# Modifiers whose result depends on nothing but their settings and other objects.
STILL = {
    "ARMATURE", "ARRAY", "BEVEL", "BOOLEAN", "CAST", "CURVE", "DATA_TRANSFER", "DECIMATE", "DISPLACE",
    "EDGE_SPLIT", "HOOK", "LATTICE", "MASK", "MESH_DEFORM", "MIRROR", "MULTIRES", "NODES", "NORMAL_EDIT",
    "REMESH", "SCREW", "SHRINKWRAP", "SIMPLE_DEFORM", "SKIN", "SMOOTH", "SOLIDIFY", "SUBSURF",
    "SURFACE_DEFORM", "TRIANGULATE", "UV_PROJECT", "UV_WARP", "WARP", "WEIGHTED_NORMAL", "WELD", "WIREFRAME",
}  # fmt: skip
# Nodes whose result depends on the time, or may.
TIMED = {
    "GeometryNodeInputSceneTime",
    "GeometryNodeSimulationInput",
    "GeometryNodeImageTexture",
    "GeometryNodeInputActiveCamera",
}


def moving(scene, left_out: set) -> str:
    """The name of an object of a scene that may change with the frame; empty if none may.

    left_out: objects that no ray meets.
    """
    look = _Look()
    for obj in scene.objects:
        if obj not in left_out and obj.type != "CAMERA" and not is_rig_part(obj) and look.may_move(obj):
            return obj.name
    return ""


class _Look:
    """One look at the objects of a scene, each visited once."""

    def __init__(self) -> None:
        self._seen: set[int] = set()

    def may_move(self, obj) -> bool:
        """Whether an object or one that it depends on may change."""
        if obj is None or obj.session_uid in self._seen:
            return False
        self._seen.add(obj.session_uid)
        data = obj.data
        owners = obj, data, getattr(data, "shape_keys", None)
        if any(owner is not None and has_other_animation(owner) for owner in owners):
            return True
        if len(obj.constraints) or obj.rigid_body is not None or len(getattr(obj, "particle_systems", ())):
            return True
        if getattr(data, "is_sequence", False) or obj.type == "GREASEPENCIL":
            return True
        if any(self._changes(modifier) for modifier in obj.modifiers):
            return True
        others = [obj.parent, *_pointed(data)]
        if obj.instance_type == "COLLECTION" and obj.instance_collection is not None:
            others += obj.instance_collection.all_objects
        return any(self.may_move(other) for other in others)

    def _changes(self, modifier) -> bool:
        if modifier.type not in STILL:
            return True
        others = _pointed(modifier)
        if modifier.type == "NODES" and modifier.node_group is not None:
            others += _inputs(modifier)
            if self._tree_changes(modifier.node_group, others):
                return True
        if (
            modifier.type == "DISPLACE"
            and modifier.texture is not None
            and has_other_animation(modifier.texture)
        ):
            return True
        return any(self.may_move(other) for other in others)

    def _tree_changes(self, tree, others: list) -> bool:
        """Whether a tree depends on the time; append the objects that it refers to."""
        if tree.session_uid in self._seen:
            return False
        self._seen.add(tree.session_uid)
        if has_other_animation(tree):
            return True
        for node in tree.nodes:
            if node.bl_idname in TIMED:
                return True
            for socket in node.inputs:
                _append(others, getattr(socket, "default_value", None))
            group = getattr(node, "node_tree", None)
            if group is not None and self._tree_changes(group, others):
                return True
        return False


def _pointed(owner) -> list:
    """The objects that properties of a datablock or a modifier point to."""
    found: list = []
    if owner is not None:
        for item in owner.bl_rna.properties:
            if item.type == "POINTER":
                _append(found, getattr(owner, item.identifier, None))
    return found


def _inputs(modifier) -> list:
    """The objects that inputs of a Geometry Nodes modifier point to."""
    found: list = []
    for identifier in input_identifiers(modifier.node_group).values():
        _append(found, versions.modifier_input(modifier, identifier))
    return found


def _append(found: list, value) -> None:
    if isinstance(value, bpy.types.Object):
        found.append(value)
    elif isinstance(value, bpy.types.Collection):
        found.extend(value.all_objects)
