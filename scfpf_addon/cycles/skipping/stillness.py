# SPDX-License-Identifier: GPL-3.0-or-later
"""Return whether anything in a scene may change from frame to frame, by what Blender's data say.

In case of doubt it may.
"""

from __future__ import annotations

import functools
from typing import NamedTuple

import bpy

from ...bridge.blender import versions
from ...bridge.blender.rig_mark import has_other_animation, is_rig_part

# Modifiers whose result depends on nothing but their settings and other objects.
STILL = {
    "ARMATURE", "ARRAY", "BEVEL", "BOOLEAN", "CAST", "CURVE", "DATA_TRANSFER", "DECIMATE", "DISPLACE",
    "EDGE_SPLIT", "HOOK", "LATTICE", "MASK", "MESH_DEFORM", "MIRROR", "MULTIRES", "NODES", "NORMAL_EDIT",
    "REMESH", "SCREW", "SHRINKWRAP", "SIMPLE_DEFORM", "SKIN", "SMOOTH", "SOLIDIFY", "SUBSURF",
    "SURFACE_DEFORM", "TRIANGULATE", "UV_PROJECT", "UV_WARP", "WARP", "WEIGHTED_NORMAL", "WELD", "WIREFRAME",
}  # fmt: skip
# Modifiers whose result depends on the frame, too, and on nothing else.
BY_THE_FRAME = {"BUILD", "MESH_CACHE", "MESH_SEQUENCE_CACHE", "OCEAN", "WAVE"}
# How something changes: not at all, by the frame alone, or by the frames that were shown before.
NO_CHANGE, BY_FRAME, SIMULATED = range(3)
# Nodes whose result depends on the time, or may.
NODE_CHANGES = {
    "GeometryNodeInputSceneTime": BY_FRAME,
    "GeometryNodeImageTexture": BY_FRAME,
    "GeometryNodeInputActiveCamera": BY_FRAME,
    "GeometryNodeSimulationInput": SIMULATED,
}


# Inputs that point to objects.
POINTING = {"NodeSocketObject", "NodeSocketCollection"}
# Types of properties that may point to objects.
POINTING_TYPES = {"Object", "Collection"}


class OwnChange(NamedTuple):
    """The kind of an object's own change with the frame, and what it depends on.

    kind: NO_CHANGE, BY_FRAME or SIMULATED. others: session ids of the objects that it depends on.
    """

    kind: int
    others: frozenset[int]


class Motion(NamedTuple):
    """The shown objects that may change with the frame.

    movers: session ids. simulated: the name of an object whose shape at a frame depends on how Blender came
    there, or is unknown; empty if there is none. changes: of each object, and of the data of objects, by
    session id.
    """

    movers: frozenset[int]
    simulated: str
    changes: dict[int, OwnChange]


def motion_of(scene, left_out: set) -> Motion:
    """The motion of a scene's objects and of those that they depend on.

    left_out: objects that no ray meets.
    """
    pending = [
        obj for obj in scene.objects if obj not in left_out and obj.type != "CAMERA" and not is_rig_part(obj)
    ]
    looked_at: dict[int, tuple[int, list]] = {}
    changes: dict[int, OwnChange] = {}
    movers, simulated = set(), ""
    while pending:
        obj = pending.pop()
        if obj.session_uid in changes:
            continue
        kind, found = _own_change(obj, looked_at)
        changes[obj.session_uid] = _change(kind, found)
        pending += found
        if kind > NO_CHANGE:
            movers.add(obj.session_uid)
        if kind > BY_FRAME:
            simulated = obj.name
    while more := {uid for uid, own in changes.items() if uid not in movers and own.others & movers}:
        movers |= more
    return Motion(
        frozenset(movers), simulated, {uid: _change(*found) for uid, found in looked_at.items()} | changes
    )


def change_of(obj) -> OwnChange:
    """The change of one object."""
    return _change(*_own_change(obj, {}))


def change_of_data(data) -> OwnChange:
    """The change of an object's data."""
    return _change(*_change_of_data(data, {}))


def _change(kind: int, found: list) -> OwnChange:
    return OwnChange(kind, frozenset(other.session_uid for other in found))


def _own_change(obj, looked_at: dict[int, tuple[int, list]]) -> tuple[int, list]:
    """The change of an object by itself, and the objects that it depends on.

    looked_at: what was found for node trees and data of objects, by session id.
    """
    change, found = _change_of_data(obj.data, looked_at)
    others = [obj.parent, *found]
    if has_other_animation(obj) or len(obj.constraints) or obj.type == "GREASEPENCIL":
        change = max(change, BY_FRAME)
    if obj.rigid_body is not None or len(getattr(obj, "particle_systems", ())):
        change = SIMULATED
    for modifier in obj.modifiers:
        own, found = _change_of_modifier(modifier, looked_at)
        change, others = max(change, own), others + found
    if obj.instance_type == "COLLECTION" and obj.instance_collection is not None:
        others += obj.instance_collection.all_objects
    return change, [other for other in others if other is not None]


def _change_of_data(data, looked_at: dict[int, tuple[int, list]]) -> tuple[int, list]:
    """The change of an object's data by itself, and the objects that it depends on. data: or None."""
    if data is None:
        return NO_CHANGE, []
    if data.session_uid not in looked_at:
        keys = getattr(data, "shape_keys", None)
        is_animated = any(owner is not None and has_other_animation(owner) for owner in (data, keys))
        moves = is_animated or getattr(data, "is_sequence", False)
        looked_at[data.session_uid] = BY_FRAME if moves else NO_CHANGE, _pointed(data)
    return looked_at[data.session_uid]


def _change_of_modifier(modifier, looked_at: dict[int, tuple[int, list]]) -> tuple[int, list]:
    """The change of a modifier by itself, and the objects that it depends on."""
    if modifier.type not in STILL:
        return (BY_FRAME if modifier.type in BY_THE_FRAME else SIMULATED), _pointed(modifier)
    change, others = NO_CHANGE, _pointed(modifier)
    if modifier.type == "NODES" and modifier.node_group is not None:
        change, found = _change_of_tree(modifier.node_group, looked_at)
        others += _inputs(modifier) + found
    texture = modifier.texture if modifier.type == "DISPLACE" else None
    if texture is not None and has_other_animation(texture):
        change = max(change, BY_FRAME)
    return change, others


def _change_of_tree(tree, looked_at: dict[int, tuple[int, list]]) -> tuple[int, list]:
    """The change of a node tree by itself, and the objects that it depends on."""
    if tree.session_uid in looked_at:
        return looked_at[tree.session_uid]
    change, others = BY_FRAME if has_other_animation(tree) else NO_CHANGE, []
    for node in tree.nodes:
        change = max(change, NODE_CHANGES.get(node.bl_idname, NO_CHANGE))
        for socket in node.inputs:
            _append(others, getattr(socket, "default_value", None))
        group = getattr(node, "node_tree", None)
        if group is not None:
            own, found = _change_of_tree(group, looked_at)
            change, others = max(change, own), others + found
    looked_at[tree.session_uid] = change, others
    return looked_at[tree.session_uid]


def _pointed(owner) -> list:
    """The objects that properties of a datablock or a modifier point to."""
    found: list = []
    if owner is not None:
        for name in _pointers(type(owner)):
            _append(found, getattr(owner, name, None))
    return found


@functools.cache
def _pointers(kind: type) -> list[str]:
    """The names of the properties of a type that may point to objects: looking for them takes long."""
    return [
        item.identifier
        for item in kind.bl_rna.properties
        if item.type == "POINTER" and item.fixed_type.identifier in POINTING_TYPES
    ]


def _inputs(modifier) -> list:
    """The objects that inputs of a Geometry Nodes modifier point to."""
    found: list = []
    for item in modifier.node_group.interface.items_tree:
        # Geometry has no value.
        if item.item_type == "SOCKET" and item.in_out == "INPUT" and item.socket_type in POINTING:
            _append(found, versions.modifier_input(modifier, item.identifier))
    return found


def _append(found: list, value) -> None:
    if isinstance(value, bpy.types.Object):
        found.append(value)
    elif isinstance(value, bpy.types.Collection):
        found.extend(value.all_objects)
