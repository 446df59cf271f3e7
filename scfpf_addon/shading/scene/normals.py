# SPDX-License-Identifier: GPL-3.0-or-later
"""Normals of all triangles and their corners, in the tables that shading reads; made in threads."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ...casting.common.geometry import Geometry
from ...casting.common.parallel import chunks, parallel_map
from ...casting.scene.cast_scene import CastScene
from ..typing import Single
from ..vectors import dot

# Corner normals that differ from their triangle's by less, component by component, are flat shading: float32
# normals that were stored in 16 bits.
FLAT = 1e-4
# The same where a triangle's corners share one normal: float32's rounding of small faces far from the origin.
# It changes the light by a tenth of a per cent.
FLAT_FACE = 1e-3


def normals_of(geometry: Geometry, cast_scene: CastScene, shadows: bool, threads: int) -> Normals:
    """The normals of the triangles of ``cast_scene``; threads: 0 for all cores."""
    count = len(geometry.triangles)
    parts = chunks(count)
    made = Normals(geometry, cast_scene, np.empty((3, count), np.float32))
    # Most smooth meshes are smooth in the first chunk; then the others need no test.
    if made.flat_shaded(parts[0]) and all(parallel_map(made.flat_shaded, parts[1:], threads)):
        return made
    made = made.to_be_smooth(shadows)
    parallel_map(made.write_smooth, parts, threads)
    return made


@dataclass(frozen=True)
class Normals:
    """Normals of a geometry, written in threads by chunks. flat, smooth, bulge: see ``SurfaceTable``."""

    geometry: Geometry
    cast_scene: CastScene
    flat: Single
    smooth: Single | None = None
    bulge: Single | None = None
    vertices: Single | None = None

    def to_be_smooth(self, shadows: bool) -> Self:
        """The same with the arrays of smooth shading, uninitialised."""
        count = self.flat.shape[1]
        smooth = np.empty((9, count), np.float32)
        if not shadows:
            return replace(self, smooth=smooth)
        bulge, vertices = np.empty((6, count), np.float32), self.cast_scene.vertices.astype(np.float32)
        return replace(self, smooth=smooth, bulge=bulge, vertices=vertices)

    def flat_shaded(self, some: slice) -> bool:
        """Write unit normals of triangles; return whether all their corners have these."""
        shared = self._corners(some)
        if shared is None:
            self.flat[:, some] = self.cast_scene.planes[:3, some]
            return True
        corners = np.empty(shared.shape, np.float32)
        corners[:] = shared
        flat = self._write_flat(some, corners)
        off = np.abs(np.subtract(corners, flat, out=corners), out=corners).max(axis=(0, 1))
        far = FLAT_FACE if self.geometry.flat else FLAT
        return bool(off[(flat != 0).any(axis=0)].max(initial=0) <= far)

    def write_smooth(self, some: slice) -> None:
        """Write all normals of triangles whose shading is smooth."""
        corners = self._corners(some)
        if self.smooth is None or corners is None:
            return
        rows = self.smooth[:, some].reshape(3, 3, -1)
        rows[:] = corners
        self._write_flat(some, rows)
        if self.bulge is not None and self.vertices is not None:
            places = [self.vertices.take(self.cast_scene.triangles[some, k], axis=1) for k in range(3)]
            self.bulge[:, some] = corner_heights(places, rows)
        rows[1:] -= rows[0]

    def _corners(self, some: slice) -> Single | None:
        """Normals of corners, (3, 3, n) corner by corner, (1, 3, n) if they share one, or None."""
        normals = self.geometry.corner_normals
        if normals is None:
            return None
        return normals[some, : 1 if self.geometry.flat else 3].transpose(1, 2, 0)

    def _write_flat(self, some: slice, corners: Single) -> Single:
        flat = self.cast_scene.planes[:3, some].astype(np.float32)
        flat *= np.copysign(np.float32(1), dot(flat, sum(corners[1:], corners[0])))
        self.flat[:, some] = flat
        return flat


def corner_heights(places: list[Single], normals: Single) -> Single:
    """Heights of each corner of triangles above the tangent planes at the others, (6, T) float32.

    places: of the corners in cast space, three (3, T). normals: (3, 3, T), corner by corner. Row 2k+j: for
    corner k the next one (j = 0) and the one after (j = 1), along the shading normal at k.
    """
    heights = np.empty((6, normals.shape[2]), np.float32)
    for k in range(3):
        for j in range(2):
            edge = places[(k + j + 1) % 3] - places[k]
            heights[2 * k + j] = dot(edge, normals[k])
    return heights
