# SPDX-License-Identifier: GPL-3.0-or-later
"""The data term of pins: distance, direction and frame at an image position, in pixels.

The parameter t of a pin belongs to it alone. It is eliminated from the linearised residuals by the Schur
complement, as points are in bundle adjustment (Triggs et al. 2000), which makes the few steps suffice.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...projection.typing import Array, BoolArray
from .banded import Rows
from .control_net import Along, Places, bend, combined
from .problem import AimPins, AimWeights
from .vectors import across_of, cross, dot, unit

DEGREES = 180.0 / np.pi
# The longest change of a t in a step.
LONGEST_SLIDE = 0.1
# Residuals of a pin: three of its distance, three of its direction, two of each vector of its frame.
RESIDUALS = 10


class PinTargets(NamedTuple):
    """The points and frames that pins aim at, (3, P) each. The last three count where they are wanted."""

    points: Array
    directions: Array
    across: Array
    upward: Array


# Residuals (10, P), the vectors (10, 3, P) that they measure along, samples and controls.
Residuals = tuple[Array, Array, Along, Array]


class PinEnergy:
    """Pins at their places, with one t a pin.

    footprint: (P,) world units in a pixel at the start.
    """

    def __init__(
        self, places: Places, pins: AimPins, weights: AimWeights, t: Array, footprint: Array, width: int
    ) -> None:
        self.places, self.width = places, width
        self.weights, self.home_t, self.footprint = weights, t.copy(), footprint
        self.strength = pins.weights
        # The last arguments of ``residuals``, and what it found.
        self._found: tuple[tuple[Array, Array, PinTargets], Residuals] | None = None
        self.has_direction: BoolArray = np.isfinite(pins.directions).all(axis=0)
        self.has_frame: BoolArray = np.isfinite(pins.across).all(axis=0) & np.isfinite(pins.upward).all(
            axis=0
        )

    def residuals(self, points: Array, t: Array, targets: PinTargets) -> Residuals:
        """The residuals of pins, kept for the same arrays."""
        asked = points, t, targets
        if self._found is None or any(a is not b for a, b in zip(self._found[0], asked, strict=True)):
            self._found = asked, self._measure(*asked)
        return self._found[1]

    def _measure(self, points: Array, t: Array, targets: PinTargets) -> Residuals:
        controls = self.places.controls(points)
        along = Along.of(controls, t)
        e1 = unit(across_of(targets.across, targets.directions))
        e2 = cross(targets.directions, e1)
        vectors = np.zeros((RESIDUALS, 3, len(t)))
        vectors[:3] = np.eye(3)[:, :, None] * (self.weights.pin * self.strength / self.footprint)
        turn = self.weights.direction * DEGREES * self.strength * self.has_direction
        speed = np.sqrt(dot(along.dt, along.dt))
        tangent = along.dt / speed
        # The derivative of the unit tangent is the part of that of Qt perpendicular to it.
        vectors[3:6] = (np.eye(3)[:, :, None] - tangent[:, None] * tangent) * (turn / speed)
        frame = 100.0 * self.weights.frame * self.strength * self.has_frame
        for first, wanted in ((6, targets.across), (8, targets.upward)):
            scale = frame / np.maximum(np.sqrt(dot(wanted, wanted)), 1e-300)
            vectors[first], vectors[first + 1] = e1 * scale, e2 * scale
        missing = np.zeros((RESIDUALS, 3, len(t)))
        missing[:3] = targets.points - along.position
        missing[6:8] = targets.across - along.du
        missing[8:] = targets.upward - along.dv
        residuals = (vectors * missing).sum(axis=1)
        residuals[3:6] = (targets.directions - tangent) * turn
        return residuals, vectors, along, controls

    def value(self, points: Array, t: Array, targets: PinTargets) -> float:
        """The energy."""
        residuals = self.residuals(points, t, targets)[0]
        depth = self.weights.depth * self.strength * (t - self.home_t)
        return float((residuals**2).sum() + (depth**2).sum())

    def linearise(self, points: Array, t: Array, targets: PinTargets) -> tuple[Rows, Elimination]:
        """The rows without t, and what gives the change of t of a step.

        min over s of |A x + b s - r|² + w² (s - e)² is |P (A x - r + b e)|² with P = 1 - b bᵀ / (|b|² + w²),
        the Schur complement; its root is 1 - β b bᵀ.
        """
        residuals, vectors, along, controls = self.residuals(points, t, targets)
        kinds = (0, 0, 0, 0, 0, 0, 1, 1, 2, 2)
        functions = (along.value,) * 3 + (along.slope,) * 3 + (along.value,) * 4
        parts = zip(kinds, functions, vectors, strict=True)
        rows = np.stack([self.places.rows_of(*part) for part in parts])
        ut, vt = (combined(along.slope, part) for part in controls[1:])
        slopes = np.stack([along.dt] * 3 + [bend(controls[0], t)] * 3 + [ut] * 2 + [vt] * 2)
        by_t = (vectors * slopes).sum(axis=1)
        back = self.home_t - t
        residuals = residuals - by_t * back
        square, depth = (by_t**2).sum(axis=0), (self.weights.depth * self.strength) ** 2
        elimination = Elimination(self.places, rows, residuals, by_t, square + depth, back)
        beta = (1.0 - np.sqrt(depth / (square + depth))) / np.maximum(square, 1e-300)
        onto = beta * by_t
        reduced = rows - onto[:, None] * np.einsum("ep,ecp->cp", by_t, rows)
        right = residuals - onto * (by_t * residuals).sum(axis=0)
        # Rows of weight 0 would only cost time.
        used = np.ones(right.shape, bool)
        used[3:6], used[6:] = self.has_direction, self.has_frame
        kind, pin = np.nonzero(used)
        columns, first = self.places.column[pin], self.places.row[pin]
        return Rows(columns, first, reduced[kind, :, pin].T, right[used]), elimination


class Elimination(NamedTuple):
    """The rows of pins with their t, from which a step's change of t follows."""

    places: Places
    rows: Array
    residuals: Array
    by_t: Array
    square: Array
    back: Array

    def slide(self, step: Array) -> Array:
        """The change of each t, (P,), that belongs to a step of the control points."""
        net = self.places.net
        local = step.reshape(net.points, -1)[self.places.acting].swapaxes(1, 2)
        left = self.residuals - np.einsum("ecp,cp->ep", self.rows, local.reshape(self.rows.shape[1:]))
        change: Array = self.back + (self.by_t * left).sum(axis=0) / self.square
        return np.clip(change, -LONGEST_SLIDE, LONGEST_SLIDE)
