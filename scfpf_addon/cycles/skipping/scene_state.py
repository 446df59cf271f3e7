# SPDX-License-Identifier: GPL-3.0-or-later
"""The state of a scene that empty chords were found for, to notice later that it has changed.

Shapes are not part of it: the depsgraph reports their edits.
"""

from __future__ import annotations

from typing import NamedTuple

import bpy

from ...bridge.blender.rig_mark import is_rig_part
from ..hidden_surfaces import hidden_from_rigs
from .reasons import movers_of, moves, obstacle
from .swept_bodies import shutter_of


class SceneState(NamedTuple):
    """A signature of what the scene of a rig shows to rays, and how.

    objects: of each object its place and what it shows. settings: everything else.
    """

    objects: tuple
    settings: tuple


def state_of(rig) -> SceneState:
    """The signature of a rig's scene as it is evaluated at present."""
    scene = rig.scfpf_rig.scene
    layers = tuple(_layer_state(layer.layer_collection) for layer in scene.view_layers)
    lamps = tuple(_lamp_state(lamp) for lamp in bpy.data.lights)
    render, movers = scene.render, movers_of(rig)
    blur = (render.use_motion_blur, shutter_of(render)) if movers else ()
    passes = rig.scfpf_rig.passes and moves(rig)
    settings = obstacle(rig), movers, layers, lamps, render.use_simplify, blur, passes
    return SceneState(objects_state(shown_objects(rig)), settings)


def shown_objects(rig) -> list:
    """The objects of a rig's scene, without its control surfaces and the rig."""
    hidden = hidden_from_rigs()
    return [obj for obj in rig.scfpf_rig.scene.objects if obj not in hidden and not is_rig_part(obj)]


def objects_state(objects: list) -> tuple:
    """The places of objects, original or evaluated, and what they show."""
    return tuple(_object_state(obj) for obj in objects)


def _object_state(obj) -> tuple:
    place = tuple(value for row in obj.matrix_world for value in row)
    own = tuple(value for row in obj.matrix_basis for value in row)
    shown = obj.original.data
    data = shown.session_uid if shown is not None else 0
    points = len(getattr(shown, "vertices", ()))
    return (
        obj.original.session_uid,
        data,
        points,
        obj.hide_render,
        obj.visible_camera,
        place,
        own,
        len(obj.modifiers),
    )


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
    for update in depsgraph.updates:
        if not update.is_updated_geometry or not isinstance(update.id, bpy.types.Object):
            continue
        obj = update.id.original
        if obj.type == "CAMERA" or obj in hidden or is_rig_part(obj):
            continue
        if obj.session_uid not in expected:
            return True
    return False
