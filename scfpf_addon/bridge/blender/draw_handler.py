# SPDX-License-Identifier: GPL-3.0-or-later
"""Functions that draw in an editor."""

from __future__ import annotations

from collections.abc import Callable


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
