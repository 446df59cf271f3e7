# SPDX-License-Identifier: GPL-3.0-or-later
"""Modal jobs: operators that go on while events come, and end alike.

A job ends when it is finished, cancelled by Esc, refused, or stopped by a fault; when its window closes, a
file is opened or Blender quits; and when the extension is disabled, of which Blender tells no operator.
"""

from __future__ import annotations

from contextlib import ExitStack
from typing import NamedTuple

import bpy

from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from .errors import failed, refused

NOTHING_CHANGED = "Canceled: nothing was changed"
# What ``modal`` returns at the end holds one of these.
ENDS = {"FINISHED", "CANCELLED"}


class _Place(NamedTuple):
    """Addresses of the window, the area and the region that a job was called in, 0 if absent."""

    window: int
    area: int
    region: int


class ModalJob:
    """The base of a modal operator: its ``invoke`` prepares, calls ``begin`` and returns what that returns.

    ``tick``, ``escape`` and ``respond`` answer events and return what ``modal`` returns; they may raise.
    ``give_up`` or ``abandon`` takes back a job that is not finished. Every job then leaves: ``ends`` takes
    back its traces in Blender, such as timers, texts and handlers.

    seconds: between two ticks, 0 for none. escapes: the keys that cancel. canceled: the report if they do.
    cursor: of the mouse meanwhile, "" for the usual one.
    """

    seconds = 0.0
    escapes = frozenset({"ESC"})
    canceled = ""
    cursor = ""

    ends: ExitStack
    _is_inside = False

    def tick(self, _context) -> set[str]:
        """Respond to the timer."""
        return {"PASS_THROUGH"}

    def escape(self, _context) -> set[str]:
        """Respond to a key of ``escapes``."""
        if self.canceled:
            self.report({"INFO"}, self.canceled)
        return {"CANCELLED"}

    def respond(self, _context, _event) -> set[str]:
        """Respond to another event."""
        return {"RUNNING_MODAL"}

    def is_lost(self) -> bool:
        """Return whether the job works on something that is gone, which cancels it without a report."""
        return False

    def give_up(self, context) -> None:
        """Leave the file as it was, after Esc, an error, or as the extension is disabled."""

    def abandon(self, context) -> None:
        """Give up as the window closes, a file is opened or Blender quits.

        The scene cannot be evaluated meanwhile.
        """
        self.give_up(context)

    def begin(self, context) -> set[str]:
        """Go on with the events of the window; return what ``invoke`` returns."""
        self.ends, self._workspaces = ExitStack(), set()
        self._text, self._shows_share = "", False
        _running.append((self, _Place(*map(_address, (context.window, context.area, context.region)))))
        self.ends.callback(_forget, self)
        self.ends.callback(_clear_texts, self._workspaces)
        if self.seconds:
            timer = context.window_manager.event_timer_add(self.seconds, window=context.window)
            self.ends.callback(_remove_timer, timer)
        if self.cursor:
            context.window.cursor_modal_set(self.cursor)
            self.ends.callback(_restore_cursor)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def show(self, context, text: str, share: float | None = None) -> bool:
        """Show a text in the status bar, and a share at the pointer; return whether the text is new.

        share: of the work that is done, 0 to 1.
        """
        if share is not None:
            if not self._shows_share:
                self._shows_share = True
                context.window_manager.progress_begin(0.0, 1.0)
                self.ends.callback(_end_progress)
            context.window_manager.progress_update(share)
        if text == self._text or context.workspace is None:
            return False
        self._text = text
        context.workspace.status_text_set(text)
        self._workspaces.add(context.workspace.session_uid)
        return True

    def leave(self) -> None:
        """Take back the job's traces in Blender. Called at the end, or before by the job itself."""
        self.ends.close()

    def modal(self, context, event):
        if self._is_inside:
            # Blender sends events while a job opens a window.
            return {"PASS_THROUGH"}
        self._is_inside, outcome = True, {"CANCELLED"}
        try:
            outcome = self._answer(context, event)
        except USER_ERRORS as error:
            refused(self, error)
        except Exception as error:
            failed(self, error)
        finally:
            self._is_inside = False
            if outcome & ENDS:
                self._end(self.give_up if "CANCELLED" in outcome else None, context)
        return outcome

    def _answer(self, context, event) -> set[str]:
        if self.is_lost():
            return {"CANCELLED"}
        if event.type in self.escapes and event.value == "PRESS":
            return self.escape(context)
        return self.tick(context) if event.type == "TIMER" else self.respond(context, event)

    def _end(self, way_back, context) -> None:
        try:
            if way_back is not None:
                way_back(context)
        finally:
            self.leave()

    def cancel(self, context):
        """Called by Blender as the window closes, a file is opened or Blender quits.

        Blender also calls it as the dialog before a job is left, when there is nothing to end.
        """
        if any(job is self for job, _place in _running):
            self._end(self.abandon, context)

    def disable(self, context) -> None:
        """End the job as the extension is disabled. The file may be changed, other than in ``cancel``."""
        self._end(self.give_up, context)


# The jobs that run, and where they were called.
_running: list[tuple[ModalJob, _Place]] = []


def in_window(context) -> bool:
    """Return whether events can come while an operator waits."""
    return not bpy.app.background and context.window is not None


def is_running(cls: type[ModalJob]) -> bool:
    """Return whether a job of a class runs."""
    return any(isinstance(job, cls) for job, _place in _running)


def disable_all() -> None:
    """End all jobs as the extension is disabled, the latest first, where they were called."""
    while _running:
        job, place = _running.pop()
        with _override(place):
            job.disable(bpy.context)


def _address(found) -> int:
    return 0 if found is None else found.as_pointer()


def _override(place: _Place):
    """The context of a place, as far as it still exists."""
    windows = bpy.context.window_manager.windows
    window = next((w for w in windows if w.as_pointer() == place.window), None)
    if window is None:
        return bpy.context.temp_override()
    area = next((a for a in window.screen.areas if a.as_pointer() == place.area), None)
    region = next((r for r in area.regions if r.as_pointer() == place.region), None) if area else None
    found = {"window": window, "area": area, "region": region}
    return bpy.context.temp_override(**{name: one for name, one in found.items() if one is not None})


# The callbacks of ``ends``. They take the context of the end: none that an operator was given may be kept.


def _forget(job: ModalJob) -> None:
    _running[:] = [one for one in _running if one[0] is not job]


def _clear_texts(workspaces: set[int]) -> None:
    for workspace in bpy.data.workspaces:
        if workspace.session_uid in workspaces:
            workspace.status_text_set(None)


def _remove_timer(timer) -> None:
    bpy.context.window_manager.event_timer_remove(timer)


def _restore_cursor() -> None:
    if bpy.context.window is not None:
        bpy.context.window.cursor_modal_restore()


def _end_progress() -> None:
    bpy.context.window_manager.progress_end()
