# SPDX-License-Identifier: GPL-3.0-or-later
"""The arithmetic of a solve apart from Blender's data, so that a thread can do it while a user watches.

A solve is a generator: it reads and writes Blender's data between its yields, and each yield hands out work
on arrays, whose result is sent back.
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Generator
from typing import Any, NamedTuple

from ...casting.common.cancellation import Cancelled, cancelled_by


class Progress:
    """How much of some work is done, as a share, and whether it is cancelled."""

    def __init__(self) -> None:
        self.share = 0.0
        self._cancelled = threading.Event()

    def cancel(self) -> None:
        """End the work at its next step or rays."""
        self._cancelled.set()

    def is_set(self) -> bool:
        """Whether the work is cancelled."""
        return self._cancelled.is_set()


class Work(NamedTuple):
    """Work on arrays. first, size: its part of the whole solve, as shares."""

    do: Callable[[Progress], Any]
    first: float = 0.0
    size: float = 1.0


# Ends with the line to report.
Steps = Generator[Work, Any, str]


def run_through(steps: Steps) -> str:
    """Do all work of a solve in this thread; return the line to report. Raises what it raises."""
    try:
        work = next(steps)
        while True:
            try:
                result = work.do(Progress())
            except Exception as error:
                work = steps.throw(error)
            else:
                work = steps.send(result)
    except StopIteration as end:
        return str(end.value)


class WatchedSolve:
    """A solve whose work a thread does. Every method belongs to Blender's main thread."""

    def __init__(self, steps: Steps) -> None:
        """Read what the first work needs and start it. Raises what the solve raises."""
        self._steps, self._progress = steps, Progress()
        self.message = ""
        self._begin(next(steps))

    def _begin(self, work: Work) -> None:
        self._work, self._result, self._error = work, None, None
        self._progress.share = 0.0
        self._thread = threading.Thread(target=self._run, name="SCFPF aim")
        try:
            self._thread.start()
        except RuntimeError:  # "can't start new thread"
            self._run()

    def _run(self) -> None:
        try:
            with cancelled_by(self._progress):
                self._result = self._work.do(self._progress)
        except BaseException as error:  # A thread has nowhere to raise: ``is_done`` does it.
            self._error = error

    @property
    def share(self) -> float:
        """How much of the whole solve is done."""
        return self._work.first + self._work.size * self._progress.share

    def is_done(self) -> bool:
        """Go on if the present work has ended. True when all is done and written, with ``message``.

        Raises what the solve raises.
        """
        if self._thread.is_alive():
            return False
        error, result = self._error, self._result
        try:
            self._begin(self._steps.send(result) if error is None else self._steps.throw(error))
        except StopIteration as end:
            self.message = str(end.value)
            return True
        return False

    def cancel(self) -> None:
        """Leave everything as it was. The thread, which sees arrays only, ends at its next step or rays."""
        self._progress.cancel()
        self._steps.close()


def require_wanted(progress: Progress) -> None:
    """Raise Cancelled if work is cancelled."""
    if progress.is_set():
        raise Cancelled
