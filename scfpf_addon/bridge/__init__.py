# SPDX-License-Identifier: GPL-3.0-or-later
"""Blender to arrays and back. ``versions`` is the one module that hides version differences."""

from __future__ import annotations

from . import (
    blend_properties,
    command_line,
    drawing,
    drawn,
    image_marks,
    mapping_properties,
    properties,
    read_mappings,
    render_engine,
    render_passes,
    result_undo,
    sampling,
    sound_properties,
    volume_upkeep,
)

# Registered in this order, unregistered in the reverse.
MODULES = (
    blend_properties,
    mapping_properties,
    properties,
    sampling,
    drawn,
    sound_properties,  # before all that looks at a file that was loaded
    read_mappings,
    volume_upkeep,
    drawing,
    image_marks,
    result_undo,
    render_passes,
    render_engine,
    command_line,
)


def register():
    for module in MODULES:
        module.register()


def unregister():
    for module in reversed(MODULES):
        module.unregister()
