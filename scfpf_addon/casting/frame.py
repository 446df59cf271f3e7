# SPDX-License-Identifier: GPL-3.0-or-later
"""Casting a whole image in tiles on all cores."""

from __future__ import annotations

import os
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, ThreadPoolExecutor, wait

import numpy as np

from ..projection.typing import Array
from ..projection.volume import Projection
from .cast import cast
from .hits import CastCounts, Hits
from .scene import CastError, CastScene

# Pixels in a tile: enough for NumPy to forget its overhead, few enough for the
# arrays of one tile to stay in a core's cache.
TILE_PIXELS = 65536

# How often the calling thread asks whether it should stop, in seconds.
POLL = 0.05


def image_tiles(width: int, height: int) -> list[tuple[int, int]]:
    """The image as bands of whole rows, (first row, row after the last), bottom first.

    They depend on the image's size alone: projectors share their chords within a
    tile, so the same image comes out whatever the number of threads.
    Raises CastError for an image without pixels.
    """
    if width < 1 or height < 1:
        raise CastError(f"an image of {width} × {height} pixels cannot be cast")
    rows = max(1, TILE_PIXELS // width)
    return [(row, min(row + rows, height)) for row in range(0, height, rows)]


def pixel_centres(width: int, height: int, rows: tuple[int, int]) -> tuple[Array, Array]:
    """x and y in [0, 1] of the pixels' centres in a band of rows, each (N,), row by row."""
    first, last = rows
    x = np.tile((np.arange(width) + 0.5) / width, last - first)
    y = np.repeat((np.arange(first, last) + 0.5) / height, width)
    return x, y


def thread_count(threads: int = 0) -> int:
    """``threads``, or for 0 the number of cores that this process may use."""
    if threads > 0:
        return threads
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


def cast_frame(
    scene: CastScene,
    projection: Projection,
    width: int,
    height: int,
    pixel_error: float = 0.1,
    threads: int = 0,
    cancelled: Callable[[], bool] | None = None,
    counts: CastCounts | None = None,
) -> Hits | None:
    """Cast a projector through every pixel's centre.

    projection: in world space. Returns hits in image order (row 0 at the bottom,
    pixel (i, j) at index j·width + i), or None when ``cancelled`` (asked from the
    calling thread) answered True. threads: 0 for all cores; they have ended when
    this returns. Memory: 117 bytes a pixel, and some 20 MB a thread.
    Raises CastError for an image without pixels or a bad pixel error.
    """
    tiles = image_tiles(width, height)
    inside = projection.transformed(scene.matrix)
    size = (1.0 / width, 1.0 / height)
    frame = Hits.empty(width * height)

    def run(rows: tuple[int, int]) -> CastCounts:
        own = CastCounts()
        x, y = pixel_centres(width, height, rows)
        tile = cast(scene, inside, x, y, size, pixel_error, own, width)
        frame.put(slice(rows[0] * width, rows[1] * width), tile)
        return own

    with ThreadPoolExecutor(thread_count(threads)) as pool:
        waiting = {pool.submit(run, rows) for rows in tiles}
        while waiting:
            done, waiting = wait(waiting, POLL, FIRST_COMPLETED)
            stop = cancelled is not None and cancelled()
            if stop or any(f.exception() for f in done):
                for future in waiting:
                    future.cancel()
            for future in done:
                own = future.result()
                if counts is not None:
                    counts.add(own)
            if stop:
                return None
    return frame
