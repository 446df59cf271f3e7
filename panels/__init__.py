# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user sees: panels, lists and menus. They draw and decide nothing."""

from . import (
    camera_panels,
    cycles,
    engine_panels,
    mapping_stack,
    menus,
    own_preset_menus,
    preview,
    stylised,
    surface_list,
    thumbnails,
)

# Registered in this order, unregistered in the reverse.
MODULES = (
    thumbnails,
    surface_list,
    mapping_stack,
    own_preset_menus,
    menus,
    camera_panels,
    preview,
    cycles,
    engine_panels,
    stylised,
)


def register():
    for module in MODULES:
        module.register()


def unregister():
    for module in reversed(MODULES):
        module.unregister()
