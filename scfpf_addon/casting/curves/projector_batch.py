# SPDX-License-Identifier: GPL-3.0-or-later
"""A batch of projectors as curves, and where they meet the planes of triangles."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, IndexArray
from ...projection.volume.basis import SpanBasis
from ...projection.volume.bezier import bernstein, evaluate, restrict
from ..scene.cast_scene import CastScene
from .plane_roots import crossing, short_cubic_roots, unit_roots

# A curve that leaves a triangle by less than this share of it still hits it: with
# 0, curves aimed at an edge slip between both triangles (12 % do), with this none.
INSIDE = 1e-9

# A root this far outside [0, 1] is rounding; t is clipped.
T_ROUNDING = 1e-12

# A derivative below this share of the coordinates is what their rounding leaves of 0.
STILL = 1e-13

# Triangles that a solution may cross to reach the one that it is in.
WALK_STEPS = 4

# Curves whose positions are worked out at a time: their arrays fit in a core's own cache.
PORTION = 8192


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
        return Solutions(
            self.t.take(index),
            self.triangle.take(index),
            self.barycentric.take(index, 1),
            self.inside.take(index),
        )

    def put(self, where: IndexArray, found: Solutions, which: IndexArray) -> None:
        """Write the solutions ``which`` of ``found`` over those at where[which]."""
        there = where[which]
        self.t[there] = found.t[which]
        self.triangle[there] = found.triangle[which]
        self.barycentric[:, there] = found.barycentric[:, which]
        self.inside[there] = found.inside[which]


@dataclass(frozen=True)
class ProjectorBatch:
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

    def take(self, index: IndexArray) -> ProjectorBatch:
        """The projectors at ``index`` (M,)."""
        return ProjectorBatch(self.spans, self.points.take(index, 2))

    def at(self, t: Array) -> tuple[Array, Array]:
        """Position and tangent dQ/dt at t (N,), each (3, N)."""
        if self.spans.is_bezier:
            return self._at_quadratic(t) if self.spans.degree == 2 else self._at_bezier(t)
        weights, slopes = self.spans.weights(t)
        return (
            np.einsum("kn,kcn->cn", weights, self.points),
            np.einsum("kn,kcn->cn", slopes, self.points),
        )

    def _at_quadratic(self, t: Array) -> tuple[Array, Array]:
        """As ``at``, by differences: Q0 + t (2 d + t e), with d from Q0 to Q1 and e how that changes."""
        first, middle, last = self.points
        step = middle - first
        change = last - middle
        change -= step
        change *= t
        tangent = change
        tangent += step
        position = step
        position += tangent
        position *= t
        position += first
        tangent *= 2.0
        return position, tangent

    def _at_bezier(self, t: Array) -> tuple[Array, Array]:
        """As ``at``, of plain Bézier curves: de Casteljau's algorithm on the differences of their points.

        What it leaves at the front of each round adds up to the way from the first point, by t.
        """
        position, tangent = np.empty((2, 3, self.count))
        for begin in range(0, self.count, PORTION):
            part = slice(begin, begin + PORTION)
            points, at = self.points[:, :, part], t[part]
            steps = points[1:] - points[:-1]
            way = steps[0]
            for _ in range(len(steps) - 1):
                change = steps[1:] - steps[:-1]
                change *= at
                change += steps[:-1]
                steps = change
                way = way + steps[0]
            way = np.multiply(way, at, out=position[:, part])
            way += points[0]
            np.multiply(steps[0], self.spans.degree, out=tangent[:, part])
        return position, tangent

    def place(self, t: Array) -> Array:
        """The position at t (N,), (3, N)."""
        spans = self.spans
        weights = bernstein(spans.degree, t) if spans.is_bezier else spans.weights(t)[0]
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
            root, others = _single_roots(coefficients, first, last)
        elif len(coefficients) == 4:
            root, sure = short_cubic_roots(coefficients, first, last)
            others = np.flatnonzero(~sure)
        else:
            root, others = np.empty(len(triangle)), np.arange(len(triangle))
        several = _restricted if len(coefficients) > 2 else _linear
        roots = several(coefficients.take(others, 1), first.take(others), last.take(others))
        root[others] = roots[0]
        best = self._inside(scene, triangle, np.clip(start + root * length, 0.0, 1.0))
        if len(roots) > 1 and len(others):
            if not self.spans.direct:
                start, length = start.take(others), length.take(others)
            later = np.clip(start + roots[1:] * length, 0.0, 1.0)
            for t in later:
                open_ones = np.flatnonzero(~best.inside.take(others) & ~np.isnan(t))
                if len(open_ones):
                    which = others[open_ones]
                    again = self.take(which)._inside(scene, triangle[which], t[open_ones])
                    best.put(which, again, np.flatnonzero(again.inside))
        return best

    def next_root(
        self, scene: CastScene, triangle: IndexArray, span: IndexArray, low: Array, high: Array
    ) -> tuple[Solutions, Array]:
        """The first meeting with the triangles' planes in [low, high] of t, in the spans; all (N,).

        Also where that is, (3, N), anything where it is nowhere.
        """
        plane = scene.planes.take(triangle, 1)
        heights = np.einsum("cn,kcn->kn", plane[:3], self.points)
        heights += plane[3]
        start, length, coefficients = self._span_coefficients(heights, span)
        if len(coefficients) > 3:
            # A short part nearly always rises or falls throughout, which makes roots easy.
            first, last = np.maximum((low - start) / length, 0.0), np.minimum((high - start) / length, 1.0)
            roots = _short(coefficients, first, last)
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
        return self._inside_at(scene, triangle, t)

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
        return self._inside_at(scene, triangle, t)[0]

    def _inside_at(self, scene: CastScene, triangle: IndexArray, t: Array) -> tuple[Solutions, Array]:
        """As _inside, and where they are, (3, N)."""
        known = ~np.isnan(t)
        position = self.place(np.where(known, t, 0.0))
        barycentric = scene.barycentric(position, triangle)
        second, third = barycentric
        inside = known & (second >= -INSIDE) & (third >= -INSIDE) & (second + third <= 1.0 + INSIDE)
        return Solutions(t, triangle, barycentric, inside), position


def _restricted(coefficients: Array, low: Array, high: Array) -> Array:
    """The roots in [low, high] of N polynomials, ascending, (d, N), NaN where fewer exist."""
    roots: Array = low + unit_roots(restrict(coefficients, low, high)) * (high - low)
    return roots


def _short(coefficients: Array, low: Array, high: Array) -> Array:
    """As _restricted, where most polynomials rise or fall throughout."""
    if len(coefficients) != 4:
        return _restricted(coefficients, low, high)
    roots = np.full((3, len(low)), np.nan)
    roots[0], sure = short_cubic_roots(coefficients, low, high)
    others = np.flatnonzero(~sure)
    if len(others):
        roots[:, others] = _restricted(coefficients.take(others, 1), low.take(others), high.take(others))
    return roots


def _single_roots(coefficients: Array, low: Array, high: Array) -> tuple[Array, IndexArray]:
    """The roots (N,) of quadratics whose ends lie on different sides, and the numbers of those left.

    Left are those with another number of roots, those whose root is not in [low, high], and those for
    which an end of that is one of [0, 1]: there rounding decides.
    """
    first, middle, last = coefficients
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        root = crossing(first, middle, last)
        known = (first * last < 0.0) & (root >= low) & (root <= high)
    known &= (low > 0.0) & (high < 1.0)
    return root, np.flatnonzero(~known)


def _linear(coefficients: Array, low: Array, high: Array) -> Array:
    """The root in [low, high] of N linear polynomials, (1, N), NaN where none is."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        root = coefficients[0] / (coefficients[0] - coefficients[1])
        return np.where((root >= low) & (root <= high), root, np.nan)[None]
