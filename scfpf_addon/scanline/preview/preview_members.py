# SPDX-License-Identifier: GPL-3.0-or-later
"""The objects that the nodes preview shows, and the members of its source collections.

Collection Info shows everything in a collection, hidden or not. So objects that are hidden in renders,
control surfaces and the like must not be in it.
"""

from __future__ import annotations

import numpy as np

from ...bridge.camera.flexible_camera import control_objects
from ...bridge.scene.read_materials import unmet_slots, volume_only_materials

# Types of objects that have faces, or instance a collection whose objects have some.
SHAPES = {"MESH", "CURVE", "SURFACE", "FONT", "META", "EMPTY"}
# Instancers of this type hide the children that they instance.
PARENTS = {"VERTS", "FACES"}


def shown_objects(view_layer) -> dict[int, object]:
    """The objects, by session_uid, that a render of a view layer shows and nodes can take.

    As in renders, hiding in viewports does not count.
    """
    left_out, volume_only = control_objects(), volume_only_materials()
    shown: dict[int, object] = {}
    pending = [view_layer.layer_collection]
    while pending:
        layer = pending.pop()
        if layer.collection.hide_render or layer.indirect_only:
            continue
        pending.extend(layer.children)
        if layer.exclude:
            continue
        for candidate in layer.collection.objects:
            if candidate.session_uid not in shown and _is_shown(candidate, left_out, volume_only):
                shown[candidate.session_uid] = candidate
    return shown


def _is_shown(candidate, left_out: set[str], volume_only: frozenset[int]) -> bool:
    if candidate.hide_render or candidate.type not in SHAPES or not candidate.visible_camera:
        return False
    if candidate.type == "EMPTY":
        if candidate.instance_type != "COLLECTION":
            return False
    elif candidate.is_instancer and not candidate.show_instancer_for_render:
        return False
    if candidate.parent is not None and candidate.parent.instance_type in PARENTS:
        return False
    if candidate.material_slots and len(unmet_slots(candidate, volume_only)) == len(candidate.material_slots):
        return False
    return candidate.name_full not in left_out


def take_members(collections, wanted: dict[int, object], places: dict[int, int]) -> list:
    """Make collections hold exactly the wanted objects; return the objects that are new in them.

    places: the number of each object's collection. Changes collections only where they differ: every change
    rebuilds the depsgraph's relations.
    """
    present = places_of(collections)
    for number, collection in enumerate(collections):
        for member in list(collection.objects):
            if places.get(member.session_uid) != number:
                collection.objects.unlink(member)
    for uid, number in places.items():
        if present.get(uid) != number:
            collections[number].objects.link(wanted[uid])
    return [wanted[uid] for uid in wanted if uid not in present]


def places_of(collections) -> dict[int, int]:
    """The number of the collection that each object is in, by session_uid."""
    return {
        member.session_uid: number
        for number, collection in enumerate(collections)
        for member in collection.objects
    }


def visibility_signature(view_layer) -> bytes:
    """A summary of the visibility of objects in renders, quick to make.

    Members and visibility of collections are not in it: the depsgraph's updates tell of their edits.
    """
    objects = view_layer.objects
    count = len(objects)
    numbers, hidden, visible = np.empty(count, np.int32), np.empty(count, bool), np.empty(count, bool)
    objects.foreach_get("session_uid", numbers)
    objects.foreach_get("hide_render", hidden)
    objects.foreach_get("visible_camera", visible)
    return numbers.tobytes() + hidden.tobytes() + visible.tobytes()
