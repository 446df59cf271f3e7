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

# What files and Blender's render job need: see ``switching``.
TYPES = (blend_properties, mapping_properties, properties, sampling, drawn, render_passes, render_engine)
# Registered in this order after the types, unregistered in the reverse before them.
MODULES = (
    sound_properties,  # before all that looks at a file that was loaded
    read_mappings,
    volume_upkeep,
    drawing,
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
