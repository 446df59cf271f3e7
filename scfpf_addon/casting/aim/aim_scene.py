# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene as aiming sees it: triangles with their objects, and fast first hits for the solver."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...projection.aim.problem import FindHits, FirstHits
from ...projection.typing import Array, BoolArray, IndexArray
from ...projection.volume.bezier import bernstein
from ...projection.volume.viewing_volume import Projection
from ..cast import cast
from ..common.hits import Hits
from ..scene.cast_scene import CastScene

# Chords of a projector in the solver: what hides what needs no more.
CHORDS = 10
PIXEL_ERROR = 0.1


@dataclass(frozen=True)
class AimScene:
    """Triangles that rays can meet. objects: (T,), the number of each triangle's object."""

    cast: CastScene
    objects: NDArray[np.int32]

    def triangles_of(self, objects: IndexArray) -> BoolArray:
        """The mask (T,) of the triangles of objects with these numbers."""
        return np.isin(self.objects, objects)

    def hits(self, projection: Projection, x: Array, y: Array, width: int) -> Hits:
        """The first hits of projectors in world space, at image positions (N,)."""
        size = (1.0 / width, projection.aspect / width)
        return cast(self.cast, projection.transformed(self.cast.matrix), x, y, size, PIXEL_ERROR)

    def world(self, positions: Array) -> Array:
        """Positions (3, N) in cast space as world points."""
        points: Array = positions / self.cast.scale + self.cast.centre[:, None]
        return points

    def points(self, triangles: IndexArray, barycentric: Array) -> Array:
        """World points (3, N) on triangles."""
        corners = self.cast.vertices[:, self.cast.triangles[triangles]]
        second, third = barycentric
        return self.world(
            corners[..., 0] * (1 - second - third) + corners[..., 1] * second + corners[..., 2] * third
        )


def hit_finder(scene: AimScene, wanted: BoolArray) -> FindHits:
    """First hits for the solver. wanted: (T,), the triangles of the things that pins show."""
    mesh, planes = scene.cast.mesh, scene.cast.planes
    shares = np.linspace(0.0, 1.0, CHORDS + 1)

    def find(controls: Array) -> FirstHits:
        """The first hits of projectors (K, 3, N), in world space, along chords."""
        count = controls.shape[2]
        weights = bernstein(len(controls) - 1, shares)
        corners = np.einsum("kt,kcn->tcn", weights, controls)
        corners = (corners - scene.cast.centre[:, None]) * scene.cast.scale
        t, seen = np.full(count, np.inf), np.zeros(count, bool)
        open_ = np.arange(count)
        for chord in range(CHORDS):
            start = corners[chord][:, open_]
            way = corners[chord + 1][:, open_] - start
            limits = np.ones(len(open_), np.float32)
            found = mesh.trace(start.astype(np.float32), way.astype(np.float32), limits)
            hit = np.flatnonzero(found >= 0)
            plane = planes[:, found[hit]]
            height = np.einsum("cn,cn->n", plane[:3], start[:, hit]) + plane[3]
            fall = np.einsum("cn,cn->n", plane[:3], way[:, hit])
            share = np.clip(-height / np.where(fall == 0.0, np.inf, fall), 0.0, 1.0)
            t[open_[hit]] = (chord + share) / CHORDS
            seen[open_[hit]] = wanted[found[hit]]
            open_ = open_[found < 0]
        return FirstHits(t, seen)

    return find
