# SPDX-License-Identifier: GPL-3.0-or-later
"""A frame, from the projection and the scene to pixels and a report: tiles in threads."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import NamedTuple, TypeAlias

import numpy as np

from ..casting.common.cancellation import Cancelled, cancelled_by
from ..casting.common.hits import CastCounts
from ..casting.common.memory import peak_memory
from ..casting.scene.cast_scene import CastScene
from ..casting.tiles import TileJob, image_tiles, run_tiles
from ..projection.volume.folds import find_folds
from ..projection.volume.viewing_volume import Projection
from .passes.data_passes import empty_passes
from .pipeline import Pipeline
from .report import RenderReport
from .scene.motion import Moment
from .scene.shading_scene import Scene
from .settings.frame_settings import FrameSettings
from .tile_rendering import TileCounts, render_tile
from .typing import Single

# Pixels (rows, W, 4) and passes (rows, W, channels) of the part of a tile that is in the border.
Tile: TypeAlias = tuple[Single, dict[str, Single]]


class Frame(NamedTuple):
    """A finished image.

    pixels: (H, W, 4) float32, scene-linear, premultiplied by alpha, row 0 at the bottom. passes: by name,
    each (H, W, channels) float32.
    """

    pixels: Single
    report: RenderReport
    passes: dict[str, Single]


@dataclass(frozen=True)
class CallerSignal:
    """A signal that asks the caller of a render."""

    cancelled: Callable[[], bool] | None

    def is_set(self) -> bool:
        """Return whether the render is cancelled."""
        return self.cancelled is not None and self.cancelled()


@dataclass(frozen=True)
class FrameTiles:
    """The pixels and passes of a frame's border, and the parts of them that tiles fill in.

    pixels: (H, W, 4), of no rows where tiles have arrays of their own.
    """

    settings: FrameSettings
    pixels: Single
    passes: dict[str, Single]

    @classmethod
    def of(cls, settings: FrameSettings, keep: bool, pixels: Single | None) -> FrameTiles:
        """The empty frame; the parameters are those of ``render_frame``."""
        region = settings.region
        height, width = region.top - region.bottom, region.right - region.left
        if pixels is None:
            pixels = np.empty((height if keep else 0, width, 4), np.float32)
        return cls(settings, pixels, empty_passes(settings.passes, len(pixels), width))

    @property
    def rows(self) -> list[slice]:
        """The rows of all tiles that the border meets.

        Tiles are whole rows of the whole image whatever the border: their projectors share chords.
        """
        region, tiles = self.settings.region, image_tiles(self.settings.width, self.settings.height)
        return [rows for rows in tiles if rows.stop > region.bottom and rows.start < region.top]

    def in_border(self, rows: slice) -> slice:
        """The rows of a tile that are in the border, counted from its bottom."""
        region = self.settings.region
        start, stop = max(rows.start, region.bottom), min(rows.stop, region.top)
        return slice(start - region.bottom, stop - region.bottom)

    def tile(self, rows: slice) -> Tile:
        """The arrays of a tile, to be filled in."""
        own, width = self.in_border(rows), self.pixels.shape[1]
        if len(self.pixels):
            return self.pixels[own], {name: values[own] for name, values in self.passes.items()}
        count = own.stop - own.start
        return np.empty((count, width, 4), np.float32), empty_passes(self.settings.passes, count, width)


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
    """Render the image that a projection makes of a scene; None when cancelled.

    projection: in world space. cast_scene: made of the scene's triangles before, to save building it again.
    progress(share in [0, 1]), cancelled() and on_tile(rows, pixels (rows, W, 4), passes) are called from the
    calling thread, the last as tiles are finished, in any order; rows count from the border's bottom.
    moments: the scene and projection that samples see while the shutter is open; data passes show the
    others. keep: if False the frame has no rows, only on_tile gets pixels. pixels: the border's (H, W, 4),
    to be the frame's own: tiles appear in it as they are finished. Raises CastError for triangles that
    cannot be cast at, and the errors of tiles after all threads have ended. A scene without triangles shows
    its background.
    """
    started = perf_counter()
    try:
        with cancelled_by(CallerSignal(cancelled)):
            pipeline = Pipeline.of(projection, scene, settings, cast_scene, moments)
    except Cancelled:
        return None
    build_seconds = perf_counter() - started
    tiles = FrameTiles.of(settings, keep, pixels)
    counts, hits = CastCounts(), 0

    def render(job: TileJob) -> tuple[TileCounts, Tile]:
        """Render a tile, in a thread."""
        tile, data = tiles.tile(job.rows)
        flat = {name: values.reshape(-1, values.shape[2]) for name, values in data.items()}
        return render_tile(pipeline, job, tile.reshape(-1, 4), flat), (tile, data)

    def finished(rows: slice, made: tuple[TileCounts, Tile]) -> None:
        """Add a tile's counts and deliver it, in the calling thread."""
        nonlocal hits
        done, tile = made
        counts.add(done.cast)
        hits += done.hits
        if on_tile:
            on_tile(tiles.in_border(rows), *tile)

    if not run_tiles(render, tiles.rows, settings.threads, finished, progress, cancelled):
        return None
    report = report_of(projection, scene, pipeline, counts, hits)
    report = replace(report, seconds=perf_counter() - started, build_seconds=build_seconds)
    return Frame(tiles.pixels, report, tiles.passes)


def draw_over_frame(
    projection: Projection,
    scene: Scene,
    settings: FrameSettings,
    pixels: Single,
    progress: Callable[[float], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
) -> bool:
    """Draw the paper, hatching and lines of a style over a finished image; False when cancelled.

    projection: in world space. settings: of the whole image, with a style, whose fill the image is. pixels:
    (H, W, 4) float32, contiguous, premultiplied, row 0 at the bottom, changed in place. progress, cancelled,
    and what is raised: as for ``render_frame``.
    """
    try:
        with cancelled_by(CallerSignal(cancelled)):
            drawing = Pipeline.of(projection, scene, settings).drawing
    except Cancelled:
        return False
    assert drawing is not None and settings.border is None

    def draw(job: TileJob) -> None:
        """Draw over a tile, in a thread."""
        drawing.draw_over(job.rows, None, pixels[job.rows].reshape(-1, 4))

    tiles = image_tiles(settings.width, settings.height)
    return run_tiles(draw, tiles, settings.threads, lambda _rows, _made: None, progress, cancelled)


def report_of(
    projection: Projection, scene: Scene, pipeline: Pipeline, counts: CastCounts, hits: int
) -> RenderReport:
    """The report of a frame, without times. projection: in world space."""
    folds = find_folds(projection)
    settings, cast_scene = pipeline.settings, pipeline.view.cast_scene
    return RenderReport(
        width=settings.width,
        height=settings.height,
        seconds=0.0,
        build_seconds=0.0,
        straight=len(projection.volume.surfaces) == 2,
        projectors=counts.projectors,
        rays=counts.rays,
        chords=counts.chords,
        hit_fraction=hits / counts.projectors if counts.projectors else 0.0,
        error_bound=counts.error_bound,
        folded_share=folds.share,
        mirrored=folds.mirrored,
        exact=settings.pixel_error == 0.0,
        tests=counts.tested,
        triangles=len(scene.geometry.triangles),
        built=len(cast_scene.triangles) if cast_scene else 0,
        peak_memory=peak_memory(),
        shaded=pipeline.shaded / hits if hits else 0.0,
    )
