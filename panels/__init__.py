# SPDX-License-Identifier: GPL-3.0-or-later
"""What the user sees: panels, lists and menus. They draw and decide nothing."""

from . import camera_panels, engine_panels, menus, preview, surface_list

# Registered in this order, unregistered in the reverse.
MODULES = (surface_list, menus, camera_panels, preview, engine_panels)


def register():
    for module in MODULES:
        module.register()


def unregister():
    for module in reversed(MODULES):
        module.unregister()
