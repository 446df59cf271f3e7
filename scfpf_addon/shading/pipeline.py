# SPDX-License-Identifier: GPL-3.0-or-later
"""The pipeline of a tile: samples, projectors, hits, colours, film."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..casting.cast import cast
from ..casting.chord_map import chord_map
from ..casting.common.cancellation import raise_if_cancelled
from ..casting.common.geometry import Geometry
from ..casting.common.hits import CastCounts, Hits
from ..casting.continuation import Continuation
from ..casting.curves.chords import complete
from ..casting.curves.projector_batch import ProjectorBatch
from ..casting.frame import pixel_centres
from ..casting.scene.cast_scene import CastScene
from ..casting.tiles import TileJob
from ..projection.typing import Array, IndexArray
from ..projection.volume.viewing_volume import Projection
from .film import Film
from .lights.ray_visibility import seen_directly
from .lights.scene_culling import cull_scene
from .passes.data_passes import CryptoPasses, DataPasses, PassSamples, PassSource, fill_passes
from .passes.light_passes import ENVIRONMENT, EXPOSED, LightFilm, LightParts
from .sampling.adaptive import Adaptive, AdaptiveFilm, margin, sample_adaptively
from .sampling.samples import SamplePlaces, row_pixels
from .scene.depth_of_field import DepthOfField, through
from .scene.motion import Moment, moment_of_samples
from .scene.shading_scene import Scene
from .scene.world import World
from .settings.frame_settings import FrameSettings
from .stylised.drawing import Drawing
from .stylised.tones import StylisedShading
from .tracing.hit_colors import Shading
from .typing import Single

# Pixels whose data passes are made at once, at most: motion vectors take tens of microseconds each, and
# a render should end soon after it is told to.
PASS_PIXELS = 1 << 13


class TileCounts(NamedTuple):
    """What a tile did: the casting's counts, and how many projectors hit the scene."""

    cast: CastCounts
    hits: int


@dataclass(frozen=True)
class Pipeline:
    """What the threads share while a frame is made.

    projection: in cast space. places: where samples are. cast_scene and
    shading are None where there is nothing to hit. geometry: what cast_scene was made of. depth_of_field:
    in cast space. world: what is seen where nothing is, instead of the background. moments: what takes the
    place of this one for the picture, while the shutter is open. drawing: what draws over finished tiles.
    """

    projection: Projection
    settings: FrameSettings
    background: Array
    places: SamplePlaces
    cast_scene: CastScene | None
    shading: Shading | None
    passes: PassSource | None
    depth_of_field: DepthOfField | None
    geometry: Geometry | None
    world: World | None = None
    moments: tuple[Pipeline, ...] = ()
    drawing: Drawing | None = None

    @classmethod
    def of(
        cls,
        projection: Projection,
        scene: Scene,
        settings: FrameSettings,
        cast_scene: CastScene | None,
        alone: bool = True,
    ) -> Pipeline:
        """Everything that is done once a frame. What the volume cannot meet is left for shadows.

        alone: no other projection will see the same scene.
        """
        if cast_scene is None:
            scene, cast_scene = cull_scene(scene, projection, alone, settings.pixel_error == 0.0)
        everything, cast_scene = cast_scene, cast_scene and seen_directly(scene.geometry, cast_scene)
        inside = projection.transformed(cast_scene.matrix) if cast_scene else projection
        stylised, (background, world) = settings.stylised, scene.backdrop
        shading: Shading | None = None
        if everything and cast_scene and stylised:
            shading = StylisedShading.stylised_of(scene, everything, settings, stylised)
        elif everything and cast_scene:
            shading = Shading.of(scene, everything, settings)
        made = cls(
            inside,
            settings,
            np.asarray(background, np.float64),
            SamplePlaces(
                settings.width,
                settings.height,
                settings.samples,
                settings.pixel_filter,
                settings.scrambled or settings.adaptive is not None,
            ),
            cast_scene,
            shading,
            PassSource(
                settings.passes, (settings.width, settings.height), inside, scene, cast_scene, shading.surface
            )
            if cast_scene and shading and settings.passes.names
            else None,
            settings.depth_of_field.transformed(cast_scene.matrix)
            if settings.depth_of_field and cast_scene
            else settings.depth_of_field,
            scene.geometry if cast_scene else None,
            None if stylised and stylised.on_paper else world,
        )
        return replace(made, drawing=Drawing.of(made, stylised)) if stylised else made

    def with_moments(self, scene: Scene, moments: tuple[Moment, ...]) -> Pipeline:
        """The pipeline, of ``scene``, of a picture that is exposed while things move."""
        made: list[tuple[Scene, Pipeline]] = [(scene, self)]
        bare = replace(self.settings, passes=DataPasses())
        for moment in moments:
            raise_if_cancelled()
            settings = replace(bare, depth_of_field=moment.depth_of_field)
            same = next((known for seen, known in made if seen is moment.scene), None)
            if same is None:
                each = Pipeline.of(moment.projection, moment.scene, settings, None, False)
            else:
                # All but the projection is there.
                matrix = same.cast_scene.matrix if same.cast_scene else np.eye(4)
                lens = moment.depth_of_field and moment.depth_of_field.transformed(matrix)
                each = replace(same, projection=moment.projection.transformed(matrix), depth_of_field=lens)
            made.append((moment.scene, each))
        # There is one background behind all samples.
        return replace(self, moments=tuple(replace(e, background=self.background) for _, e in made[1:]))

    @property
    def behind(self) -> Array:
        """The colour of the picture where nothing is hit, (3,)."""
        stylised = self.settings.stylised
        return stylised.paper if stylised and stylised.on_paper else self.background

    def at(self, sample: int) -> Pipeline:
        """What a sample sees."""
        return self.moments[self.moment(sample)] if self.moments else self

    def moment(self, sample: int) -> int:
        """Which of the moments a sample sees, 0 where there are none."""
        if not self.moments:
            return 0
        return moment_of_samples(self.settings.samples, len(self.moments))[sample]

    def render_tile(self, job: TileJob, pixels: Single, passes: dict[str, Single]) -> TileCounts:
        """Samples → projectors → hits → colours → film, into pixels (n, 4) and passes (n, channels).

        Gives up between two steps of a sample when the job is to stop.
        """
        counts, hit_count = CastCounts(), 0
        inside = self.inside(job.rows)
        if self.settings.adaptive and self.settings.samples > self.settings.adaptive.least:
            return self.render_adaptively(self.settings.adaptive, job, inside, pixels, passes)
        mine = row_pixels(job.rows, self.settings.width)
        if inside is not None:
            mine = mine[inside]
        crypto = CryptoPasses(self.passes, len(pixels))
        film = Film(len(pixels), self.behind, self.settings.transparent)
        light = LightFilm.of(passes, len(pixels), self.background)
        for sample in range(self.settings.samples):
            if job.stop.is_set():
                return TileCounts(counts, hit_count)
            now = self.at(sample)
            hits, continuation = now.cast_sample(job.rows, sample, counts)
            hit_count += int(np.count_nonzero(hits.triangle >= 0))
            if job.stop.is_set():
                return TileCounts(counts, hit_count)
            if inside is not None:
                hits = hits.take(inside)
            where = np.flatnonzero(hits.triangle >= 0)
            parts = LightParts(len(where)) if light else None
            color = now.color(
                hits, where, sample, mine, continuation and replace(continuation, known=inside), parts
            )
            shown, color, parts = now.with_world(hits, where, color, parts)
            film.add(hits.mask, shown, color)
            if light and parts:
                light.add(np.arange(len(pixels)), hits.mask, shown, parts)
            if now.geometry:
                crypto.add(where, now.geometry, hits.triangle[where])
            job.done = (sample + 1) / self.settings.samples
        if film.exposed:
            film.develop(pixels)
        if self.drawing:
            self.drawing.draw_over(job, inside, pixels)
        for each in (crypto, light):
            if each:
                each.develop(np.arange(len(pixels)), float(self.settings.samples), passes)
        self.expose(pixels, passes)
        if self.passes and self.settings.passes.central and not job.stop.is_set():
            self.fill_passes(self.passes, job, inside, passes)
        return TileCounts(counts, hit_count)

    def render_adaptively(
        self,
        adaptive: Adaptive,
        job: TileJob,
        inside: IndexArray | None,
        pixels: Single,
        passes: dict[str, Single],
    ) -> TileCounts:
        """As ``render_tile``, with more samples for pixels that differ."""
        counts, hit_count = CastCounts(), 0
        width = self.settings.width
        rows = margin(job.rows, self.settings.height)
        block = row_pixels(rows, width)
        film = AdaptiveFilm(len(block), self.behind, self.settings.transparent)
        crypto = CryptoPasses(self.passes, len(block))
        light = LightFilm.of(passes, len(block), self.background)

        def take(some: IndexArray | None, samples: range) -> None:
            """Add samples of the pixels ``some`` (n,) of the block, None for all, to the films."""
            nonlocal hit_count
            which = np.arange(len(block)) if some is None else some
            for sample, hits, continuation in self.cast_samples(rows, samples, counts, some):
                where = np.flatnonzero(hits.triangle >= 0)
                hit_count += len(where)
                now = self.at(sample)
                parts = LightParts(len(where)) if light else None
                color = now.color(hits, where, sample, block[which], continuation, parts)
                shown, color, parts = now.with_world(hits, where, color, parts)
                film.add(which, hits.mask, shown, color)
                if light and parts:
                    light.add(which, hits.mask, shown, parts)
                if now.geometry:
                    crypto.add(which[where], now.geometry, hits.triangle[where])

        def stopped(done: float) -> bool:
            """Say how far the tile is; whether the work is to be given up."""
            job.done = done
            return job.stop.is_set()

        own = slice(job.rows.start - rows.start, job.rows.stop - rows.start)
        shape = rows.stop - rows.start, width
        sample_adaptively(take, film, adaptive, shape, own, self.settings.samples, stopped)
        if job.stop.is_set():
            return TileCounts(counts, hit_count)
        mine = np.arange(own.start * width, own.stop * width)
        mine = mine if inside is None else mine[inside]
        film.develop(mine, pixels)
        if self.drawing:
            self.drawing.draw_over(job, inside, pixels)
        for each in (crypto, light):
            if each:
                each.develop(mine, film.samples(mine), passes)
        self.expose(pixels, passes)
        if self.passes and self.settings.passes.central:
            self.fill_passes(self.passes, job, inside, passes)
        return TileCounts(counts, hit_count)

    def expose(self, pixels: Single, passes: dict[str, Single]) -> None:
        """Brighten finished pixels (n, 4) and passes of light by the film's exposure.

        A stylised image has an exposure of its own.
        """
        exposure = np.float32(self.settings.exposure)
        if exposure != 1.0 and self.drawing is None:
            pixels[:, :3] *= exposure
        for name in passes.keys() & EXPOSED:
            passes[name] *= exposure

    def fill_passes(
        self, source: PassSource, job: TileJob, inside: IndexArray | None, into: dict[str, Single]
    ) -> None:
        """The data passes of a tile, from one projector a pixel, which the report does not count."""
        x, y = self.pixel_centres(job.rows)
        hits = self.cast(x, y, CastCounts(), self.settings.passes.weighted)
        if "CHORD_COUNT" in into or "CHORD_ERROR" in into:
            self.fill_chords(x, y, hits, inside, into)
        if inside is not None:
            hits, x, y = hits.take(inside), x[inside], y[inside]
        where = np.flatnonzero(hits.triangle >= 0)
        for first in range(0, len(where), PASS_PIXELS):
            some = where[first : first + PASS_PIXELS]
            if not job.stop.is_set():
                fill_passes(source, PassSamples(x[some], y[some], hits.take(some)), some, into)

    def fill_chords(
        self, x: Array, y: Array, hits: Hits, inside: IndexArray | None, into: dict[str, Single]
    ) -> None:
        """The passes of a tile that show its chords, hit or not."""
        if self.cast_scene is None:
            return
        size = 1 / self.settings.width, 1 / self.settings.height
        error = self.settings.pixel_error
        chords = chord_map(self.cast_scene, self.projection, x, y, hits.t, size, error, self.settings.width)
        for name, values in (("CHORD_COUNT", chords.count), ("CHORD_ERROR", chords.error)):
            if name in into:
                into[name][:, 0] = values if inside is None else values[inside]

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

    def pixel_centres(self, rows: slice) -> tuple[Array, Array]:
        """Image positions (x, y) of the middle of each pixel of the rows, each (n,)."""
        return pixel_centres(self.settings.width, self.settings.height, (rows.start, rows.stop))

    def cast_sample(self, rows: slice, sample: int, counts: CastCounts) -> tuple[Hits, Continuation | None]:
        """What a sample of the pixels of whole rows hits, and what follows it on."""
        if self.depth_of_field is None:
            return self.followed(*self.places.of_rows(rows, sample), counts, True)
        pixel = row_pixels(rows, self.settings.width)
        x, y = self.places.of_pixels(pixel, sample)
        return self.through_lens(self.places.on_lens(pixel, sample)).followed(x, y, counts, True)

    def followed(
        self, x: Array, y: Array, counts: CastCounts, in_rows: bool
    ) -> tuple[Hits, Continuation | None]:
        """``cast`` with what follows its projectors on."""
        hits = self.cast(x, y, counts, in_rows=in_rows)
        if self.cast_scene is None:
            return hits, None
        size = 1 / self.settings.width, 1 / self.settings.height
        return hits, Continuation(
            self.cast_scene, self.projection, x, y, hits.mask, None, size, self.settings.pixel_error
        )

    def cast_samples(
        self, rows: slice, samples: range, counts: CastCounts, some: IndexArray | None
    ) -> Iterator[tuple[int, Hits, Continuation | None]]:
        """What each of several samples of the pixels of whole rows hits, or of ``some`` (n,) of these alone.

        Samples that see the same moment are cast together, a pixel's one after the other: they
        are as near as neighbours.
        """
        if some is None:
            for sample in samples:
                yield sample, *self.at(sample).cast_sample(rows, sample, counts)
            return
        pixel = row_pixels(rows, self.settings.width)[some]
        groups: dict[int, list[int]] = {}
        for sample in samples:
            groups.setdefault(self.moment(sample), []).append(sample)
        found: dict[int, tuple[Hits, Continuation | None]] = {}
        for together in groups.values():
            now, many = self.at(together[0]), len(together)
            places = [self.places.of_pixels(pixel, sample) for sample in together]
            x, y = (np.stack(axis, axis=1).ravel() for axis in zip(*places, strict=True))
            if now.depth_of_field is not None:
                share = np.stack([self.places.on_lens(pixel, sample) for sample in together], axis=2)
                now = now.through_lens(share.reshape(2, -1))
            hits, continuation = now.followed(x, y, counts, False)
            for number, sample in enumerate(together):
                mine = np.arange(number, len(x), many)
                found[sample] = hits.take(mine), continuation and replace(continuation, known=mine)
        # In order: a film's sums depend on it.
        for sample in samples:
            yield sample, *found.pop(sample)

    def through_lens(self, share: Array) -> Pipeline:
        """The pipeline for projectors that each pass the lens at a place of its own, shares (2, n)."""
        return (
            replace(self, projection=through(self.projection, self.depth_of_field, share))
            if self.depth_of_field
            else self
        )

    def color(
        self,
        hits: Hits,
        where: IndexArray,
        sample: int,
        pixel: IndexArray,
        continuation: Continuation | None,
        parts: LightParts | None,
    ) -> Single:
        """As ``Shading.color``, of nothing where nothing is there. pixel: (n,) the image's, of the hits."""
        if self.shading is None or continuation is None:
            return np.zeros((3, 0), np.float32)
        own: int | IndexArray = sample
        # What is sent on belongs to no pixel any more.
        if self.places.scrambled and self.shading.tracer is None:
            own = self.places.on_lamps(pixel[where], sample)
        return self.shading.color(hits, where, own, replace(continuation, pixels=pixel), parts)

    def with_world(
        self, hits: Hits, where: IndexArray, color: Single, parts: LightParts | None
    ) -> tuple[IndexArray, Single, LightParts | None]:
        """The hits at ``where`` (n,), their colours and parts, with the projectors that the world is seen by.

        It is seen in the direction in which a projector leaves the volume.
        """
        clear = self.settings.transparent
        if self.world is None or (clear and parts is None):
            return where, color, parts
        missed = np.flatnonzero(hits.mask & (hits.triangle < 0))
        if not len(missed):
            return where, color, parts
        shown = np.flatnonzero(hits.mask)
        light = self.world.radiance(hits.tangent.take(missed, axis=1))
        whole = np.ones((4, len(hits.mask)), np.float32)
        whole[: len(color), where] = color
        whole[:3, missed], whole[3, missed] = (0.0, 0.0) if clear else (light, 1.0)
        if parts:
            rows = np.zeros((len(parts.rows), len(hits.mask)), np.float32)
            rows[:, where], rows[ENVIRONMENT, missed] = parts.rows, light
            parts = LightParts(len(shown))
            parts.rows[:] = rows[:, shown]
        return shown, whole.take(shown, axis=1), parts

    def cast(
        self, x: Array, y: Array, counts: CastCounts, weighted: bool = False, in_rows: bool = True
    ) -> Hits:
        """The hits of the projectors at image positions (n,); nothing is hit where nothing is there.

        weighted: barycentric weights are wanted though nothing is smooth. in_rows: the positions
        are whole rows.
        """
        if self.cast_scene is None:
            projectors = self.projection.projectors(x, y)
            nothing = Hits.empty(len(x))._replace(mask=projectors.valid)
            return complete(nothing, ProjectorBatch(self.projection.volume.spans, projectors.points))
        pixel_size = (1 / self.settings.width, 1 / self.settings.height)
        return cast(
            self.cast_scene,
            self.projection,
            x,
            y,
            pixel_size,
            self.settings.pixel_error,
            counts,
            self.settings.width if in_rows else None,
            weighted or self.shading is None or self.shading.surface.weighted,
        )
