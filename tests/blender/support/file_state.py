# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything in a file and its handlers, to be compared before and after; and faults between."""

import hashlib
import inspect
from contextlib import contextmanager

import bpy
import numpy as np

# Statistics, counts of edits, and what Blender itself changes when anything is evaluated.
VOLATILE = {"rna_type", "is_evaluated", "users", "session_uid", "statistics", "scfpf_edits"}
SIMPLE = {"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"}


class Fault(Exception):
    """Raised by ``fault_in``."""


# What the code that stands for a function's calls, by the function's name.
FAULTS = {}


def file_state():
    """A dict of all datablocks, their settings, links, drivers and handlers, by readable keys."""
    found = {}
    for prop in bpy.data.bl_rna.properties:
        if prop.type != "COLLECTION" or prop.identifier in {"all_ids", "screens", "workspaces"}:
            continue
        members = getattr(bpy.data, prop.identifier)
        found[prop.identifier] = sorted(member.name_full for member in members)
    for scene in bpy.data.scenes:
        for label, owner in (("", scene), (".render", scene.render), (".cycles", scene.cycles)):
            found[f"{scene.name}{label}"] = values_of(owner)
        found[f"{scene.name} markers"] = [(m.name, m.frame, _name(m.camera)) for m in scene.timeline_markers]
        is_old = bpy.app.version < (5, 0, 0)
        tree = scene.node_tree if is_old else scene.compositing_node_group
        found[f"{scene.name} compositor"] = sorted(node.name for node in tree.nodes) if tree else None
        for layer in scene.view_layers:
            found[f"{scene.name} {layer.name}"] = (values_of(layer), _layers(layer.layer_collection))
            selected = sorted(obj.name_full for obj in layer.objects if obj.select_get(view_layer=layer))
            found[f"{scene.name} {layer.name} selected"] = selected, _name(layer.objects.active)
    for collection in bpy.data.collections:
        found[f"collection {collection.name_full}"] = (
            sorted(obj.name_full for obj in collection.objects),
            [child.name_full for child in collection.children],
            values_of(collection),
        )
    for obj in bpy.data.objects:
        drivers = obj.animation_data.drivers if obj.animation_data else ()
        found[f"object {obj.name_full}"] = {
            "data": _name(obj.data),
            "keys": sorted(key for key in obj.keys() if key not in obj.bl_rna.properties),
            "drivers": sorted((curve.data_path, curve.array_index) for curve in drivers),
            "modifiers": [(m.name, m.type) for m in obj.modifiers],
            "values": values_of(obj),
            "shape": _shape(obj.data),
        }
    for lens in bpy.data.cameras:
        found[f"lens {lens.name_full}"] = values_of(lens)
    for name in dir(bpy.app.handlers):
        handlers = getattr(bpy.app.handlers, name)
        if isinstance(handlers, list):
            found[f"handlers {name}"] = [handler.__qualname__ for handler in handlers]
    return found


def values_of(owner):
    """The plain values of an RNA struct, with the names of datablocks and the members of its lists."""
    found = {}
    for prop in owner.bl_rna.properties:
        name = prop.identifier
        if name in VOLATILE:
            continue
        if prop.type in SIMPLE:
            value = getattr(owner, name)
            found[name] = repr(value[:]) if getattr(prop, "is_array", False) else repr(value)
        elif prop.type == "POINTER":
            value = getattr(owner, name)
            if isinstance(value, bpy.types.PropertyGroup):
                found[name] = values_of(value)
            elif isinstance(value, bpy.types.ID):
                found[name] = _name(value)
        elif prop.type == "COLLECTION" and prop.fixed_type.base == bpy.types.PropertyGroup.bl_rna:
            found[name] = [values_of(item) for item in getattr(owner, name)]
    return found


def _name(datablock):
    return None if datablock is None else datablock.name_full


def _layers(layer):
    own = layer.collection.name_full, layer.exclude, layer.hide_viewport, layer.holdout, layer.indirect_only
    return (*own, [_layers(child) for child in layer.children])


def _shape(data):
    if isinstance(data, bpy.types.Mesh):
        materials = [_name(m) for m in data.materials]
        return _points(data.vertices), len(data.polygons), materials, _keys(data.shape_keys)
    if isinstance(data, bpy.types.Curve):
        points = [tuple(p.co) for spline in data.splines for p in spline.points]
        return points, _keys(data.shape_keys)
    return None


def _points(vertices):
    """The number of vertices or points of a shape key, and a digest of where they are."""
    values = np.empty(3 * len(vertices), np.float32)
    vertices.foreach_get("co", values)
    return len(vertices), hashlib.sha256(values.tobytes()).hexdigest()[:8]


def _keys(keys):
    """The shape keys of an object's data, and what moves them."""
    if keys is None:
        return None
    drivers = keys.animation_data.drivers if keys.animation_data else ()
    shapes = [(key.name, key.mute, key.value, _points(key.data)) for key in keys.key_blocks]
    return shapes, sorted((curve.data_path, curve.driver.expression) for curve in drivers)


def differences(before, after):
    """Readable differences of two states."""
    return [
        f"{key}: {_first_difference(before.get(key), after.get(key))}"
        for key in sorted(before.keys() | after.keys())
        if before.get(key) != after.get(key)
    ]


def _first_difference(one, other):
    if isinstance(one, dict) and isinstance(other, dict):
        keys = [key for key in one | other if one.get(key) != other.get(key)]
        return [f"{key}: {_first_difference(one.get(key), other.get(key))}" for key in keys]
    return f"{one!r:.200} -> {other!r:.200}"


@contextmanager
def fault_in(function):
    """Raise Fault at the first call of a function, whoever has imported it; later calls do as ever.

    Yields a list that then is not empty.
    """
    own = inspect.unwrap(getattr(function, "__func__", function))
    code, happened = own.__code__, []

    def fail(*_, **__):
        happened.append(own.__qualname__)
        own.__code__ = code
        raise Fault(own.__qualname__)

    FAULTS[own.__qualname__] = fail
    space = {}
    exec(f"def fault(*_, **__):\n    __import__('file_state').FAULTS[{own.__qualname__!r}]()\n", space)
    own.__code__ = space["fault"].__code__
    try:
        yield happened
    finally:
        own.__code__ = code
        del FAULTS[own.__qualname__]
