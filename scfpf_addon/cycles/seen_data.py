# SPDX-License-Identifier: GPL-3.0-or-later
"""The objects, materials, worlds, lamps and drawings that renders meet, wherever they come from."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterator

import bpy
import numpy as np
from bpy.types import Object

from ..bridge.blender.rig_mark import is_rig_part
from ..bridge.scene.instances import Instance, instances
from ..bridge.scene.read_visibility import ShownInRenders, rendered_objects

# Through these an object that no viewport evaluates may come to a material.
LEADING = {"COLLECTION", "MATERIAL", "MESH", "NODETREE", "PARTICLE"}
# Data of objects that have materials of their own, besides meshes.
LEADING |= {"CURVE", "CURVES", "META", "POINTCLOUD", "VOLUME"}


def seen_data(scene) -> set:
    """The original materials, lamps and worlds that some ray meets, of all view layers that are rendered.

    Objects that viewports evaluate have the materials that modifiers and nodes give them. Others count with
    all materials that their data, their nodes and their instances might use.
    """
    found = set()
    for layer in _rendered_layers(scene):
        world = layer.world_override or scene.world
        found |= {world} - {None}
        override = layer.material_override
        for obj in (instance.obj for instance in _looks(layer)):
            if obj.type == "LIGHT":
                found.add(obj.data.original)
            else:
                found |= {override} if override else materials_of(obj)
        found |= might_use(_unevaluated(layer))
    return found


def links(owner, output: str, socket: str) -> bool:
    """Return whether a datablock's nodes end in a linked socket of an output node."""
    if owner is None or owner.node_tree is None:
        return False
    return any(node.type == output and node.inputs[socket].is_linked for node in owner.node_tree.nodes)


def seen_instances(scene, is_meant: Callable[[Object, set], bool]) -> Iterator[tuple]:
    """Each evaluated object that renders show and that is meant, its matrix and its instancer.

    is_meant: of an object and the materials on it. An object is its own instancer if nothing instances it.
    Objects that instances share come once for each.
    """
    for layer in _rendered_layers(scene):
        override = layer.material_override
        meant: dict[tuple, bool] = {}
        for look, instance in _shown(layer):
            obj = instance.obj
            if look not in meant:
                used = {override} if override else materials_of(obj)
                meant[look] = obj.type != "LIGHT" and is_meant(obj, used)
            if meant[look]:
                yield obj, instance.matrix, instance.parent or obj


def unevaluated_objects(scene) -> set:
    """The objects that renders show, and that no viewport evaluates."""
    return set().union(*(_unevaluated(layer) for layer in _rendered_layers(scene)))


def strokes(scene) -> str:
    """The name of a Grease Pencil object that an ordinary camera's renders show; empty without one."""
    if not any(obj.type == "GREASEPENCIL" for obj in bpy.data.objects):
        return ""
    names = set()
    for layer in _rendered_layers(scene):
        if layer.use_grease_pencil:
            shown = [*(each.obj.original for each in _looks(layer)), *_unevaluated(layer)]
            names |= {obj.name for obj in shown if obj.type == "GREASEPENCIL"}
    return min(names, default="")


def _rendered_layers(scene) -> list:
    layers = [layer for layer in scene.view_layers if layer.use]
    return layers or list(scene.view_layers[:1])


def _shown(layer) -> Iterator[tuple[tuple, Instance]]:
    """Each instance that viewports evaluate and renders show, with a key that instances of one look share."""
    depsgraph = layer.depsgraph
    if depsgraph is None:
        return
    rigs: dict[int, bool] = {}
    for instance in instances(depsgraph, renders=ShownInRenders(depsgraph)):
        uid = instance.key.uid
        if uid not in rigs:
            rigs[uid] = is_rig_part(instance.obj)
        if not rigs[uid]:
            yield (instance.key, instance.data), instance


def _looks(layer) -> Iterator[Instance]:
    """The first instance of each look."""
    known = set()
    for look, instance in _shown(layer):
        if look not in known:
            known.add(look)
            yield instance


def _unevaluated(layer) -> set:
    """The objects of a view layer that renders show, but that no viewport evaluates."""
    present = set() if layer.depsgraph is None else {obj.original for obj in layer.depsgraph.objects}
    return {obj for obj in rendered_objects(layer) - present if not (obj.hide_render or is_rig_part(obj))}


def materials_of(obj) -> set:
    """The original materials on an evaluated object; of a mesh those that its faces have."""
    used = [slot.material for slot in obj.material_slots]
    own = list(getattr(obj.data, "materials", ()))
    used += own[len(used) :]
    if obj.type == "MESH" and len(used) > 1:
        attribute = obj.data.attributes.get("material_index")
        index = np.zeros(len(obj.data.polygons), np.int32)
        if attribute is not None and attribute.domain == "FACE" and attribute.data_type == "INT":
            attribute.data.foreach_get("value", index)
        # Strands of particles grow in the material of any slot.
        if not len(obj.particle_systems):
            used = [used[number] for number in np.unique(index.clip(0, len(used) - 1))]
    return {material.original for material in used if material is not None}


def might_use(objects: set) -> set:
    """The materials and lamps that objects reach through their data, nodes, collections and particles."""
    return {each for each in _reached(objects) if each.id_type in {"MATERIAL", "LIGHT"}}


def might_use_each(objects: set) -> Iterator[tuple]:
    """Each object and what it reaches: ``might_use``, and the objects that it may show."""
    uses = _uses() if objects else {}
    for obj in objects:
        yield obj, _reached({obj}, uses)


def _uses() -> dict:
    """The datablocks that each datablock uses."""
    uses = defaultdict(set)
    for each, users in bpy.data.user_map().items():
        for user in users:
            uses[user].add(each)
    return uses


def _reached(objects: set, uses: dict | None = None) -> set:
    """The datablocks that objects reach, as ``might_use``, themselves too. uses: None to find them."""
    if not objects:
        return set()
    uses = _uses() if uses is None else uses
    reached, pending = set(), list(objects)
    while pending:
        each = pending.pop()
        if each in reached:
            continue
        reached.add(each)
        # An object points to others that it does not show: its parent, targets of constraints.
        instances = each.id_type != "OBJECT" or any(mod.type == "NODES" for mod in each.modifiers)
        kinds = LEADING | {"LIGHT"} | ({"OBJECT"} if instances else set())
        pending += [used for used in uses[each] if used.id_type in kinds]
    return reached
