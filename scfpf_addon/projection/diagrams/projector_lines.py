# SPDX-License-Identifier: GPL-3.0-or-later
"""The projectors of a drawn volume, whole or parted where they are folded.

As in ``diagram``: segments (S, 2, 3) float32 in the space of the projection.
"""

from __future__ import annotations

import numpy as np

from ..typing import Array, BoolArray, IndexArray
from ..volume.basis import SpanBasis
from ..volume.bezier import chord_count
from ..volume.folds import find_folds, folded_pieces
from ..volume.viewing_volume import Projection, ViewingVolume
from .segments import Segments, joined, ranged, segments
from .surface_lines import distance_from_net

# Places along each side of a cell of drawn projectors at which bends between them are looked for, and how far
# the controls must be from where the drawn ones have them, as a share of a cell: a full turn has 0.4.
BETWEEN, LEAVES_PROJECTORS = 4, 0.5
# Those that leave as far as the farthest one but for this share are drawn with it: symmetric ones.
AS_FAR = 1e-3
# A drawn projector leaves its curve by at most this share of its control polygon's length.
BEND_TOLERANCE = 1e-3
# More chords than this in one span look the same on a screen.
MAXIMUM_CHORDS = 128
# Places in a span of rational projectors at which their bend is measured.
BEND_SAMPLES = np.linspace(0.0, 1.0, 33)
# The bend along a projector counts by this share: it only shifts chord ends, but where the curve turns back.
BEND_ALONG = 0.25
# Pieces along t in which a projector is looked at for folds, and drawn where it has one.
FOLD_PIECES = 48
# How far beside a drawn projector folds are looked for, as a share of the u and v ranges.
BESIDE = 1e-4


def projector_lines(
    projection: Projection, count_u: int, count_v: int, chords: int | None = None
) -> Segments:
    """A sampling of the volume's projectors: count_u × count_v of them, evenly over the u and v ranges.

    They include the borders if a count is 2 or more, and projectors between them that bend otherwise. chords:
    segments in each span of a projector; None for as many as the bend of each needs, one for straight ones.
    """
    controls = projection.volume.controls(*ranged(projection, *_drawn_places(projection, count_u, count_v)))
    return _curves(projection.volume, controls.points, controls.valid, chords)


def parted_projector_lines(
    projection: Projection, count_u: int, count_v: int
) -> tuple[Segments, Segments, Segments]:
    """``projector_lines`` in two parts, the pieces in order and the folded ones; dashes all over folds."""
    volume, folds = projection.volume, find_folds(projection)
    places = _drawn_places(projection, count_u, count_v)
    controls = volume.controls(*ranged(projection, *places))
    ends = np.union1d(np.linspace(0.0, 1.0, FOLD_PIECES + 1), volume.spans.breaks)
    middles = (ends[1:] + ends[:-1]) / 2
    # The lines of a control grid may run here, where derivatives are those of one side: all sides count.
    beside = volume.controls(*ranged(projection, *_beside(*places)))
    folded = (
        folded_pieces(volume, beside, middles, folds.orientation).reshape(4, -1, len(middles)).any(axis=0)
    )
    dashes = segments(folds.dashes, np.ones(folds.dashes.shape[1:], bool))
    mixed = folded.any(axis=1)
    if not mixed.any():
        return _curves(volume, controls.points, controls.valid), joined([]), dashes
    whole = _curves(volume, controls.points[..., ~mixed], controls.valid[~mixed])
    weights, _ = volume.spans.weights(ends)
    curves = np.moveaxis(controls.points[..., mixed], 0, -1) @ weights
    parts = []
    for kept in (~folded[mixed], folded[mixed]):
        pairs = np.stack([curves[..., :-1], curves[..., 1:]], axis=-1)[:, kept]
        valid = np.repeat(controls.valid[mixed, None], kept.shape[1], axis=1)[kept]
        parts.append(segments(pairs, np.stack([valid, valid], axis=1)))
    return joined([whole, parts[0]]), parts[1], dashes


def picked_line(projection: Projection, x: float, y: float) -> Segments:
    """The projector through an image position; no segments where the image shows nothing."""
    projectors = projection.projectors(np.array([x]), np.array([y]))
    return _curves(projection.volume, projectors.points, projectors.valid)


def projector_point(projection: Projection, x: float, y: float, t: float) -> Segments:
    """The point at t of the projector through an image position, (1, 3) float32; (0, 3) without one."""
    projectors = projection.projectors(np.array([x]), np.array([y]))
    weights, _ = projection.volume.spans.weights(np.array([t]))
    points = np.einsum("k,kcn->nc", weights[:, 0], projectors.points)[projectors.valid]
    single: Segments = points.astype(np.float32)
    return single


def _drawn_places(projection: Projection, count_u: int, count_v: int) -> tuple[Array, Array]:
    """Shares x, y of the u and v ranges at which projectors are drawn: even ones, and bends between them."""
    x, y = (a.ravel() for a in np.meshgrid(_even(count_u), _even(count_v)))
    if min(count_u, count_v) < 2:
        return x, y
    cells = count_u - 1, count_v - 1
    surfaces = projection.volume.surfaces
    left = np.max([distance_from_net(projection, one, cells, BETWEEN) for one in surfaces], axis=0)
    # Of each cell, without its last row and column, the places that leave the net farthest.
    blocks = left[:-1, :-1].reshape(cells[1], BETWEEN, cells[0], BETWEEN)
    most = np.maximum((1.0 - AS_FAR) * blocks.max(axis=(1, 3), keepdims=True), LEAVES_PROJECTORS)
    rows, columns = np.nonzero((blocks >= most).reshape(BETWEEN * cells[1], BETWEEN * cells[0]))
    return (
        np.concatenate([x, columns / (BETWEEN * cells[0])]),
        np.concatenate([y, rows / (BETWEEN * cells[1])]),
    )


def _beside(x: Array, y: Array) -> tuple[Array, Array]:
    """Shares near x, y (N,), inside the borders: all of them on each of the four sides in turn."""
    steps = np.array([[-BESIDE, -BESIDE, BESIDE, BESIDE], [-BESIDE, BESIDE, -BESIDE, BESIDE]])
    around = np.clip(np.stack([x, y])[:, None] + steps[..., None], BESIDE, 1.0 - BESIDE)
    return around[0].ravel(), around[1].ravel()


def _curves(volume: ViewingVolume, controls: Array, valid: BoolArray, chords: int | None = None) -> Segments:
    """The curves with control points (m+1, 3, N); see ``projector_lines``."""
    result = []
    for span in range(len(volume.spans.matrices)):
        if chords is None:
            needed = _chords_needed(volume.spans, span, controls)
        else:
            needed = np.full(controls.shape[2], chords)
        for count in np.unique(needed):
            chosen = needed == count
            shares = volume.spans.values(span, np.linspace(0.0, 1.0, count + 1))
            curves = np.moveaxis(controls[:, :, chosen], 0, -1) @ shares.T
            result.append(segments(curves, np.repeat(valid[chosen, None], count + 1, axis=1)))
    return joined(result)


def _chords_needed(spans: SpanBasis, span: int, controls: Array) -> IndexArray:
    """The number of chords of equal steps in t that draw each curve in a span, (N,)."""
    points = np.einsum("kc,cdn->kdn", spans.matrices[span], controls)
    length = np.sqrt((np.diff(points, axis=0) ** 2).sum(axis=1)).sum(axis=0)
    # A span of no length has no bend either; any tolerance does for it.
    tolerance = np.where(length > 0, BEND_TOLERANCE * length, 1.0)
    if spans.point_weights is None:
        return np.minimum(chord_count(points, tolerance), MAXIMUM_CHORDS)
    # Bounds for rational curves ask for several times too many, so the bend is measured.
    _, slopes, bends = spans.within(span, BEND_SAMPLES)
    flat = controls.reshape(len(controls), -1)
    way, bend = ((w @ flat).reshape(len(w), *controls.shape[1:]) for w in (slopes, bends))
    whole = np.einsum("gdn,gdn->gn", bend, bend)
    speed = np.maximum(np.einsum("gdn,gdn->gn", way, way), np.finfo(float).tiny)
    across = whole - np.einsum("gdn,gdn->gn", way, bend) ** 2 / speed
    largest = np.sqrt(np.maximum(across, BEND_ALONG**2 * whole).max(axis=0))
    extent = spans.breaks[span + 1] - spans.breaks[span]
    needed = np.ceil(extent * np.sqrt(largest / (8.0 * tolerance)))
    counts: IndexArray = np.clip(needed, 1, MAXIMUM_CHORDS).astype(np.int64)
    return counts


def _even(count: int) -> Array:
    return np.linspace(0.0, 1.0, count) if count > 1 else np.array([0.5])
