# SPDX-License-Identifier: GPL-3.0-or-later
"""The parameters of a volume whose projectors may meet some things, found once for all of them.

Certain, not sampled: boxes that hold the projectors of whole cells of parameters are looked up in the grid of
empty space, from large cells to small ones.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...projection.surfaces.boxes import boxes_of_cells
from ...projection.typing import Array, BoolArray
from ...projection.volume.viewing_volume import Projection
from ..scene.occupancy import SLACK, Occupancy
from ..scene.projector_boxes import bounds_of_each, piece_weights

# Cells along each axis, at first and at last; each level halves them.
COARSE, FINE = 8, 32


@dataclass(frozen=True)
class SeenCells:
    """Cells of an image's parameters (u, v).

    held: (FINE + 2, FINE + 2), rows along v, whether a cell's projectors may meet the things. The outer ones
    stand for what lies outside of [0, 1]² and are True.
    """

    held: BoolArray

    @classmethod
    def of(cls, projection: Projection, occupancy: Occupancy, lower: Array, upper: Array) -> SeenCells | None:
        """The cells of projectors that may meet what is within a box, lower to upper (3,), in cast space.

        occupancy: of these things. None if the volume does not know the boxes of its surfaces.
        """
        found = _boxes(projection)
        if found is None:
            return None
        weights = piece_weights(projection.volume.spans)[:, None]
        row, column, piece = (place.ravel() for place in np.indices((COARSE, COARSE, len(weights))))
        for level, (least, most) in enumerate(_from_coarse(*found)):
            if level:
                row, column = (2 * place[:, None] + np.arange(2) for place in (row, column))
                row, column = row.repeat(2, 1).ravel(), np.tile(column, 2).ravel()
                piece = piece.repeat(4)
            low, high = bounds_of_each(weights, piece, least[:, :, row, column], most[:, :, row, column])
            slack = SLACK * (1.0 + np.maximum(np.abs(low), np.abs(high)).max(initial=0.0))
            low, high = low[:, 0] - slack, high[:, 0] + slack
            met = ((low <= upper[:, None]) & (high >= lower[:, None])).all(axis=0)
            look_up = occupancy.holds if least.shape[-1] < FINE else occupancy.holds_finely
            met &= look_up(low, high)
            row, column, piece = row[met], column[met], piece[met]
        held = np.ones((FINE + 2, FINE + 2), bool)
        held[1:-1, 1:-1] = False
        held[row + 1, column + 1] = True
        return cls(held)

    def hold(self, u: Array, v: Array) -> BoolArray:
        """Return whether projectors through image parameters (N,) may meet the things, (N,)."""
        side = FINE + 2
        row, column = (np.clip(place * FINE + 1.0, 0.0, side - 1.0).astype(np.intp) for place in (v, u))
        row *= side
        row += column
        # NumPy's fastest mode.
        held: BoolArray = self.held.ravel().take(row, mode="wrap")
        return held


def _boxes(projection: Projection) -> tuple[Array, Array] | None:
    """The boxes of a projection's surfaces in the finest cells, lower and upper (K, 3, FINE, FINE)."""
    even = np.linspace(0.0, 1.0, FINE + 1)
    # As ``Projection.projectors`` rounds them.
    u, v = (low + even * (high - low) for low, high in (projection.u_range, projection.v_range))
    if not (np.diff(u) > 0.0).all() or not (np.diff(v) > 0.0).all():
        return None
    boxes = [boxes_of_cells(surface, u, v) for surface in projection.volume.surfaces]
    known = [each for each in boxes if each is not None]
    if len(known) < len(boxes):
        return None
    lower, upper = (np.stack(side) for side in zip(*known, strict=True))
    return (lower, upper) if np.isfinite(lower).all() and np.isfinite(upper).all() else None


def _from_coarse(lower: Array, upper: Array) -> Iterator[tuple[Array, Array]]:
    """Boxes (K, 3, side, side) of COARSE to FINE cells along each axis, of those of FINE."""
    levels = [(lower, upper)]
    while lower.shape[-1] > COARSE:
        shape = (*lower.shape[:2], lower.shape[2] // 2, 2, lower.shape[3] // 2, 2)
        lower, upper = lower.reshape(shape).min(axis=(3, 5)), upper.reshape(shape).max(axis=(3, 5))
        levels.append((lower, upper))
    return reversed(levels)
