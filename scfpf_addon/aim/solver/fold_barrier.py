# SPDX-License-Identifier: GPL-3.0-or-later
"""The barrier that keeps projectors from turning inside out before their first hit.

The scaled Jacobian g = det / (|Qu| |Qv| |Qt|) is that of mesh quality (Knupp 2000); below LEAST_JACOBIAN a
hinge acts. Like the regularised barrier of Garanzha et al. (Foldover-free maps in 50 lines of code, 2021) it
is finite in folds, so that the solver can leave them, and its strength grows as they go.
"""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array, IndexArray
from ...projection.volume.bezier import bernstein, bernstein_derivative
from .banded import Rows
from .control_net import NetBasis, Places, combined
from .vectors import cross, dot

# The scaled Jacobian is kept above this; it is 1 for a right-angled frame.
LEAST_JACOBIAN = 0.15
# Shares of the way to the first hit at which folds are tested. A little more than 1: the hit itself counts.
SHARES = np.array([0.12, 0.3, 0.5, 0.7, 0.85, 0.95, 1.01])
# Where the product of the squared lengths is less than this share of the typical one, as at the eye of a
# perspective, the volume has no extent and cannot fold.
POINT = 1e-30


# The scaled Jacobians (7, N) of projectors, and Qu, Qv and Qt there.
Jacobians = tuple[Array, tuple[Array, Array, Array]]


class FoldBarrier:
    """The barrier at N projectors.

    orientation: the sign of the determinant where nothing folds. hits_t: (N,), their first hits, None for
    whole projectors. t: (7, N), where they are tested.
    """

    def __init__(self, places: NetBasis | Places, orientation: float, hits_t: Array | None = None) -> None:
        self.places, self.orientation = places, orientation
        self.look(np.ones(places.count) if hits_t is None else hits_t)

    def look(self, hits_t: Array) -> None:
        """Test up to the first hits (N,)."""
        self._test(np.clip(SHARES[:, None] * np.minimum(hits_t, 1.0), 0.0, 1.0))

    def take(self, which: IndexArray) -> FoldBarrier:
        """The barrier at the projectors of these numbers, up to the same t."""
        taken = FoldBarrier(self.places.take(which), self.orientation)
        taken._test(self.t[:, which])
        return taken

    def joined(self, other: FoldBarrier) -> FoldBarrier:
        """The barrier at the projectors of both, up to the same t: small parts cost as much as large ones."""
        both = FoldBarrier(Places.joined([_each(self.places), _each(other.places)]), self.orientation)
        both._test(np.hstack([self.t, other.t]))
        return both

    def _test(self, t: Array) -> None:
        self.t = t
        # The last control points, and their Jacobians.
        self._found: tuple[Array, Jacobians] | None = None
        degree = self.places.net.surfaces - 1
        self._weights = bernstein(degree, t), bernstein_derivative(degree, t)

    def worst(self, points: Array) -> Array:
        """The least scaled Jacobian of each projector, (N,)."""
        least: Array = self._jacobians(points)[0].min(axis=0)
        return least

    def _jacobians(self, points: Array) -> Jacobians:
        """The Jacobians of control points, kept for the same array."""
        if self._found is None or self._found[0] is not points:
            controls = self.places.controls(points)
            value, slope = self._weights
            du, dv = combined(value, controls[1]), combined(value, controls[2])
            dt = combined(slope, controls[0])
            squares = dot(du, du) * dot(dv, dv) * dot(dt, dt)
            flat = squares <= POINT * squares.mean() if squares.size else np.zeros(squares.shape, bool)
            lengths = np.sqrt(np.where(flat, 1.0, squares))
            found = np.where(flat, 1.0, self.orientation * dot(cross(du, dv), dt) / lengths)
            self._found = points, (found, (du, dv, dt))
        return self._found[1]

    def value(self, points: Array, strength: float) -> float:
        """The energy."""
        short = np.maximum(LEAST_JACOBIAN - self._jacobians(points)[0], 0.0)
        return float((short * short).sum()) * strength**2

    def linearise(self, points: Array, strength: float) -> Rows:
        """The rows of the samples below LEAST_JACOBIAN."""
        g, derivatives = self._jacobians(points)
        share, place = np.nonzero(g < LEAST_JACOBIAN)
        du, dv, dt = (part[:, share, place] for part in derivatives)
        short = g[share, place]
        squares = [dot(d, d) for d in (du, dv, dt)]
        scale = self.orientation / np.maximum(np.sqrt(squares[0] * squares[1] * squares[2]), 1e-300)
        places = self.places.take(place)
        degree = places.net.surfaces - 1
        value, slope = (weights[:, share, place] for weights in self._weights)
        rows = np.zeros((48 * degree, len(place)))
        parts = (
            (1, value, cross(dv, dt), du),
            (2, value, cross(dt, du), dv),
            (0, slope, cross(du, dv), dt),
        )
        for (kind, weights, cofactor, own), square in zip(parts, squares, strict=True):
            gradient = cofactor * scale - own * (short / np.maximum(square, 1e-300))
            rows += places.rows_of(kind, weights, gradient * strength)
        return Rows(places.column, places.row, rows, (LEAST_JACOBIAN - short) * strength)


def _each(places: NetBasis | Places) -> Places:
    """The places one by one."""
    return places.places if isinstance(places, NetBasis) else places
