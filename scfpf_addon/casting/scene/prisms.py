# SPDX-License-Identifier: GPL-3.0-or-later
"""A prism round every triangle, in an Embree scene of their own, for exact casting.

A chord that follows its curve within ε passes within ε of every point that the
curve hits. So each triangle gets a prism that encloses all points within ε of it:
where a chord enters no prism, its curve hits nothing, silhouettes included. The
prism's two caps lie above and below the triangle; its outline is the triangle with
the edges moved out, or for a sliver, whose moved corners would run far away, a
triangle round its bounding rectangle.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...projection.typing import Array, BoolArray, Float32Array
from .embree_meshes import mesh_in_embree

# ε is this share of a typical triangle's height: thinner prisms need more chords, of which
# few are cast; thicker ones are entered in vain more often.
EPSILON_SHARE = 1.0 / 200.0

# Bounds of ε in cast units: below, caps of uneven prisms would be closer than a walk can tell
# apart; above, a scene of a few large triangles would be entered from everywhere.
EPSILON_RANGE = (1e-5, 2e-2)

# Every prism is thicker by this, in cast units, for the rounding of its corners, of
# chord ends and of Embree's arithmetic: 50 roundings (2⁻²⁴) of a coordinate of 1.
MARGIN = 3e-6

# Prisms are thicker by a random share up to this, so that the caps of neighbouring or
# coincident triangles do not coincide: a walk could not tell which it enters.
UNEVEN = 0.25

# The rectangle round a sliver fills this share of the height of the triangle round it;
# at a half its area is least.
FILL = 0.5

# Two caps and three walls: quads, which Embree has fewer of than triangles.
FACES = np.array([[0, 1, 2, 2], [3, 5, 4, 4], [0, 3, 4, 1], [1, 4, 5, 2], [2, 5, 3, 0]], np.int32)

# What Embree and its input take for the eight faces of a prism, in bytes: measured
# 750 for a million triangles; the arrays on the way there come to half as much again.
BYTES_PER_TRIANGLE = 1800


@dataclass(frozen=True)
class Prisms:
    """Prisms of T triangles. corners: (T, 6, 3) float32, three of one cap and three of the
    other; epsilon: how far a chord may be from its curve. thickness: no point of a
    prism is farther from the triangle's plane. Triangles without area have a prism without size.
    """

    corners: Float32Array
    epsilon: float
    thickness: float

    @classmethod
    def of(cls, corners: Array, normals: Array, usable: BoolArray) -> Prisms:
        """corners: (3 corners, 3, T) float64, cast space. normals: (3, T), unit. usable: (T,)."""
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

    def embree_scene(self, modules: tuple[Any, Any]) -> tuple[Any, Any, int]:
        """As ``mesh_in_embree``, the third what a prism counts for."""
        count = len(self.corners)
        faces = (FACES[None] + 6 * np.arange(count, dtype=np.int32)[:, None, None]).reshape(-1, 4)
        scene, kept, each = mesh_in_embree(modules, self.corners.reshape(-1, 3), faces)
        return scene, kept, each * len(FACES)


def typical_epsilon(corners: Array, usable: BoolArray) -> float:
    """ε for a scene: a share of its triangles' height over their longest side.

    The median, in which a triangle counts as much as it is high: neither a few large
    ones nor a lot of dust decide.
    """
    sides = corners[[1, 2, 0]] - corners
    longest = np.sqrt((sides**2).sum(axis=1).max(axis=0))[usable]
    area = np.linalg.norm(np.cross(sides[0], sides[1], axis=0), axis=0)[usable]
    height = np.sort(area / longest)
    total = np.cumsum(height)
    middle = height[np.searchsorted(total, 0.5 * total[-1])]
    return float(np.clip(EPSILON_SHARE * middle, *EPSILON_RANGE))


def enclosing_triangles(corners: Array, normals: Array, radius: Array) -> Array:
    """Triangles in the same planes round all points within ``radius`` (T,) of each, (3, 3, T)."""
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
