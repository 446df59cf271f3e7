# SPDX-License-Identifier: GPL-3.0-or-later
"""Where in a picture rays between two flat surfaces can meet anything: a rectangle round the scene.

Certain, not sampled: the volume of a strip of the picture lies in the hull of its eight corners, and what is
on one side of a plane that the scene's box is wholly on the other side of meets none of it.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..projection.typing import Array, BoolArray

# Strips that the picture is cut into either way.
STRIPS = 512

# Strips are this much nearer to the box than they are, as a share of the largest coordinate: far more
# than what rays lose that are rounded to float32, and END_SLACK.
NEARER = 1e-5


class Window(NamedTuple):
    """Image positions outside which nothing is met, in [0, 1]; empty where right < left."""

    left: float
    right: float
    bottom: float
    top: float

    def held(self, x: Array, y: Array) -> tuple[slice, slice]:
        """Which of the columns x (W,) and of the rows y (R,) may see something."""
        return _held(x, self.left, self.right), _held(y, self.bottom, self.top)


def window_round(corner: Array, across: Array, up: Array, lower: Array, upper: Array) -> Window:
    """The part of the picture that can show anything in the box from lower to upper (3,).

    corner, across, up: (2, 3), where rays begin and their way, which ends at the far surface: in the
    image's lower left corner, and what is added across the image and up it.
    """
    return Window(
        *_span(_may_meet(corner, across, up, lower, upper)),
        *_span(_may_meet(corner, up, across, lower, upper)),
    )


def _may_meet(corner: Array, along: Array, other: Array, lower: Array, upper: Array) -> BoolArray:
    """Which strips may meet the box, (STRIPS,): one behind the other ``along`` and as long as ``other``."""
    edges = np.arange(STRIPS + 1) / STRIPS
    # Both ends of the rays on the borders between strips: (end, side, 3, STRIPS + 1).
    rays = (corner[:, None] + np.stack([0 * other, other], 1))[..., None] + along[:, None, :, None] * edges
    rays[1] += rays[0]
    reach = max(np.abs(rays).max(), np.abs(lower).max(), np.abs(upper).max())
    points = rays.reshape(4, 3, -1)
    hull = np.concatenate([points[..., :-1], points[..., 1:]])
    # The planes of the borders, where these are planes; anything is right as a plane that separates.
    sideways = rays[1, 1] - rays[1, 0]
    if not sideways.any():
        sideways = rays[0, 1] - rays[0, 0]
    border = np.cross(sideways, (points[2] + points[3] - points[0] - points[1]), axis=0)
    normals = np.broadcast_to(np.eye(3)[:, :, None], (3, 3, STRIPS))
    normals = np.concatenate([normals, [border[:, :-1], border[:, 1:]]])
    centre, half = (upper + lower) / 2, (upper - lower) / 2
    heights = np.einsum("kcn,pcn->kpn", normals, hull) - np.einsum("kcn,c->kn", normals, centre)[:, None]
    size = np.einsum("kcn,c->kn", np.abs(normals), half)
    size += NEARER * reach * np.sqrt((normals**2).sum(axis=1))
    apart = (heights.min(axis=1) > size) | (heights.max(axis=1) < -size)
    found: BoolArray = ~apart.any(axis=0)
    return found


def _span(met: BoolArray) -> tuple[float, float]:
    """From the first to the last strip that is met."""
    which = np.flatnonzero(met)
    return (which[0] / STRIPS, (which[-1] + 1) / STRIPS) if len(which) else (1.0, 0.0)


def _held(places: Array, low: float, high: float) -> slice:
    """From the first to the last of the places that is between two."""
    which = np.flatnonzero((places >= low) & (places <= high))
    return slice(int(which[0]), int(which[-1]) + 1) if len(which) else slice(0, 0)
