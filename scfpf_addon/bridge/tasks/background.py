# SPDX-License-Identifier: GPL-3.0-or-later
"""Background work between steps that only Blender's main thread can take."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import Any, NamedTuple, TypeVar

from ...casting.common.cancellation import cancelled_by
from .task import Task

Result = TypeVar("Result")


class AwaitedWork(NamedTuple):
    """A task that is to be done before the next step. text: its name in the status bar."""

    text: str
    task: Task[Any]


def in_background(text: str, work: Callable[[Task[Result]], Result]) -> Generator[AwaitedWork, None, Result]:
    """Yield work for the caller to do, in a thread or at once (``Task.run``); return its result.

    work: a function of its task, on arrays only, which ends early if that is cancelled. Raises its
    exceptions.
    """

    def watched(task: Task[Result]) -> Result:
        with cancelled_by(task.cancellation):
            return work(task)

    task = Task(watched, "SCFPF work between renders")
    yield AwaitedWork(text, task)
    result = task.result()
    # A caller that cancels the work closes the iterator.
    assert result is not None
    return result
