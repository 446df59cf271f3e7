# SPDX-License-Identifier: GPL-3.0-or-later
"""A frame, from the projection and the scene to pixels: the pipeline of the whole program."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from time import perf_counter
from typing import NamedTuple

import numpy as np

from ..casting.behind import Onward
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
from .passes import DataPasses, PassSource, Seen, empty_passes, fill_passes
from .report import RenderReport
from .scene import Scene
from .surface import PhongTable, SurfaceTable
from .tracing import Tracer
from .typing import Single


class Border(NamedTuple):
    """A rectangle of pixels, the ends not included."""

    left: int
    bottom: int
    right: int
    top: int


@dataclass(frozen=True)
class FrameSettings:
    """width, height: pixels. samples: a pixel. pixel_error: by which a chord may leave its
    projector, in pixels, 0 for none. transparent: what hits nothing is see-through.
    threads: 0 for all cores. border: the part of the image that is made; its pixels are those
    that the whole image would have. passes: besides the picture. Raises ValueError for what
    makes no picture.
    """

    width: int
    height: int
    samples: int = 4
    pixel_error: float = 0.1
    transparent: bool = False
    threads: int = 0
    border: Border | None = None
    passes: DataPasses = field(default_factory=DataPasses)

    def __post_init__(self) -> None:
        if min(self.width, self.height) < 1:
            size = f"{self.width} × {self.height}"
            raise ValueError(f"an image of {size} pixels cannot be made: raise the resolution")
        if self.samples < 1:
            raise ValueError("a pixel needs at least one sample")
        left, bottom, right, top = self.region
        if not (0 <= left < right <= self.width and 0 <= bottom < top <= self.height):
            raise ValueError("the border must lie in the image and hold at least one pixel")

    @property
    def region(self) -> Border:
        """The part of the image that is made."""
        return self.border or Border(0, 0, self.width, self.height)


class Frame(NamedTuple):
    """A picture. pixels: (H, W, 4) float32, scene-linear, premultiplied by alpha, row 0 at the bottom.
    passes: by name, each (H, W, channels) float32.
    """

    pixels: Single
    report: RenderReport
    passes: dict[str, Single]


def render_frame(
    projection: Projection,
    scene: Scene,
    settings: FrameSettings,
    cast_scene: CastScene | None = None,
    progress: Callable[[float], None] | None = None,
    cancelled: Callable[[], bool] | None = None,
    on_tile: Callable[[slice, Single, dict[str, Single]], None] | None = None,
) -> Frame | None:
    """The picture that a projection makes of a scene, or None when cancelled.

    projection: in world space. cast_scene: made of the scene's triangles before, to
    save building it again. progress(share in [0, 1]), cancelled() and on_tile(rows,
    pixels (rows, W, 4), passes) are called from the calling thread, the last as tiles are
    finished, in any order; rows count from the border's bottom. What a tile raises is raised
    here, after all threads have ended.
    CastError when the scene's triangles cannot be cast at; a scene without any
    shows its background.
    """
    started = perf_counter()
    pipeline = Pipeline.of(projection, scene, settings, cast_scene)
    build_seconds = perf_counter() - started
    region = settings.region
    height, width = region.top - region.bottom, region.right - region.left
    pixels = np.empty((height, width, 4), np.float32)
    passes = empty_passes(settings.passes, height, width)
    counts, hits = CastCounts(), 0

    def made(rows: slice) -> slice:
        """The rows of a tile that are in the border, counted from its bottom."""
        return slice(
            max(rows.start, region.bottom) - region.bottom, min(rows.stop, region.top) - region.bottom
        )

    def render(job: TileJob) -> TileCounts:
        own = made(job.rows)
        flat = {name: values[own].reshape(-1, values.shape[2]) for name, values in passes.items()}
        return pipeline.render_tile(job, pixels[own].reshape(-1, 4), flat)

    def finished(rows: slice, tile: TileCounts) -> None:
        nonlocal hits
        counts.add(tile.cast)
        hits += tile.hits
        if on_tile:
            own = made(rows)
            on_tile(own, pixels[own], {name: values[own] for name, values in passes.items()})

    # Tiles are whole rows of the whole image whatever the border: their projectors share chords.
    tiles = [
        rows
        for rows in image_tiles(settings.width, settings.height)
        if rows.stop > region.bottom and rows.start < region.top
    ]
    if not run_tiles(render, tiles, settings.threads, finished, progress, cancelled):
        return None
    folds = find_folds(projection)
    report = RenderReport(
        width,
        height,
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
    return Frame(pixels, report, passes)


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
    tracer: Tracer | None

    @classmethod
    def of(cls, scene: Scene, cast_scene: CastScene, settings: FrameSettings) -> Shading:
        """Prepared for frames of these settings. Lights without power are left out."""
        lights = [light for light in scene.lights if np.any(light.color)]
        shadows = any(light.casts_shadow for light in lights)
        surface = SurfaceTable.of(scene.geometry, cast_scene, shadows)
        phong = PhongTable.of(scene.materials, scene.world_color)
        lamps = tuple(Lamp.of(light, cast_scene.matrix, settings.samples) for light in lights)
        tracer = Tracer.of(scene, surface, phong, lamps, settings.transparent)
        return cls(surface, phong, lamps, tracer)

    def color(self, hits: Hits, where: IndexArray, sample: int, onward: Onward) -> Single:
        """Radiance towards the viewer of the hits at ``where`` (n,), (3, n), and alpha if not 1, (4, n).

        onward: follows the projectors of ``hits`` on.
        """
        if self.tracer is not None and self.tracer.needed(hits.triangle.take(where)):
            return self.tracer.color(hits.take(where), sample, onward.of(where))
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
    passes: PassSource | None

    @classmethod
    def of(
        cls, projection: Projection, scene: Scene, settings: FrameSettings, cast_scene: CastScene | None
    ) -> Pipeline:
        """Everything that is done once a frame. What the volume cannot meet is left for shadows."""
        if cast_scene is None and len(scene.geometry.triangles):
            whole = scene.geometry
            kept = within_volume(whole.vertices, whole.triangles, projection.volume)
            # Mirrors and glass show what lies beyond, too.
            if kept.all() or any(graph.reflects for graph in scene.materials.graphs.values()):
                cast_scene = CastScene(whole.vertices, whole.triangles)
            elif kept.any():
                beyond = whole.vertices, whole.triangles[~kept]
                scene = replace(scene, geometry=whole.part(kept))
                cast_scene = CastScene(scene.geometry.vertices, scene.geometry.triangles, beyond)
        inside = projection.transformed(cast_scene.matrix) if cast_scene else projection
        shading = Shading.of(scene, cast_scene, settings) if cast_scene else None
        return cls(
            inside,
            settings,
            np.asarray(scene.world_color, np.float64),
            pixel_positions(settings.samples),
            cast_scene,
            shading,
            PassSource(settings.passes, inside, scene, cast_scene, shading.surface)
            if cast_scene and shading and settings.passes.names
            else None,
        )

    def render_tile(self, job: TileJob, pixels: Single, passes: dict[str, Single]) -> TileCounts:
        """Samples → projectors → hits → colours → film, into pixels (n, 4) and passes (n, channels).

        Gives up between two steps of a sample when the job is to stop.
        """
        counts, hit_count = CastCounts(), 0
        inside = self.inside(job.rows)
        film = Film(len(pixels), self.background, self.settings.transparent)
        pixel_size, error = (1 / self.settings.width, 1 / self.settings.height), self.settings.pixel_error
        for sample in range(self.settings.samples):
            if job.stop.is_set():
                return TileCounts(counts, hit_count)
            x, y = self.image_positions(job.rows, self.offsets[:, sample])
            hits = self.cast(x, y, counts)
            mask = hits.mask
            hit_count += int(np.count_nonzero(hits.triangle >= 0))
            if job.stop.is_set():
                return TileCounts(counts, hit_count)
            if inside is not None:
                hits = hits.take(inside)
            where = np.flatnonzero(hits.triangle >= 0)
            color = np.zeros((3, 0), np.float32)
            if self.shading:
                scene = self.shading.surface.cast_scene
                onward = Onward(scene, self.projection, x, y, mask, inside, pixel_size, error)
                color = self.shading.color(hits, where, sample, onward)
            film.add(hits.mask, where, color)
            job.done = (sample + 1) / self.settings.samples
        film.develop(pixels)
        if self.passes and not job.stop.is_set():
            self.fill_passes(self.passes, job.rows, inside, passes)
        return TileCounts(counts, hit_count)

    def fill_passes(
        self, source: PassSource, rows: slice, inside: IndexArray | None, into: dict[str, Single]
    ) -> None:
        """The data passes of a tile, from one projector a pixel, which the report does not count."""
        x, y = self.image_positions(rows, np.array([0.5, 0.5]))
        hits = self.cast(x, y, CastCounts(), "UV" in self.settings.passes.names)
        if inside is not None:
            hits, x, y = hits.take(inside), x[inside], y[inside]
        where = np.flatnonzero(hits.triangle >= 0)
        fill_passes(source, Seen(x[where], y[where], hits.take(where)), where, into)

    def inside(self, rows: slice) -> IndexArray | None:
        """Which pixels of the rows are in the border, row by row; None for all."""
        left, bottom, right, top = self.settings.region
        width = self.settings.width
        first, last = max(rows.start, bottom), min(rows.stop, top)
        if (first, last, left, right) == (rows.start, rows.stop, 0, width):
            return None
        lines = np.arange(first - rows.start, last - rows.start)
        columns = np.arange(left, right)
        return (lines[:, None] * width + columns).reshape(-1)

    def image_positions(self, rows: slice, offset: Array) -> tuple[Array, Array]:
        """Image positions (x, y) of the place ``offset`` (2,) in each pixel of the rows, each (n,)."""
        x = (np.arange(self.settings.width) + offset[0]) / self.settings.width
        y = (np.arange(rows.start, rows.stop) + offset[1]) / self.settings.height
        return np.tile(x, len(y)), np.repeat(y, len(x))

    def cast(self, x: Array, y: Array, counts: CastCounts, weighted: bool = False) -> Hits:
        """The hits of the projectors at image positions (n,); nothing is hit where nothing is there.

        weighted: barycentric weights are wanted though nothing is smooth.
        """
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
            weighted or self.shading is None or self.shading.surface.weighted,
        )
