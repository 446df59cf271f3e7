# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user can do: ``bpy.ops.scfpf``. One module a family."""

from .camera import (
    blend,
    camera,
    cycles,
    duplicate,
    engine,
    own_presets,
    presets,
    preview,
    stylised,
    tutorial,
)
from .image import find, pick, render
from .volume import edit_volume, framing, image_fit, mappings, surface_tools, surfaces, volume_tools

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
    image_fit,
    preview,
    cycles,
    stylised,
    tutorial,
)


def register():
    for module in MODULES:
        module.register()


def unregister():
    for module in reversed(MODULES):
        module.unregister()
