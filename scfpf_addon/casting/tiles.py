# SPDX-License-Identifier: GPL-3.0-or-later
"""Tiles of an image, and threads that work on them."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from itertools import pairwise
from queue import Empty, SimpleQueue
from threading import Event
from typing import TypeVar

from .common.cancellation import cancelled_by, raise_if_cancelled
from .common.hits import CastError
from .common.parallel import started, thread_count

Result = TypeVar("Result")

# Pixels in a tile: enough for NumPy's overhead not to matter (curved casting takes a tenth less time than
# with two thirds of them), few enough for all cores to have work to the end and for the
# arrays of one tile to stay in a core's cache.
TILE_PIXELS = 3 << 15

# An image is cut into at least this many tiles, if it has so many rows, so that all cores work.
FEWEST_TILES = 16

# But pixels of smaller tiles take twice the time: NumPy's overhead is all of it, which no thread shares.
FEWEST_PIXELS = 1 << 10

# Seconds between two checks of the threads' progress and of cancellation.
POLL_SECONDS = 0.05


@dataclass
class TileJob:
    """A tile as the thread that works on it sees it.

    rows: of the image. done: share of the tile, in [0, 1], that the thread may raise as it goes.
    """

    rows: slice
    done: float = 0.0


def image_tiles(width: int, height: int) -> list[slice]:
    """The tiles of an image: bands of whole rows, bottom to top.

    They depend on the image's size alone. Projectors share their chords within a
    tile, so the result does not depend on the number of threads.
    Raises CastError for an image without pixels.
    """
    if width < 1 or height < 1:
        raise CastError("an image of {0} × {1} pixels cannot be cast", width, height)
    enough = max(-(-height // FEWEST_TILES), FEWEST_PIXELS // width)
    most = max(1, min(TILE_PIXELS // width, enough))
    count = -(-height // most)
    bounds = [height * k // count for k in range(count + 1)]
    return [slice(start, end) for start, end in pairwise(bounds)]


def run_tiles(
    work: Callable[[TileJob], Result],
    tiles: list[slice],
    threads: int,
    finished: Callable[[slice, Result], None],
    progress: Callable[[float], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> bool:
    """Do the work of all tiles in threads (0 for all cores); False if cancelled before the end.

    finished, progress(share of the rows, in [0, 1]) and cancelled are called in the
    calling thread. Exceptions of ``work`` are raised here. However this ends, work that is left
    has been cancelled, and all threads have ended. Raises Cancelled if the calling thread's work is
    cancelled, see ``cancelled_by``.
    """
    ends = Event()
    jobs = [TileJob(rows) for rows in tiles]
    height = sum(rows.stop - rows.start for rows in tiles)
    waiting: SimpleQueue[TileJob] = SimpleQueue()
    for job in jobs:
        waiting.put(job)
    # The result of each, or the exception of its work.
    ended: SimpleQueue[tuple[TileJob, list[Result], BaseException | None]] = SimpleQueue()

    def work_off(most: int = len(jobs)) -> None:
        """Take at most so many tiles, until all are taken or the work is to end."""
        for _ in range(most):
            try:
                job = waiting.get_nowait()
            except Empty:
                return
            if ends.is_set():
                return
            try:
                with cancelled_by(ends):
                    ended.put((job, [work(job)], None))
            except BaseException as error:  # A thread has nowhere to raise.
                ended.put((job, [], error))

    running = started(work_off, min(thread_count(threads), len(jobs)))
    left = len(jobs)
    try:
        while left:
            raise_if_cancelled()
            if cancelled and cancelled():
                return False
            if not running:
                work_off(1)
            for job, made, error in _taken(ended, POLL_SECONDS):
                if error is not None:
                    raise error
                finished(job.rows, made[0])
                job.done = 1.0
                left -= 1
            if progress:
                progress(sum(job.done * (job.rows.stop - job.rows.start) for job in jobs) / height)
    finally:
        ends.set()
        for thread in running:
            thread.join()
        # An exception that stayed here would hold its thread's scene, in a circle of references.
        for _ in _taken(ended, 0.0):
            pass
    return True


def _taken(queue: SimpleQueue[Result], seconds: float) -> Iterator[Result]:
    """All entries of a queue, after waiting at most so long for the first."""
    try:
        yield queue.get(timeout=seconds)
        while True:
            yield queue.get_nowait()
    except Empty:
        return
