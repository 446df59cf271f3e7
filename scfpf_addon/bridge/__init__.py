# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender to arrays and back. ``versions`` is the one module that hides version differences."""

from __future__ import annotations

from .mappings import read_mappings
from .overlays import image_marks, viewport_overlay
from .render import command_line, render_engine, render_passes, result_undo
from .settings import (
    camera_properties,
    mapping_properties,
    sampling,
    stylised_properties,
    validation,
)
from .sync import handlers

# What files and Blender's render job need: see ``render.type_registration``.
TYPES = (
    mapping_properties,
    camera_properties,
    sampling,
    stylised_properties,
    render_passes,
    render_engine,
)
# Registered in this order after the types, unregistered in the reverse before them.
MODULES = (
    validation,  # before all that looks at a file that was loaded
    read_mappings,
    handlers,
    viewport_overlay,
    image_marks,
    result_undo,
    command_line,
)


def register():
    for module in MODULES:
        module.register()


def unregister():
    for module in reversed(MODULES):
        module.unregister()
