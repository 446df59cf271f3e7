# SPDX-License-Identifier: GPL-3.0-or-later
"""Background tasks: work on arrays in a thread of its own, while Blender answers its user."""

from __future__ import annotations

import threading
from collections.abc import Callable
from typing import Generic, TypeVar

from ...projection.user_error import UserError

Result = TypeVar("Result")

NO_THREAD = "The system starts no more threads: close other programs, or restart Blender, and render again"


class Task(Generic[Result]):
    """Work that a thread does once. Blender's main thread calls the methods; ``work`` sees arrays only.

    progress: the share of the work that is done, 0 to 1; ``work`` sets it. cancellation: the signal that
    ``cancel`` sets. ``work`` looks at it, or casts rays within ``cancelled_by(task.cancellation)``.
    """

    def __init__(self, work: Callable[[Task[Result]], Result], name: str) -> None:
        """work: a function of this task. name: of the thread."""
        self.progress = 0.0
        self.cancellation = threading.Event()
        self._result: Result | None = None
        self._error: BaseException | None = None
        self._work: Callable[[Task[Result]], Result] | None = work
        self._thread = threading.Thread(target=self.run, name=name)

    def run(self) -> None:
        """Do the work in the caller's thread instead of ``start``. Its exception waits for ``result``."""
        assert self._work is not None, "work is done once"
        # Afterwards nothing here holds what the work refers to.
        work, self._work = self._work, None
        try:
            self._result = work(self)
        except BaseException as error:  # A thread has nowhere to raise.
            self._error = error

    def start(self) -> None:
        """Start the thread and return at once. Raises UserError if the system starts no thread."""
        try:
            self._thread.start()
        except RuntimeError as error:  # "can't start new thread"
            raise UserError(NO_THREAD) from error

    @property
    def running(self) -> bool:
        """Return whether the thread is still at work."""
        return self._thread.is_alive()

    @property
    def cancelled(self) -> bool:
        """Return whether ``cancel`` was called; the thread may still be finishing a tile."""
        return self.cancellation.is_set()

    def cancel(self) -> None:
        """Cancel the work and return at once."""
        self.cancellation.set()

    def wait(self) -> None:
        """Wait for the thread to end; return at once if none was started."""
        if self._thread.ident is not None:
            self._thread.join()

    def result(self) -> Result | None:
        """Wait for the thread and return the result, None if cancelled. Raises the work's exception once."""
        self.wait()
        error, self._error = self._error, None
        try:
            if error is not None:
                raise error
        finally:
            # The exception refers to this call: together they would hold all arrays of the work.
            del error
        return None if self.cancelled else self._result
