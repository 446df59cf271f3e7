# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion vectors through a volume: where in the picture what is hit was and will be."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, IndexArray
from ...projection.volume.inverse import follow, invert
from ...projection.volume.viewing_volume import Projection


class Neighbour(NamedTuple):
    """The frame before or after. projection: in world space. vertices: (V, 3) of the same triangles as
    this frame's, None where they are others: then only the volume's motion is known.
    """

    projection: Projection
    vertices: Array | None


class MotionSample(NamedTuple):
    """N hits as they are now: position (3, N), world; their triangles' vertex numbers (N, 3) and weights of
    second and third corner (2, N); u, v, t and x, y (N,).
    """

    position: Array
    corners: NDArray[np.int32]
    weight: Array
    parameters: Array
    x: Array
    y: Array


def moved_places(neighbour: Neighbour, vertices: Array, now: MotionSample) -> Array:
    """How far hits are away in a neighbouring frame's picture, (2, N), in shares of its width and height.

    vertices: (V, 3) of this frame. The search starts from where they are now, so that in a folded
    volume a hit is followed through the sheet that it is in, and a little beyond the picture. 0 for
    what the other frame's volume does not hold.
    """
    points = now.position
    if neighbour.vertices is not None:
        points = points + _shift(neighbour.vertices, vertices, now.corners, now.weight)
    projection = neighbour.projection
    ranges = projection.u_range, projection.v_range
    found = follow(projection.volume, points, now.parameters, *ranges)
    places = np.stack([found.u, found.v])
    lost = np.flatnonzero(~found.found)
    if len(lost):
        again = invert(projection.volume, points[:, lost], *ranges)
        places[:, lost] = again.u, again.v
    (u0, u1), (v0, v1) = ranges
    x, y = projection.reparameterisation.image_positions(
        (places[0] - u0) / (u1 - u0), (places[1] - v0) / (v1 - v0), projection.aspect
    )
    away = np.stack([x - now.x, y - now.y])
    return np.where(np.isfinite(away), away, 0.0)


def _shift(after: Array, before: Array, corners: IndexArray, weight: Array) -> Array:
    """How far points of triangles have moved, (3, N)."""
    first, second, third = ((after[k] - before[k]).T for k in corners.T)
    shift: Array = first + (second - first) * weight[0] + (third - first) * weight[1]
    return shift
