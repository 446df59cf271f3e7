# SPDX-License-Identifier: GPL-3.0-or-later
"""The state of a scene that empty chords were found for, to notice later that it has changed.

Shapes are not part of it: the depsgraph reports their edits. It also names what it has updated: a look at
that is enough as long as the scene has the same members.
"""

from __future__ import annotations

from typing import NamedTuple

import bpy

from ...bridge.blender.rig_mark import has_other_animation, is_rig_part
from ...bridge.blender.scene_objects import originals
from ..hidden_surfaces import hidden_from_rigs
from .reasons import (
    material_obstacle,
    movers_of,
    moves,
    obstacle,
    rig_motion,
    setting_obstacle,
)
from .stillness import OwnChange, change_of, change_of_data
from .swept_bodies import shutter_of

# Edits of these may change whether materials displace faces.
OF_MATERIALS = ("MATERIAL", "NODETREE", "SCENE")


class SceneState(NamedTuple):
    """A signature of what the scene of a rig shows to rays, and how.

    objects: of each object, by session id, its place and what it shows. movers, changes: see ``Motion``.
    obstacle: see there. settings: everything else.
    """

    objects: dict[int, tuple]
    movers: frozenset[int]
    changes: dict[int, OwnChange]
    obstacle: str
    settings: tuple


def state_of(rig) -> SceneState:
    """The signature of a rig's scene as it is evaluated at present."""
    motion = rig_motion(rig)
    movers = movers_of(rig, motion)
    objects = objects_state(shown_objects(rig))
    return SceneState(objects, movers, motion.changes, obstacle(rig, motion), _settings_state(rig, movers))


def is_as(rig, known: SceneState, depsgraph) -> bool:
    """Return whether a rig's scene still has the state that it had before the updates of a depsgraph.

    The cost follows the updates, unless collections or node groups are edited.
    """
    updates = [update.id for update in depsgraph.updates]
    is_of_many = any(
        isinstance(found, (bpy.types.Collection, bpy.types.GeometryNodeTree)) for found in updates
    )
    if is_of_many or depsgraph.id_type_updated("COLLECTION"):
        return state_of(rig) == known
    if known.settings != _settings_state(rig, known.movers):
        return False
    if any(depsgraph.id_type_updated(kind) for kind in OF_MATERIALS) and material_obstacle(rig):
        return False
    hidden = hidden_from_rigs()
    return all(_is_one_as(found, known, hidden) for found in originals(updates))


def _is_one_as(found, known: SceneState, hidden: set) -> bool:
    """Return whether an updated datablock is as in a known state. hidden: see ``hidden_from_rigs``."""
    if not isinstance(found, bpy.types.Object):
        # Of other datablocks only the data of objects matter.
        change = known.changes.get(found.session_uid)
        return change is None or change == change_of_data(found)
    if found in hidden or is_rig_part(found):
        return True
    uid = found.session_uid
    if uid in known.objects and known.objects[uid] != _object_state(found):
        return False
    # Objects of instanced collections are not among those of the scene. New ones are unknown.
    if found.type == "CAMERA":
        return uid in known.objects
    return known.changes.get(uid) == change_of(found)


def _settings_state(rig, movers: frozenset[int]) -> tuple:
    """The part of a state that no object has. movers: see ``Motion``."""
    scene = rig.scfpf_rig.scene
    layers = tuple(_layer_state(layer.layer_collection) for layer in scene.view_layers)
    lamps = tuple(_lamp_state(lamp) for lamp in bpy.data.lights)
    render = scene.render
    blur = (render.use_motion_blur, shutter_of(render)) if movers else ()
    passes = rig.scfpf_rig.passes and moves(rig)
    is_animated = has_other_animation(scene)
    return setting_obstacle(rig), is_animated, layers, lamps, render.use_simplify, blur, passes


def shown_objects(rig) -> list:
    """The objects of a rig's scene, without its control surfaces and the rig."""
    hidden = hidden_from_rigs()
    return [obj for obj in rig.scfpf_rig.scene.objects if obj not in hidden and not is_rig_part(obj)]


def objects_state(objects: list) -> dict[int, tuple]:
    """The places of objects, original or evaluated, and what they show, by session id."""
    return {obj.original.session_uid: _object_state(obj) for obj in objects}


def _object_state(obj) -> tuple:
    shown = obj.original.data
    data = shown.session_uid if shown is not None else 0
    points = len(getattr(shown, "vertices", ()))
    places = obj.matrix_world.copy().freeze(), obj.matrix_basis.copy().freeze()
    return data, points, obj.hide_render, obj.visible_camera, *places, len(obj.modifiers)


def _layer_state(layer) -> tuple:
    own = layer.exclude, layer.holdout, layer.collection.hide_render, len(layer.collection.objects)
    return (*own, *(_layer_state(child) for child in layer.children))


def _lamp_state(lamp) -> tuple:
    return (
        lamp.session_uid,
        lamp.type,
        *(getattr(lamp, name, 0.0) for name in ("size", "size_y", "shadow_soft_size")),
    )


def has_unwatched(scene, view_layer) -> bool:
    """Return whether renders show an object that the view layer's depsgraph does not evaluate."""
    return any(
        not obj.hide_render and not is_rig_part(obj) and not obj.visible_get(view_layer=view_layer)
        for obj in scene.objects
        if obj.type not in {"CAMERA", "EMPTY"}
    )


def shape_edits(depsgraph, expected: frozenset[int]) -> bool:
    """Return whether the depsgraph reports an edit of a shape that rays may meet.

    expected: session ids of objects whose shapes may change.
    """
    hidden = hidden_from_rigs()
    edited = (each for each in depsgraph.updates if each.is_updated_geometry)
    objects = originals(each.id for each in edited if each.id.id_type == "OBJECT")
    return any(
        obj.session_uid not in expected
        for obj in objects
        if obj.type != "CAMERA" and obj not in hidden and not is_rig_part(obj)
    )
