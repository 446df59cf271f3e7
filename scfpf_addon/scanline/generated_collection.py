# SPDX-License-Identifier: GPL-3.0-or-later
"""Collections of generated objects: the rules that the nodes preview and the Cycles rig share.

The settings of both name the flexible ``camera``, its ``scene``, and the ``table`` object.
"""

from __future__ import annotations

from collections.abc import Iterable

import bpy

from ..bridge.blender.drivers import add_property, new_driver
from ..bridge.blender.modifier_inputs import input_property
from ..bridge.blender.scene_objects import absent_text, holds, may_remove_groups
from ..projection.user_error import Message

_SIZE = {
    "width": "render.resolution_x",
    "height": "render.resolution_y",
    "across": "render.pixel_aspect_x",
    "up": "render.pixel_aspect_y",
    "percentage": "render.resolution_percentage",
}
# Inputs of modifiers that follow the size of a scene's image, as expressions of the variables above.
_FOLLOWING = {
    "Aspect": "width * across / (height * up)",
    "Picture Width": "width * percentage / 100",
}


def linked_text(scene, camera, remedy: str) -> str:
    """The reason (linked or absent data) why nothing can be generated for a camera in a scene; else empty.

    remedy: for a scene from another file.
    """
    if not scene.is_editable:
        return Message("The scene is linked from another file: {0}", remedy)
    if not camera.is_editable:
        return Message("'{0}' is linked from another file: make a library override of it first", camera.name)
    return absent_text(camera, scene, Message("choose another camera"))


def is_complete(settings, collection, parts: Iterable) -> bool:
    """Return whether a collection in the scene is complete, and the camera is a flexible one of that scene.

    collection, parts: None for those that are lost.
    """
    scene, camera = settings.scene, settings.camera
    if None in (scene, camera, settings.table, collection) or camera.type != "CAMERA":
        return False
    if not camera.scfpf.enabled:
        return False
    if any(part is None or collection.objects.get(part.name) != part for part in parts):
        return False
    return collection in scene.collection.children_recursive and holds(scene.objects, camera)


def new_orthographic_camera(name: str, width: float):
    """An orthographic camera object with an image of a width, across in any format."""
    lens = bpy.data.cameras.new(name)
    lens.type = "ORTHO"
    lens.sensor_fit = "HORIZONTAL"
    lens.ortho_scale = width
    return bpy.data.objects.new(name, lens)


def follow_image_size(modifier, names: Iterable[str], scene, factor: float = 1.0) -> None:
    """Drive inputs of a modifier, "Aspect" and "Picture Width", by ``factor`` times a scene's image's."""
    for name in names:
        expression = _FOLLOWING[name] if factor == 1.0 else f"{_FOLLOWING[name]} * {factor!r}"
        driver = new_driver(*input_property(modifier, name), expression)
        for variable, path in _SIZE.items():
            if variable in expression:
                add_property(driver, scene, path, variable, "SCENE")


def remove_generated(settings, collection, parts: list, table_key: str, others: Iterable = ()) -> None:
    """Remove a collection with its parts; objects that the artist has put into it stay in the scene.

    table_key: the camera's custom property that names the table. others: see ``remove_parts``.
    """
    for guest in set(collection.objects) - set(parts) if collection is not None else ():
        if len(guest.users_collection) == 1 and settings.scene is not None:
            settings.scene.collection.objects.link(guest)
    camera = settings.camera
    remove_parts(collection, parts, others)
    if camera is not None:
        camera.pop(table_key, None)


def remove_parts(collection, parts: list, others: Iterable = ()) -> None:
    """Remove objects and their collection, or None, and the data and node groups that only they use.

    others: more datablocks that go if nothing uses them any more.
    """
    groups = [
        modifier.node_group
        for part in parts
        for modifier in part.modifiers
        if modifier.type == "NODES" and modifier.node_group is not None
    ]
    data, others = {part.data for part in parts} - {None}, list(others)
    bpy.data.batch_remove(parts)
    for unused in (data, others):
        bpy.data.batch_remove([one for one in unused if one.users == 0])
    if collection is not None:
        bpy.data.collections.remove(collection)
    remove_unused_groups(groups)


def remove_replaced_groups(groups: Iterable) -> None:
    """Remove node groups, None among them, that modifiers had before others, and those that only they used.

    They stay in a file with several scenes; see ``scene_objects.may_remove_groups``.
    """
    if may_remove_groups():
        remove_unused_groups([group for group in groups if group is not None])


def remove_unused_groups(groups: Iterable) -> None:
    """Remove node groups that nothing uses, and then those that only they used."""
    pending = list(dict.fromkeys(groups))
    while pending:
        group = pending.pop()
        if group.users > 0:
            continue
        inner = {node.node_tree for node in group.nodes if getattr(node, "node_tree", None) is not None}
        bpy.data.node_groups.remove(group)
        # A group that another one in the list still uses comes up again when that one goes.
        pending = [other for other in pending if other not in inner] + list(inner)
