# SPDX-License-Identifier: GPL-3.0-or-later
"""Solve in a window: a thread computes, the status bar shows how far it is, and Esc cancels."""

from __future__ import annotations

import bpy

from ...scfpf_addon.bridge.aim.solve_work import Steps, WatchedSolve
from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid
from ..common.modal_job import ModalJob
from ..common.words import report_text
from ..image.preparation import redraw_interface

CANCELED = "Solve canceled: the volume is as before"


class SolveJob(ModalJob):
    """A modal job that is a solve or ends with one."""

    # Between two looks at the thread.
    seconds = 0.1
    canceled = CANCELED

    _solve: WatchedSolve | None = None

    def tell(self, camera, message: str) -> None:
        """Report the line of a solve of a camera, as a warning if something is wrong in its picture."""
        self.report({"WARNING" if camera.scfpf.aim.flaws else "INFO"}, message)

    def begin_solve(self, steps: Steps, camera) -> None:
        """Start a solve of a camera. Raises USER_ERRORS."""
        self._solved = camera.session_uid
        self._solve = WatchedSolve(steps)

    def show_solve(self, context) -> None:
        """Show how far the solve is."""
        self.show(context, report_text("Aim: solving, {0:.0%}    Esc: cancel", self._solve.share))

    def tick(self, context):
        if not self._solve.is_done():
            self.show_solve(context)
            return {"PASS_THROUGH"}
        self.tell(object_by_uid(self._solved), self._solve.message)
        redraw_interface(bpy.context.window_manager)
        return {"FINISHED"}

    def give_up(self, _context):
        """Cancel the solve; everything is as before."""
        if self._solve is not None:
            self._solve.cancel()
        redraw_interface(bpy.context.window_manager)
