# SPDX-License-Identifier: GPL-3.0-or-later
"""What triangles can meet a convex body, by planes that it lies behind.

A triangle whose corners are all in front of the same plane cannot. A bit a plane and vertex: that
takes a tenth of the time of looking at the triangles themselves.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ..projection.typing import Array, BoolArray

# Bits of a vertex.
MOST_PLANES = 16
# Planes stand off by this share of the largest coordinate, for rounding: bodies are often made of
# float32 values, whose places are not known any better.
SLACK = 1e-6


@dataclass(frozen=True)
class HalfSpaces:
    """The points p with normals · p ≤ limits. normals: (K, 3) unit, K up to MOST_PLANES; limits: (K,)."""

    normals: Array
    limits: Array

    @classmethod
    def around(cls, normals: Array, points: Array) -> Self:
        """The narrowest with normals (K, 3) of any length round points (3, N), with SLACK to spare."""
        length = np.linalg.norm(normals, axis=1)
        unit = normals[length > 0.0] / length[length > 0.0, None]
        limits = np.array([heights(normal, points).max() for normal in unit])
        return cls(unit, limits + SLACK * float(np.abs(points).max()))

    def met_by(self, vertices: Array, triangles: NDArray[np.int32]) -> BoolArray:
        """Whether triangles (T, 3) may meet the body, (T,); those with a vertex that is not finite may.

        vertices: (V, 3).
        """
        columns = vertices.T
        outside = np.zeros(len(vertices), np.uint16)
        with np.errstate(invalid="ignore", over="ignore"):
            for bit, (normal, limit) in enumerate(zip(self.normals, self.limits, strict=True)):
                outside |= (heights(normal, columns) > limit).astype(np.uint16) << np.uint16(bit)
        common = outside.take(triangles[:, 0])
        common &= outside.take(triangles[:, 1])
        common &= outside.take(triangles[:, 2])
        met: BoolArray = common == 0
        return met


def heights(normal: Array, points: Array) -> Array:
    """normal (3,) · points (3, N), without BLAS, which wakes its threads for so slim a product."""
    result: Array = normal[0] * points[0]
    result += normal[1] * points[1]
    result += normal[2] * points[2]
    return result
