# SPDX-License-Identifier: GPL-3.0-or-later
"""Long arrays in chunks, in threads.

The intermediate arrays of a chunk stay in a core's cache and reuse memory that the process already has.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from queue import Empty, SimpleQueue
from threading import Lock, Thread
from typing import Generic, TypeVar

Result = TypeVar("Result")

# Vertices or triangles in a chunk.
AT_ONCE = 1 << 15

# Fewer chunks than this are done in one thread before others have started.
WORTH_THREADS = 8


class AtFirstUse(Generic[Result]):
    """A value that is made when a thread first asks for it; other threads wait.

    make: called once, unless it raises an exception, which the caller gets. It must not refer to the object
    that keeps this one: Embree's memory would wait for the garbage collector.
    """

    def __init__(self, make: Callable[[], Result]) -> None:
        self._make: Callable[[], Result] | None = make
        self._lock = Lock()
        self._made: Result

    def get(self) -> Result:
        """Return the value."""
        if self._make is not None:
            with self._lock:
                if self._make is not None:
                    self._made = self._make()
                    self._make = None
        return self._made


def thread_count(threads: int = 0) -> int:
    """Return ``threads``, or for 0 the number of cores that this process may use."""
    if threads > 0:
        return threads
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def chunks(count: int) -> list[slice]:
    """Return slices of AT_ONCE that cover an array of length ``count``."""
    return [slice(start, min(start + AT_ONCE, count)) for start in range(0, count, AT_ONCE)]


def started(work: Callable[[], None], count: int) -> list[Thread]:
    """Start ``count`` threads that do ``work``, or as many as the system allows, perhaps none."""
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
    """Return the results of ``work`` on each part, in their order; the threads (0: one a core) have ended.

    Each part must be written by its own work alone. Exceptions of ``work`` are raised here; NumPy's
    errstate of the caller does not apply in it. The caller's thread works if no other can be started.
    """
    if len(parts) < WORTH_THREADS:
        return [work(some) for some in parts]
    waiting: SimpleQueue[tuple[int, slice]] = SimpleQueue()
    for item in enumerate(parts):
        waiting.put(item)
    results: dict[int, Result] = {}
    errors: list[BaseException] = []

    def work_off() -> None:
        """Take parts until all are taken or one has failed."""
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
    """Return the result of ``other`` while a thread does ``work``, or both in turn if no thread starts.

    Exceptions of either are raised here, once both have ended.
    """
    errors: list[BaseException] = []

    def run() -> None:
        """Do ``work`` and keep its exception."""
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
