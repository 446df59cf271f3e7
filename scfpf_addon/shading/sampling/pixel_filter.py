# SPDX-License-Identifier: GPL-3.0-or-later
"""Reconstruction filters by importance sampling: samples of equal weight, denser where the filter is high.

A pixel is the mean of its own samples however wide its filter is, so that borders and tiles need no margin
(Ernst, Stamminger and Greiner 2006).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...projection.typing import Array

FilterKind = Literal["BOX", "GAUSSIAN", "BLACKMAN_HARRIS"]

# Nodes of the table that inverts a filter's distribution, with an error below 1e-5 pixels.
NODES = 4097
# Total extent of a filter of width 1, as Blender's own engines define width.
REACH = {"BOX": 1.0, "GAUSSIAN": 3.0, "BLACKMAN_HARRIS": 2.0}
# The weight of a Gaussian at its end is exp of minus this.
GAUSSIAN_FALL = 18.0
# The window of Harris 1978, four terms, 92 dB.
BLACKMAN_HARRIS = (0.35875, -0.48829, 0.14128, -0.01168)


@dataclass(frozen=True)
class PixelFilter:
    """A filter of a kind. width: pixels, > 0, unused by a box. Raises ValueError."""

    kind: FilterKind = "BOX"
    width: float = 1.0

    def __post_init__(self) -> None:
        if not 0.0 < self.width < np.inf:
            raise ValueError(f"a pixel filter needs a width above 0, not {self.width}")

    def offset(self, share: Array) -> Array:
        """Offsets from the pixel's centre, in pixels, for shares in [0, 1] of the filter's area."""
        share = np.asarray(share, np.float64)
        if self.kind == "BOX":
            inside: Array = share - 0.5
            return inside
        place = np.linspace(-0.5, 0.5, NODES)
        weight = self._weight(place)
        below = np.concatenate([[0.0], np.cumsum(0.5 * (weight[1:] + weight[:-1]))])
        offset: Array = np.interp(share, below / below[-1], place) * (REACH[self.kind] * self.width)
        return offset

    def _weight(self, place: Array) -> Array:
        """The value of a filter other than a box at places in [-1/2, 1/2] of its extent, not normalised."""
        weight: Array
        if self.kind == "GAUSSIAN":
            weight = np.exp(-GAUSSIAN_FALL * (2.0 * place) ** 2)
        else:
            angle = 2.0 * np.pi * (place + 0.5)
            weight = np.sum([a * np.cos(k * angle) for k, a in enumerate(BLACKMAN_HARRIS)], axis=0)
        return weight
