# SPDX-License-Identifier: GPL-3.0-or-later
"""Casting a whole image, in tiles on all cores."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from ..projection.typing import Array
from ..projection.volume.viewing_volume import Projection
from .cast import cast
from .common.hits import CastCounts, Hits
from .scene.cast_scene import CastScene
from .tiles import TileJob, image_tiles, run_tiles


def pixel_centres(width: int, height: int, rows: tuple[int, int]) -> tuple[Array, Array]:
    """x and y in [0, 1] of the centres of pixels in a band of rows, each (N,), row by row."""
    first, last = rows
    x = np.tile((np.arange(width) + 0.5) / width, last - first)
    y = np.repeat((np.arange(first, last) + 0.5) / height, width)
    return x, y


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
    pixel (i, j) at index j·width + i), or None if ``cancelled``, called in the
    calling thread, returned True. threads: 0 for all cores; they have ended when
    this returns. Memory: 117 bytes a pixel and some 30 MB a thread.
    Raises CastError for an image without pixels or a bad pixel error.
    """
    tiles = image_tiles(width, height)
    inside = projection.transformed(scene.matrix)
    size = (1.0 / width, 1.0 / height)
    frame = Hits.empty(width * height)

    def run(job: TileJob) -> CastCounts:
        """Cast a tile into its rows of the frame."""
        own, rows = CastCounts(), job.rows
        x, y = pixel_centres(width, height, (rows.start, rows.stop))
        tile = cast(scene, inside, x, y, size, pixel_error, own, width)
        frame.put(slice(rows.start * width, rows.stop * width), tile)
        return own

    def finished(rows: slice, own: CastCounts) -> None:
        """Add up the counts of the tiles."""
        if counts is not None:
            counts.add(own)

    return frame if run_tiles(run, tiles, threads, finished, cancelled=cancelled) else None
