# SPDX-License-Identifier: GPL-3.0-or-later
"""The volume object: a child mesh of a flexible camera that keeps its surfaces evaluated, hidden ones too."""

from __future__ import annotations

import bpy

from ...projection.presets.preset import MAXIMUM_SURFACES
from ..blender import versions
from ..blender.node_builder import NodeBuilder


def editable_collections(obj):
    """The collections that hold an object and can be changed."""
    return [c for c in obj.users_collection if c.is_editable and not c.override_library]


def link_beside(new, obj) -> None:
    """Link a new object where another one is, or to the context's scene where that cannot be."""
    for collection in editable_collections(obj) or [bpy.context.scene.collection]:
        collection.objects.link(new)


def delete_with_data(obj) -> None:
    """Delete an object, and its data if nothing else uses it.

    Of any type: Object > Convert may have made a curve of what was a mesh.
    """
    data = obj.data
    bpy.data.objects.remove(obj)
    if data is not None and data.users == 0:
        bpy.data.batch_remove([data])


def is_volume_object(candidate) -> bool:
    """Whether an object is the volume object of its parent."""
    parent = candidate.parent
    return parent is not None and parent.type == "CAMERA" and parent.scfpf.volume_object == candidate


def volume_facts(camera) -> tuple:
    """What ``sync_volume_object`` depends on and sets, as numbers to compare with those of another time."""
    settings = camera.scfpf
    if not settings.enabled:
        return (camera.session_uid,)
    volume = settings.volume_object
    listed = tuple(_uid(member) for member in members(settings))
    facts = (camera.session_uid, camera.users, camera.is_editable, listed)
    if volume is None:
        return facts
    modifier = _node_modifier(volume)
    taken = () if modifier is None or modifier.node_group is None else _taken_surfaces(modifier)
    return (
        *facts,
        *(_uid(volume), volume.users, _uid(volume.parent), volume.hide_viewport, volume.hide_render),
        modifier is not None and modifier.show_viewport and modifier.show_render,
        tuple(_uid(surface) for surface in taken),
    )


def members(settings) -> list:
    """The objects that a camera's volume object takes: its surfaces, and the grids of its image mappings."""
    # A longer list is no volume; taking its thousands would hold Blender up.
    surfaces = [slot.object for slot in settings.surfaces[:MAXIMUM_SURFACES]]
    return surfaces + [m.grid for m in settings.mappings if m.kind == "GRID" and m.grid is not None]


def _uid(obj) -> int:
    return 0 if obj is None else obj.session_uid


def _node_modifier(volume):
    return next((m for m in volume.modifiers if m.type == "NODES"), None)


def delete_volume_object(volume) -> None:
    """Delete a volume object that no camera needs any more, with its mesh and an unused node group."""
    modifier = _node_modifier(volume)
    group = None if modifier is None else modifier.node_group
    delete_with_data(volume)
    if group is not None and group.users == 0 and group.is_editable:
        bpy.data.node_groups.remove(group)


def is_absent(surface, scene) -> bool:
    """Whether a scene does not have an object: deleted with X it lives on for its pointer.

    Never an object of another file: linking a camera alone brings its surfaces
    along without linking them to the scene, and the volume object evaluates them.
    """
    return surface.library is None and not holds(scene.objects, surface)


def holds(objects, obj) -> bool:
    """Whether an object is among a scene's or a collection's."""
    found = objects.get(obj.name)
    # A linked object, or a library override of it, may have the same name.
    return found == obj or (found is not None and obj in objects.values())


def sync_volume_object(camera):
    """Make the volume object take every surface of the list; create it where it is missing.

    A property pointer alone does not get an object evaluated; Object Info in a
    node modifier does, whatever hides the object. The volume object is also
    linked to the scene's master collection, which nothing can exclude.
    Call it from operators, never during evaluation or drawing. Returns the
    object; for a camera that cannot be edited the one there is, or None.
    """
    settings = camera.scfpf
    volume = settings.volume_object
    if not camera.is_editable:
        if volume is not None:
            _link_volume(volume, camera)
        return volume
    if not _may_serve(volume, camera):
        volume = _new_volume_object(camera)
        settings.volume_object = volume
    if volume.parent != camera:
        volume.parent = camera
    _link_volume(volume, camera)
    surfaces = members(settings)
    modifier = _node_modifier(volume)
    if modifier is None:
        modifier = volume.modifiers.new("SCFPF Volume", "NODES")
    # The present one, whatever the artist calls it.
    present = modifier.node_group
    group = present if _is_volume_group(present, len(surfaces)) else _volume_group(len(surfaces))
    # Hidden or disabled, it would evaluate nothing. Eye-hidden it still does.
    for owner, switch, value in (
        (volume, "hide_viewport", False),
        (volume, "hide_render", False),
        (modifier, "show_viewport", True),
        (modifier, "show_render", True),
    ):
        if getattr(owner, switch) != value:
            setattr(owner, switch, value)
    before = modifier.node_group
    if before == group and surfaces == _taken_surfaces(modifier):
        return volume
    modifier.node_group = group
    if before is not None and before.users == 0:
        bpy.data.node_groups.remove(before)
    for identifier, surface in zip(_object_inputs(group), surfaces, strict=True):
        versions.set_modifier_input(modifier, identifier, surface)
    # Assigning the group once more rebuilds the depsgraph's relations; setting an input does not in 4.5.
    modifier.node_group = group
    volume.update_tag()
    return volume


def release_pointers(camera) -> int:
    """Take from a camera and its volume object all pointers that handlers may have set.

    Call it before a step of undo or redo; ``restore_pointers`` and ``sync_volume_object`` set them again.
    Returns the session id of the volume object, 0 if the camera has none or cannot be edited.
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
    """Give a camera the volume object that ``release_pointers`` has taken, unless undo has given it one."""
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
    """Whether an object can be the camera's volume object.

    Not another camera's, of which this one is a duplicate. Not a library override either: a node
    modifier's inputs are not overridden for good, they go back to the library's own surfaces.
    """
    if volume is None or volume.type != "MESH" or not volume.is_editable or volume.override_library:
        return False
    return volume.parent == camera or not is_volume_object(volume)


def _link_volume(volume, camera) -> None:
    """Link the volume object where the camera is and to the master collection of its scenes."""
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


def _taken_surfaces(modifier) -> list:
    """The objects that a volume object's modifier takes, in order."""
    return [
        versions.modifier_input(modifier, identifier) for identifier in _object_inputs(modifier.node_group)
    ]


def keeps_evaluated(camera, surface, depsgraph) -> bool:
    """Whether the camera's volume object makes a surface evaluate in a depsgraph, hidden or not."""
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
        and surface in _taken_surfaces(modifier)
        for modifier in volume.modifiers
    )


def _is_volume_group(group, count: int) -> bool:
    """Whether a node group, or None, can be that of a volume of ``count`` surfaces."""
    return group is not None and group.bl_idname == "GeometryNodeTree" and len(_object_inputs(group)) == count


def _volume_group(count: int):
    """The node group of a volume of ``count`` surfaces: Object Info of each, no geometry.

    The objects are inputs of the modifier, not of the group, so that duplicates remap them.
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
