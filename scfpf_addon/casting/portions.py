# SPDX-License-Identifier: GPL-3.0-or-later
"""Long arrays a portion at a time, in threads: what is made of a portion stays in a core's cache, and takes
no memory that the system would have to be asked for.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
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


def portions(count: int) -> list[slice]:
    """So many things, AT_ONCE at a time."""
    return [slice(start, min(start + AT_ONCE, count)) for start in range(0, count, AT_ONCE)]


def in_threads(work: Callable[[slice], Result], parts: list[slice], threads: int = 0) -> list[Result]:
    """What ``work`` makes of each part, in their order, made in threads (0: all cores) that have ended.

    Each part must be written by its own work alone. What ``work`` raises is raised here; NumPy's
    errstate of the caller does not reach it.
    """
    if len(parts) < WORTH_THREADS:
        return [work(some) for some in parts]
    with ThreadPoolExecutor(thread_count(threads)) as pool:
        return list(pool.map(work, parts))
