# SPDX-License-Identifier: GPL-3.0-or-later
"""A prism around every triangle, in an Embree scene of their own, for exact casting.

A chord that follows its curve within ε passes within ε of every point that the
curve hits. So each triangle gets a prism that encloses all points within ε of it:
if a chord enters no prism, its curve hits nothing, silhouettes included. The
prism's two caps lie above and below the triangle. Its outline is the triangle with
the edges moved out. The moved corners of a sliver would be far away, so its outline is a
triangle around its bounding rectangle.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, Float32Array
from ..common.cancellation import raise_if_cancelled
from ..common.hits import CastError
from ..common.memory import shortage
from .embree_meshes import build_mesh
from .occupancy import Occupancy

# ε is this share of a typical triangle's height: thinner prisms need more chords, of which
# few are cast; thicker ones are more often entered without a hit.
EPSILON_SHARE = 1.0 / 200.0

# Bounds of ε in cast units: below, traversal could not separate the caps of uneven prisms;
# above, the prisms of a few large triangles would fill the scene.
EPSILON_RANGE = (1e-5, 2e-2)

# Every prism is thicker by this, in cast units, for the rounding of its corners, of
# chord ends and of Embree's arithmetic: 50 roundings (2⁻²⁴) of a coordinate of 1.
MARGIN = 3e-6

# Prisms are thicker by a random share up to this, so that the caps of neighbouring or
# coincident triangles do not coincide: traversal could not tell which of them it enters.
UNEVEN = 0.25

# The rectangle around a sliver takes this share of the height of the triangle around it;
# at a half the triangle's area is least.
FILL = 0.5

# Two caps and three walls, as quads: fewer faces than triangles.
FACES = np.array([[0, 1, 2, 2], [3, 5, 4, 4], [0, 3, 4, 1], [1, 4, 5, 2], [2, 5, 3, 0]], np.int32)

# Bytes that Embree and its input take for the eight triangles of a prism's faces: measured
# 750 with a million triangles; temporary arrays take half as much again.
BYTES_PER_TRIANGLE = 1800


@dataclass(frozen=True)
class Prisms:
    """Prisms of T triangles.

    corners: (T, 6, 3) float32, three of one cap and three of the other. epsilon: the largest distance of a
    chord from its curve. thickness: the largest distance of a prism's points from the triangle's plane.
    Unusable triangles have a prism of size 0.
    """

    corners: Float32Array
    epsilon: float
    thickness: float

    @classmethod
    def of(cls, corners: Array, normals: Array, usable: BoolArray) -> Prisms:
        """Make prisms. corners: (3, 3, T) by corner and axis. normals: (3, T), unit. usable: (T,)."""
        epsilon = typical_epsilon(corners, usable)
        generator = np.random.default_rng(len(usable))
        above, below = 1.0 + UNEVEN * generator.random((2, len(usable)))
        radius = epsilon + MARGIN
        outline = enclosing_triangles(corners, normals, radius * above)
        prism = np.empty((len(usable), 6, 3), np.float32)
        for side, lift in ((0, radius * above), (3, -radius * below)):
            for k in range(3):
                prism[:, side + k] = (outline[k] + normals * lift).T
        prism[~usable] = np.where(np.isfinite(corners[0]), corners[0], 0.0).T[~usable][:, None]
        return cls(prism, epsilon, radius * (1.0 + UNEVEN))


class PrismScene:
    """The prisms of all triangles in Embree, safe to use from several threads.

    epsilon, thickness: see ``Prisms``. lower, upper: (3,) the box of all prisms. occupancy: the grid of the
    space that prisms fill. steepest: (T,) the largest slope of a triangle's barycentric weights, 1 over its
    least height.
    """

    def __init__(self, prisms: Prisms, steepest: Array) -> None:
        self.steepest = steepest
        self.epsilon, self.thickness = prisms.epsilon, prisms.thickness
        self.lower: Array = prisms.corners.min(axis=(0, 1)).astype(np.float64)
        self.upper: Array = prisms.corners.max(axis=(0, 1)).astype(np.float64)
        raise_if_cancelled()
        first = 6 * np.arange(len(prisms.corners), dtype=np.int32)[:, None, None]
        faces = (FACES[None] + first).reshape(-1, 4)
        self._embree, self._kept, each = build_mesh(prisms.corners.reshape(-1, 3), faces)
        self._faces_each = each * len(FACES)
        raise_if_cancelled()
        outlines = prisms.corners[:, :3][np.ptp(prisms.corners, axis=1).any(axis=1)]
        # The distance between the caps of a prism is at most this.
        self.occupancy = Occupancy.of(outlines.transpose(1, 2, 0).astype(np.float64), 2.0 * self.thickness)

    def trace(
        self, origins: Float32Array, directions: Float32Array, limits: Float32Array
    ) -> tuple[NDArray[np.int32], Float32Array]:
        """The triangles whose prisms the rays enter or leave first, (N,) int32, -1 for none, and where.

        Rays as in ``TracedMesh``; the second array (N,) is in units of the direction's length.
        """
        raise_if_cancelled()
        found = self._embree.run(origins.T, directions.T, limits.copy(), output=True)
        triangle: NDArray[np.int32] = found["primID"]
        # -1 // n is -1.
        triangle //= self._faces_each
        return triangle, found["tfar"]


def require_room_for_prisms(triangles: int) -> None:
    """Raise CastError if the available memory does not hold the prisms of so many triangles."""
    short = shortage(BYTES_PER_TRIANGLE * triangles)
    if short:
        raise CastError(
            "exact casting needs {0} of memory for {1:,} triangles, {2} are free: set the pixel error above "
            "0, or hide what the picture does not show",
            short[0],
            triangles,
            short[1],
        )


def typical_epsilon(corners: Array, usable: BoolArray) -> float:
    """ε for a scene: a share of the median height of its triangles over their longest side.

    The median is weighted by the heights, so that neither a few large triangles nor many tiny
    ones determine it.
    """
    sides = corners[[1, 2, 0]] - corners
    longest = np.sqrt((sides**2).sum(axis=1).max(axis=0))[usable]
    area = np.linalg.norm(np.cross(sides[0], sides[1], axis=0), axis=0)[usable]
    height = np.sort(area / longest)
    total = np.cumsum(height)
    middle = height[np.searchsorted(total, 0.5 * total[-1])]
    return float(np.clip(EPSILON_SHARE * middle, *EPSILON_RANGE))


def enclosing_triangles(corners: Array, normals: Array, radius: Array) -> Array:
    """Triangles (3, 3, T) in the same planes around all points within ``radius`` (T,) of each."""
    sides = corners[[2, 0, 1]] - corners[[1, 2, 0]]
    lengths = np.sqrt((sides**2).sum(axis=1))
    around = lengths.sum(axis=0)
    area = np.linalg.norm(np.cross(sides[0], sides[1], axis=0), axis=0)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        # Moving all edges out is scaling about the centre of the inscribed circle.
        centre = (corners * lengths[:, None]).sum(axis=0) / around
        growth = 1.0 + radius * around / area
        moved = centre + (corners - centre) * growth
        longest = lengths.argmax(axis=0)
        which = np.arange(len(longest))
        length, start = lengths[longest, which], corners[(longest + 1) % 3, :, which].T
        along = sides[longest, :, which].T / length
        across = np.cross(normals, along, axis=0)
        width, height = length + 2.0 * radius, area / length + 2.0 * radius
        tall = 0.5 * area * growth**2 > 0.5 * width * height / (FILL * (1.0 - FILL))
        # Counter-clockwise corners: the third lies on the side that ``across`` points to.
        base = start + along * (0.5 * length) - across * radius
        half = along * (0.5 * width / (1.0 - FILL))
        round_rectangle = np.stack([base - half, base + half, base + across * (height / FILL)])
    return np.where(tall, round_rectangle, moved)
