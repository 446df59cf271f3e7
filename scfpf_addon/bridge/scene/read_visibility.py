# SPDX-License-Identifier: GPL-3.0-or-later
"""Objects' ray visibility and holdouts, and light linking, as Cycles has them."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...casting.common.ray_visibility import CAMERA, CATCHER, EVERYWHERE, GLASS, HOLDOUT, MIRROR, SHADOW
from ...shading.scene.shading_scene import Light

RAYS = (
    ("visible_camera", CAMERA),
    ("visible_shadow", SHADOW),
    ("visible_glossy", MIRROR),
    ("visible_transmission", GLASS),
)

# Names of objects and whether a collection includes them, or leaves them out.
Members = dict[str, bool]


def visible_rays(thing, parent, view_layer) -> int:
    """To what an evaluated object is visible, bits of ``casting.visibility``, 0 for nothing.

    parent: the evaluated object that instances it, or None.
    """
    bits = _own_rays(thing) & (_own_rays(parent) if parent else EVERYWHERE)
    top = (parent or thing).original
    if top.holdout_get(view_layer=view_layer) or thing.is_holdout:
        return bits | HOLDOUT if bits & CAMERA else bits
    if thing.is_shadow_catcher and bits & CAMERA:
        bits |= CATCHER
    if top.indirect_only_get(view_layer=view_layer):
        bits &= ~CAMERA
    return bits


def _own_rays(thing) -> int:
    return sum(bit for name, bit in RAYS if getattr(thing, name))


class LightLinks:
    """Which things lamps light, and which cast their shadows."""

    def __init__(self) -> None:
        self._things: dict[tuple[str, str], int] = {}
        self._lamps: dict[int, dict[str, Members]] = {}

    def number(self, name: str, parent: str) -> int:
        """The number by which lamps know an object, by full names; parent: what instances it, or empty."""
        return self._things.setdefault((name, parent), len(self._things))

    def add(self, number: int, lamp) -> None:
        """Take what a lamp (a bpy.types.Object) is linked with. number: of it in the list of lights."""
        linking = lamp.light_linking
        for kind, collection in (
            ("receivers", linking.receiver_collection),
            ("blockers", linking.blocker_collection),
        ):
            members = _members(collection) if collection else {}
            if members:
                self._lamps.setdefault(number, {})[kind] = members

    def __bool__(self) -> bool:
        """Whether any lamp is linked."""
        return bool(self._lamps)

    def linked(self, lights: list[Light]) -> tuple[Light, ...]:
        """The lights with what they are linked with."""
        made = list(lights)
        for kind in ("receivers", "blockers"):
            # An instance is linked by what instances it, if any lamp names that, else by its object.
            named = {name for kinds in self._lamps.values() for name in kinds.get(kind, ())}
            names = [parent if parent in named else own for own, parent in self._things]
            for number, kinds in self._lamps.items():
                if kind in kinds:
                    made[number] = replace(made[number], **{kind: _chosen(kinds[kind], names)})
        return tuple(made)


def _members(collection) -> Members:
    """What a collection says of objects. Its own members come before those of collections in it."""
    found: Members = {}
    for state, child in zip(collection.collection_children, collection.children, strict=True):
        found.update(dict.fromkeys((one.name_full for one in child.all_objects), _included(state)))
    for state, one in zip(collection.collection_objects, collection.objects, strict=True):
        found[one.name_full] = _included(state)
    return found


def _included(state) -> bool:
    return state.light_linking.link_state == "INCLUDE"


def _chosen(members: Members, names: list[str]) -> NDArray[np.bool_] | None:
    """Which of the names count: those included, or where none is, all that are not left out; None for all."""
    otherwise = not any(members.values())
    chosen = np.array([members.get(name, otherwise) for name in names], bool)
    return None if chosen.all() else chosen
