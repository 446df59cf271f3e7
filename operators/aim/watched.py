# SPDX-License-Identifier: GPL-3.0-or-later
"""Solve in a window: a thread computes, the status bar shows how far it is, and Esc cancels."""

from __future__ import annotations

import bpy

from ...scfpf_addon.bridge.aim.solve_work import Steps, WatchedSolve
from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid
from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from ..common import running
from ..common.errors import refused
from ..common.words import report_text
from ..image.preparation import redraw_interface

# Seconds between two looks at the thread.
TICK = 0.1


class Watched:
    """An operator that ends with a solve. Call ``begin``, and pass each event to ``watch`` from then on."""

    _solve: WatchedSolve | None = None

    def tell(self, camera, message: str) -> None:
        """Report the line of a solve of a camera, as a warning if something is wrong in its picture."""
        self.report({"WARNING" if camera.scfpf.aim.flaws else "INFO"}, message)

    def begin(self, context, steps: Steps, camera):
        """Start a solve of a camera; returns what invoke or modal returns."""
        self._solved = camera.session_uid
        try:
            self._solve = WatchedSolve(steps)
        except USER_ERRORS as error:
            return refused(self, error)
        self._ticks = context.window_manager.event_timer_add(TICK, window=context.window)
        self._tell(context)
        return {"RUNNING_MODAL"}

    def watch(self, context, event):
        """Respond to an event; returns what modal returns. Other input waits until the solve has ended."""
        if event.type == "ESC" and event.value == "PRESS":
            self.stop_solve(context)
            self.report({"INFO"}, "Solve canceled: the volume is as before")
            return {"CANCELLED"}
        if event.type != "TIMER":
            return {"RUNNING_MODAL"}
        try:
            if not self._solve.is_done():
                self._tell(context)
                return {"PASS_THROUGH"}
        except USER_ERRORS as error:
            self._leave(context)
            return refused(self, error)
        except BaseException:
            self._leave(context)
            raise
        self.tell(object_by_uid(self._solved), self._solve.message)
        self._leave(context)
        return {"FINISHED"}

    def stop_solve(self, context) -> None:
        """Cancel the solve; everything is as before."""
        self._solve.cancel()
        self._leave(context)

    def _tell(self, context) -> None:
        if context.workspace is not None:
            context.workspace.status_text_set(
                report_text("Aim: solving, {0:.0%}    Esc: cancel", self._solve.share)
            )

    def _leave(self, context) -> None:
        running.end(self)
        self._solve = None
        context.window_manager.event_timer_remove(self._ticks)
        if context.workspace is not None:
            context.workspace.status_text_set(None)
        redraw_interface(context.window_manager)


def in_window(context) -> bool:
    """Whether events can come while an operator waits."""
    return not bpy.app.background and context.window is not None
