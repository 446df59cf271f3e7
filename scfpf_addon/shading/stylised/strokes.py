# SPDX-License-Identifier: GPL-3.0-or-later
"""The share of each pixel that ink covers: lines of a width, strokes and lines of equal t."""

from __future__ import annotations

from math import ceil

import numpy as np

from ...projection.colors import LUMINANCE
from ...projection.typing import Array
from ..settings.stylised_settings import Hatching
from ..typing import Single
from .edges import Segments
from .surface_samples import SurfaceSamples

# The square of a length below which a piece of a line is a point.
TINY = 1e-12
# Tones below which the strokes of each layer begin, and the range of tones over which they widen.
LAYERS = (0.8, 0.55, 0.3)
WIDENING = 0.25
# Lines of equal t closer than this many of their widths fade, so that steep places do not become black.
DENSEST = 3.0


def reach_of(width: float) -> float:
    """The largest distance of ink from a line's middle: half its width, and half a pixel of soft rim."""
    return width / 2 + 0.5


def cover_lines(pieces: Segments, width: float, rows: slice, columns: int) -> Single:
    """The share of each pixel of whole rows that lines of ``width`` pixels cover, (m,).

    pieces: of lines, shorter than a pixel. For a straight line the integral across it is its width.
    """
    height = rows.stop - rows.start
    squared = np.full(height * columns, np.inf)
    reach = reach_of(width)
    length = np.maximum(pieces.right**2 + pieces.up**2, TINY)
    column, row = np.floor(pieces.x).astype(np.intp), np.floor(pieces.y).astype(np.intp)
    around = range(-ceil(reach + 1), ceil(reach + 1) + 1)
    for above in around:
        for beside in around:
            i, j = column + beside, row + above
            x, y = i + 0.5 - pieces.x, j + 0.5 - pieces.y
            share = np.clip((x * pieces.right + y * pieces.up) / length, 0.0, 1.0)
            away = (x - share * pieces.right) ** 2 + (y - share * pieces.up) ** 2
            some = np.flatnonzero(
                (away < reach**2) & (i >= 0) & (i < columns) & (j >= rows.start) & (j < rows.stop)
            )
            np.minimum.at(squared, (j[some] - rows.start) * columns + i[some], away[some])
    # The soft rims of a line thinner than a pixel would be wider than the line.
    thin = width / reach**2 if width < 1.0 else 1.0
    ink: Single = (np.clip(reach - np.sqrt(squared), 0.0, 1.0) * thin).astype(np.float32)
    return ink


def tone_of(light: Single, exposure: float) -> Single:
    """The perceived brightness in [0, 1] of white paper in light (3, n), by a gamma of 2.2, (n,)."""
    red, green, blue = LUMINANCE.astype(np.float32)
    bright = light[0] * red + light[1] * green + light[2] * blue
    tone: Single = np.clip(bright * np.float32(2.0**exposure), 0, 1) ** np.float32(1 / 2.2)
    return tone


def stripes(distance: Array, width: Array | float, rim: float) -> Array:
    """The share of ink at a distance from the middle of stripes of a width; ``rim`` pixels are soft."""
    return np.clip((np.asarray(width) / 2 - distance) / rim + 0.5, 0.0, 1.0)


def depth_lines(surface: SurfaceSamples, hatching: Hatching, detail: int) -> Single:
    """Ink of lines of equal t at the samples, (n,). detail: samples along a pixel of the image."""
    slope = np.maximum(surface.slope.astype(np.float64) * detail, 1e-30)
    steps = surface.t * hatching.count
    nearest = np.clip(np.rint(steps), 1, max(hatching.count - 1, 1))
    distance = np.abs(steps - nearest) / hatching.count / slope
    spacing = 1.0 / hatching.count / slope
    ink = stripes(distance, hatching.width, 1.0 / detail)
    ink *= np.minimum(1.0, spacing / (DENSEST * hatching.width)) * surface.hit
    return (ink if hatching.count > 1 else np.zeros_like(ink)).astype(np.float32)


def tone_strokes(x: Array, y: Array, tone: Single, hatching: Hatching, detail: int) -> Single:
    """Ink of strokes at places x, y (n,) in pixels with tones (n,) of ``tone_of``."""
    ink = np.zeros(len(x))
    for layer, threshold in enumerate(LAYERS):
        angle, spacing, shift = hatching.angle, hatching.spacing, 0.0
        if hatching.cross:
            angle += (0.0, np.pi / 2, np.pi / 4)[layer]
        else:
            # Between the strokes of the layers before.
            spacing, shift = ((spacing, 0.0), (spacing, 0.5), (spacing / 2, 0.5))[layer]
        place = (y * np.cos(angle) - x * np.sin(angle)) / spacing + shift
        distance = np.abs(place - np.rint(place)) * spacing
        widened = np.clip((threshold - tone) / WIDENING, 0.0, 1.0)
        ink = np.maximum(ink, stripes(distance, hatching.width * widened, 1.0 / detail) * (widened > 0))
    return ink.astype(np.float32)


def mean_of_blocks(values: Single, shape: tuple[int, int], detail: int) -> Single:
    """The means of blocks of detail × detail values, (rows·columns,). shape: rows and columns of blocks."""
    blocks = values.reshape(shape[0], detail, shape[1], detail)
    total = np.zeros(shape, np.float32)
    for up in range(detail):
        for right in range(detail):
            total += blocks[:, up, :, right]
    return (total / np.float32(detail**2)).ravel()


def in_pixels(rows: slice, columns: int, detail: int) -> tuple[Array, Array]:
    """Places x, y, in pixels, of a grid of detail × detail places per pixel of whole rows."""
    x = (np.arange(columns * detail) + 0.5) / detail
    y = (np.arange(rows.start * detail, rows.stop * detail) + 0.5) / detail
    return np.tile(x, len(y)), np.repeat(y, len(x))


def inked(pixels: Single, ink: Single, color: Array) -> None:
    """Draw a colour over pixels (n, 4), premultiplied, in place. ink: (n,) share of each that it covers."""
    pixels *= (1 - ink)[:, None]
    pixels[:, :3] += ink[:, None] * color.astype(np.float32)
    pixels[:, 3] += ink
