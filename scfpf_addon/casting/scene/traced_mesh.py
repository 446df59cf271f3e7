# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles in Embree, and the rays that are traced against them."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import BoolArray, Float32Array, IndexArray
from ..common.cancellation import raise_if_cancelled
from ..common.geometry import renumbered
from .embree_meshes import build_mesh
from .quads import Quads

# Usable triangles that are a smaller share of all are built alone.
FEW = 0.5


class TracedMesh:
    """Triangles in Embree, pairs of them as quads where most are pairs.

    vertices: (3, V) of any dtype, cast space. triangles: (T, 3) int32. usable: (T,), those that rays can hit.
    numbers: (T,), by which hits name them; None for their places.
    Rays are origins and directions (3, N) float32 and limits (N,) float32 in units of the direction's
    length; a negative limit switches a ray off. All methods raise Cancelled.
    """

    def __init__(
        self,
        vertices: NDArray[Any],
        triangles: NDArray[np.int32],
        usable: BoolArray,
        numbers: IndexArray | None = None,
    ) -> None:
        kept = np.flatnonzero(usable)
        if 0 < len(kept) < len(usable) * FEW:
            used, triangles = renumbered(triangles[kept], vertices.shape[1])
            vertices, usable = vertices[:, used], np.ones(len(kept), bool)
            numbers = kept if numbers is None else numbers.take(kept)
        # The last one stands for a miss, -1.
        self._numbers = None if numbers is None else np.append(numbers, -1).astype(np.int32)
        faces = triangles
        self.quads = Quads.of(triangles, usable)
        if self.quads:
            faces = self.quads.faces
        elif not usable.all():
            faces = np.where(usable[:, None], faces, faces[:, :1])
        self._embree, self._kept, self._faces_each = build_mesh(vertices.T, faces)

    def trace(
        self, origins: Float32Array, directions: Float32Array, limits: Float32Array
    ) -> NDArray[np.int32]:
        """The first triangle on each ray, (N,) int32, -1 for none."""
        raise_if_cancelled()
        if self.quads:
            # embreex overwrites the array of limits.
            rays = origins.T, directions.T, limits.copy()
            found = self.quads.triangles(self._embree.run(*rays, output=True), self._faces_each)
        else:
            found = self._embree.run(origins.T, directions.T, limits)
        return found if self._numbers is None else self._numbers[found]

    def trace_distance(
        self, origins: Float32Array, directions: Float32Array, limits: Float32Array
    ) -> Float32Array:
        """Embree's distance to the first triangle, (N,) float32; the limit on a miss."""
        raise_if_cancelled()
        # embreex overwrites the array of limits.
        found: Float32Array = self._embree.run(origins.T, directions.T, limits.copy(), query="DISTANCE")
        return found

    def occluded(self, origins: Float32Array, directions: Float32Array, limits: Float32Array) -> BoolArray:
        """Return whether anything lies on each ray, (N,). A negative limit counts as a hit."""
        raise_if_cancelled()
        hit: BoolArray = self._embree.run(origins.T, directions.T, limits, query="OCCLUDED") >= 0
        return hit


class JoinedMesh(TracedMesh):
    """Several meshes in one cast space. start: the number of the first triangle of each."""

    def __init__(self, meshes: Sequence[TracedMesh], start: Sequence[int]) -> None:
        self._meshes, self._start = tuple(meshes), tuple(np.int32(number) for number in start)

    def trace(
        self, origins: Float32Array, directions: Float32Array, limits: Float32Array
    ) -> NDArray[np.int32]:
        found = np.full(origins.shape[1], -1, np.int32)
        for number, (mesh, start) in enumerate(zip(self._meshes, self._start, strict=True)):
            others = mesh.trace(origins, directions, limits)
            nearer: BoolArray = others >= 0
            both = np.flatnonzero(nearer & (found >= 0))
            if len(both):
                rays = origins[:, both], directions[:, both], limits[both]
                before = [each.trace_distance(*rays) for each in self._meshes[:number]]
                nearer[both] = mesh.trace_distance(*rays) < np.min(before, axis=0)
            found = np.where(nearer, others + start, found)
        return found

    def trace_distance(
        self, origins: Float32Array, directions: Float32Array, limits: Float32Array
    ) -> Float32Array:
        distances = [mesh.trace_distance(origins, directions, limits) for mesh in self._meshes]
        nearest: Float32Array = np.min(distances, axis=0)
        return nearest

    def occluded(self, origins: Float32Array, directions: Float32Array, limits: Float32Array) -> BoolArray:
        hits = [mesh.occluded(origins, directions, limits.copy()) for mesh in self._meshes]
        hit: BoolArray = np.any(hits, axis=0)
        return hit
