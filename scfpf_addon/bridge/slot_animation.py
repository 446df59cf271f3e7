# SPDX-License-Identifier: GPL-3.0-or-later
"""Changes to the order of a camera's surfaces that take the slots' animation along.

F-curves and drivers name a slot by its place in the list; Blender leaves them at
the place when the slot moves.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping

SLOT_PATH = re.compile(r"^scfpf\.surfaces\[(\d+)\]")


def move_slot(settings, index: int, place: int) -> None:
    """Move a surface of ``Object.scfpf`` from one place of the list to another."""
    order = list(range(len(settings.surfaces)))
    order.insert(place, order.pop(index))
    settings.surfaces.move(index, place)
    _renumber(settings.id_data, {old: new for new, old in enumerate(order)})


def remove_slot(settings, index: int) -> None:
    """Take a surface off the list, with its slot's animation."""
    order = list(range(len(settings.surfaces)))
    order.pop(index)
    settings.surfaces.remove(index)
    _renumber(settings.id_data, {old: new for new, old in enumerate(order)})


def clear_slots(settings) -> None:
    """Empty the list, with the animation of all its slots."""
    settings.surfaces.clear()
    _renumber(settings.id_data, {})


def _renumber(camera, places: Mapping[int, int]) -> None:
    """Give the slots' F-curves and drivers their slots' new places; those without one are removed."""
    for curves in _curve_collections(camera):
        for curve in list(curves):
            found = SLOT_PATH.match(curve.data_path)
            if found is None:
                continue
            old = int(found[1])
            if old not in places:
                curves.remove(curve)
            elif places[old] != old:
                curve.data_path = f"scfpf.surfaces[{places[old]}]" + curve.data_path[found.end() :]


def _curve_collections(camera) -> Iterator:
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
