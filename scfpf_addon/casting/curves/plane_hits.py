# SPDX-License-Identifier: GPL-3.0-or-later
"""Intersections of projectors with the planes of triangles, in float64, inside the triangles or not."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...projection.arrays import put_columns
from ...projection.typing import Array, BoolArray, IndexArray
from ...projection.volume.basis import SpanBasis
from ..common.hits import Hits
from ..scene.cast_triangles import CastTriangles
from .plane_roots import short_roots, unit_roots
from .projector_batch import ProjectorBatch

# A curve that leaves a triangle by less than this share of it still hits it: with
# 0, curves aimed at an edge slip between both triangles (12 % do), with this none.
INSIDE = 1e-9

# A root this far outside [0, 1] is rounding; t is clipped.
T_ROUNDING = 1e-12

# Triangles that a solution may cross to reach the one that it is in.
MOST_CROSSED = 4


class Solutions(NamedTuple):
    """Intersections of M curves with the planes of M triangles.

    t: (M,), NaN without a hit. triangle: (M,). barycentric: (2, M).
    inside: (M,) bool, the point is in the triangle.
    """

    t: Array
    triangle: IndexArray
    barycentric: Array
    inside: BoolArray

    def take(self, index: IndexArray) -> Solutions:
        """The solutions at ``index``."""
        return Solutions._make(field.take(index, -1) for field in self)

    def put(self, where: IndexArray, found: Solutions, which: IndexArray) -> None:
        """Write the solutions ``which`` of ``found`` over those at where[which]."""
        there = where[which]
        self.t[there] = found.t[which]
        self.triangle[there] = found.triangle[which]
        put_columns(self.barycentric, there, found.barycentric.take(which, 1))
        self.inside[there] = found.inside[which]

    def store(self, hits: Hits, projector: IndexArray) -> None:
        """Write all solutions into the hits of the projectors (M,)."""
        hits.t[projector] = self.t
        hits.triangle[projector] = self.triangle
        # Row by row: indices along one axis alone are fast.
        for row, weights in zip(hits.barycentric, self.barycentric, strict=True):
            row[projector] = weights


def solve(
    curves: ProjectorBatch,
    scene: CastTriangles,
    triangle: IndexArray,
    span: IndexArray,
    low: Array,
    high: Array,
) -> Solutions:
    """The first intersection with the triangles' planes in [low, high], one inside the triangle if any is.

    triangle, span: (N,); low, high: (N,) in t, taken within the span.
    """
    start, length, coefficients = _plane_heights(curves, scene, triangle, span)
    first = np.clip((low - start) / length, 0.0 - T_ROUNDING, 1.0)
    last = np.clip((high - start) / length, 0.0, 1.0 + T_ROUNDING)
    root, others, later = short_roots(coefficients, first, last)
    best = _solutions_at(curves, scene, triangle, np.clip(start + root * length, 0.0, 1.0))[0]
    if len(others) and not curves.spans.direct:
        start, length = start.take(others), length.take(others)
    for more in later if len(others) else ():
        t = np.clip(start + more * length, 0.0, 1.0)
        missed = np.flatnonzero(~best.inside.take(others) & ~np.isnan(t))
        if len(missed):
            which = others[missed]
            again = _solutions_at(curves.take(which), scene, triangle[which], t[missed])[0]
            best.put(which, again, np.flatnonzero(again.inside))
    return best


def first_root(
    curves: ProjectorBatch,
    scene: CastTriangles,
    triangle: IndexArray,
    span: IndexArray,
    low: Array,
    high: Array,
) -> tuple[Solutions, Array]:
    """The first intersection with the triangles' planes in [low, high] of t, in the spans; all (N,).

    Also its position, (3, N), undefined without a hit.
    """
    start, length, coefficients = _plane_heights(curves, scene, triangle, span)
    if len(coefficients) > 3:
        # A short part nearly always rises or falls throughout, which makes roots easy.
        first, last = np.maximum((low - start) / length, 0.0), np.minimum((high - start) / length, 1.0)
        roots = np.full((len(coefficients) - 1, len(low)), np.nan)
        roots[0], others, later = short_roots(coefficients, first, last)
        roots[1:, others] = later
    else:
        roots = unit_roots(coefficients)
    roots *= length
    roots += start
    t = roots[0]
    with np.errstate(invalid="ignore"):
        for root in roots[1:]:
            early = np.flatnonzero(t < low)
            t[early] = root[early]
        t[(t < low) | (t > high)] = np.nan
    return _solutions_at(curves, scene, triangle, t)


def move_to_neighbours(
    curves: ProjectorBatch, scene: CastTriangles, span: IndexArray, low: Array, high: Array, found: Solutions
) -> int:
    """Move solutions outside their triangle to the neighbour that they are in.

    ``found`` is changed where that succeeds; returns how often it did.
    """
    moved = 0
    current = np.flatnonzero(~found.inside & ~np.isnan(found.t))
    at = found.take(current)
    for _ in range(MOST_CROSSED):
        b, c = at.barycentric
        corner = np.argmin(np.stack([1.0 - b - c, b, c]), axis=0)
        following = scene.neighbours[corner, at.triangle]
        usable = np.flatnonzero(following >= 0)
        current = current[usable]
        if len(current) == 0:
            break
        some = curves.take(current)
        at = solve(some, scene, following[usable], span[current], low[current], high[current])
        arrived = np.flatnonzero(at.inside)
        found.put(current, at, arrived)
        moved += len(arrived)
        going = np.flatnonzero(~at.inside & ~np.isnan(at.t))
        current, at = current[going], at.take(going)
    return moved


def _plane_heights(
    curves: ProjectorBatch, scene: CastTriangles, triangle: IndexArray, span: IndexArray
) -> tuple[Array, Array, Array]:
    """Start and length of the spans in t, and the curves' heights over the planes as Bézier coefficients.

    For a rational span those of the numerator, which is 0 where the curve is in the plane.
    """
    plane = scene.planes.take(triangle, 1)
    heights = np.einsum("cn,kcn->kn", plane[:3], curves.points)
    heights += plane[3]
    return _span_coefficients(curves.spans, heights, span)


def _span_coefficients(spans: SpanBasis, heights: Array, span: IndexArray) -> tuple[Array, Array, Array]:
    """The result of ``_plane_heights`` from the heights (K, N) of the control points."""
    breaks, weights = spans.breaks, spans.point_weights
    if spans.direct:
        if weights is not None:
            heights = heights * weights[0][:, None]
        return breaks[:1], breaks[1:] - breaks[:1], heights
    coefficients: Array = np.einsum("nik,kn->in", spans.matrices[span], heights)
    if weights is not None:
        coefficients *= weights[span].T
    return breaks[span], breaks[span + 1] - breaks[span], coefficients


def _solutions_at(
    curves: ProjectorBatch, scene: CastTriangles, triangle: IndexArray, t: Array
) -> tuple[Solutions, Array]:
    """Solutions at t (N,), NaN allowed, and their positions (3, N)."""
    known = ~np.isnan(t)
    position = curves.place(np.where(known, t, 0.0))
    barycentric = scene.barycentric(position, triangle)
    second, third = barycentric
    inside = known & (second >= -INSIDE) & (third >= -INSIDE) & (second + third <= 1.0 + INSIDE)
    return Solutions(t, triangle, barycentric, inside), position
