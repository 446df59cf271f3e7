# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects in scenes and collections: link and delete them, and say why one is missing."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from contextlib import contextmanager

import bpy

from ...projection.user_error import Message

# Blender's way to put objects of one scene into another one.
LINK_MENU = "Object > Link/Transfer Data > Link Objects to Scene"


def editable_collections(obj) -> list:
    """The collections that hold an object and can be changed."""
    return [c for c in obj.users_collection if c.is_editable and not c.override_library]


def link_beside(new, obj) -> None:
    """Link a new object to the collections of another one, or to the context's scene if none can change."""
    for collection in editable_collections(obj) or [bpy.context.scene.collection]:
        collection.objects.link(new)


def originals(evaluated: Iterable) -> list:
    """The originals of evaluated datablocks of a depsgraph's updates, without those that are gone.

    A handler may have removed one since, or undo; its evaluated copy still points to it. So originals are
    looked up by name. Datablocks within others, such as the nodes of a material, are left out.
    """
    wanted = {(each.id_type, each.name, each.library) for each in evaluated}
    kinds = {kind for kind, _, _ in wanted}
    found = []
    for name in dir(bpy.data) if wanted else ():
        members = getattr(bpy.data, name)
        first = next(iter(members), None) if isinstance(members, bpy.types.bpy_prop_collection) else None
        if isinstance(first, bpy.types.ID) and first.id_type in kinds:
            found += [each for each in members if (each.id_type, each.name, each.library) in wanted]
    return found


# The number of objects as the present event began, None outside of events.
_count: int | None = None


@contextmanager
def event() -> Iterator[None]:
    """Note the objects that there are, for a block in which handlers respond to an event."""
    global _count
    before, _count = _count, len(bpy.data.objects)
    try:
        yield
    finally:
        _count = before


def is_in_event() -> bool:
    """Return whether handlers are responding to an event: what they assign, no undo step holds."""
    return _count is not None


def has_removed() -> bool:
    """Return whether handlers have removed objects during the present event.

    An evaluated depsgraph still has them: to read its instances would follow pointers into freed memory.
    """
    return _count is not None and len(bpy.data.objects) < _count


def delete_with_data(obj) -> None:
    """Delete an object of any type, and its data if nothing else uses it."""
    data = obj.data
    bpy.data.objects.remove(obj)
    if data is not None and data.users == 0:
        bpy.data.batch_remove([data])


def may_remove_groups() -> bool:
    """Return whether node groups may be removed whose modifiers have got others.

    In a file with several scenes they stay until the file is saved: the depsgraph of a scene that no window
    shows goes on to evaluate them, and Blender would crash.
    """
    return len(bpy.data.scenes) == 1


def holds(objects, obj) -> bool:
    """Return whether an object is among a scene's or a collection's."""
    found = objects.get(obj.name)
    # A linked object, or a library override of it, may have the same name.
    return found == obj or (found is not None and obj in objects.values())


def is_absent(obj, scene) -> bool:
    """Return whether a local object is not in a scene: deleted with X, it stays in the file for its pointers.

    A linked object is never absent. Linking a camera alone brings its surfaces without linking them to the
    scene; the volume object evaluates them.
    """
    return obj.library is None and not holds(scene.objects, obj)


def missing_text(obj) -> str:
    """A message about a linked object whose file is gone or lacks it; empty for any other object."""
    if obj is None or not obj.is_missing:
        return ""
    linked = obj.override_library.reference if obj.override_library else obj
    path = linked.library.filepath if linked and linked.library else Message("another file")
    return Message(
        "'{0}' is missing from '{1}': put that file back and open this one again, or choose its "
        "new place in the Outliner (Blender File, right-click the library, Relocate)",
        obj.name,
        path,
    )


def absence(obj, scene) -> str:
    """The place of an object outside of a scene, in two or three words; empty if it is in the scene."""
    if holds(scene.objects, obj):
        return ""
    if not obj.users_collection:
        return Message("deleted")
    return Message("in another scene") if obj.users_scene else Message("in no scene")


def absent_text(obj, scene, otherwise: str, camera=None) -> str:
    """The reason why an object is not in a scene, and the remedy; empty if it is in the scene.

    otherwise: a remedy that does without the object. camera: the camera that needs the object, unless that
    is the object itself.
    """
    where = absence(obj, scene)
    if not where:
        return ""
    otherwise, link = Message(otherwise), Message(LINK_MENU)
    if where == "deleted":
        return Message("'{0}' was deleted: undo that with Ctrl-Z, or {1}", obj.name, otherwise)
    if where == "in no scene":
        return Message(
            "'{0}' is in no scene: drag its collection '{1}' into '{2}' in the Outliner "
            "(Display Mode > Blender File), or {3}",
            obj.name,
            obj.users_collection[0].name,
            scene.name,
            otherwise,
        )
    home = obj.users_scene[0].name
    if camera is not None and not holds(scene.objects, camera):
        return Message(
            "'{0}' and its camera '{1}' are in the scene '{2}', not in '{3}': go to that scene, or link both "
            "to this one with {4}",
            obj.name,
            camera.name,
            home,
            scene.name,
            link,
        )
    return Message(
        "'{0}' is in the scene '{1}', not in '{2}': link it to this one with {3}, or {4}",
        obj.name,
        home,
        scene.name,
        link,
        otherwise,
    )


def object_by_uid(session_uid: int):
    """The object with a ``session_uid``, which survives renaming and undo; None if it was removed."""
    return next((obj for obj in bpy.data.objects if obj.session_uid == session_uid), None)


def scene_by_uid(session_uid: int):
    """The scene with a ``session_uid``; None if it was removed."""
    return next((scene for scene in bpy.data.scenes if scene.session_uid == session_uid), None)


def is_being_edited(obj) -> bool:
    """Return whether an object is in Edit Mode or another mode in any scene, or shares data that are.

    Blender keeps such data apart until the mode ends: what is written to them is lost or refused.
    """
    return obj.mode != "OBJECT" or getattr(obj.data, "is_editmode", False)
