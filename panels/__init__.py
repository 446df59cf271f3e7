# SPDX-License-Identifier: GPL-3.0-or-later
"""Panels, lists and menus. They draw, and leave decisions to operators and the bridge."""

from . import (
    aim,
    camera_panels,
    cycles,
    engine_panels,
    languages,
    layers,
    look_behind,
    mapping_stack,
    menus,
    messages,
    preset_menus,
    render_job,
    stylised,
    surface_list,
    thumbnails,
)

# Registered in this order, unregistered in the reverse.
MODULES = (
    thumbnails,
    surface_list,
    mapping_stack,
    preset_menus,
    menus,
    messages,
    camera_panels,
    aim,
    layers,
    look_behind,
    cycles,
    engine_panels,
    render_job,
    stylised,
    languages,
)


def register():
    for module in MODULES:
        module.register()


def unregister():
    for module in reversed(MODULES):
        module.unregister()
