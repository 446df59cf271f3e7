# SPDX-License-Identifier: GPL-3.0-or-later
"""A frame, from the projection and the scene to pixels: the pipeline of the whole program."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import NamedTuple

import numpy as np

from ..casting.cast import cast
from ..casting.culling import within_volume
from ..casting.hits import CastCounts, Hits
from ..casting.memory import peak_memory
from ..casting.scene import CastScene
from ..casting.tiles import TileJob, image_tiles, run_tiles
from ..projection.folds import find_folds
from ..projection.typing import Array, IndexArray
from ..projection.volume import Projection
from .film import Film, pixel_positions
from .lighting import Lamp, radiance
from .report import RenderReport
from .scene import Scene
from .surface import PhongTable, SurfaceTable
from .typing import Single


@dataclass(frozen=True)
class FrameSettings:
    """width, height: pixels. samples: a pixel. pixel_error: by which a chord may leave its
    projector, in pixels, 0 for none. transparent: what hits nothing is see-through.
    threads: 0 for all cores. Raises ValueError for what makes no picture.
    """

    width: int
    height: int
    samples: int = 4
    pixel_error: float = 0.1
    transparent: bool = False
    threads: int = 0

    def __post_init__(self) -> None:
        if min(self.width, self.height) < 1:
            size = f"{self.width} × {self.height}"
            raise ValueError(f"an image of {size} pixels cannot be made: raise the resolution")
        if self.samples < 1:
            raise ValueError("a pixel needs at least one sample")


class Frame(NamedTuple):
    """A picture. pixels: (H, W, 4) float32, scene-linear, premultiplied by alpha, row 0 at the bottom."""

    pixels: Single
    report: RenderReport


def render_frame(
    projection: Projection,
    scene: Scene,
    settings: FrameSettings,
    cast_scene: CastScene | None = None,
    progress: Callable[[float], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
    on_tile: Callable[[slice, Single], None] | None = None,
) -> Frame | None:
    """The picture that a projection makes of a scene, or None when cancelled.

    projection: in world space. cast_scene: made of the scene's triangles before, to
    save building it again. progress(share in [0, 1]), cancelled() and on_tile(rows,
    pixels (rows, W, 4)) are called from the calling thread, the last as tiles are finished, in
    any order. What a tile raises is raised here, after all threads have ended.
    CastError when the scene's triangles cannot be cast at; a scene without any
    shows its background.
    """
    started = perf_counter()
    pipeline = Pipeline.of(projection, scene, settings, cast_scene)
    build_seconds = perf_counter() - started
    pixels = np.empty((settings.height, settings.width, 4), np.float32)
    counts, hits = CastCounts(), 0

    def render(job: TileJob) -> TileCounts:
        return pipeline.render_tile(job, pixels[job.rows].reshape(-1, 4))

    def finished(rows: slice, tile: TileCounts) -> None:
        nonlocal hits
        counts.add(tile.cast)
        hits += tile.hits
        if on_tile:
            on_tile(rows, pixels[rows])

    tiles = image_tiles(settings.width, settings.height)
    if not run_tiles(render, tiles, settings.threads, finished, progress, cancelled):
        return None
    folds = find_folds(projection)
    report = RenderReport(
        settings.width,
        settings.height,
        perf_counter() - started,
        build_seconds,
        len(projection.volume.surfaces) == 2,
        counts.projectors,
        counts.rays,
        counts.chords,
        hits / counts.projectors if counts.projectors else 0.0,
        counts.error_bound,
        folds.share,
        folds.mirrored,
        settings.pixel_error == 0.0 and projection.volume.spans.point_weights is None,
        counts.tested,
        len(scene.geometry.triangles),
        len(pipeline.cast_scene.triangles) if pipeline.cast_scene else 0,
        peak_memory(),
    )
    return Frame(pixels, report)


class TileCounts(NamedTuple):
    """What a tile did: the casting's counts, and how many projectors hit the scene."""

    cast: CastCounts
    hits: int


@dataclass(frozen=True)
class Shading:
    """All that colours a hit: lookup tables, and lamps in cast space."""

    surface: SurfaceTable
    phong: PhongTable
    lamps: tuple[Lamp, ...]

    @classmethod
    def of(cls, scene: Scene, cast_scene: CastScene, samples: int) -> Shading:
        """Prepared for frames of ``samples`` samples. Lights without power are left out."""
        lights = [light for light in scene.lights if np.any(light.color)]
        shadows = any(light.casts_shadow for light in lights)
        return cls(
            SurfaceTable.of(scene.geometry, cast_scene, shadows),
            PhongTable.of(scene.materials, scene.world_color),
            tuple(Lamp.of(light, cast_scene.matrix, samples) for light in lights),
        )

    def color(self, hits: Hits, where: IndexArray, sample: int) -> Single:
        """Radiance towards the viewer of the hits at ``where`` (n,), (3, n)."""
        triangle, barycentric, position, tangent = hits[1:5]
        if len(where) < len(triangle):
            triangle, barycentric = triangle.take(where), barycentric.take(where, axis=1)
            position, tangent = position.take(where, axis=1), tangent.take(where, axis=1)
        points = self.surface.points(triangle, barycentric, position, tangent)
        return radiance(points, self.phong, self.lamps, sample, self.surface.cast_scene)


@dataclass(frozen=True)
class Pipeline:
    """What the threads share while a frame is made.

    projection: in cast space. offsets: (2, samples), where in a pixel. cast_scene and
    shading are None where there is nothing to hit.
    """

    projection: Projection
    settings: FrameSettings
    background: Array
    offsets: Array
    cast_scene: CastScene | None
    shading: Shading | None

    @classmethod
    def of(
        cls, projection: Projection, scene: Scene, settings: FrameSettings, cast_scene: CastScene | None
    ) -> Pipeline:
        """Everything that is done once a frame. What the volume cannot meet is left for shadows."""
        if cast_scene is None and len(scene.geometry.triangles):
            whole = scene.geometry
            kept = within_volume(whole.vertices, whole.triangles, projection.volume)
            if kept.all():
                cast_scene = CastScene(whole.vertices, whole.triangles)
            elif kept.any():
                beyond = whole.vertices, whole.triangles[~kept]
                scene = replace(scene, geometry=whole.part(kept))
                cast_scene = CastScene(scene.geometry.vertices, scene.geometry.triangles, beyond)
        return cls(
            projection.transformed(cast_scene.matrix) if cast_scene else projection,
            settings,
            np.asarray(scene.world_color, np.float64),
            pixel_positions(settings.samples),
            cast_scene,
            Shading.of(scene, cast_scene, settings.samples) if cast_scene else None,
        )

    def render_tile(self, job: TileJob, pixels: Single) -> TileCounts:
        """Samples → projectors → hits → colours → film, into pixels (n, 4).

        Gives up between two samples when the job is to stop.
        """
        counts, hit_count = CastCounts(), 0
        film = Film(len(pixels), self.background, self.settings.transparent)
        for sample in range(self.settings.samples):
            if job.stop.is_set():
                break
            hits = self.cast(*self.image_positions(job.rows, sample), counts)
            where = np.flatnonzero(hits.triangle >= 0)
            color = self.shading.color(hits, where, sample) if self.shading else np.zeros((3, 0), np.float32)
            film.add(hits.mask, where, color)
            hit_count += len(where)
            job.done = (sample + 1) / self.settings.samples
        else:
            film.develop(pixels)
        return TileCounts(counts, hit_count)

    def image_positions(self, rows: slice, sample: int) -> tuple[Array, Array]:
        """Image positions (x, y) of one sample of each pixel in the rows, row by row, each (n,)."""
        x = (np.arange(self.settings.width) + self.offsets[0, sample]) / self.settings.width
        y = (np.arange(rows.start, rows.stop) + self.offsets[1, sample]) / self.settings.height
        return np.tile(x, len(y)), np.repeat(y, len(x))

    def cast(self, x: Array, y: Array, counts: CastCounts) -> Hits:
        """The hits of the projectors at image positions (n,); nothing is hit where nothing is there."""
        if self.cast_scene is None:
            return Hits.empty(len(x))._replace(mask=self.projection.projectors(x, y).valid)
        pixel_size = (1 / self.settings.width, 1 / self.settings.height)
        return cast(
            self.cast_scene,
            self.projection,
            x,
            y,
            pixel_size,
            self.settings.pixel_error,
            counts,
            self.settings.width,
            self.shading is None or self.shading.surface.weighted,
        )
