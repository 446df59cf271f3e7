# SPDX-License-Identifier: GPL-3.0-or-later
"""A frame, from the projection and the scene to pixels and a report: tiles in threads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import NamedTuple

import numpy as np

from ..casting.common.cancellation import Cancelled, cancelled_by
from ..casting.common.hits import CastCounts
from ..casting.common.memory import peak_memory
from ..casting.scene.cast_scene import CastScene
from ..casting.tiles import TileJob, image_tiles, run_tiles
from ..projection.volume.folds import find_folds
from ..projection.volume.viewing_volume import Projection
from .passes.data_passes import empty_passes
from .pipeline import Pipeline, TileCounts
from .report import RenderReport
from .scene.motion import Moment
from .scene.shading_scene import Scene
from .settings.frame_settings import FrameSettings
from .typing import Single


class Frame(NamedTuple):
    """A picture. pixels: (H, W, 4) float32, scene-linear, premultiplied by alpha, row 0 at the bottom.
    passes: by name, each (H, W, channels) float32.
    """

    pixels: Single
    report: RenderReport
    passes: dict[str, Single]


@dataclass(frozen=True)
class Asking:
    """A signal that asks the caller of a render."""

    cancelled: Callable[[], bool] | None

    def is_set(self) -> bool:
        """Whether the render is to end."""
        return self.cancelled is not None and self.cancelled()


def render_frame(
    projection: Projection,
    scene: Scene,
    settings: FrameSettings,
    cast_scene: CastScene | None = None,
    progress: Callable[[float], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
    on_tile: Callable[[slice, Single, dict[str, Single]], None] | None = None,
    moments: tuple[Moment, ...] = (),
    keep: bool = True,
    pixels: Single | None = None,
) -> Frame | None:
    """The picture that a projection makes of a scene, or None when cancelled.

    projection: in world space. cast_scene: made of the scene's triangles before, to save building it again.
    progress(share in [0, 1]), cancelled() and on_tile(rows, pixels (rows, W, 4), passes) are called from the
    calling thread, the last as tiles are finished, in any order; rows count from the border's bottom. What a
    tile raises is raised here, after all threads have ended. moments: what the samples see while the shutter
    is open, instead of the projection and the scene, which data passes are made of. keep: without, the frame
    has no rows: what on_tile was given is all that there is. pixels: the border's (H, W, 4), to be the
    frame's own: tiles appear in it as they are finished. CastError when the scene's triangles cannot be cast
    at; a scene without any shows its background.
    """
    started = perf_counter()
    pipeline = _prepared(projection, scene, settings, cast_scene, cancelled, moments)
    if pipeline is None:
        return None
    build_seconds = perf_counter() - started
    region = settings.region
    height, width = region.top - region.bottom, region.right - region.left
    if pixels is None:
        pixels = np.empty((height if keep else 0, width, 4), np.float32)
    passes = empty_passes(settings.passes, len(pixels), width)
    counts, hits = CastCounts(), 0
    tiles_made: dict[int, tuple[Single, dict[str, Single]]] = {}

    def made(rows: slice) -> slice:
        """The rows of a tile that are in the border, counted from its bottom."""
        return slice(
            max(rows.start, region.bottom) - region.bottom, min(rows.stop, region.top) - region.bottom
        )

    def place(rows: slice) -> tuple[Single, dict[str, Single]]:
        """Where the pixels and passes of a tile are written."""
        own = made(rows)
        if keep:
            return pixels[own], {name: values[own] for name, values in passes.items()}
        count = own.stop - own.start
        return np.empty((count, width, 4), np.float32), empty_passes(settings.passes, count, width)

    def render(job: TileJob) -> TileCounts:
        """Make a tile, in a thread."""
        tile, data = tiles_made[job.rows.start] = place(job.rows)
        flat = {name: values.reshape(-1, values.shape[2]) for name, values in data.items()}
        return pipeline.render_tile(job, tile.reshape(-1, 4), flat)

    def finished(rows: slice, tile: TileCounts) -> None:
        """Count what a tile did and hand it on, in the calling thread."""
        nonlocal hits
        counts.add(tile.cast)
        hits += tile.hits
        written = tiles_made.pop(rows.start)
        if on_tile:
            on_tile(made(rows), *written)

    # Tiles are whole rows of the whole image whatever the border: their projectors share chords.
    tiles = [
        rows
        for rows in image_tiles(settings.width, settings.height)
        if rows.stop > region.bottom and rows.start < region.top
    ]
    if not run_tiles(render, tiles, settings.threads, finished, progress, cancelled):
        return None
    report = report_of(projection, scene, pipeline, counts, hits)
    return Frame(
        pixels, replace(report, seconds=perf_counter() - started, build_seconds=build_seconds), passes
    )


def _prepared(
    projection: Projection,
    scene: Scene,
    settings: FrameSettings,
    cast_scene: CastScene | None,
    cancelled: Callable[[], bool] | None,
    moments: tuple[Moment, ...],
) -> Pipeline | None:
    """The pipeline, None when cancelled on the way. As for ``render_frame``."""
    # Vertices of other frames belong to all triangles; a lens sees past the volume's sides.
    alone = not moments and settings.passes.neighbours is None and settings.depth_of_field is None
    try:
        with cancelled_by(Asking(cancelled)):
            pipeline = Pipeline.of(projection, scene, settings, cast_scene, alone)
            return pipeline.with_moments(scene, moments) if moments else pipeline
    except Cancelled:
        return None


def report_of(
    projection: Projection, scene: Scene, pipeline: Pipeline, counts: CastCounts, hits: int
) -> RenderReport:
    """What is said of a frame but the time that it took. projection: in world space."""
    folds = find_folds(projection)
    settings = pipeline.settings
    return RenderReport(
        settings.width,
        settings.height,
        0.0,
        0.0,
        len(projection.volume.surfaces) == 2,
        counts.projectors,
        counts.rays,
        counts.chords,
        hits / counts.projectors if counts.projectors else 0.0,
        counts.error_bound,
        folds.share,
        folds.mirrored,
        settings.pixel_error == 0.0,
        counts.tested,
        len(scene.geometry.triangles),
        len(pipeline.cast_scene.triangles) if pipeline.cast_scene else 0,
        peak_memory(),
    )
