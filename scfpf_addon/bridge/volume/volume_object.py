# SPDX-License-Identifier: GPL-3.0-or-later
"""The volume object: a child mesh of a flexible camera that keeps its surfaces evaluated, hidden ones too."""

from __future__ import annotations

import bpy

from ...projection.presets.preset import MAXIMUM_SURFACES
from ..blender import versions
from ..blender.node_builder import NodeBuilder
from ..blender.scene_objects import delete_with_data, editable_collections, holds, may_remove_groups
from .camera_members import grids_of


def is_volume_object(candidate) -> bool:
    """Return whether an object is the volume object of its parent."""
    parent = candidate.parent
    return parent is not None and parent.type == "CAMERA" and parent.scfpf.volume_object == candidate


def volume_facts(camera) -> tuple:
    """The state that ``sync_volume_object`` reads and sets, as numbers by which changes are noticed."""
    settings = camera.scfpf
    if not settings.enabled:
        return (camera.session_uid,)
    volume = settings.volume_object
    listed = tuple(_uid(member) for member in members(camera))
    facts = (camera.session_uid, camera.users, camera.is_editable, listed)
    if volume is None:
        return facts
    modifier = _node_modifier(volume)
    evaluated = () if modifier is None or modifier.node_group is None else _evaluated_members(modifier)
    return (
        *facts,
        *(_uid(volume), volume.users, _uid(volume.parent), volume.hide_viewport, volume.hide_render),
        modifier is not None and modifier.show_viewport and modifier.show_render,
        tuple(_uid(surface) for surface in evaluated),
    )


def members(camera) -> list:
    """The objects that a volume object evaluates: surfaces, None at empty places, and grids of mappings."""
    # A longer list is not a volume, and may be far longer in a damaged file.
    surfaces = [slot.object for slot in camera.scfpf.surfaces[:MAXIMUM_SURFACES]]
    return surfaces + grids_of(camera)


def _uid(obj) -> int:
    return 0 if obj is None else obj.session_uid


def _node_modifier(volume):
    return next((m for m in volume.modifiers if m.type == "NODES"), None)


def delete_volume_object(volume) -> None:
    """Delete a volume object without a camera, with its mesh and its node group if nothing else uses it."""
    modifier = _node_modifier(volume)
    group = None if modifier is None else modifier.node_group
    delete_with_data(volume)
    if group is not None and group.users == 0 and group.is_editable and may_remove_groups():
        bpy.data.node_groups.remove(group)


def sync_volume_object(camera):
    """Make the volume object evaluate every member of a camera's volume; create the object if it is missing.

    A pointer property alone does not make Blender evaluate an object. Object Info in a node modifier does,
    even for hidden objects. The volume object is also linked to the master collection of the camera's
    scenes, which nothing can exclude. Do not call this during evaluation or drawing. Returns the volume
    object; for a camera that cannot be edited the existing one, or None.
    """
    settings = camera.scfpf
    volume = settings.volume_object
    if not camera.is_editable:
        if volume is not None:
            _link_volume(volume, camera)
        return volume
    if not _may_serve(volume, camera):
        volume = settings.volume_object = _new_volume_object(camera)
    if volume.parent != camera:
        volume.parent = camera
    _link_volume(volume, camera)
    modifier = _node_modifier(volume) or volume.modifiers.new("SCFPF Volume", "NODES")
    # The volume object evaluates nothing while it or its modifier is disabled; the eye does not matter.
    for owner, switch, value in (
        (volume, "hide_viewport", False),
        (volume, "hide_render", False),
        (modifier, "show_viewport", True),
        (modifier, "show_render", True),
    ):
        if getattr(owner, switch) != value:
            setattr(owner, switch, value)
    _set_members(modifier, members(camera))
    return volume


def _set_members(modifier, objects: list) -> None:
    """Make a volume object's modifier evaluate these objects."""
    before = modifier.node_group
    # A group that the artist has renamed serves as well.
    group = before if _is_volume_group(before, len(objects)) else _volume_group(len(objects))
    if before == group and objects == _evaluated_members(modifier):
        return
    modifier.node_group = group
    if before is not None and before.users == 0 and may_remove_groups():
        bpy.data.node_groups.remove(before)
    for identifier, obj in zip(_object_inputs(group), objects, strict=True):
        versions.set_modifier_input(modifier, identifier, obj)
    # Setting an input in 4.5 leaves the depsgraph's relations as they were; assigning the group builds them.
    modifier.node_group = group
    modifier.id_data.update_tag()


def release_pointers(camera) -> int:
    """Clear all pointers between a camera and its volume object, as is necessary before undo and redo.

    ``restore_pointers`` and ``sync_volume_object`` set them again afterwards. Returns the session id of the
    volume object, 0 if the camera has none or cannot be edited.
    """
    volume = camera.scfpf.volume_object
    if volume is None or not (camera.is_editable and volume.is_editable):
        return 0
    modifier = _node_modifier(volume)
    if modifier is not None:
        volume.modifiers.remove(modifier)
    if volume.parent == camera:
        volume.parent = None
    for collection in editable_collections(volume):
        collection.objects.unlink(volume)
    camera.scfpf.volume_object = None
    return volume.session_uid


def restore_pointers(camera, volume) -> None:
    """Set the volume object that ``release_pointers`` has cleared, unless undo has set one."""
    if camera.scfpf.volume_object is not None:
        return
    camera.scfpf.volume_object = volume
    if volume.parent is None:
        volume.parent = camera


def _new_volume_object(camera):
    name = f"{camera.name} Volume"
    volume = bpy.data.objects.new(name, bpy.data.meshes.new(name))
    volume.scfpf_surface.is_volume = True
    volume.hide_select = True
    volume.display_type = "WIRE"
    return volume


def _may_serve(volume, camera) -> bool:
    """Return whether an object can be the camera's volume object.

    The volume object of another camera cannot: this camera is then its duplicate. A library override cannot
    either: reloading resets a node modifier's inputs to the library's own surfaces.
    """
    if volume is None or volume.type != "MESH" or not volume.is_editable or volume.override_library:
        return False
    return volume.parent == camera or not is_volume_object(volume)


def _link_volume(volume, camera) -> None:
    """Link the volume object to the camera's collections and to the master collection of its scenes."""
    wanted = editable_collections(camera)
    wanted += [
        scene.collection
        for scene in camera.users_scene
        if scene.is_editable and scene.collection not in wanted
    ]
    for collection in wanted:
        if not holds(collection.objects, volume):
            collection.objects.link(volume)
    for collection in editable_collections(volume):
        if collection not in wanted:
            collection.objects.unlink(volume)


def _object_inputs(group) -> list[str]:
    return [
        item.identifier
        for item in group.interface.items_tree
        if item.item_type == "SOCKET" and item.in_out == "INPUT" and item.socket_type == "NodeSocketObject"
    ]


def _evaluated_members(modifier) -> list:
    """The objects that a volume object's modifier evaluates, in order."""
    return [
        versions.modifier_input(modifier, identifier) for identifier in _object_inputs(modifier.node_group)
    ]


def is_evaluated(camera, obj, depsgraph) -> bool:
    """Return whether a depsgraph evaluates an object, for the camera's volume object or as it is visible.

    The evaluated copy of any other object may be stale.
    """
    return _volume_evaluates(camera, obj, depsgraph) or any(
        visible.original == obj for visible in depsgraph.objects
    )


def _volume_evaluates(camera, obj, depsgraph) -> bool:
    volume = camera.scfpf.volume_object
    hide, show = (
        ("hide_viewport", "show_viewport") if depsgraph.mode == "VIEWPORT" else ("hide_render", "show_render")
    )
    if volume is None or getattr(volume, hide):
        return False
    if not holds(depsgraph.scene.collection.objects, volume):
        return False
    return any(
        modifier.type == "NODES"
        and modifier.node_group is not None
        and getattr(modifier, show)
        and obj in _evaluated_members(modifier)
        for modifier in volume.modifiers
    )


def _is_volume_group(group, count: int) -> bool:
    """Return whether a node group, or None, can serve a volume of ``count`` surfaces."""
    return group is not None and group.bl_idname == "GeometryNodeTree" and len(_object_inputs(group)) == count


def _volume_group(count: int):
    """The node group of a volume of ``count`` surfaces: Object Info of each, without any geometry.

    The objects are inputs of the modifier, not values in the group, so that duplicates remap them.
    """
    name = f"SCFPF Volume {count}"
    existing = bpy.data.node_groups.get((name, None))
    if _is_volume_group(existing, count):
        return existing
    tree = bpy.data.node_groups.new(name, "GeometryNodeTree")
    tree.is_modifier = True
    tree.description = f"Keeps the {count} control surfaces of a flexible camera evaluated, hidden ones too"
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    for number in range(1, count + 1):
        tree.interface.new_socket(
            f"Surface {number}",
            description="A control surface, from near to far",
            in_out="INPUT",
            socket_type="NodeSocketObject",
        )
    nodes = NodeBuilder(tree, row=260)
    source = nodes.node("NodeGroupInput", "Surfaces", {})
    nodes.open_frame("Makes the surfaces evaluate; no geometry leaves")
    for number in range(count):
        nodes.node("GeometryNodeObjectInfo", f"Surface {number + 1}", {"Object": source.outputs[number]})
    nodes.close_frame()
    nodes.node("NodeGroupOutput", "Nothing", {})
    return tree
