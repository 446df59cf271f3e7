# SPDX-License-Identifier: GPL-3.0-or-later
"""Options that the properties of cameras and scenes share, and shorthands for properties that use them."""

from __future__ import annotations

from bpy.props import BoolProperty, FloatProperty, FloatVectorProperty

OVERRIDABLE = {"LIBRARY_OVERRIDABLE"}


def noted(owner, context):
    """Do nothing: a property needs a callback for edits from Python to reach the depsgraph."""


# Of properties that can have keyframes, and of those that cannot.
ANIMATABLE = {"update": noted, "override": OVERRIDABLE}
STATIC = {"options": set(), **ANIMATABLE}
# Of properties that no panel shows.
MARK = {"options": {"HIDDEN"}, **ANIMATABLE}


def switch(name, description, default):
    """A property that is on or off."""
    return BoolProperty(name=name, description=description, default=default, **ANIMATABLE)


def color(name, description, default):
    """A scene-linear RGB color."""
    channel = {"min": 0.0, "max": 1.0, "size": 3, "subtype": "COLOR"}
    return FloatVectorProperty(name=name, description=description, default=default, **channel, **ANIMATABLE)


def number(name, description, default, low, high, **options):
    """A number between two limits."""
    limits = {"min": low, "max": high}
    return FloatProperty(
        name=name, description=description, default=default, **limits, **options, **ANIMATABLE
    )
