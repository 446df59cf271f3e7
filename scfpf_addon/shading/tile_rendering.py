# SPDX-License-Identifier: GPL-3.0-or-later
"""The rendering of a tile: samples → projectors → hits → colours → films → pixels and passes."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from ..casting.chord_map import chord_map
from ..casting.common.cancellation import raise_if_cancelled
from ..casting.common.hits import CastCounts
from ..casting.tiles import TileJob
from ..projection.typing import IndexArray
from .passes.cryptomatte import CryptoFilms
from .passes.data_passes import PASSES, DataPasses, PassSamples, PassSource, fill_chord_passes, fill_passes
from .passes.light_passes import EXPOSED, LightFilm, LightParts
from .pipeline import Pipeline
from .sample_casting import CastSample
from .sampling.adaptive import Adaptive, adaptive_batches, margin
from .sampling.films import AdaptiveFilm, Film
from .settings.frame_settings import FrameSettings
from .tracing.scene_view import SceneView
from .typing import Single

# Pixels whose data passes are made at once: motion vectors take tens of microseconds each, and a cancelled
# render should end soon.
PASS_PIXELS = 1 << 13
# Pixel samples whose paths are traced at once: with fewer, NumPy's calls take longer than its work.
TOGETHER = 1 << 17
# The most samples of a tile between two messages of progress.
MOST_SAMPLES = 8


class TileCounts(NamedTuple):
    """The casting's counts of a tile, and how many projectors hit the scene."""

    cast: CastCounts
    hits: int


class TileFilms:
    """The films of a block of whole rows, to which samples are added: image, light passes, cryptomattes.

    image: film of as many pixels as ``kept``, or as the rows. kept: (n,) pixels of the block that the films
    hold, None for all. names: of the passes.
    """

    def __init__(
        self,
        pipeline: Pipeline,
        rows: slice,
        image: Film,
        kept: IndexArray | None,
        names: Collection[str],
    ) -> None:
        width = pipeline.settings.width
        self._count = (rows.stop - rows.start) * width if kept is None else len(kept)
        self._caster, self._rows, self._kept = pipeline.caster, rows, kept
        self._image = image
        self._light = LightFilm.of(names, self._count, pipeline.background)
        wanted = pipeline.passes.wanted if pipeline.passes else DataPasses()
        self._crypto = CryptoFilms(wanted.crypto_layers(), wanted.identifiers, self._count)
        self._counts, self._hits = CastCounts(), 0

    def take(self, samples: range, some: IndexArray | None = None) -> None:
        """Cast samples of the block's pixels, or of ``some`` (n,) of them, and add them to the films."""
        pixel = np.arange(self._count) if some is None else some
        casts = self._caster.cast(self._rows, samples, self._counts, some)
        for _, together in groupby(casts, lambda cast: cast.group):
            raise_if_cancelled()
            taken = list(together)
            self._hits += sum(len(cast.where) for cast in taken)
            self._add(taken if self._kept is None else [cast.take(self._kept) for cast in taken], pixel)

    def _add(self, casts: Sequence[CastSample], pixel: IndexArray) -> None:
        """Add samples of the films' pixels (n,), of one ``CastSample.group``."""
        wheres = [cast.where for cast in casts]
        total = sum(len(where) for where in wheres)
        parts = LightParts(total) if self._light else None
        colors, first = self._caster.colors(casts, parts), 0
        for cast, where in zip(casts, wheres, strict=True):
            view, hits, some = cast.view, cast.hits, slice(first, first + len(where))
            first = some.stop
            shown, color, own = view.with_world(hits, where, colors[:, some], parts and parts.part(some))
            self._image.add(pixel, hits.mask, shown, color)
            if self._light and own:
                self._light.add(pixel, hits.mask, shown, own)
            if view.cast_scene:
                self._crypto.add(pixel[where], view.scene.geometry, hits.triangle[where])

    def develop(self, pixel: IndexArray, pixels: Single, passes: dict[str, Single]) -> None:
        """Write the films' pixels (m,) into pixels (m, 4) and passes (m, channels)."""
        self._image.develop(pixel, pixels)
        samples = self._image.samples(pixel)
        self._crypto.develop(pixel, samples, passes)
        if self._light:
            self._light.develop(pixel, samples, passes)

    @property
    def counts(self) -> TileCounts:
        """The counts of all samples so far."""
        return TileCounts(self._counts, self._hits)


def render_tile(pipeline: Pipeline, job: TileJob, pixels: Single, passes: dict[str, Single]) -> TileCounts:
    """Render a tile into pixels (n, 4) and passes (n, channels) of those pixels that are in the border.

    Raises Cancelled between two steps of a sample when the job is to stop.
    """
    settings = pipeline.settings
    inside = border_pixels(settings, job.rows)
    adaptive = settings.adaptive
    if adaptive and settings.samples > adaptive.least:
        films, own = _sample_adaptively(pipeline, adaptive, job, passes)
        own = own if inside is None else own[inside]
    else:
        films = _sample_evenly(pipeline, job, inside, len(pixels), passes)
        own = np.arange(len(pixels))
    films.develop(own, pixels, passes)
    if pipeline.drawing:
        pipeline.drawing.draw_over(job.rows, inside, pixels)
    _expose(pipeline, pixels, passes)
    if pipeline.passes and settings.passes.central:
        fill_data_passes(pipeline.view, pipeline.passes, job.rows, inside, passes)
    return films.counts


def _sample_evenly(
    pipeline: Pipeline, job: TileJob, inside: IndexArray | None, count: int, names: Collection[str]
) -> TileFilms:
    """The films of a tile's pixels ``inside``, ``count`` in all, each with all of its samples."""
    settings = pipeline.settings
    image = Film(count, pipeline.empty_color, settings.transparent)
    films = TileFilms(pipeline, job.rows, image, inside, names)
    # Samples that are cast together share chords, which must not depend on the border.
    whole = (job.rows.stop - job.rows.start) * settings.width if pipeline.view.parts else count
    step = max(1, min(MOST_SAMPLES, TOGETHER // max(whole, 1)))
    for first in range(0, settings.samples, step):
        taken = range(first, min(first + step, settings.samples))
        films.take(taken)
        job.done = taken.stop / settings.samples
    return films


def _sample_adaptively(
    pipeline: Pipeline, adaptive: Adaptive, job: TileJob, names: Collection[str]
) -> tuple[TileFilms, IndexArray]:
    """The films of a tile and its margin, with more samples for uncertain pixels; the tile's own pixels."""
    settings = pipeline.settings
    width, rows = settings.width, margin(job.rows, settings.height)
    shape = rows.stop - rows.start, width
    own = slice(job.rows.start - rows.start, job.rows.stop - rows.start)
    image = AdaptiveFilm(shape[0] * width, pipeline.empty_color, settings.transparent)
    films = TileFilms(pipeline, rows, image, None, names)
    for some, samples in adaptive_batches(image, adaptive, shape, own, settings.samples):
        films.take(samples, some)
        job.done = samples.stop / settings.samples
    return films, np.arange(own.start * width, own.stop * width)


def border_pixels(settings: FrameSettings, rows: slice) -> IndexArray | None:
    """The pixels of whole rows that are in the border, row by row; None for all."""
    left, bottom, right, top = settings.region
    first, last = max(rows.start, bottom), min(rows.stop, top)
    if (first, last, left, right) == (rows.start, rows.stop, 0, settings.width):
        return None
    lines = np.arange(first - rows.start, last - rows.start)
    columns = np.arange(left, right)
    return (lines[:, None] * settings.width + columns).reshape(-1)


def _expose(pipeline: Pipeline, pixels: Single, passes: dict[str, Single]) -> None:
    """Multiply finished pixels (n, 4) and passes of light by the film's exposure, in place.

    A stylised image has an exposure of its own.
    """
    exposure = np.float32(pipeline.settings.exposure)
    if exposure != 1.0 and pipeline.drawing is None:
        pixels[:, :3] *= exposure
    for name in passes.keys() & EXPOSED:
        passes[name] *= exposure


def fill_data_passes(
    view: SceneView, source: PassSource, rows: slice, inside: IndexArray | None, into: dict[str, Single]
) -> None:
    """Fill in the data passes of whole rows by one projector a pixel, which the report does not count.

    inside: pixels of the rows that the passes hold, None for all.
    """
    x, y = view.pixel_centres(rows)
    hits, layer = view.cast_layers(x, y, CastCounts(), source.wanted.weighted)
    if view.cast_scene and any(PASSES[name].chords for name in into):
        settings = view.settings
        chords = chord_map(
            view.cast_scene,
            view.projection,
            x,
            y,
            hits.t,
            view.pixel_size,
            settings.pixel_error,
            settings.width,
        )
        fill_chord_passes(chords, inside, into)
    if inside is not None:
        hits, x, y, layer = hits.take(inside), x[inside], y[inside], layer[inside]
    for number, own in enumerate(source.of_layers()):
        where = np.flatnonzero((hits.triangle >= 0) & (layer == number))
        for first in range(0, len(where), PASS_PIXELS):
            raise_if_cancelled()
            some = where[first : first + PASS_PIXELS]
            fill_passes(own, PassSamples(x[some], y[some], hits.take(some)), some, into)
