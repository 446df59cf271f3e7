# SPDX-License-Identifier: GPL-3.0-or-later
"""Registration of handlers in ``bpy.app.handlers``.

Handlers are given as a dict from the name of a list in ``bpy.app.handlers`` to a persistent function.
"""

from __future__ import annotations

from collections.abc import Callable

import bpy


def add_handlers(handlers: dict[str, Callable], at_front: bool = False) -> None:
    """Register handlers. at_front: Blender then calls them before those that are registered already."""
    for name, function in handlers.items():
        registered = getattr(bpy.app.handlers, name)
        registered.insert(0 if at_front else len(registered), function)


def remove_handlers(handlers: dict[str, Callable]) -> None:
    """Remove handlers that ``add_handlers`` has registered."""
    for name, function in handlers.items():
        getattr(bpy.app.handlers, name).remove(function)
