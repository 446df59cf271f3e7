# SPDX-License-Identifier: GPL-3.0-or-later
"""Long arrays a portion at a time, in threads: what is made of a portion stays in a core's cache, and takes
no memory that the system would have to be asked for.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from queue import Empty, SimpleQueue
from threading import Thread
from typing import TypeVar

Result = TypeVar("Result")

# Vertices or triangles in a portion.
AT_ONCE = 1 << 15

# Portions below which one thread is done before others have begun.
WORTH_THREADS = 8


def thread_count(threads: int = 0) -> int:
    """``threads``, or for 0 the number of cores that this process may use."""
    if threads > 0:
        return threads
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def chunks(count: int) -> list[slice]:
    """So many things, AT_ONCE at a time."""
    return [slice(start, min(start + AT_ONCE, count)) for start in range(0, count, AT_ONCE)]


def started(work: Callable[[], None], count: int) -> list[Thread]:
    """Threads that do ``work``, ``count`` of them or as many as the system starts: perhaps none."""
    threads: list[Thread] = []
    for _ in range(count):
        thread = Thread(target=work, name="SCFPF work")
        try:
            thread.start()
        except RuntimeError:  # "can't start new thread"
            break
        threads.append(thread)
    return threads


def parallel_map(work: Callable[[slice], Result], parts: list[slice], threads: int = 0) -> list[Result]:
    """What ``work`` makes of each part, in their order, made in threads (0: all cores) that have ended.

    Each part must be written by its own work alone. What ``work`` raises is raised here; NumPy's
    errstate of the caller does not reach it. The caller's thread works where no other can be started.
    """
    if len(parts) < WORTH_THREADS:
        return [work(some) for some in parts]
    waiting: SimpleQueue[tuple[int, slice]] = SimpleQueue()
    for item in enumerate(parts):
        waiting.put(item)
    results: dict[int, Result] = {}
    errors: list[BaseException] = []

    def work_off() -> None:
        while not errors:
            try:
                number, some = waiting.get_nowait()
            except Empty:
                return
            try:
                results[number] = work(some)
            except BaseException as error:  # A thread has nowhere to raise.
                errors.append(error)

    running = started(work_off, min(thread_count(threads), len(parts)))
    if not running:
        work_off()
    for thread in running:
        thread.join()
    if errors:
        raise errors[0]
    return [results[number] for number in range(len(parts))]


def beside(work: Callable[[], None], other: Callable[[], Result]) -> Result:
    """Return the result of ``other`` while a thread does ``work``; one after the other if no thread starts.

    What either raises is raised here, once both have ended.
    """
    errors: list[BaseException] = []

    def run() -> None:
        try:
            work()
        except BaseException as error:  # A thread has nowhere to raise.
            errors.append(error)

    running = started(run, 1)
    if not running:
        run()
    try:
        result = other()
    finally:
        for thread in running:
            thread.join()
    if errors:
        raise errors[0]
    return result
