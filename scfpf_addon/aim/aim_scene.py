# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene as aiming sees it: triangles with their objects, and fast first hits for the solver."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..casting.cast import cast
from ..casting.common.hits import Hits
from ..casting.scene.cast_scene import CastScene
from ..projection.arrays import product
from ..projection.typing import Array, BoolArray, IndexArray
from ..projection.volume.bezier import bernstein
from ..projection.volume.viewing_volume import Projection
from .solver.problem import FirstHits

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


class HitFinder:
    """Casts projectors for the solver. wanted: (T,), the triangles of the things that pins show."""

    def __init__(self, scene: AimScene, wanted: BoolArray) -> None:
        self.scene, self.wanted = scene, wanted
        corners = scene.cast.vertices[:, np.unique(scene.cast.triangles[wanted])]
        # Without such things the box is empty: nothing meets it.
        self.low = corners.min(axis=1, initial=np.inf, keepdims=True)
        self.high = corners.max(axis=1, initial=-np.inf, keepdims=True)

    def _corners(self, controls: Array) -> Array:
        """The corners of the chords of projectors (K, 3, N) in cast space, (CHORDS + 1, 3, N)."""
        weights = bernstein(len(controls) - 1, np.linspace(0.0, 1.0, CHORDS + 1))
        local = (controls - self.scene.cast.centre[:, None]) * self.scene.cast.scale
        flat = local.reshape(len(controls), controls[0].size)
        return product(weights.T, flat).reshape(CHORDS + 1, *controls.shape[1:])

    def may_meet_wanted(self, controls: Array) -> BoolArray:
        """Return which projectors (K, 3, N) have a chord whose box meets that of the pinned things, (N,)."""
        corners = self._corners(controls)
        below, above = corners < self.low, corners > self.high
        beside = (below[:-1] & below[1:]) | (above[:-1] & above[1:])
        found: BoolArray = ~(beside[:, 0] | beside[:, 1] | beside[:, 2]).all(axis=0)
        return found

    def __call__(self, controls: Array) -> FirstHits:
        """The first hits of projectors (K, 3, N), in world space, along chords."""
        count = controls.shape[2]
        mesh, planes = self.scene.cast.mesh, self.scene.cast.planes
        corners = self._corners(controls)
        ways = np.diff(corners, axis=0)
        starts, traced_ways = corners.astype(np.float32), ways.astype(np.float32)
        t, seen = np.full(count, np.inf), np.zeros(count, bool)
        open_ = np.arange(count)
        for chord in range(CHORDS):
            limits = np.ones(len(open_), np.float32)
            found = mesh.trace(starts[chord].take(open_, 1), traced_ways[chord].take(open_, 1), limits)
            is_hit = found >= 0
            hit, triangle = open_[is_hit], found[is_hit]
            plane = planes[:, triangle]
            height = np.einsum("cn,cn->n", plane[:3], corners[chord][:, hit]) + plane[3]
            fall = np.einsum("cn,cn->n", plane[:3], ways[chord][:, hit])
            share = np.clip(-height / np.where(fall == 0.0, np.inf, fall), 0.0, 1.0)
            t[hit] = (chord + share) / CHORDS
            seen[hit] = self.wanted[triangle]
            open_ = open_[~is_hit]
        return FirstHits(t, seen)
