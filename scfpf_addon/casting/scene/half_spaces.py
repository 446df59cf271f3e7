# SPDX-License-Identifier: GPL-3.0-or-later
"""The triangles that can meet a convex body, by the half-spaces that contain it.

A triangle whose corners are all in front of the same plane cannot. One bit per plane and vertex
takes a tenth of the time of testing whole triangles. Planes that reject almost nothing, as a sample of
the triangles tells, are not tested.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray
from ..common.parallel import chunks

# Planes are bits of a vertex's uint16.
MOST_PLANES = 16
# At least so many triangles are sampled to choose the planes; if there are fewer than twice as many
# triangles, all are tested directly.
SAMPLES = 4096
# A plane must reject this share of all triangles, or testing it takes longer than casting at them.
WORTH = 0.003
# Planes are moved out by this share of the largest coordinate, for rounding: bodies are often made of
# float32 values, whose positions are no more precise.
SLACK = 1e-6


@dataclass(frozen=True)
class HalfSpaces:
    """The points p with normals · p ≤ limits. normals: (K, 3) unit; limits: (K,)."""

    normals: Array
    limits: Array

    @classmethod
    def around(cls, normals: Array, points: Array) -> Self:
        """The narrowest half-spaces with normals (K, 3) of any length around points (3, N), plus SLACK."""
        length = np.linalg.norm(normals, axis=1)
        unit = normals[length > 0.0] / length[length > 0.0, None]
        limits = highest(unit, points)
        return cls(unit, limits + SLACK * float(np.abs(points).max()))

    def met_by(self, vertices: Array, triangles: NDArray[np.int32]) -> BoolArray:
        """Return whether triangles (T, 3) may meet the body, (T,); triangles with a vertex that is NaN may.

        vertices: (V, 3). A few triangles that do not meet it may be reported too.
        """
        some = self._in_front(vertices, triangles[:: max(1, len(triangles) // SAMPLES)])
        if some.shape[1] == len(triangles):
            return ~some.any(axis=0)
        return self._worth_testing(some)._met_by_bits(vertices, triangles)

    def _in_front(self, vertices: Array, triangles: NDArray[np.int32]) -> BoolArray:
        """Return whether all of each triangle's corners are in front of each plane, (K, T)."""
        corners = vertices.take(triangles.T.reshape(-1), axis=0, mode="clip").T
        found: BoolArray = np.empty((len(self.limits), len(triangles)), bool)
        with np.errstate(invalid="ignore", over="ignore"):
            for row, normal, limit in zip(found, self.normals, self.limits, strict=True):
                np.all((heights(normal, corners) > limit).reshape(3, -1), axis=0, out=row)
        return found

    def _worth_testing(self, in_front: BoolArray) -> Self:
        """The planes that reject most of some triangles; in_front: (K, n)."""
        chosen: list[int] = []
        left = np.ones(in_front.shape[1], bool)
        while len(chosen) < min(MOST_PLANES, len(in_front)):
            gain = np.count_nonzero(in_front & left, axis=1)
            best = int(gain.argmax())
            if gain[best] <= WORTH * len(left):
                break
            chosen.append(best)
            left &= ~in_front[best]
        return type(self)(self.normals[chosen], self.limits[chosen])

    def _met_by_bits(self, vertices: Array, triangles: NDArray[np.int32]) -> BoolArray:
        """Return whether triangles may meet the body, (T,), of at most MOST_PLANES planes."""
        # In one thread: steps this short take as long in two, which wait for each other.
        outside = np.empty(len(vertices), np.uint16)
        for some in chunks(len(vertices)):
            outside[some] = self._outside(np.ascontiguousarray(vertices[some].T))
        met: BoolArray = np.empty(len(triangles), bool)
        for some in chunks(len(triangles)):
            # NumPy is fastest in this mode, with indices of its own dtype.
            corner = triangles[some].T.astype(np.intp, order="C")
            common = outside.take(corner[0], mode="clip")
            common &= outside.take(corner[1], mode="clip")
            common &= outside.take(corner[2], mode="clip")
            np.equal(common, 0, out=met[some])
        return met

    def _outside(self, points: Array) -> NDArray[np.uint16]:
        """The planes that points (3, n) are in front of, (n,), one bit per plane."""
        bits = np.zeros(points.shape[1], np.uint16)
        buffer = np.empty((2, len(bits)))
        with np.errstate(invalid="ignore", over="ignore"):
            for bit, (normal, limit) in enumerate(zip(self.normals, self.limits, strict=True)):
                bits |= (heights(normal, points, buffer) > limit) * np.uint16(1 << bit)
        return bits


def highest(normals: Array, points: Array) -> Array:
    """The largest of ``heights`` over points (3, N), N > 0, for each of normals (K, 3): (K,)."""
    most = np.full(len(normals), -np.inf)
    for some in chunks(points.shape[1]):
        part = np.ascontiguousarray(points[:, some])
        buffer = np.empty((2, part.shape[1]))
        np.maximum(most, [heights(normal, part, buffer).max() for normal in normals], out=most)
    return most


def heights(normal: Array, points: Array, buffer: Array | None = None) -> Array:
    """normal (3,) · points (3, N), without BLAS, which starts its threads for so slim a product.

    buffer: (2, N), whose first row then is the result.
    """
    result: Array
    result, term = np.empty((2, points.shape[1])) if buffer is None else buffer
    np.multiply(normal[0], points[0], out=result)
    result += np.multiply(normal[1], points[1], out=term)
    result += np.multiply(normal[2], points[2], out=term)
    return result
