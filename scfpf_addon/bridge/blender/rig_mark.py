# SPDX-License-Identifier: GPL-3.0-or-later
"""Marks of Cycles rigs: a property of their own objects, drivers of the objects that they hide from rays."""

from __future__ import annotations

import bpy

from .drivers import add_scene_property

# The custom property of a rig's objects that points to the flexible camera.
RIG_KEY = "scfpf_rig_of"
# The custom property of the scene copies that rigs of one render are made in.
PASSING_KEY = "scfpf_passing"

# The custom property of a rig's camera with the number of the rig, from 1: drivers recognise it by that.
MARK_KEY = "scfpf_rig_mark"
# Drivers of these properties, with this expression, hide objects from the rays of rigs.
HIDDEN_RAYS = (
    "visible_camera",
    "visible_diffuse",
    "visible_glossy",
    "visible_transmission",
    "visible_volume_scatter",
    "visible_shadow",
)
HIDING = "mark < 1"
# As other versions wrote it: they knew a rig by the ortho scale of its camera.
OTHER_HIDING = "width < 200000"


def is_rig_part(obj) -> bool:
    """Return whether an object is part of a Cycles rig."""
    return RIG_KEY in obj


def camera_behind(obj):
    """The flexible camera behind a rig's camera; for any other object, or None, the object itself."""
    camera = None if obj is None else obj.get(RIG_KEY)
    return camera if isinstance(camera, bpy.types.Object) else obj


def is_hiding(curve) -> bool:
    """Return whether a driver hides an object from the rays of rigs."""
    driver = curve.driver
    is_one = driver is not None and driver.expression in (HIDING, OTHER_HIDING)
    return is_one and curve.data_path in HIDDEN_RAYS


def add_mark(driver) -> None:
    """Add the variable ``mark`` to a driver: the number of the rig that is rendered, 0 for other cameras."""
    target = add_scene_property(driver, f'camera["{MARK_KEY}"]', "mark")
    # A scene may have no camera, or one without the property.
    target.use_fallback_value, target.fallback_value = True, 0.0


def has_other_animation(owner) -> bool:
    """Return whether a datablock has an action, NLA tracks, or drivers that do not hide it from rigs."""
    # Images, the data of empties, have no animation.
    animation = getattr(owner, "animation_data", None)
    if animation is None:
        return False
    if animation.action is not None or len(animation.nla_tracks):
        return True
    return not all(is_hiding(curve) for curve in animation.drivers)
