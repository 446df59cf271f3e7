# SPDX-License-Identifier: GPL-3.0-or-later
"""Motion vectors through a volume: the places of hits in the images of neighbouring frames."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, IndexArray
from ...projection.volume.inverse import follow, invert
from ...projection.volume.viewing_volume import Projection


class Neighbour(NamedTuple):
    """The frame before or after.

    projection: in world space. vertices: (V, 3) of the same triangles as this frame's; None where the
    triangles differ, and only the volume's motion is known.
    """

    projection: Projection
    vertices: Array | None


class MotionSample(NamedTuple):
    """N hits in this frame.

    position: (3, N) in world space. corners: (N, 3) vertex numbers of their triangles. weight: (2, N) of the
    second and third corner. parameters: (3, N) u, v and t. x, y: (N,) image positions.
    """

    position: Array
    corners: NDArray[np.int32]
    weight: Array
    parameters: Array
    x: Array
    y: Array


def moved_places(neighbour: Neighbour, vertices: Array, motion: MotionSample) -> Array:
    """The shift of hits to their places in a neighbouring frame's image, (2, N), in shares of its size.

    vertices: (V, 3) of this frame. The search starts from the places in this frame, so that in a folded
    volume a hit is followed through its own sheet, and a little beyond the image. 0 for hits outside the
    other frame's volume.
    """
    points = motion.position
    if neighbour.vertices is not None:
        points = points + _shift(neighbour.vertices, vertices, motion.corners, motion.weight)
    projection = neighbour.projection
    ranges = projection.u_range, projection.v_range
    found = follow(projection.volume, points, motion.parameters, *ranges)
    places = np.stack([found.u, found.v])
    lost = np.flatnonzero(~found.found)
    if len(lost):
        again = invert(projection.volume, points[:, lost], *ranges)
        places[:, lost] = again.u, again.v
    (u0, u1), (v0, v1) = ranges
    x, y = projection.reparameterisation.image_positions(
        (places[0] - u0) / (u1 - u0), (places[1] - v0) / (v1 - v0), projection.aspect
    )
    away = np.stack([x - motion.x, y - motion.y])
    return np.where(np.isfinite(away), away, 0.0)


def _shift(after: Array, before: Array, corners: IndexArray, weight: Array) -> Array:
    """The motion of points of triangles, (3, N)."""
    first, second, third = ((after[k] - before[k]).T for k in corners.T)
    shift: Array = first + (second - first) * weight[0] + (third - first) * weight[1]
    return shift
