# SPDX-License-Identifier: GPL-3.0-or-later
"""The data term of straight lines: projectors between two pins meet the line between their points."""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array
from .banded import Rows
from .control_net import Along, ControlNet, position_and_tangent
from .pin_energy import LONGEST_SLIDE, PinEnergy, PinTargets
from .problem import AimLines, AimPins
from .vectors import across_of, cross, dot, unit

# Pieces of a line between whose ends projectors shall meet it.
LINE_SAMPLES = 12


class LineEnergy:
    """Lines of the scene that are straight in the image.

    The distance of a projector from the line is measured at the nearest t, along n = L × Qt.
    """

    def __init__(self, net: ControlNet, pins: AimPins, lines: AimLines, energy: PinEnergy) -> None:
        shares = np.arange(1, LINE_SAMPLES) / LINE_SAMPLES
        self.pins = np.repeat(lines.pins, len(shares), axis=1)
        share = np.tile(shares, lines.pins.shape[1])
        first, last = pins.positions[:, self.pins[0]], pins.positions[:, self.pins[1]]
        self.places = net.at(*(first + share * (last - first)))
        self.t = energy.home_t[self.pins[0]] * (1.0 - share) + energy.home_t[self.pins[1]] * share
        footprint = energy.footprint[self.pins].mean(axis=0)
        self.strength = energy.weights.line / footprint

    def _measure(self, points: Array, targets: PinTargets) -> tuple[Array, Array, Along, Array]:
        """Residuals (N,), the vectors (3, N) that they measure along, samples, and t."""
        start = targets.points[:, self.pins[0]]
        along_line = unit(targets.points[:, self.pins[1]] - start)
        controls, t = self.places.controls(points), self.t
        for _ in range(2):
            position, dt = position_and_tangent(controls[0], t)
            off, way = across_of(position - start, along_line), across_of(dt, along_line)
            change = -dot(off, way) / np.maximum(dot(way, way), 1e-300)
            t = np.clip(t + np.clip(change, -LONGEST_SLIDE, LONGEST_SLIDE), 0.0, 1.0)
        along = Along.of(controls, t)
        vectors = unit(cross(along_line, along.dt)) * self.strength
        return dot(vectors, start - along.position), vectors, along, t

    def value(self, points: Array, targets: PinTargets) -> float:
        """The energy."""
        residuals = self._measure(points, targets)[0]
        return float(residuals @ residuals)

    def linearise(self, points: Array, targets: PinTargets) -> Rows:
        """The rows at the nearest t."""
        residuals, vectors, along, self.t = self._measure(points, targets)
        rows = self.places.rows_of(0, along.value, vectors)
        return Rows(self.places.column, self.places.row, rows, residuals)
