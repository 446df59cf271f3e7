# SPDX-License-Identifier: GPL-3.0-or-later
"""The data term of detours: projectors pass what hides their pins through points beside it.

Obstacles bend a projector as they bend an elastic band (Quinlan and Khatib 1993), across it only, so that it
may slide along itself.
"""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array
from .banded import Rows
from .control_net import Along
from .pin_energy import PinEnergy
from .problem import AimDetours
from .vectors import across_of, cross, dot, unit


class DetourEnergy:
    """Detours of projectors. share: how far their points are on the way from the obstacle to its side."""

    def __init__(self, detours: AimDetours, energy: PinEnergy) -> None:
        self.places, self.detours, self.share = energy.places.take(detours.pins), detours, 1.0
        footprint = energy.footprint[detours.pins]
        self.strength = energy.weights.detour / max(float(footprint.sum()), 1e-300)

    def _measure(self, points: Array) -> tuple[Along, Array]:
        """Samples, and the weighted ways (3, D) from them to the points of the detours."""
        detours = self.detours
        along = Along.of(self.places.controls(points), detours.t)
        aim = detours.points + self.share * (detours.passes - detours.points)
        return along, (aim - along.position) * self.strength

    def value(self, points: Array) -> float:
        """The energy."""
        along, miss = self._measure(points)
        miss = across_of(miss, unit(along.dt))
        return float(dot(miss, miss).sum())

    def linearise(self, points: Array) -> Rows:
        """Two rows a detour, across its projector."""
        along, miss = self._measure(points)
        tangent = unit(along.dt)
        # The axis that is farthest from the tangent gives the first of two perpendicular vectors.
        first = unit(across_of(np.eye(3)[:, np.abs(tangent).argmin(axis=0)], tangent))
        vectors = first, cross(tangent, first)
        rows = [self.places.rows_of(0, along.value, vector * self.strength) for vector in vectors]
        return Rows.of(self.places, np.stack(rows, axis=1), np.stack([dot(v, miss) for v in vectors]))
