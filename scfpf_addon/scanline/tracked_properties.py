# SPDX-License-Identifier: GPL-3.0-or-later
"""Shorthands for the properties of generated collections, which no panel shows."""

from __future__ import annotations

from collections.abc import Callable

import bpy
from bpy.props import PointerProperty, StringProperty

from ..bridge.settings.property_options import noted


def _is_camera(_settings, candidate) -> bool:
    return candidate.type == "CAMERA"


def tracked(kind: Callable, name: str, description: str, **options):
    """A property of a kind, such as IntProperty, whose edits from Python reach the depsgraph."""
    return kind(name=name, description=description, update=noted, **options)


def text(name: str, description: str):
    """A string."""
    return tracked(StringProperty, name, description)


def pointer(name: str, description: str, kind: type = bpy.types.Object):
    """A pointer to a datablock."""
    return tracked(PointerProperty, name, description, type=kind)


def camera_pointer(name: str, description: str):
    """A pointer to a camera object."""
    return tracked(PointerProperty, name, description, type=bpy.types.Object, poll=_is_camera)
