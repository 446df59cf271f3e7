# SPDX-License-Identifier: GPL-3.0-or-later
"""The samples of pixels cast at the moments that they see, and their colours."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import groupby
from typing import NamedTuple

import numpy as np

from ..casting.common.hits import CastCounts, Hits
from ..casting.continuation import Continuation
from ..projection.typing import IndexArray
from .passes.light_passes import LightParts
from .sampling.point_samples import PointSamples, pixel_places
from .sampling.sample_positions import SamplePositions, row_pixels
from .scene.motion import moment_of_samples
from .tracing.scene_view import SceneView
from .typing import Single


class CastSample(NamedTuple):
    """One sample of n pixels after casting.

    number: of the sample. hits: of the n projectors. continuation: of these, with the ``pixel_places`` as
    seeds; None where there are no triangles.
    """

    view: SceneView
    number: int
    hits: Hits
    continuation: Continuation | None

    @property
    def where(self) -> IndexArray:
        """The pixels that hit the scene."""
        return np.flatnonzero(self.hits.triangle >= 0)

    @property
    def group(self) -> tuple[int, int]:
        """A key of samples whose paths can be traced at once: of one moment, in a scene with graphs."""
        shading = self.view.shading
        return id(self.view), -1 if shading and shading.tracer else self.number

    def take(self, index: IndexArray) -> CastSample:
        """The same sample of the pixels at ``index``."""
        continuation = self.continuation and self.continuation.take(index)
        return self._replace(hits=self.hits.take(index), continuation=continuation)


@dataclass(frozen=True)
class SampleCaster:
    """Casts samples. views: the scene at the moments of the open shutter; one if nothing moves."""

    places: SamplePositions
    views: tuple[SceneView, ...]

    def cast(
        self, rows: slice, samples: range, counts: CastCounts, some: IndexArray | None
    ) -> Iterator[CastSample]:
        """Cast several samples of the pixels of whole rows, or of ``some`` (n,) of these pixels.

        Samples of ``some`` that see the same moment are cast together, a pixel's one after the other: they
        are as near as neighbours.
        """
        pixel = row_pixels(rows, self.places.width)
        if some is None:
            for moment, seen in groupby(samples, self._moment):
                yield from self._cast_rows(self.views[moment], rows, pixel, [*seen], counts)
            return
        pixel = pixel[some]
        groups: dict[int, list[int]] = {}
        for sample in samples:
            groups.setdefault(self._moment(sample), []).append(sample)
        found: dict[int, CastSample] = {}
        for moment, together in groups.items():
            found |= self._cast_together(self.views[moment], pixel, together, counts)
        # In order: a film's sums depend on it.
        for sample in samples:
            yield found.pop(sample)

    def colors(self, casts: Sequence[CastSample], parts: LightParts | None) -> Single:
        """The colours of all hits of samples, in order, see ``Shading.color``. parts: of them.

        casts: one, or several whose paths can be traced at once.
        """
        first, wheres = casts[0], [cast.where for cast in casts]
        shading = first.view.shading
        continuations = [cast.continuation for cast in casts if cast.continuation is not None]
        if shading is None or len(continuations) < 2:
            return self._color(first, wheres[0], parts)
        count = len(first.hits.t)
        number = np.repeat([cast.number for cast in casts], [len(where) for where in wheres])
        continuation = Continuation.joined(continuations)
        where = np.concatenate([where + count * k for k, where in enumerate(wheres)])
        hits = Hits.joined([cast.hits for cast in casts])
        samples = self._samples(continuation, where, number)
        return shading.color(hits, where, samples, continuation, parts)

    def _color(self, cast: CastSample, where: IndexArray, parts: LightParts | None) -> Single:
        """The colours of the hits at ``where`` of one sample; (3, 0) without triangles."""
        shading = cast.view.shading
        if shading is None or cast.continuation is None:
            return np.zeros((3, 0), np.float32)
        samples = self._samples(cast.continuation, where, cast.number)
        return shading.color(cast.hits, where, samples, cast.continuation, parts)

    def _samples(
        self, continuation: Continuation, where: IndexArray, number: int | IndexArray
    ) -> PointSamples:
        """The samples of the hits at ``where``. number: see ``PointSamples``."""
        return PointSamples(continuation.pixel.take(where).astype(np.uint32), number, self.places.count)

    def _moment(self, sample: int) -> int:
        """The number of the moment that a sample sees."""
        return moment_of_samples(self.places.count, len(self.views))[sample]

    def _cast_rows(
        self, view: SceneView, rows: slice, pixel: IndexArray, samples: list[int], counts: CastCounts
    ) -> Iterator[CastSample]:
        """Cast samples of all pixels of whole rows, which see one view: all at once if it has layers."""
        step = len(samples) if view.parts else 1
        place = pixel_places(pixel, self.places.width).astype(np.intp)
        for first in range(0, len(samples), step):
            some = samples[first : first + step]
            lenses = [self.places.on_lens(pixel, each) if view.depth_of_field else None for each in some]
            seen = [
                (view.through_lens(share), *self.places.of_rows(rows, each))
                for each, share in zip(some, lenses, strict=True)
            ]
            for number, (hits, continuation) in zip(some, view.cast_samples(seen, counts), strict=True):
                yield CastSample(view, number, hits, continuation and replace(continuation, pixel=place))

    def _cast_together(
        self, view: SceneView, pixel: IndexArray, samples: list[int], counts: CastCounts
    ) -> dict[int, CastSample]:
        """Cast several samples of the pixels, which see the same moment, in one batch; by number."""
        places = [self.places.of_pixels(pixel, sample) for sample in samples]
        x, y = (np.stack(axis, axis=1).ravel() for axis in zip(*places, strict=True))
        share = None
        if view.depth_of_field:
            shares = [self.places.on_lens(pixel, sample) for sample in samples]
            share = np.stack(shares, axis=2).reshape(2, -1)
        hits, continuation = view.through_lens(share).cast_with_continuation(x, y, counts, False)
        seeds = np.repeat(pixel_places(pixel, self.places.width).astype(np.intp), len(samples))
        whole = CastSample(view, -1, hits, continuation and replace(continuation, pixel=seeds))
        return {
            sample: whole.take(np.arange(first, len(x), len(samples)))._replace(number=sample)
            for first, sample in enumerate(samples)
        }
