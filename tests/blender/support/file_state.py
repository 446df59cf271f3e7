# SPDX-License-Identifier: GPL-3.0-or-later
"""Everything in a file and its handlers, to be compared before and after; and faults between."""

import gc
import hashlib
import inspect
import sys
from contextlib import contextmanager
from types import FunctionType

import bpy
import numpy as np
import pytest

# Statistics, counts of edits, and what Blender itself changes when anything is evaluated.
VOLATILE = {"rna_type", "is_evaluated", "users", "session_uid", "statistics", "scfpf_edits"}
SIMPLE = {"BOOLEAN", "INT", "FLOAT", "STRING", "ENUM"}


class Fault(Exception):
    """Raised by ``fault_in``."""


# Images of a render that is done: a later fault does not take it back.
RESULTS = {"Render Result", "SCFPF Render"}

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
        parts = (
            ("", scene),
            (".render", scene.render),
            (".cycles", scene.cycles),
            (".view", scene.view_settings),
        )
        for label, owner in parts:
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
        animation = obj.animation_data
        found[f"object {obj.name_full}"] = {
            "data": _name(obj.data),
            "keys": sorted(key for key in obj.keys() if key not in obj.bl_rna.properties),
            "drivers": _curves(animation.drivers if animation else ()),
            "action": (_name(animation.action), _curves(_action_curves(animation))) if animation else None,
            "modifiers": [(m.name, m.type, _inputs(m)) for m in obj.modifiers],
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


def _curves(curves):
    keys = (
        (curve.data_path, curve.array_index, [tuple(p.co) for p in curve.keyframe_points]) for curve in curves
    )
    return sorted(keys)


def _action_curves(animation):
    if animation.action is None or animation.action_slot is None:
        return ()
    strips = (strip for layer in animation.action.layers for strip in layer.strips)
    bags = (strip.channelbag(animation.action_slot) for strip in strips)
    return [curve for bag in bags if bag is not None for curve in bag.fcurves]


def _inputs(modifier):
    """The group of a node modifier and its inputs. A rig skips no chords after a fault: its image stays."""
    if modifier.type != "NODES" or modifier.node_group is None:
        return None
    sockets = [item for item in modifier.node_group.interface.items_tree if item.item_type == "SOCKET"]
    names = [socket.identifier for socket in sockets if socket.in_out == "INPUT" and socket.name != "Skip"]
    if bpy.app.version >= (5, 2, 0):
        values = {name: getattr(modifier.properties.inputs, name, None) for name in names}
        values = {name: getattr(value, "value", None) for name, value in values.items()}
    else:
        values = {name: modifier.get(name) for name in names}
    plain = {name: value for name, value in values.items() if isinstance(value, (bool, int, float, str))}
    return modifier.node_group.name, plain


def values_of(owner):
    """The plain values of an RNA struct, with the names of datablocks and the members of its lists."""
    found = {}
    for prop in owner.bl_rna.properties:
        name = prop.identifier
        if name in VOLATILE:
            continue
        if prop.type in SIMPLE:
            value = getattr(owner, name)
            # A zero may have got a sign.
            text = repr(value[:]) if getattr(prop, "is_array", False) else repr(value)
            found[name] = text.replace("-0.0,", "0.0,").replace("-0.0)", "0.0)")
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
        maps = [_digest(layer.uv, "vector", 2) for layer in data.uv_layers]
        return _points(data.vertices), len(data.polygons), materials, maps, _keys(data.shape_keys)
    if isinstance(data, bpy.types.Lattice):
        return _digest(data.points, "co_deform", 3), data.points_u, data.points_v, data.points_w
    if isinstance(data, bpy.types.Curve):
        points = [tuple(p.co) for spline in data.splines for p in spline.points]
        return points, _keys(data.shape_keys)
    return None


def _points(vertices):
    """The number of vertices or points of a shape key, and a digest of where they are."""
    return _digest(vertices, "co", 3)


def _digest(items, name, size):
    """The number of items, and a digest of a property of theirs."""
    values = np.empty(size * len(items), np.float32)
    items.foreach_get(name, values)
    return len(items), hashlib.sha256(values.tobytes()).hexdigest()[:8]


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


def function_of(addon, path):
    """A function by its path in the extension, through classes."""
    parts = path.split(".")
    for count in range(len(parts) - 1, 0, -1):
        try:
            found = addon(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        for name in parts[count:]:
            found = getattr(found, name)
        return found
    raise AssertionError(path)


def settled_state():
    bpy.context.view_layer.update()
    state = file_state()
    state["images"] = [name for name in state["images"] if name not in RESULTS]
    return state


def require_all_or_nothing(addon, case, setup, action, steps, after_setup=lambda: None):
    """Assert that an action leaves the file as it was after a fault in each function, and then is done.

    setup: called with ``addon``. steps: paths of functions in the extension, with spaces between.
    """
    setup(addon)
    after_setup()
    before, traces = settled_state(), []
    for step in steps.split():
        with fault_in(function_of(addon, step)) as happened, pytest.raises(RuntimeError):
            action()
        assert happened, f"{case} does not call {step}"
        if found := differences(before, settled_state()):
            traces.append((step, [text[:200] for text in found[:6]]))
            before = settled_state()
    assert traces == [], traces
    assert action() == {"FINISHED"}


def called_functions(root, action):
    """The functions below a folder that an operator calls, in the order of their first calls.

    Those that need values of an enclosing function, and generators' parts, are left out.
    """
    seen = {}

    def note(frame, event, _argument):
        code = frame.f_code
        if event == "call" and code not in seen and code.co_filename.startswith(root):
            seen[code] = _is_within(frame, "act")

    sys.setprofile(note)
    try:
        assert action() == {"FINISHED"}
    finally:
        sys.setprofile(None)
    functions = {each.__code__: each for each in gc.get_objects() if type(each) is FunctionType}
    wanted = [code for code, is_within in seen.items() if is_within and not code.co_freevars]
    return [functions[code] for code in wanted if code in functions and "<" not in code.co_qualname]


def _is_within(frame, name):
    """Return whether a frame is called by a function with a name."""
    while frame.f_back is not None:
        frame = frame.f_back
        if frame.f_code.co_name == name:
            return True
    return False
