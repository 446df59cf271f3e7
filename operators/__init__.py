# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user can do: ``bpy.ops.scfpf``. One module a family."""

from . import (
    blend,
    camera,
    cycles,
    drawn,
    duplicate,
    edit_volume,
    engine,
    find,
    framing,
    mappings,
    own_presets,
    pick,
    picture_fit,
    presets,
    preview,
    render,
    surface_tools,
    surfaces,
    tutorial,
    volume_tools,
)

# Registered in this order, unregistered in the reverse.
MODULES = (
    camera,
    presets,
    own_presets,
    surfaces,
    edit_volume,
    volume_tools,
    surface_tools,
    framing,
    duplicate,
    blend,
    render,
    engine,
    pick,
    find,
    mappings,
    picture_fit,
    preview,
    cycles,
    drawn,
    tutorial,
)


def register():
    for module in MODULES:
        module.register()


def unregister():
    for module in reversed(MODULES):
        module.unregister()
