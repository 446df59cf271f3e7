# SPDX-License-Identifier: GPL-3.0-or-later
"""The samples of pixels cast at the moments that they see, and their colours."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from ..casting.common.hits import CastCounts, Hits
from ..casting.continuation import Continuation
from ..projection.typing import IndexArray
from .passes.light_passes import LightParts
from .sampling.samples import SamplePlaces, row_pixels
from .scene.motion import moment_of_samples
from .tracing.scene_view import SceneView
from .typing import Single


class CastSample(NamedTuple):
    """One sample of n pixels after casting.

    number: of the sample. pixel: (n,) numbers in the image. hits: of the n projectors. continuation: of
    these, None where there are no triangles.
    """

    view: SceneView
    number: int
    pixel: IndexArray
    hits: Hits
    continuation: Continuation | None

    def take(self, index: IndexArray) -> CastSample:
        """The same sample of some of the pixels; only for one that is not restricted yet."""
        continuation = self.continuation and replace(self.continuation, known=index)
        return self._replace(pixel=self.pixel[index], hits=self.hits.take(index), continuation=continuation)


@dataclass(frozen=True)
class SampleCaster:
    """Casts samples. views: the scene at the moments of the open shutter; one if nothing moves."""

    places: SamplePlaces
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
            for sample in samples:
                yield self._cast_rows(rows, pixel, sample, counts)
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

    def color(self, cast: CastSample, where: IndexArray, parts: LightParts | None) -> Single:
        """The colours of the hits at ``where``, see ``Shading.color``; (3, 0) without triangles."""
        shading = cast.view.shading
        if shading is None or cast.continuation is None:
            return np.zeros((3, 0), np.float32)
        own: int | IndexArray = cast.number
        # Places that paths reach belong to no pixel any more.
        if self.places.scrambled and shading.tracer is None:
            own = self.places.on_lamps(cast.pixel[where], cast.number)
        return shading.color(cast.hits, where, own, replace(cast.continuation, pixels=cast.pixel), parts)

    def _moment(self, sample: int) -> int:
        """The number of the moment that a sample sees."""
        return moment_of_samples(self.places.count, len(self.views))[sample]

    def _cast_rows(self, rows: slice, pixel: IndexArray, sample: int, counts: CastCounts) -> CastSample:
        """Cast one sample of all pixels of whole rows."""
        view = self.views[self._moment(sample)]
        x, y = self.places.of_rows(rows, sample)
        through = view.through_lens(self.places.on_lens(pixel, sample)) if view.depth_of_field else view
        return CastSample(view, sample, pixel, *through.cast_with_continuation(x, y, counts, True))

    def _cast_together(
        self, view: SceneView, pixel: IndexArray, samples: list[int], counts: CastCounts
    ) -> dict[int, CastSample]:
        """Cast several samples of the pixels, which see the same moment, in one batch; by number."""
        places = [self.places.of_pixels(pixel, sample) for sample in samples]
        x, y = (np.stack(axis, axis=1).ravel() for axis in zip(*places, strict=True))
        through = view
        if view.depth_of_field is not None:
            share = np.stack([self.places.on_lens(pixel, sample) for sample in samples], axis=2)
            through = view.through_lens(share.reshape(2, -1))
        hits, continuation = through.cast_with_continuation(x, y, counts, False)
        whole = CastSample(view, -1, np.repeat(pixel, len(samples)), hits, continuation)
        return {
            sample: whole.take(np.arange(first, len(x), len(samples)))._replace(number=sample)
            for first, sample in enumerate(samples)
        }
