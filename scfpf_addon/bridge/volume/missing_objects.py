# SPDX-License-Identifier: GPL-3.0-or-later
"""Messages about objects whose file is gone, and about those that a scene does not have."""

from __future__ import annotations

from .volume_object import holds

# Blender's way to put objects of one scene into another one.
LINK_MENU = "Object > Link/Transfer Data > Link Objects to Scene"


def missing_text(obj) -> str:
    """The remedy for an object whose file is gone or lacks it; empty for any other object."""
    if obj is None or not obj.is_missing:
        return ""
    linked = obj.override_library.reference if obj.override_library else obj
    path = linked.library.filepath if linked and linked.library else "another file"
    return (
        f"'{obj.name}' is missing from '{path}': put that file back and open this one again, or choose its "
        "new place in the Outliner (Blender File, right-click the library, Relocate)"
    )


def absence(obj, scene) -> str:
    """The whereabouts of an object that a scene does not have, in two or three words; empty if it has it."""
    if holds(scene.objects, obj):
        return ""
    if not obj.users_collection:
        return "deleted"  # with X: a pointer keeps it in the file
    return "in another scene" if obj.users_scene else "in no scene"


def absent_text(obj, scene, otherwise: str, camera=None) -> str:
    """The reason why a scene does not have an object, and the remedy; empty if the scene has it.

    otherwise: a remedy that does without the object. camera: the camera that needs the object, unless it is
    the object itself.
    """
    where = absence(obj, scene)
    if not where:
        return ""
    if where == "deleted":
        return f"'{obj.name}' was deleted: undo that with Ctrl-Z, or {otherwise}"
    if where == "in no scene":
        return (
            f"'{obj.name}' is in no scene: drag its collection '{obj.users_collection[0].name}' into "
            f"'{scene.name}' in the Outliner (Display Mode > Blender File), or {otherwise}"
        )
    home = obj.users_scene[0].name
    if camera is not None and not holds(scene.objects, camera):
        return (
            f"'{obj.name}' and its camera '{camera.name}' are in the scene '{home}', not in '{scene.name}': "
            f"go to that scene, or link both to this one with {LINK_MENU}"
        )
    return (
        f"'{obj.name}' is in the scene '{home}', not in '{scene.name}': link it to this one with "
        f"{LINK_MENU}, or {otherwise}"
    )
