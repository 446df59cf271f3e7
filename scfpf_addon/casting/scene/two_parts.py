# SPDX-License-Identifier: GPL-3.0-or-later
"""A scene in two parts for casting: a large one that stands still, and a small one that is built anew.

Embree scenes of embreex can neither be changed nor instanced. So an object that moves is left out of the
large part once, and only the small part is built for each of its places.
"""

from __future__ import annotations

from dataclasses import dataclass, fields
from threading import Lock

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, Float32Array
from .cast_scene import MOST_PARTS, CastScene
from .cast_triangles import SharedWeights
from .graded_triangles import graded_mesh
from .occupancy import Occupancy
from .traced_mesh import TracedMesh

# Cells of the grid of a moving part's empty space: a fine one takes longer than the images that it is for.
MOVING_CELLS = 1 << 12


class TwoMeshes(TracedMesh):
    """Two meshes in one cast space. The triangles of the second come after the ``count`` of the first."""

    def __init__(self, first: TracedMesh, second: TracedMesh, count: int) -> None:
        self._first, self._second, self._count = first, second, np.int32(count)

    def trace(
        self, origins: Float32Array, directions: Float32Array, limits: Float32Array
    ) -> NDArray[np.int32]:
        """The first triangle on each ray, (N,) int32, -1 for none."""
        found = self._first.trace(origins, directions, limits)
        others = self._second.trace(origins, directions, limits)
        nearer: BoolArray = others >= 0
        both = np.flatnonzero(nearer & (found >= 0))
        if len(both):
            rays = origins[:, both], directions[:, both], limits[both]
            nearer[both] = self._second.trace_distance(*rays) < self._first.trace_distance(*rays)
        return np.where(nearer, others + self._count, found)

    def trace_distance(
        self, origins: Float32Array, directions: Float32Array, limits: Float32Array
    ) -> Float32Array:
        """Embree's distance to the first triangle, (N,) float32; the limit on a miss."""
        distances = (mesh.trace_distance(origins, directions, limits) for mesh in (self._first, self._second))
        nearest: Float32Array = np.minimum(*distances)
        return nearest

    def occluded(self, origins: Float32Array, directions: Float32Array, limits: Float32Array) -> BoolArray:
        """Return whether anything lies on each ray, (N,). A negative limit counts as a hit."""
        hits = [mesh.occluded(origins, directions, limits.copy()) for mesh in (self._first, self._second)]
        return hits[0] | hits[1]


@dataclass(frozen=True)
class TwoOccupancies(Occupancy):
    """The grid of one scene's empty space together with that of another one."""

    other: Occupancy

    @classmethod
    def joined(cls, one: Occupancy, other: Occupancy) -> TwoOccupancies:
        """The empty space that both leave."""
        return cls(**{field.name: getattr(one, field.name) for field in fields(Occupancy)}, other=other)

    def holds(self, lower: Array, upper: Array) -> BoolArray:
        """Return whether boxes from lower to upper (3, …), cast space, meet a marked cell."""
        return super().holds(lower, upper) | self.other.holds(lower, upper)

    def holds_finely(self, lower: Array, upper: Array) -> BoolArray:
        return super().holds_finely(lower, upper) | self.other.holds_finely(lower, upper)


class StillPart:
    """The triangles ``kept`` (T,) of a scene, all of which keep their indices; the others cannot be hit."""

    def __init__(self, scene: CastScene, kept: BoolArray) -> None:
        self.scene, self.usable = scene, scene.usable & kept
        whole = self.usable.sum() == scene.usable.sum()
        self.mesh = scene.mesh
        if not whole:
            self.mesh = graded_mesh(scene.vertices, scene.triangles, self.usable, scene.core)
        self._parts: dict[bytes, StillPart] = {}

    def only(self, kept: BoolArray) -> StillPart:
        """The part of which only ``kept`` (T,) can be hit. Answers are cached."""
        key = np.packbits(kept).tobytes()
        if key not in self._parts:
            if len(self._parts) == MOST_PARTS:
                self._parts.clear()
            self._parts[key] = StillPart(self.scene, self.usable & kept)
        return self._parts[key]


class TwoPartScene(CastScene):
    """A still part and a moving scene in its cast space, whose triangles come after.

    moving: the moving part, or None. The empty space of the whole scene is kept for its still part: it is a
    little less than there is.
    """

    def __init__(self, still: StillPart, moving: CastScene | None) -> None:
        scene = still.scene
        self._still, self._moving = still, moving
        self._parts_of_it = (scene,) if moving is None else (scene, moving)
        self._tables_lock, self._lock = Lock(), Lock()
        self._neighbours: NDArray[np.int32] | None = None
        self._occupancy: Occupancy | None = None
        self.space, self.matrix = scene.space, scene.matrix
        self.centre, self.scale, self.core = scene.space
        self.lower = np.stack([part.lower for part in self._parts_of_it]).min(axis=0)
        self.upper = np.stack([part.upper for part in self._parts_of_it]).max(axis=0)
        self.mesh, self.planes = still.mesh, scene.planes
        usable: BoolArray = still.usable
        if moving is not None:
            self.mesh = TwoMeshes(still.mesh, moving.mesh, len(still.usable))
            usable = np.concatenate([still.usable, moving.usable])
            self.planes = np.concatenate([scene.planes, moving.planes], axis=1)
        self._largest = np.concatenate([part._largest for part in self._parts_of_it])
        self.usable = usable
        self._weights = SharedWeights(usable)

    def only(self, kept: BoolArray | None) -> CastScene | None:
        if kept is None or kept[self.usable].all():
            return self
        if not kept[self.usable].any():
            return None
        count = len(self._still.usable)
        moving = None if self._moving is None else self._moving.only(kept[count:])
        return TwoPartScene(self._still.only(kept[:count]), moving)

    def enclosed(self, kept: BoolArray, lower: Array, upper: Array) -> CastScene | None:
        """Return a scene of the ``kept`` triangles that may meet a box; they come whole."""
        return self.only(kept & self.within(lower, upper))

    def points_of(self, which: BoolArray) -> Array:
        count = len(self._still.usable)
        points = self._parts_of_it[0].points_of(which[:count])
        if self._moving is None:
            return points
        return np.concatenate([points, self._moving.points_of(which[count:])], axis=1)

    def within(self, lower: Array, upper: Array) -> BoolArray:
        return np.concatenate([part.within(lower, upper) for part in self._parts_of_it])

    def _make_weights(self, usable: BoolArray) -> Array:
        weights = [part.weights for part in self._parts_of_it]
        return weights[0] if len(weights) == 1 else np.concatenate(weights, axis=1)

    @property
    def neighbours(self) -> NDArray[np.int32]:
        with self._tables_lock:
            if self._neighbours is None:
                found = [part.neighbours for part in self._parts_of_it]
                for part in found[1:]:
                    found[1] = np.where(part >= 0, part + np.int32(found[0].shape[1]), part)
                self._neighbours = np.concatenate(found, axis=1)
            return self._neighbours

    @property
    def occupancy(self) -> Occupancy:
        with self._lock:
            if self._occupancy is None:
                self._occupancy = self._parts_of_it[0].occupancy
                for moving in self._parts_of_it[1:]:
                    corners = moving.vertices.take(moving.triangles[moving.usable].T, 1).swapaxes(0, 1)
                    grid = Occupancy.of(corners, cells=MOVING_CELLS)
                    self._occupancy = TwoOccupancies.joined(self._occupancy, grid)
            return self._occupancy
