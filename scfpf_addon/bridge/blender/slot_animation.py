# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes to the order of a camera's surfaces, and of its image mappings, that take their animation along.

F-curves and drivers name a slot by its place in the list; Blender leaves them at
the place when the slot moves.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import NoReturn

SLOT_PATH = re.compile(r"^scfpf\.(\w+)\[(\d+)\]")
SURFACES = "surfaces"


class SlotError(ValueError):
    """An item that Blender lets be neither moved nor removed; the message says why, and what to do."""


def require_own_items(settings, *names: str) -> None:
    """Raise SlotError where lists of ``Object.scfpf`` have items that cannot go.

    Library overrides may add items to those of the other file, and move and remove what they have added.
    """
    override = settings.id_data.override_library
    reference = override.reference if override is not None else None
    if reference is not None and any(len(getattr(reference.scfpf, name)) for name in names):
        _refuse(settings)


def _refuse(settings) -> NoReturn:
    raise SlotError(
        f"'{settings.id_data.name}' is a library override: surfaces and mappings from its file can be "
        "neither moved nor removed here; make the camera local (Object > Relations > Make Local), or edit "
        "that file"
    )


def move_slot(settings, index: int, place: int, name: str = SURFACES) -> None:
    """Move an item of a list of ``Object.scfpf`` from one place to another. name: of the list.

    Raises SlotError, as ``remove_slot`` does, for an item that a library override has from its file.
    """
    if index == place:
        return
    slots = getattr(settings, name)
    order = list(range(len(slots)))
    order.insert(place, order.pop(index))
    try:
        slots.move(index, place)
    except TypeError:
        _refuse(settings)
    _renumber(settings.id_data, name, {old: new for new, old in enumerate(order)})


def remove_slot(settings, index: int, name: str = SURFACES) -> None:
    """Take an item off its list, with its animation."""
    slots = getattr(settings, name)
    order = list(range(len(slots)))
    order.pop(index)
    try:
        slots.remove(index)
    except TypeError:
        _refuse(settings)
    _renumber(settings.id_data, name, {old: new for new, old in enumerate(order)})


def clear_slots(settings, name: str = SURFACES) -> None:
    """Empty a list, with the animation of all its items. Raises SlotError as ``require_own_items`` does."""
    require_own_items(settings, name)
    getattr(settings, name).clear()
    _renumber(settings.id_data, name, {})


def _renumber(camera, name: str, places: Mapping[int, int]) -> None:
    """Give the F-curves and drivers of a list their items' new places; those without one are removed."""
    for curves in curve_collections(camera):
        for curve in list(curves):
            found = SLOT_PATH.match(curve.data_path)
            if found is None or found[1] != name:
                continue
            old = int(found[2])
            if old not in places:
                curves.remove(curve)
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
