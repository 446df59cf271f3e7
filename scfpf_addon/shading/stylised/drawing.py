# SPDX-License-Identifier: GPL-3.0-or-later
"""A tile of a picture drawn over: paper, hatching, lines."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from math import ceil
from typing import TYPE_CHECKING

import numpy as np

from ...casting.common.hits import CastCounts
from ...casting.tiles import TileJob
from ...projection.typing import IndexArray
from ..passes.data_passes import DataPasses
from ..settings.stylised_settings import OUTER, Stylised
from ..tracing.hit_colors import Shading
from ..typing import Single
from .canvas import measure, see
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
from .tones import StylisedShading, on_paper

if TYPE_CHECKING:
    from ..pipeline import Pipeline

# Places that are looked at in one go, at most, but for those at their borders: their arrays take 60 MB,
# and a render should end soon after it is told to.
BAND_PLACES = 1 << 18


@dataclass(frozen=True)
class Drawing:
    """What draws over the tiles of a frame.

    fine: the pipeline of a picture of ``detail`` times the pixels along each axis, in which lines are
    found. light: as white clay shows it, None where nothing depends on it.
    """

    drawn: Stylised
    fine: Pipeline
    light: Shading | None

    @classmethod
    def of(cls, pipeline: Pipeline, drawn: Stylised) -> Drawing:
        """Prepared once a frame."""
        settings, detail = pipeline.settings, drawn.detail
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
        light = pipeline.shading.light if isinstance(pipeline.shading, StylisedShading) else None
        return cls(
            drawn, replace(pipeline, settings=finer, passes=None, depth_of_field=None, moments=()), light
        )

    @property
    def margin(self) -> int:
        """Rows of the image beyond a tile's that may have a line that reaches into it."""
        lines = self.drawn.lines
        return ceil(reach_of(max(lines.width, lines.inner_width))) + 1 if lines else 0

    def draw_over(self, job: TileJob, inside: IndexArray | None, pixels: Single) -> None:
        """Draw over the finished pixels (n, 4) of a tile: all of it, or those ``inside`` (n,) a border.

        All of the tile's rows are looked at, and some more on either side, whatever the border:
        what a line is depends on the whole image only.
        """
        on_paper(pixels, self.drawn, self.fine.settings.transparent)
        if self.fine.cast_scene is None or not (self.drawn.lines or self.drawn.hatching):
            return
        width = self.fine.settings.width // self.drawn.detail
        rows = job.rows.stop - job.rows.start
        bands = ceil(rows * width * self.drawn.detail**2 / BAND_PLACES)
        bounds = [job.rows.start + rows * band // bands for band in range(bands + 1)]
        lines, hatching = [], []
        for start, stop in pairwise(bounds):
            line, hatch = self.ink(slice(start, stop), job)
            lines.append(line)
            hatching.append(hatch)
        if job.stop.is_set():
            return
        for parts, style in ((hatching, self.drawn.hatching), (lines, self.drawn.lines)):
            if style:
                ink = np.concatenate(parts)
                inked(pixels, ink if inside is None else ink[inside], style.color)

    def ink(self, rows: slice, job: TileJob) -> tuple[Single, Single]:
        """What lines and hatching cover of the pixels of whole rows of the image, each (n,)."""
        detail, settings = self.drawn.detail, self.fine.settings
        height, columns = settings.height // detail, settings.width // detail
        wide = slice(max(rows.start - self.margin, 0), min(rows.stop + self.margin, height))
        fine_rows = slice(wide.start * detail, wide.stop * detail)
        line = np.zeros((rows.stop - rows.start) * columns, np.float32)
        hatch = np.zeros_like(line)
        if job.stop.is_set():
            return line, hatch
        x, y = self.fine.pixel_centres(fine_rows)
        hits, continuation = self.fine.followed(x, y, CastCounts(), True)
        if continuation is None or not np.any(hits.triangle >= 0):
            return line, hatch
        view = see(self.fine, hits)
        lines, hatching = self.drawn.lines, self.drawn.hatching
        shape = fine_rows.stop - fine_rows.start, settings.width
        if lines:
            pairs = neighbours(view, shape)
            near = np.zeros(len(x), bool)
            near[pairs.first] = near[pairs.second] = True
            measure(self.fine, view, x, y, np.flatnonzero(near & view.hit))
            pieces = joined_up(find_edges(self.fine, view, fine_rows, pairs, lines, job.stop.is_set), shape)
            line = self.cover(pieces, rows, columns)
        if hatching and not job.stop.is_set():
            own = slice(rows.start - wide.start, rows.stop - wide.start)
            mine = slice(own.start * detail * settings.width, own.stop * detail * settings.width)
            if hatching.kind == "DEPTH" or self.light is None:
                measure(self.fine, view, x, y, np.flatnonzero(view.hit))
                ink = depth_lines(view, hatching, detail)[mine]
            else:
                where = np.flatnonzero(view.hit[mine])
                light = self.light.color(hits, where + mine.start, 0, continuation)
                ink = np.zeros(mine.stop - mine.start, np.float32)
                right, up = (axis[where] for axis in in_pixels(rows, columns, detail))
                ink[where] = tone_strokes(right, up, tone_of(light, self.drawn.exposure), hatching, detail)
            hatch = mean_of_blocks(ink, (rows.stop - rows.start, columns), detail)
        return line, hatch

    def cover(self, pieces: Segments, rows: slice, columns: int) -> Single:
        """What lines cover of the pixels of whole rows."""
        lines, detail = self.drawn.lines, self.drawn.detail
        ink = np.zeros((rows.stop - rows.start) * columns, np.float32)
        outer = (pieces.kinds & OUTER) > 0
        if lines:
            for some, width in ((outer, lines.width), (~outer, lines.inner_width)):
                x, y, right, up = (values[some] / detail for values in pieces[:4])
                if len(x):
                    part = Segments(x, y, right, up, pieces.kinds[some])
                    np.maximum(ink, cover_lines(part, width, rows, columns), out=ink)
        return ink
