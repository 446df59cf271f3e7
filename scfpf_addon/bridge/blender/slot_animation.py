# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of a camera's lists, such as those of surfaces, layers or targets of Aim, with their animation.

F-curves and drivers refer to an item by its place in the list. Blender does not change them when items move.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import NoReturn

from ...projection.user_error import UserError
from .all_or_nothing import at_end, way_back

SLOT_PATH = re.compile(r"^scfpf\.(\w+)\[(\d+)\]")
# The path of curves of removed items, until they are removed.
REMOVED = "scfpf.removed"
SURFACES, MAPPINGS, AIM_TARGETS, LAYERS = "surfaces", "mappings", "aim_targets", "layers"
BLEND_MORE = "blend_more"
# The property of ``Object.scfpf`` with the index of each list's active item.
ACTIVE = {
    SURFACES: "active_surface",
    MAPPINGS: "active_mapping",
    AIM_TARGETS: "active_aim",
    LAYERS: "active_layer",
    BLEND_MORE: "active_blend",
}


def require_own_items(settings, *names: str) -> None:
    """Raise UserError if lists of ``Object.scfpf`` have items that cannot be removed.

    A library override can move and remove only the items that it has added to those of its file.
    """
    override = settings.id_data.override_library
    reference = override.reference if override is not None else None
    if reference is not None and any(len(getattr(reference.scfpf, name)) for name in names):
        _refuse(settings)


def _refuse(settings) -> NoReturn:
    raise UserError(
        "'{0}' is a library override: surfaces, mappings, targets and layers of its file "
        "can be neither moved nor removed here; make the camera local (Object > Relations "
        "> Make Local), or edit that file",
        settings.id_data.name,
    )


def move_slot(settings, index: int, place: int, name: str = SURFACES) -> int:
    """Move an item of a list of ``Object.scfpf`` to a place within the list, and make it active.

    name: of the list. Returns the place. Raises UserError for an item that a library override has from its
    file.
    """
    slots = getattr(settings, name)
    order = list(range(len(slots)))
    place = min(max(place, 0), len(slots) - 1)
    if index != place:
        order.insert(place, order.pop(index))
        try:
            slots.move(index, place)
        except TypeError:
            _refuse(settings)
        _renumber(settings.id_data, name, {old: new for new, old in enumerate(order)})
    setattr(settings, ACTIVE[name], place)
    return place


def remove_slot(settings, index: int, name: str = SURFACES) -> None:
    """Remove an item from its list, with its animation. Raises UserError as ``move_slot`` does."""
    slots = getattr(settings, name)
    order = list(range(len(slots)))
    order.pop(index)
    try:
        slots.remove(index)
    except TypeError:
        _refuse(settings)
    _renumber(settings.id_data, name, {old: new for new, old in enumerate(order)})
    setattr(settings, ACTIVE[name], max(min(getattr(settings, ACTIVE[name]), len(slots) - 1), 0))


def clear_slots(settings, name: str = SURFACES) -> None:
    """Empty a list, with the animation of all its items. Raises UserError as ``require_own_items`` does."""
    require_own_items(settings, name)
    getattr(settings, name).clear()
    _renumber(settings.id_data, name, {})
    setattr(settings, ACTIVE[name], 0)


def _renumber(camera, name: str, places: Mapping[int, int]) -> None:
    """Update the places in the F-curves and drivers of a list; remove those of removed items."""
    for curves in curve_collections(camera):
        for curve in list(curves):
            found = SLOT_PATH.match(curve.data_path)
            if found is None or found[1] != name:
                continue
            old = int(found[2])
            if places.get(old) != old:
                way_back(setattr, curve, "data_path", curve.data_path)
            if old not in places:
                curve.data_path = REMOVED
                at_end(curves.remove, curve)
            elif places[old] != old:
                curve.data_path = f"scfpf.{name}[{places[old]}]" + curve.data_path[found.end() :]


def curve_collections(camera) -> Iterator:
    """The collections of F-curves, drivers among them, that animate a camera."""
    data = camera.animation_data
    if data is None:
        return
    yield data.drivers
    used = [(data.action, data.action_slot)]
    used += [(strip.action, strip.action_slot) for track in data.nla_tracks for strip in track.strips]
    bags = {}
    for action, slot in used:
        if action is None or slot is None or not action.is_editable:
            continue
        for layer in action.layers:
            for strip in layer.strips:
                bag = strip.channelbag(slot)
                if bag is not None:
                    bags[bag.as_pointer()] = bag.fcurves
    yield from bags.values()
