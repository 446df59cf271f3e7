# SPDX-License-Identifier: GPL-3.0-or-later
"""A projector batch: curves with their positions, tangents, and directions where tangents vanish."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, IndexArray
from ...projection.volume.basis import SpanBasis
from ...projection.volume.bezier import bernstein, evaluate

# A derivative below this share of the coordinates is what their rounding leaves of 0.
STILL = 1e-13

# Curves evaluated at a time: their arrays fit in a core's own cache.
CHUNK = 8192


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
        """Evaluate quadratics by differences: Q0 + t (2 d + t e), d = Q1 - Q0 and e the second difference."""
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
        """Evaluate plain Bézier curves by de Casteljau's algorithm on the differences of their points.

        The first differences of all rounds add up to the way from the first point, divided by t.
        """
        position, tangent = np.empty((2, 3, self.count))
        for begin in range(0, self.count, CHUNK):
            part = slice(begin, begin + CHUNK)
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
        """Replace vanishing tangents (3, N) at t (N,) by the first derivative that does not vanish.

        Coincident control surfaces stop a projector for an instant. It leaves along
        that derivative. At t = 1 it arrives along it or, if its order is even, against it.
        """
        still = np.flatnonzero(tangent[0] == 0.0)
        still = still[~tangent[1:, still].any(axis=0)]
        if len(still) == 0:
            return
        curves, at = self.take(still), t[still]
        span, start, length = self.spans.locate(at)
        found = curves._leaving(span, (at - start) / length, at >= 1.0)
        # If a whole span is a point, the curve arrives along the span before, or leaves along the next.
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

        arriving: (N,) whether to return the direction of arrival instead of that of leaving.
        """
        controls = np.einsum("nik,kcn->icn", self.spans.matrices[span], self.points)
        if self.spans.point_weights is not None:
            # Of C = A/w, relative to the point C itself, the first derivative that is left is A's, over w.
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
