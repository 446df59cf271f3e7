# SPDX-License-Identifier: GPL-3.0-or-later
"""The parts of objects and copies that rays meet, and light linking, as in Cycles; notes on the rest."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...casting.common.ray_visibility import CAMERA, CATCHER, EVERYWHERE, GLASS, HOLDOUT, MIRROR, SHADOW
from ...projection.typing import Array, BoolArray, IndexArray
from ...shading.scene.shading_scene import Light
from ..blender import versions
from ..camera.flexible_camera import control_objects

# The Geometry Offset of a new object's Shadow Terminator, which the image does not depend on.
USUAL_OFFSET, ROUNDING = 0.1, 1e-6

# A transform flattens an object if its axes, made unit, span no more than float32's rounding, or if one is
# shorter than float32's least normal number: Cycles has no inverse of it.
FLATTEST, SHORTEST = float(np.finfo(np.float32).eps), float(np.finfo(np.float32).tiny)

# Names of objects, and whether a collection includes or excludes each.
Members = dict[str, bool]


def flattened_copies(mesh: IndexArray, matrix: Array) -> BoolArray:
    """Return which instances Cycles leaves out, (N,): copies of a mesh that their transforms flatten.

    mesh: (N,) numbers of the instances' meshes. matrix: (N, 4, 4). Cycles applies the transform of an
    instance that shares its mesh with no other; so that one is shown flat.
    """
    flat = np.zeros(len(mesh), bool)
    shared = np.flatnonzero(np.bincount(mesh, minlength=1)[mesh] > 1)
    axes = matrix[shared, :3, :3]
    length = np.linalg.norm(axes, axis=1, keepdims=True)
    spanned = np.abs(np.linalg.det(axes / np.maximum(length, SHORTEST)))
    flat[shared] = (length < SHORTEST).any(axis=(1, 2)) | (spanned <= FLATTEST)
    return flat


def unshown_parts(obj, scene) -> Iterator[str]:
    """Notes on settings of an evaluated object that change Cycles' image but not the engine's."""
    if not obj.visible_diffuse:
        yield "Ray Visibility: Diffuse"
    offset = abs(obj.shadow_terminator_geometry_offset - USUAL_OFFSET)
    if obj.shadow_terminator_shading_offset > 0.0 or offset > ROUNDING:
        yield "Shadow Terminator"
    cycles = getattr(obj, "cycles", None)
    moves = cycles is None or (cycles.use_motion_blur and cycles.use_deform_motion)
    if scene.render.use_motion_blur and not moves:
        yield "Motion Blur that is off for an object"
    subdivided = (each for each in obj.modifiers if each.type == "SUBSURF" and each.show_render)
    if any(versions.is_subdivided_adaptively(each, obj, scene) for each in subdivided):
        yield "Adaptive Subdivision"


def has_hair(obj) -> bool:
    """Return whether a render shows hair of particles on an object."""
    systems = (each for each in obj.modifiers if each.type == "PARTICLE_SYSTEM" and each.show_render)
    settings = (each.particle_system.settings for each in systems)
    return any(each.type == "HAIR" and each.render_type == "PATH" for each in settings)


class ObjectKey(NamedTuple):
    """The session ids and full names of an object and of its instancer.

    An object that nothing instances is its own instancer, the one that a click selects.
    """

    uid: int
    name: str
    owner_uid: int
    owner_name: str

    def image_layer(self, members: Mapping[int, int]) -> int:
        """The number of the image layer that shows the object; that of its instancer comes first.

        members: the numbers by session id, 0 for others.
        """
        return members.get(self.owner_uid) or members.get(self.uid, 0)


class _Asked(NamedTuple):
    """The visibility of an object, and of the objects that it instances, in renders.

    rays: that meet it. added: HOLDOUT, CATCHER or 0. is_hidden: in renders. is_shown: whether renders show it
    where nothing instances it, and what it instances. is_held_out, is_indirect: by collections. leaves_out:
    whether hidden parts of what it instances are left out.
    """

    rays: int
    added: int
    is_hidden: bool
    is_shown: bool
    is_held_out: bool
    is_indirect: bool
    leaves_out: bool


class ShownInRenders:
    """The objects of a depsgraph that a render shows. Each is asked once, whatever instances it."""

    def __init__(self, depsgraph) -> None:
        self._view_layer = depsgraph.view_layer
        self.left_out = control_objects()
        self._rendered: set[str] | None = None
        if depsgraph.mode != "RENDER":
            self._rendered = {obj.name_full for obj in rendered_objects(depsgraph.view_layer)}
        self._asked: dict[int, _Asked] = {}

    def rays(self, obj, parent, key: ObjectKey) -> int:
        """The ray visibility of an evaluated object, bits of ``casting.common.ray_visibility``.

        It is 0 if renders do not show the object. parent: the evaluated object that instances it, or None.
        """
        own = self._ask(obj, key.uid, key.name)
        top = self._ask(parent, key.owner_uid, key.owner_name) if parent else own
        if not top.is_shown or (top.leaves_out and own.is_hidden) or key.name in self.left_out:
            return 0
        if obj.type == "LIGHT":
            return EVERYWHERE
        bits = own.rays & top.rays
        if bits & CAMERA and (top.is_held_out or own.added):
            bits |= HOLDOUT if top.is_held_out else own.added
        return bits & ~CAMERA if top.is_indirect and not bits & HOLDOUT else bits

    def _ask(self, obj, uid: int, name: str) -> _Asked:
        if uid in self._asked:
            return self._asked[uid]
        own, rendered = obj.original, self._rendered
        # A viewport's depsgraph has objects that renders hide.
        is_hidden = rendered is not None and own.hide_render
        asked = self._asked[uid] = _Asked(
            (obj.visible_camera and CAMERA)
            | (obj.visible_shadow and SHADOW)
            | (obj.visible_glossy and MIRROR)
            | (obj.visible_transmission and GLASS),
            HOLDOUT if obj.is_holdout else CATCHER if obj.is_shadow_catcher else 0,
            is_hidden,
            name not in self.left_out and not is_hidden and (rendered is None or name in rendered),
            own.holdout_get(view_layer=self._view_layer),
            own.indirect_only_get(view_layer=self._view_layer),
            # A hidden object can still be instanced, on vertices or by nodes.
            own.instance_type == "COLLECTION",
        )
        return asked


def rendered_objects(view_layer) -> set:
    """The objects in collections that are neither excluded nor hidden in renders."""
    objects: set = set()
    pending = [view_layer.layer_collection]
    while pending:
        layer = pending.pop()
        if not layer.collection.hide_render:
            if not layer.exclude:
                objects.update(layer.collection.objects)
            pending.extend(layer.children)
    return objects


class LightLinks:
    """The objects that each lamp lights, and those that cast its shadows."""

    def __init__(self) -> None:
        self._objects: dict[tuple[str, str], int] = {}
        self._lamps: dict[int, dict[str, Members]] = {}

    def number(self, name: str, parent: str) -> int:
        """The number of an object for lamps. name, parent: full names, of its instancer "" without one."""
        return self._objects.setdefault((name, parent), len(self._objects))

    def add(self, number: int, lamp) -> None:
        """Take the links of a lamp (a bpy.types.Object). number: of the lamp in the list of lights."""
        linking = lamp.light_linking
        for kind, collection in (
            ("receivers", linking.receiver_collection),
            ("blockers", linking.blocker_collection),
        ):
            members = _members(collection) if collection else {}
            if members:
                self._lamps.setdefault(number, {})[kind] = members

    def __bool__(self) -> bool:
        """Return whether any lamp is linked."""
        return bool(self._lamps)

    def linked(self, lights: list[Light]) -> tuple[Light, ...]:
        """The lights with their links."""
        made = list(lights)
        for kind in ("receivers", "blockers"):
            # An instance is linked through its instancer, if any lamp names that, else through its object.
            named = {name for kinds in self._lamps.values() for name in kinds.get(kind, ())}
            names = [parent if parent in named else own for own, parent in self._objects]
            for number, kinds in self._lamps.items():
                if kind in kinds:
                    made[number] = replace(made[number], **{kind: _chosen(kinds[kind], names)})
        return tuple(made)


def _members(collection) -> Members:
    """The members of a light linking collection. Its own come before those of collections in it."""
    found: Members = {}
    for state, child in zip(collection.collection_children, collection.children, strict=True):
        found.update(dict.fromkeys((one.name_full for one in child.all_objects), _included(state)))
    for state, one in zip(collection.collection_objects, collection.objects, strict=True):
        found[one.name_full] = _included(state)
    return found


def _included(state) -> bool:
    return state.light_linking.link_state == "INCLUDE"


def _chosen(members: Members, names: list[str]) -> NDArray[np.bool_] | None:
    """The linked names: those included or, if none is, all that are not excluded. None for all."""
    otherwise = not any(members.values())
    chosen = np.array([members.get(name, otherwise) for name in names], bool)
    return None if chosen.all() else chosen
