# SPDX-License-Identifier: GPL-3.0-or-later
"""Marks of Cycles rigs: a property of their own objects, drivers of the objects that they hide from rays."""

from __future__ import annotations

import bpy

# The custom property of a rig's objects that points to the flexible camera.
RIG_KEY = "scfpf_rig_of"
# The custom property of the scene copies that rigs of one render are made in.
PASSING_KEY = "scfpf_passing"

# The least width of a rig's screen, which is the ortho scale of its camera; no other camera has such a scale.
WIDTH = 200_000.0
# Drivers of these properties, with this expression, hide objects from the rays of rigs.
HIDDEN_RAYS = (
    "visible_camera",
    "visible_diffuse",
    "visible_glossy",
    "visible_transmission",
    "visible_volume_scatter",
    "visible_shadow",
)
HIDING = f"width < {WIDTH:.0f}"


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
    return driver is not None and driver.expression == HIDING and curve.data_path in HIDDEN_RAYS


def has_other_animation(owner) -> bool:
    """Return whether a datablock has an action, NLA tracks, or drivers that do not hide it from rigs."""
    animation = owner.animation_data
    if animation is None:
        return False
    if animation.action is not None or len(animation.nla_tracks):
        return True
    return not all(is_hiding(curve) for curve in animation.drivers)
