# SPDX-License-Identifier: GPL-3.0-or-later
"""Registration of handlers in ``bpy.app.handlers``, and of functions that draw in an editor.

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


class DrawHandler:
    """A function without arguments that draws in the main region of an editor.

    space: type of the editor, such as bpy.types.SpaceView3D. stage: "POST_VIEW" draws in world space,
    "POST_PIXEL" in pixels of the region.
    """

    def __init__(self, space: type, function: Callable, stage: str):
        self._space, self._function, self._stage = space, function, stage
        self._registered = None

    @property
    def is_registered(self) -> bool:
        return self._registered is not None

    def register(self) -> None:
        self._registered = self._space.draw_handler_add(self._function, (), "WINDOW", self._stage)

    def unregister(self) -> None:
        self._space.draw_handler_remove(self._registered, "WINDOW")
        self._registered = None
