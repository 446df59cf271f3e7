# SPDX-License-Identifier: GPL-3.0-or-later
"""A batch of projectors as curves, and where they meet the planes of triangles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..projection.basis import SpanBasis
from ..projection.bezier import bernstein, bernstein_derivative, evaluate, restrict
from ..projection.typing import Array, BoolArray, IndexArray
from .plane_roots import unit_roots
from .scene import CastScene

# A curve that leaves a triangle by less than this share of it still hits it: with
# 0, curves aimed at an edge slip between both triangles (12 % do), with this none.
INSIDE = 1e-9

# A root this far outside [0, 1] is rounding; t is clipped.
T_ROUNDING = 1e-12

# A derivative below this share of the coordinates is what their rounding leaves of 0.
STILL = 1e-13

# Triangles that a solution may cross to reach the one that it is in.
WALK_STEPS = 4


class Solutions(NamedTuple):
    """Where M curves meet the planes of M triangles.

    t: (M,), NaN where they do not. triangle: (M,). barycentric: (2, M).
    inside: (M,) bool, the point is in the triangle.
    """

    t: Array
    triangle: IndexArray
    barycentric: Array
    inside: BoolArray

    def take(self, index: IndexArray) -> Solutions:
        """The solutions at ``index``."""
        return Solutions(self.t[index], self.triangle[index], self.barycentric[:, index], self.inside[index])

    def put(self, where: IndexArray, found: Solutions, which: IndexArray) -> None:
        """Write the solutions ``which`` of ``found`` over those at where[which]."""
        there = where[which]
        self.t[there] = found.t[which]
        self.triangle[there] = found.triangle[which]
        self.barycentric[:, there] = found.barycentric[:, which]
        self.inside[there] = found.inside[which]


@dataclass(frozen=True)
class Bundle:
    """N projectors. points: (K, 3, N) float64, cast space."""

    spans: SpanBasis
    points: Array

    @property
    def count(self) -> int:
        """The number of projectors."""
        return int(self.points.shape[2])

    @cached_property
    def single(self) -> NDArray[np.float32]:
        """The control points in float32, as Embree sees them."""
        return self.points.astype(np.float32)

    def take(self, index: IndexArray) -> Bundle:
        """The projectors at ``index`` (M,)."""
        return Bundle(self.spans, self.points.take(index, 2))

    def at(self, t: Array) -> tuple[Array, Array]:
        """Position and tangent dQ/dt at t (N,), each (3, N)."""
        if self.spans.direct and self.spans.point_weights is None:
            weights, slopes = bernstein(self.spans.degree, t), bernstein_derivative(self.spans.degree, t)
        else:
            weights, slopes = self.spans.weights(t)
        return (
            np.einsum("kn,kcn->cn", weights, self.points),
            np.einsum("kn,kcn->cn", slopes, self.points),
        )

    def place(self, t: Array) -> Array:
        """The position at t (N,), (3, N)."""
        if self.spans.direct and self.spans.point_weights is None:
            weights = bernstein(self.spans.degree, t)
        else:
            weights = self.spans.weights(t)[0]
        position: Array = np.einsum("kn,kcn->cn", weights, self.points)
        return position

    def steer(self, t: Array, tangent: Array) -> None:
        """Where ``tangent`` (3, N), at t (N,), vanishes, put the first derivative that does not.

        Coincident control surfaces stop a projector for an instant. It leaves along
        that derivative; at t = 1 it arrives along it or, if its order is even, against it.
        """
        still = np.flatnonzero(tangent[0] == 0.0)
        still = still[~tangent[1:, still].any(axis=0)]
        if len(still) == 0:
            return
        curves, at = self.take(still), t[still]
        span, start, length = self.spans.locate(at)
        found = curves._leaving(span, (at - start) / length, at >= 1.0)
        # Where a whole span is a point, it is arrived at along the span before, or left along the next.
        last = len(self.spans.matrices) - 1
        for step in (*range(-1, -last - 1, -1), *range(1, last + 1)):
            beside = span + step
            going = np.flatnonzero(~found.any(axis=0) & (beside >= 0) & (beside <= last))
            if len(going):
                end = np.full(len(going), step < 0)
                found[:, going] = curves.take(going)._leaving(beside[going], end.astype(float), end)
        tangent[:, still] = found

    def _leaving(self, span: IndexArray, local: Array, arriving: BoolArray) -> Array:
        """The first derivative that does not vanish at ``local`` (N,) in the spans, (3, N); 0 for a point.

        arriving: (N,) where the direction is that from which the curve comes.
        """
        controls = np.einsum("nik,kcn->icn", self.spans.matrices[span], self.points)
        if self.spans.point_weights is not None:
            # Of C = A/w, seen from C's own place, the first derivative left is that of A, over w.
            value = bernstein(self.spans.degree, local) * self.spans.point_weights[span].T
            controls -= np.einsum("kn,kcn->cn", value / value.sum(axis=0), controls)
            controls *= self.spans.point_weights[span].T[:, None]
        found = np.zeros((3, self.count))
        least = STILL * np.abs(self.points).max(axis=(0, 1))
        for order in range(1, self.spans.degree + 1):
            derivative = evaluate(controls, local)[1]
            sign = np.where(arriving & (order % 2 == 0), -1.0, 1.0)
            found = np.where(
                found.any(axis=0) | (np.abs(derivative) <= least).all(axis=0), found, sign * derivative
            )
            controls = np.diff(controls, axis=0)
        return found

    def solve(
        self, scene: CastScene, triangle: IndexArray, span: IndexArray, low: Array, high: Array
    ) -> Solutions:
        """The first meeting with the triangles' planes in [low, high], inside the triangle if one is.

        triangle, span: (N,); low, high: (N,) in t, taken within the span.
        """
        plane = scene.planes.take(triangle, 1)
        heights = np.einsum("cn,kcn->kn", plane[:3], self.points)
        heights += plane[3]
        start, length, coefficients = self._span_coefficients(heights, span)
        first = np.clip((low - start) / length, 0.0 - T_ROUNDING, 1.0)
        last = np.clip((high - start) / length, 0.0, 1.0 + T_ROUNDING)
        if len(coefficients) == 3:
            roots = _quadratic(coefficients, first, last)
        elif len(coefficients) > 2:
            roots = _restricted(coefficients, first, last)
        else:
            roots = _linear(coefficients, first, last)
        t = np.clip(start + roots * length, 0.0, 1.0)
        best = self._inside(scene, triangle, t[0])
        for later in t[1:]:
            open_ones = np.flatnonzero(~best.inside & ~np.isnan(later))
            if len(open_ones):
                again = self.take(open_ones)._inside(scene, triangle[open_ones], later[open_ones])
                better = open_ones[again.inside]
                best.t[better] = again.t[again.inside]
                best.barycentric[:, better] = again.barycentric[:, again.inside]
                best.inside[better] = True
        return best

    def next_root(
        self, scene: CastScene, triangle: IndexArray, span: IndexArray, low: Array, high: Array
    ) -> Solutions:
        """The first meeting with the triangles' planes in [low, high] of t, in the spans; all (N,)."""
        plane = scene.planes.take(triangle, 1)
        heights = np.einsum("cn,kcn->kn", plane[:3], self.points)
        heights += plane[3]
        start, length, coefficients = self._span_coefficients(heights, span)
        if len(coefficients) > 3:
            # A short part nearly always rises or falls throughout, which makes roots easy.
            first, last = np.maximum((low - start) / length, 0.0), np.minimum((high - start) / length, 1.0)
            roots = first + unit_roots(restrict(coefficients, first, last)) * (last - first)
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
        return self._inside(scene, triangle, t)

    def walk(self, scene: CastScene, span: IndexArray, low: Array, high: Array, found: Solutions) -> int:
        """Move solutions outside their triangle to the neighbour that they are in.

        ``found`` is changed where that succeeds; returns how often it did.
        """
        moved = 0
        current = np.flatnonzero(~found.inside & ~np.isnan(found.t))
        at = found.take(current)
        for _ in range(WALK_STEPS):
            b, c = at.barycentric
            corner = np.argmin(np.stack([1.0 - b - c, b, c]), axis=0)
            following = scene.neighbours[corner, at.triangle]
            usable = np.flatnonzero(following >= 0)
            current = current[usable]
            if len(current) == 0:
                break
            at = self.take(current).solve(
                scene, following[usable], span[current], low[current], high[current]
            )
            arrived = np.flatnonzero(at.inside)
            found.put(current, at, arrived)
            moved += len(arrived)
            going = np.flatnonzero(~at.inside & ~np.isnan(at.t))
            current, at = current[going], at.take(going)
        return moved

    def _span_coefficients(self, heights: Array, span: IndexArray) -> tuple[Array, Array, Array]:
        """Start and length of the spans in t, and the heights as their Bézier coefficients.

        Of a rational span those of the numerator: it is 0 where the curve is in the plane.
        """
        breaks, weights = self.spans.breaks, self.spans.point_weights
        if self.spans.direct:
            if weights is not None:
                heights = heights * weights[0][:, None]
            return breaks[:1], breaks[1:] - breaks[:1], heights
        coefficients: Array = np.einsum("nik,kn->in", self.spans.matrices[span], heights)
        if weights is not None:
            coefficients *= weights[span].T
        return breaks[span], breaks[span + 1] - breaks[span], coefficients

    def _inside(self, scene: CastScene, triangle: IndexArray, t: Array) -> Solutions:
        """Solutions at t (N,), NaN allowed."""
        known = ~np.isnan(t)
        position = self.place(np.where(known, t, 0.0))
        barycentric = scene.barycentric(position, triangle)
        second, third = barycentric
        inside = known & (second >= -INSIDE) & (third >= -INSIDE) & (second + third <= 1.0 + INSIDE)
        return Solutions(t, triangle, barycentric, inside)


def _restricted(coefficients: Array, low: Array, high: Array) -> Array:
    """The roots in [low, high] of N polynomials, ascending, (d, N), NaN where fewer exist."""
    roots: Array = low + unit_roots(restrict(coefficients, low, high)) * (high - low)
    return roots


def _quadratic(coefficients: Array, low: Array, high: Array) -> Array:
    """As _restricted: all roots are as quickly found as those in a part, but at the ends of [0, 1]."""
    roots = unit_roots(coefficients)
    with np.errstate(invalid="ignore"):
        roots[(roots < low) | (roots > high)] = np.nan
    late = np.flatnonzero(np.isnan(roots[0]))
    roots[0, late] = roots[1, late]
    roots[1, late] = np.nan
    ends = np.flatnonzero((low <= 0.0) | (high >= 1.0))
    if len(ends):
        roots[:, ends] = _restricted(coefficients.take(ends, 1), low.take(ends), high.take(ends))
    return roots


def _linear(coefficients: Array, low: Array, high: Array) -> Array:
    """The root in [low, high] of N linear polynomials, (1, N), NaN where none is."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        root = coefficients[0] / (coefficients[0] - coefficients[1])
        return np.where((root >= low) & (root <= high), root, np.nan)[None]
