# SPDX-License-Identifier: GPL-3.0-or-later
"""Options that the properties of cameras and scenes share, and shorthands for properties that use them."""

from __future__ import annotations

from bpy.props import (
    BoolProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

OVERRIDABLE = {"LIBRARY_OVERRIDABLE"}


def noted(owner, context):
    """Do nothing: a property needs a callback for edits from Python to reach the depsgraph."""


# Of properties that can have keyframes, and of those that cannot.
ANIMATABLE = {"update": noted, "override": OVERRIDABLE}
STATIC = {"options": set(), **ANIMATABLE}
# Of properties that no panel shows.
MARK = {"options": {"HIDDEN"}, **ANIMATABLE}


def switch(name, description, default=False, **options):
    """A property that is on or off."""
    return BoolProperty(name=name, description=description, default=default, **(ANIMATABLE | options))


def number(name, description, default, low, high, **options):
    """A number between two limits."""
    given = {"name": name, "description": description, "default": default, "min": low, "max": high}
    return FloatProperty(**(ANIMATABLE | given | options))


def integer(name, description, default, low, high, **options):
    """A whole number between two limits."""
    given = {"name": name, "description": description, "default": default, "min": low, "max": high}
    return IntProperty(**(ANIMATABLE | given | options))


def list_index(name, description):
    """The number, from 0, of the entry that is selected in a list."""
    return IntProperty(name=name, description=description, default=0, min=0, **STATIC)


def vector(name, description, default, low, high, **options):
    """A vector of numbers between two limits, as long as its default."""
    given = {"name": name, "description": description, "default": default, "min": low, "max": high}
    return FloatVectorProperty(size=len(default), **(ANIMATABLE | given | options))


def color(name, description, default):
    """A scene-linear RGB color."""
    return vector(name, description, default, 0.0, 1.0, subtype="COLOR")


def text(name, description, **options):
    """A text, empty by default."""
    return StringProperty(name=name, description=description, **(ANIMATABLE | options))


def choice(name, description, items, default, **options):
    """One of several items, (identifier, name, description) each."""
    return EnumProperty(
        name=name, description=description, items=items, default=default, **(ANIMATABLE | options)
    )


def pointer(name, description, target, **options):
    """A pointer to a datablock or a property group. target: the class that it points to."""
    return PointerProperty(name=name, description=description, type=target, **(ANIMATABLE | options))
