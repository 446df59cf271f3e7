# SPDX-License-Identifier: GPL-3.0-or-later
"""A batch of projectors as curves, and where they meet the planes of triangles."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..projection.basis import SpanBasis
from ..projection.bezier import evaluate, restrict
from ..projection.typing import Array, BoolArray, IndexArray
from .plane_roots import unit_roots
from .scene import CastScene

# A curve that leaves a triangle by less than this share of it still hits it: with
# 0, curves aimed at an edge slip between both triangles (12 % do), with this none.
INSIDE = 1e-9

# A root this far outside [0, 1] is rounding; t is clipped.
T_ROUNDING = 1e-12

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

    def take(self, index: IndexArray) -> Bundle:
        """The projectors at ``index`` (M,)."""
        return Bundle(self.spans, self.points.take(index, 2))

    def at(self, t: Array) -> tuple[Array, Array]:
        """Position and tangent dQ/dt at t (N,), each (3, N)."""
        if len(self.spans.matrices) == 1:
            return evaluate(self._span_controls(0), t)
        weights, slopes = self.spans.weights(t)
        return (
            np.einsum("kn,kcn->cn", weights, self.points),
            np.einsum("kn,kcn->cn", slopes, self.points),
        )

    def steer(self, t: Array, tangent: Array) -> None:
        """Where ``tangent`` (3, N), at t (N,), vanishes, put the first derivative that does not.

        Coincident control surfaces stop a projector for an instant. It leaves along
        that derivative; at t = 1 it arrives along it or, if its order is even, against it.
        """
        still = np.flatnonzero(~tangent.any(axis=0))
        if len(still) == 0:
            return
        at = t[still]
        span, start, length = self.spans.locate(at)
        local = (at - start) / length
        controls = np.einsum("nik,kcn->icn", self.spans.matrices[span], self.points.take(still, 2))
        for order in range(2, self.spans.degree + 1):
            controls = np.diff(controls, axis=0)
            higher = evaluate(controls, local)[1]
            lacking = ~tangent[:, still].any(axis=0)
            sign = np.where((at >= 1.0) & (order % 2 == 0), -1.0, 1.0)
            tangent[:, still] = np.where(lacking, sign * higher, tangent[:, still])

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
        if len(coefficients) > 2:
            roots = unit_roots(restrict(coefficients, first, last))
            roots = first + roots * (last - first)
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

    def _span_controls(self, span: int) -> Array:
        matrix = self.spans.matrices[span]
        if len(self.spans.matrices) == 1 and matrix.shape[0] == matrix.shape[1]:
            return self.points
        controls: Array = np.einsum("ik,kcn->icn", matrix, self.points)
        return controls

    def _span_coefficients(self, heights: Array, span: IndexArray) -> tuple[Array, Array, Array]:
        """Start and length of the spans in t, and the heights as their Bézier coefficients."""
        breaks = self.spans.breaks
        if len(self.spans.matrices) == 1:
            matrix = self.spans.matrices[0]
            plain = matrix.shape[0] == matrix.shape[1]
            return breaks[:1], breaks[1:] - breaks[:1], heights if plain else matrix @ heights
        coefficients: Array = np.einsum("nik,kn->in", self.spans.matrices[span], heights)
        return breaks[span], breaks[span + 1] - breaks[span], coefficients

    def _inside(self, scene: CastScene, triangle: IndexArray, t: Array) -> Solutions:
        """Solutions at t (N,), NaN allowed."""
        known = ~np.isnan(t)
        position = self.at(np.where(known, t, 0.0))[0]
        barycentric = scene.barycentric(position, triangle)
        second, third = barycentric
        inside = known & (second >= -INSIDE) & (third >= -INSIDE) & (second + third <= 1.0 + INSIDE)
        return Solutions(t, triangle, barycentric, inside)


def _linear(coefficients: Array, low: Array, high: Array) -> Array:
    """The root in [low, high] of N linear polynomials, (1, N), NaN where none is."""
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        root = coefficients[0] / (coefficients[0] - coefficients[1])
        return np.where((root >= low) & (root <= high), root, np.nan)[None]
