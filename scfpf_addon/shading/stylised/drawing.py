# SPDX-License-Identifier: GPL-3.0-or-later
"""Paper, hatching and lines drawn over finished tiles."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil
from typing import NamedTuple

import numpy as np

from ...casting.common.cancellation import raise_if_cancelled
from ...casting.common.hits import CastCounts, Hits
from ...casting.continuation import Continuation
from ...projection.typing import Array, IndexArray
from ..passes.data_passes import DataPasses
from ..sampling.point_samples import PointSamples
from ..settings.stylised_settings import OUTER, Hatching, Lines, Stylised
from ..tracing.hit_colors import Shading
from ..tracing.scene_view import SceneView
from ..typing import Single
from .edges import Segments, find_edges, joined_up, neighbours
from .strokes import (
    cover_lines,
    depth_lines,
    in_pixels,
    inked,
    mean_of_blocks,
    reach_of,
    tone_of,
    tone_strokes,
)
from .surface_samples import SurfaceSamples, add_derivatives, samples_of_hits
from .tones import StylisedShading, on_paper

# Places that are sampled at once, at most, apart from margins: their arrays take 60 MB, and a cancelled
# render should end soon.
BAND_PLACES = 1 << 18


class Band(NamedTuple):
    """A band of whole rows, sampled at its fine places.

    fine_rows: with the margin, of the fine image. own: its places among these, without the margin.
    x, y: image positions of all places. continuation: of their projectors.
    """

    rows: slice
    fine_rows: slice
    own: slice
    x: Array
    y: Array
    hits: Hits
    continuation: Continuation
    surface: SurfaceSamples


@dataclass(frozen=True)
class Drawing:
    """Draws over the tiles of a frame.

    fine: the view for an image of ``detail`` times the pixels along each axis, in which lines are found.
    light: the shading of white clay, None where nothing depends on it.
    """

    style: Stylised
    fine: SceneView
    light: Shading | None

    @classmethod
    def of(cls, view: SceneView, style: Stylised) -> Drawing:
        """Prepare the drawing of a frame."""
        settings, detail = view.settings, style.detail
        finer = replace(
            settings,
            width=settings.width * detail,
            height=settings.height * detail,
            pixel_error=settings.pixel_error * detail,
            border=None,
            passes=DataPasses(),
            depth_of_field=None,
            stylised=None,
        )
        light = view.shading.light if isinstance(view.shading, StylisedShading) else None
        return cls(style, replace(view, settings=finer, depth_of_field=None), light)

    @property
    def margin(self) -> int:
        """Rows of the image beyond a tile's that may hold a line which reaches into it."""
        lines = self.style.lines
        return ceil(reach_of(max(lines.width, lines.inner_width))) + 1 if lines else 0

    @property
    def columns(self) -> int:
        """Width of the image in pixels."""
        return self.fine.settings.width // self.style.detail

    def draw_over(self, rows: slice, inside: IndexArray | None, pixels: Single) -> None:
        """Draw over the finished pixels (n, 4) of whole rows, or of those ``inside`` (n,) a border.

        All pixels of the rows are sampled, and some rows more on either side, whatever the border: lines
        depend on the whole image only.
        """
        style = self.style
        on_paper(pixels, style, self.fine.settings.transparent)
        if self.fine.cast_scene is None or not (style.lines or style.hatching):
            return
        count = rows.stop - rows.start
        bands = ceil(count * self.columns * style.detail**2 / BAND_PLACES)
        bounds = [rows.start + count * band // bands for band in range(bands + 1)]
        ink = [self._ink(slice(start, stop)) for start, stop in pairwise(bounds)]
        for parts, kind in zip(zip(*ink, strict=True), (style.hatching, style.lines), strict=True):
            if kind:
                cover = np.concatenate(parts)
                inked(pixels, cover if inside is None else cover[inside], kind.color)

    def _ink(self, rows: slice) -> tuple[Single, Single]:
        """The share of each pixel of whole rows that hatching and lines cover, (n,) each."""
        hatch = np.zeros((rows.stop - rows.start) * self.columns, np.float32)
        line = np.zeros_like(hatch)
        band = self._sampled(rows)
        if band is None:
            return hatch, line
        if self.style.lines:
            line = self._lines(band, self.style.lines)
        if self.style.hatching:
            hatch = self._hatching(band, self.style.hatching)
        return hatch, line

    def _sampled(self, rows: slice) -> Band | None:
        """The samples of whole rows and their margin; None where nothing is hit."""
        raise_if_cancelled()
        detail, settings = self.style.detail, self.fine.settings
        wide = slice(
            max(rows.start - self.margin, 0), min(rows.stop + self.margin, settings.height // detail)
        )
        fine_rows = slice(wide.start * detail, wide.stop * detail)
        x, y = self.fine.pixel_centres(fine_rows)
        hits, continuation = self.fine.cast_with_continuation(x, y, CastCounts(), True)
        if continuation is None or not np.any(hits.triangle >= 0):
            return None
        places = detail * settings.width
        own = slice((rows.start - wide.start) * places, (rows.stop - wide.start) * places)
        return Band(rows, fine_rows, own, x, y, hits, continuation, samples_of_hits(self.fine, hits))

    def _lines(self, band: Band, lines: Lines) -> Single:
        """The share of the band's pixels that lines cover, (n,)."""
        surface, shape = band.surface, (band.fine_rows.stop - band.fine_rows.start, self.fine.settings.width)
        pairs = neighbours(surface, shape)
        near = np.zeros(len(band.x), bool)
        near[pairs.first] = near[pairs.second] = True
        add_derivatives(self.fine, surface, band.x, band.y, np.flatnonzero(near & surface.hit))
        pieces = joined_up(find_edges(self.fine, surface, band.fine_rows, pairs, lines), shape)
        ink = np.zeros((band.rows.stop - band.rows.start) * self.columns, np.float32)
        outer = (pieces.kinds & OUTER) > 0
        for some, width in ((outer, lines.width), (~outer, lines.inner_width)):
            x, y, right, up = (values[some] / self.style.detail for values in pieces[:4])
            if len(x):
                part = Segments(x, y, right, up, pieces.kinds[some])
                np.maximum(ink, cover_lines(part, width, band.rows, self.columns), out=ink)
        return ink

    def _hatching(self, band: Band, hatching: Hatching) -> Single:
        """The share of the band's pixels that hatching covers, (n,)."""
        raise_if_cancelled()
        detail, surface = self.style.detail, band.surface
        if hatching.kind == "DEPTH" or self.light is None:
            add_derivatives(self.fine, surface, band.x, band.y, np.flatnonzero(surface.hit))
            ink = depth_lines(surface, hatching, detail)[band.own]
        else:
            where = np.flatnonzero(surface.hit[band.own])
            seen = where + band.own.start
            light = self.light.color(band.hits, seen, PointSamples.alone(len(seen)), band.continuation)
            ink = np.zeros(band.own.stop - band.own.start, np.float32)
            right, up = (axis[where] for axis in in_pixels(band.rows, self.columns, detail))
            ink[where] = tone_strokes(right, up, tone_of(light, self.style.exposure), hatching, detail)
        return mean_of_blocks(ink, (band.rows.stop - band.rows.start, self.columns), detail)
