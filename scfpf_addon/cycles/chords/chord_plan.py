# SPDX-License-Identifier: GPL-3.0-or-later
"""The chords of an image's projectors in Cycles: their number, their ends, the resolution of their sheets.

A ray runs along a chord until a sheet turns it into the next. All projectors share the sheets,
so there is one list of breaks in t for the image, planned as the caster plans a tile.
Sheets are triangles: between their vertices a projector is the mean of those at the corners.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...casting.curves.chord_rules import SHIFT, graded, half_cosine, running_total
from ...casting.curves.sampled_curves import Curves, across, blend, curves_through
from ...projection.mappings.stack import is_disc
from ...projection.typing import Array, BoolArray
from ...projection.user_error import UserError
from ...projection.volume.basis import SpanBasis
from ...projection.volume.viewing_volume import Projection
from ..portals.pixel_cone import PixelCone, pixel_cone
from ..portals.sheets import image_places
from .pixel_footprint import SMALLEST_ERROR, pixels

# Projectors that are sampled, across and up the image.
SAMPLES = (25, 17)

# Places at which a chord is compared with its curve, both ends included.
PLACES = 9

# The chords' part of the pixel error; the rest is for the sheets between their vertices.
CHORD_SHARE = 0.75

# At most so many chords are made: each is a sheet, and a step of every ray.
MOST_CHORDS = 256

# Attempts to find the fewest chords within the pixel error.
ATTEMPTS = 12

# Steps in t at which the demand for chords is evaluated, per span.
STEPS = 64

# Cells across and up a sheet: at least, and at most.
FEWEST_CELLS, MOST_CELLS = 8, 256

# Vertices of all sheets together, at most: some 800 MB in Blender and Cycles.
MOST_VERTICES = 1_500_000

# Cells of a sheet that are sampled, across and up.
CELL_SAMPLES = 16

# Cells along the rim of a polar image: their polygon looks like a circle.
ROUND_CELLS = 64

# Rendering time of a chord, and of the rig itself, as a share of a plain camera's in a simple scene.
COST_CHORD, COST_RIG = 0.25, 0.3


@dataclass(frozen=True)
class ChordPlan:
    """The chords of an image.

    breaks: (n+1,) increasing from 0 to 1 in t. shifts: (n+1,): chords end at Q(t) - shift Q''(t).
    cells: of each sheet, across and up. error: the largest distance between curve and chord
    plus that between vertices, on the sampled projectors, in pixels. missing: the share of
    the sampled projectors that do not exist (holes of a surface, or of an image mapping). disc: whether
    the image is one. cone: of its pixels; None leaves the screen of a rig as it is. is_own_view: whether
    each pixel sees along the camera's own ray, as without flexible projection, at all frames.
    """

    breaks: Array
    shifts: Array
    cells: tuple[int, int]
    error: float
    missing: float
    disc: bool = False
    cone: PixelCone | None = None
    is_own_view: bool = False

    @property
    def count(self) -> int:
        """The number of chords."""
        return len(self.breaks) - 1

    @property
    def cost(self) -> float:
        """Rendering time as a multiple of a plain camera's, in a simple scene: less in others."""
        return rendering_cost(self.count)


def rendering_cost(chords: float) -> float:
    """Rendering time as a multiple of a plain camera's, in a simple scene: less in others."""
    return 1.0 + COST_RIG + COST_CHORD * chords


def plan_chords(
    projections: Sequence[Projection],
    size: tuple[int, int],
    pixel_error: float,
    lines: tuple[int, int] = (1, 1),
) -> ChordPlan:
    """Plan the chords of an image.

    projections: the same volume at one or more frames; those whose spans differ from the first's
    (animated weights) are ignored. size: width and height of the image in pixels. pixel_error: as
    in ``casting.cast``. lines: cells of the surfaces' own grids, whose lines sheets should follow.
    Raises UserError if no projector is finite.
    """
    first = projections[0]
    spans = first.volume.spans
    alike = [p for p in projections if _same(p.volume.spans, spans)]
    pixel_error = max(pixel_error, SMALLEST_ERROR)
    sampled = [_sample(p, size) for p in alike]
    curves = Curves(
        *(np.concatenate(parts, axis=2) for parts in zip(*(each.curves for each in sampled), strict=True))
    )
    if curves.points.shape[2] == 0:
        raise UserError("No projector of the volume is finite: check the transforms of its control surfaces")
    missing = 1.0 - float(np.mean([np.mean(each.present) for each in sampled]))
    breaks, shifts, error = _breaks(spans, curves, CHORD_SHARE * pixel_error)
    cells, between = _cells(alike, size, breaks, (1.0 - CHORD_SHARE) * pixel_error, lines)
    return ChordPlan(
        breaks=breaks,
        shifts=shifts,
        cells=cells,
        error=error + between,
        missing=missing,
        disc=_shape(first)[0],
        cone=pixel_cone(spans, [(s.curves, s.x, s.y) for s in sampled], size, first.aspect),
    )


def chord_error(projection: Projection, size: tuple[int, int], breaks: Array, shifts: Array) -> float:
    """The error of given chords, in pixels, as ``plan_chords`` measures it."""
    curves = _sample(projection, size).curves
    return _measure(projection.volume.spans, curves, breaks, shifts)


def _same(a: SpanBasis, b: SpanBasis) -> bool:
    if (a.point_weights is None) != (b.point_weights is None):
        return False
    return a.matrices.shape == b.matrices.shape and bool(np.array_equal(a.matrices, b.matrices))


class _Sampled(NamedTuple):
    """Projectors, their image positions (S,), and whether each exists of those that were tried."""

    curves: Curves
    x: Array
    y: Array
    present: BoolArray


def _sample(projection: Projection, size: tuple[int, int]) -> _Sampled:
    """Projectors spread over the image."""
    # Borders too, a little inside: derivatives are one-sided there.
    x, y = (np.linspace(1e-6, 1.0 - 1e-6, count) for count in SAMPLES)
    across, up = np.meshgrid(x, y)
    x, y = image_places(across.ravel(), up.ravel(), *_shape(projection))
    curves, valid, mask = _curves(projection, size, x, y)
    present = valid & curves.finite()
    if not _shape(projection)[0]:
        # On the rim of a disc rounding decides.
        present &= mask
    return _Sampled(curves.only(present), x[present], y[present], present)


def _curves(
    projection: Projection, size: tuple[int, int], x: Array, y: Array
) -> tuple[Curves, BoolArray, BoolArray]:
    """The ``curves_through`` image positions, with derivatives by one pixel."""
    curves, valid, mask = curves_through(projection, x, y)
    return Curves(curves.points, curves.dx / size[0], curves.dy / size[1]), valid, mask


def _shape(projection: Projection) -> tuple[bool, float]:
    """Return whether the image is a disc, and its aspect."""
    return is_disc(projection.reparameterisation, projection.aspect), projection.aspect


def _breaks(spans: SpanBasis, curves: Curves, pixel_error: float) -> tuple[Array, Array, float]:
    """The fewest breaks that keep an error in pixels, MOST_CHORDS at most; their shifts, their error."""
    if spans.is_polyline:
        return spans.breaks, np.zeros(len(spans.breaks)), 0.0
    totals = [_demand(spans, span, curves) for span in range(len(spans.matrices))]
    few, many = 0, MOST_CHORDS + 1
    best = None
    density = 1.0 / np.sqrt(pixel_error)
    for _ in range(ATTEMPTS):
        breaks = np.concatenate([_quantiles(spans, s, *t, density) for s, t in enumerate(totals)] + [[1.0]])
        shifts = _shifts(spans, breaks)
        error = _measure(spans, curves, breaks, shifts)
        count = len(breaks) - 1
        if error <= pixel_error and count < many:
            best, many = (breaks, shifts, error), count
        elif error > pixel_error and count > few:
            few = count
            if best is None and count >= MOST_CHORDS:
                return breaks, shifts, error
        if many - few <= 1:
            break
        wanted = np.clip(count * np.sqrt(error / pixel_error), few + 0.5, many - 0.5)
        density *= min(wanted, MOST_CHORDS) / count
    return (breaks, shifts, error) if best is None else best


def _demand(spans: SpanBasis, span: int, curves: Curves) -> tuple[Array, Array]:
    """Places in a span, as angles (``half_cosine``), and the chords before each for an error of one pixel."""
    edges = np.linspace(0.0, np.pi, STEPS + 1)
    middle = 0.5 * (edges[1:] + edges[:-1])
    there = pixels(curves, spans, span, half_cosine(middle))
    length = spans.breaks[span + 1] - spans.breaks[span]
    bend = SHIFT * there.moved(there.bend)
    share = np.sqrt(bend).max(axis=1) * length * 0.5 * np.sin(middle) * np.diff(edges)
    return edges, running_total(share)


def _quantiles(spans: SpanBasis, span: int, edges: Array, total: Array, density: float) -> Array:
    """The breaks of one span without its end."""
    local = graded(total, edges, max(1, int(np.ceil(density * total[-1]))))
    local[0] = 0.0
    low, high = spans.breaks[span], spans.breaks[span + 1]
    breaks: Array = low + local[:-1] * (high - low)
    return breaks


def _shifts(spans: SpanBasis, breaks: Array) -> Array:
    """Shifts of the chords' ends, in units of the bend: half the error then lies on either side of the curve.

    0 for rational projectors: with their bend, ends would move along the curve as well.
    """
    shifts = np.zeros(len(breaks))
    if spans.point_weights is None:
        steps = np.diff(breaks)
        shifts[1:-1] = SHIFT * steps[1:] * steps[:-1]
        # Spans meet in corners, or nearly: those are kept.
        shifts[np.isin(breaks, spans.breaks)] = 0.0
    return shifts


def _measure(spans: SpanBasis, curves: Curves, breaks: Array, shifts: Array) -> float:
    """Largest distance of curve and chords, in pixels."""
    largest = 0.0
    for start, end, shift, next_shift in zip(breaks[:-1], breaks[1:], shifts[:-1], shifts[1:], strict=True):
        span = int(spans.locate(0.5 * (start + end))[0])
        low, high = spans.breaks[span], spans.breaks[span + 1]
        local = (np.linspace(start, end, PLACES) - low) / (high - low)
        there = pixels(curves, spans, span, local)
        values, _, bends = spans.within(span, local[[0, -1]])
        weights = values - np.array([shift, next_shift])[:, None] * bends
        ends = np.einsum("gk,kcs->gcs", weights, curves.points)
        chord = np.broadcast_to((ends[1] - ends[0])[:, None], there.position.shape)
        offset = across(there.position - ends[0][:, None], chord)
        largest = max(largest, float(there.moved(offset).max(initial=0.0)))
    return largest


def _cells(
    projections: Sequence[Projection],
    size: tuple[int, int],
    breaks: Array,
    pixel_error: float,
    lines: tuple[int, int],
) -> tuple[tuple[int, int], float]:
    """Cells across and up that keep the pixel error between vertices too, and the error that is left."""
    least = ROUND_CELLS if _shape(projections[0])[0] else FEWEST_CELLS
    most = MOST_VERTICES // len(breaks)
    # Multiples of the surfaces' own cells: their lines are creases.
    cells = [count * -(-least // count) if count < MOST_CELLS else MOST_CELLS for count in lines]
    while True:
        errors = np.max([_between(p, size, breaks, cells) for p in projections], axis=0)
        finer = [errors[axis] > pixel_error for axis in range(2)]
        if not any(finer) and errors[2] > pixel_error:
            # The twist of a cell: both sides count alike.
            finer[int(cells[1] < cells[0])] = True
        finer = [more and 2 * count <= MOST_CELLS for more, count in zip(finer, cells, strict=True)]
        wanted = [count * 2 if more else count for count, more in zip(cells, finer, strict=True)]
        if wanted == cells or wanted[0] * wanted[1] > most:
            return (cells[0], cells[1]), float(errors.max())
        cells = wanted


def _between(projection: Projection, size: tuple[int, int], breaks: Array, cells: Sequence[int]) -> Array:
    """The error half way along cells' sides and diagonals, in pixels: (3,) across, up, diagonal."""
    column, row = (
        np.unique(np.linspace(0, count - 1, min(count, CELL_SAMPLES)).astype(int)) for count in cells
    )
    column, row = (a.ravel() for a in np.meshgrid(column, row))

    def corner(right: int, up: int) -> tuple[Array, Array]:
        """Image positions of the cells' corners: 0 left or bottom, 1 right or top."""
        return image_places((column + right) / cells[0], (row + up) / cells[1], *_shape(projection))

    others = ((1, 0), (0, 1), (1, 1))
    return np.array([_off(projection, size, breaks, corner(0, 0), corner(*other)) for other in others])


def _off(
    projection: Projection,
    size: tuple[int, int],
    breaks: Array,
    one: tuple[Array, Array],
    other: tuple[Array, Array],
) -> float:
    """Largest distance, in pixels, of projectors half way from the mean of those at both ends."""
    spans = projection.volume.spans
    x, y = (0.5 * (a + b) for a, b in zip(one, other, strict=True))
    with np.errstate(invalid="ignore", over="ignore"):
        curves, valid, _ = _curves(projection, size, x, y)
        ends = [projection.projectors(*place) for place in (one, other)]
        off = 0.5 * (ends[0].points + ends[1].points) - curves.points
    valid = valid & ends[0].valid & ends[1].valid & curves.finite() & np.isfinite(off).all(axis=(0, 1))
    if not valid.any():
        return 0.0
    curves, off = curves.only(valid), off[:, :, valid]
    largest = 0.0
    for span, (low, high) in enumerate(zip(spans.breaks[:-1], spans.breaks[1:], strict=True)):
        inside = breaks[(breaks >= low) & (breaks <= high)]
        local = (inside[:: max(1, len(inside) // 8)] - low) / (high - low)
        there = pixels(curves, spans, span, local)
        values, _, _ = spans.within(span, local)
        largest = max(largest, float(there.moved(blend(values, off)).max()))
    return largest
