# SPDX-License-Identifier: GPL-3.0-or-later
"""The robust data term of stays: what the image shows stays where it is.

The parameter t of a stay is eliminated by projection along the projector (Golub and Pereyra's variable
projection, 1973). Distances in pixels count by the function of Geman and McClure (1987), r² / (1 + (r / c)²).
"""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array, BoolArray, IndexArray
from ...projection.volume.bezier import bernstein, bernstein_derivative
from .banded import GridTerms, pairs
from .control_net import ControlNet, combined, position_and_tangent
from .pin_energy import DEGREES, LONGEST_SLIDE
from .problem import AimStays, AimWeights, FirstHits
from .vectors import across_of, dot, unit

# Projectors do not use the last share of t: stays beyond are missed.
LAST_T = 0.98
# Footprints of pixels shrink to this share of that of the start at most, since they divide.
LEAST_FOOTPRINT = 0.1
# Stays of a smaller weight are left out.
LEAST_WEIGHT = 1e-3
# The weight of a stay is that of one of so many in the image.
USUAL_COUNT = 512
# A thing hides a stay if it is nearer by so much of t.
NEARER = 0.01

# t, the unit tangents, their speeds and ways from Q to stays.
_Slid = tuple[Array, Array, Array, Array]


class StayEnergy:
    """Stays on their projectors.

    All arrays are of the N stays that count. t: (N,), where they are. active: (N,), 1 if nothing wanted hides
    them.
    """

    def __init__(
        self, net: ControlNet, stays: AimStays, weights: AimWeights, points: Array, width: int
    ) -> None:
        self.grid = net.grid(stays.x, stays.y)
        self.listed = np.flatnonzero(stays.weights.ravel() > LEAST_WEIGHT)
        self.points = stays.points.reshape(3, -1)[:, self.listed]
        self.weights = weights
        # The last control points and their projectors, and the last ones with what ``_slid`` found.
        self._seen: tuple[Array, Array] | None = None
        self._found: tuple[Array, _Slid] | None = None
        share = np.sqrt(USUAL_COUNT / stays.weights.size)
        self.strength = weights.stay * share * stays.weights.ravel()[self.listed]
        controls = self.controls(points)
        self.t = stays.t.ravel()[self.listed]
        self.width = width
        self.old_tangent = unit(position_and_tangent(controls[0], self.t)[1])
        self.least = self._footprints(controls, self.t, self.old_tangent) * LEAST_FOOTPRINT
        self.footprint = self.least / LEAST_FOOTPRINT
        self.active = np.ones(len(self.listed))

    def controls(self, points: Array) -> Array:
        """The projectors of the stays, as ``Places.controls``. Those of the same array are kept."""
        if self._seen is None or self._seen[0] is not points:
            found = self.grid.controls(points)
            self._seen = points, found if len(self.listed) == found.shape[3] else found[..., self.listed]
        return self._seen[1]

    def _footprints(self, controls: Array, t: Array, tangent: Array) -> Array:
        """World units across a pixel, (N,)."""
        across = across_of(combined(bernstein(len(controls[1]) - 1, t), controls[1]), tangent)
        footprint: Array = np.sqrt(dot(across, across)) / self.width
        return footprint

    def hide(self, which: IndexArray, hits: FirstHits) -> None:
        """Leave out the stays that wanted things hide. which: (K,), those of these first hits."""
        self.active = np.ones(len(self.listed))
        self.active[which[hits.wanted & (hits.t < self.t[which] - NEARER)]] = 0.0

    def _slid(self, points: Array) -> _Slid:
        """The nearest t; there the unit tangent, its speed, and the way from Q to the stay.

        Those of the same array are kept: ``value`` and ``linearise`` look at the same points in turn.
        """
        if self._found is None or self._found[0] is not points:
            self._found = points, self._slide(self.controls(points)[0])
        return self._found[1]

    def _slide(self, controls: Array) -> _Slid:
        t = self.t
        for _ in range(2):
            position, dt = position_and_tangent(controls, t)
            change = dot(self.points - position, dt) / np.maximum(dot(dt, dt), 1e-300)
            t = np.clip(t + np.clip(change, -LONGEST_SLIDE, LONGEST_SLIDE), 0.0, LAST_T)
        position, dt = position_and_tangent(controls, t)
        speed = np.maximum(np.sqrt(dot(dt, dt)), 1e-300)
        return t, dt / speed, speed, self.points - position

    def _measure(self, t: Array, tangent: Array, miss: Array) -> tuple[Array, BoolArray, Array]:
        """The part of a way that counts, whether its stay is beyond the projector, and 1 / (1 + (r / c)²)."""
        forward = dot(miss, tangent)
        # A projector that ends before its point has to become longer.
        short = (t >= LAST_T) & (forward > 0.0)
        miss = miss - np.where(short, 0.0, forward) * tangent
        square = dot(miss, miss) / self.footprint**2
        return miss, short, 1.0 / (1.0 + square / self.weights.robust**2)

    def value(self, points: Array) -> float:
        """The energy, with the footprints of the last linearisation."""
        t, tangent, _, miss = self._slid(points)
        miss, _, share = self._measure(t, tangent, miss)
        robust = dot(miss, miss) / self.footprint**2 * share
        turn = across_of(self.old_tangent, tangent)
        angle = (self.weights.stay_direction * DEGREES) ** 2 * dot(turn, turn)
        return float(((self.active * self.strength) ** 2 * (robust + angle * share**2)).sum())

    def linearise(self, points: Array) -> GridTerms:
        """The quadratic form at the nearest t.

        Its vectors e are two perpendicular to the tangent τ, so that Σ e eᵀ = 1 - τ τᵀ, and τ itself where a
        projector ends before its stay.
        """
        controls = self.controls(points)
        self.t, tangent, speed, miss = self._slid(points)
        self.footprint = np.maximum(self._footprints(controls, self.t, tangent), self.least)
        miss, short, share = self._measure(self.t, tangent, miss)
        strength = (self.active * self.strength * share) ** 2
        degree = controls.shape[1] - 1
        value, slope = bernstein(degree, self.t)[1:], bernstein_derivative(degree, self.t)[1:]
        near = strength / self.footprint**2
        steady = strength * (self.weights.stay_direction * DEGREES) ** 2
        first, second = pairs(degree)
        straight, bent = (
            value[first] * value[second] * near,
            slope[first] * slope[second] * (steady / speed**2),
        )
        i, j = pairs(3)
        square, same = tangent[i] * tangent[j], (i == j).astype(float)[:, None]
        # Beside a pair of surfaces stand the six pairs of components.
        products = straight[:, None] * (same - np.where(short, 0.0, square)) + bent[:, None] * (same - square)
        turn = across_of(self.old_tangent, tangent)
        right = value[:, None] * (miss * near) + slope[:, None] * (turn * (steady / speed))
        return GridTerms(self.grid, self._on_grid(products), self._on_grid(right))

    def _on_grid(self, values: Array) -> Array:
        """Values (A, B, N) at all places, (A · B, U, V)."""
        counts = len(self.grid.u), len(self.grid.v)
        full = np.zeros((values.shape[0] * values.shape[1], counts[0] * counts[1]))
        full[:, self.listed] = values.reshape(len(full), -1)
        return full.reshape(len(full), *counts)
