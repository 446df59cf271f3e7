# SPDX-License-Identifier: GPL-3.0-or-later
"""The arithmetic of a solve apart from Blender's data, so that a thread can do it while a user watches.

A solve is a generator: it reads and writes Blender's data between its yields, and each yield hands out work
on arrays, whose result is sent back.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from functools import partial
from typing import Any, NamedTuple

from ...casting.common.cancellation import cancelled_by
from ...projection.user_error import UserError
from ..tasks.task import Task


class Work(NamedTuple):
    """Work on arrays. first, size: its part of the whole solve, as shares."""

    do: Callable[[Task[Any]], Any]
    first: float = 0.0
    size: float = 1.0


# Ends with the line to report.
Steps = Generator[Work, Any, str]


def run_through(steps: Steps) -> str:
    """Do all work of a solve in this thread; return the line to report. Raises what it raises."""
    solve = WatchedSolve(steps, in_thread=False)
    while not solve.is_done():
        pass
    return solve.message


def _do(work: Work, task: Task[Any]) -> Any:
    with cancelled_by(task.cancellation):
        return work.do(task)


class WatchedSolve:
    """A solve whose work is done by tasks. Every method belongs to Blender's main thread."""

    def __init__(self, steps: Steps, in_thread: bool = True) -> None:
        """Read what the first work needs and start it. Raises what the solve raises."""
        self._steps, self._in_thread = steps, in_thread
        self.message = ""
        self._begin(next(steps))

    def _begin(self, work: Work) -> None:
        self._work, self.task = work, Task(partial(_do, work), "SCFPF aim")
        try:
            if self._in_thread:
                self.task.start()
                return
        except UserError:
            # The system starts no thread: Blender waits instead.
            pass
        self.task.run()

    @property
    def share(self) -> float:
        """The share of the whole solve that is done."""
        return self._work.first + self._work.size * self.task.progress

    def is_done(self) -> bool:
        """Go on if the present work has ended. True when all is done and written, with ``message``.

        Raises what the solve raises.
        """
        if self.task.running:
            return False
        try:
            self._begin(self._next_work())
        except StopIteration as end:
            self.message = str(end.value)
            return True
        return False

    def _next_work(self) -> Work:
        try:
            result = self.task.result()
        except BaseException as error:
            return self._steps.throw(error)
        return self._steps.send(result)

    def cancel(self) -> None:
        """Leave everything as it was. The thread, which sees arrays only, ends at its next step or rays."""
        self.task.cancel()
        self._steps.close()
