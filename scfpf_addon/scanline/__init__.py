# SPDX-License-Identifier: GPL-3.0-or-later
"""The live preview: node groups that invert the viewing volume, Q⁻¹: scene → (x, y, depth)."""

from . import preview, preview_properties

# Registered in this order, unregistered in the reverse.
MODULES = (preview_properties, preview)


def register():
    for module in MODULES:
        module.register()


def unregister():
    for module in reversed(MODULES):
        module.unregister()
