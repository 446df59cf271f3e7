# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene that Live View keeps: objects that stand still are built once, those that move each time."""

from __future__ import annotations

from threading import Lock
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

from ...casting.common.geometry import Geometry
from ...projection.typing import BoolArray
from ...shading.live.live_scene import LiveScene, StillScene
from ..scene.join_meshes import Instances, join_meshes
from .live_objects import Placements

# If more than this share of the triangles moves, the whole scene is built.
MOST_MOVING = 0.5
# While nothing else is to be done, everything is built as one still part if more than this share of the
# triangles has moved, and if that takes no longer than so many seconds.
WORTH_SETTLING, LONGEST_SETTLING = 0.1, 1.0


class KeptScene:
    """A built scene that follows its placements. Threads may share it; it never sees Blender's data."""

    def __init__(self) -> None:
        self._lock = Lock()
        self._settled: Placements = {}
        # Of each settled placement, its triangles.
        self._triangles: dict[tuple[int, ...], slice] = {}
        self._whole: LiveScene | None = None
        self._count, self._seconds = 0, 0.0
        # Those of the settled placements that have moved or gone since.
        self._left: set[tuple[int, ...]] = set()
        self._still: StillScene | None = None
        self._moving: Placements = {}
        self._scene: LiveScene | None = None
        # How often the whole scene, and a part of it, have been built.
        self.wholes = self.parts = 0

    def updated(self, placements: Placements) -> LiveScene:
        """The scene of these placements. Raises CastError and UserError."""
        with self._lock:
            if self._scene is None or self._whole is None:
                return self._build(placements)
            gone = {key for key, place in self._settled.items() if placements.get(key) is not place}
            left = gone | self._left
            moving = {
                key: place for key, place in placements.items() if key in left or key not in self._settled
            }
            if left == self._left and _equal(moving, self._moving):
                return self._scene
            if _triangle_count(moving) > MOST_MOVING * self._count:
                return self._build(placements)
            if left != self._left or self._still is None:
                self._still = StillScene(self._whole, self._kept(left))
            scene = self._still.with_moving(_joined(moving)[0] if moving else None)
            self._scene, self._left, self._moving = scene, left, moving
            self.parts += 1
            return scene

    def settle(self) -> bool:
        """Build all as one still part if that pays; return whether it was done."""
        with self._lock:
            pays = _triangle_count(self._moving) > WORTH_SETTLING * self._count
            if not pays or self._seconds > LONGEST_SETTLING:
                return False
            stays = {key: place for key, place in self._settled.items() if key not in self._left}
            self._build(stays | self._moving)
            return True

    def _build(self, placements: Placements) -> LiveScene:
        """Build everything."""
        begun = perf_counter()
        geometry, self._triangles = _joined(placements)
        self._scene = self._whole = LiveScene.built(geometry)
        self._settled, self._left, self._still, self._moving = placements, set(), None, {}
        self._count, self._seconds = len(geometry.triangles), perf_counter() - begun
        self.wholes += 1
        return self._whole

    def _kept(self, left: set[tuple[int, ...]]) -> BoolArray:
        """The mask (T,) of the settled triangles that stay."""
        kept = np.ones(self._count, bool)
        for key in left & self._triangles.keys():
            kept[self._triangles[key]] = False
        return kept


def _equal(one: Placements, other: Placements) -> bool:
    return one.keys() == other.keys() and all(other[key] is place for key, place in one.items())


def _triangle_count(places: Placements) -> int:
    return sum(len(place.mesh.triangles) for place in places.values())


def _joined(placements: Placements) -> tuple[Geometry, dict[tuple[int, ...], slice]]:
    """One geometry of placements, whose materials are looks; and the triangles of each. Raises UserError."""
    mesh_numbers: dict[int, int] = {}
    look_numbers: dict[tuple[int, int, int], int] = {}
    meshes, pairs = [], []
    for place in placements.values():
        mesh = mesh_numbers.setdefault(id(place.mesh), len(meshes))
        if mesh == len(meshes):
            meshes.append(place.mesh)
        pairs.append((mesh, look_numbers.setdefault(place[1:4], len(look_numbers))))
    placed = np.array(pairs, np.int32).reshape(-1, 2)
    looks = np.array(list(look_numbers), np.int32).reshape(-1, 3)
    instances = Instances(
        mesh=placed[:, 0],
        look=placed[:, 1],
        matrix=np.array([place.matrix for place in placements.values()]).reshape(-1, 4, 4),
        look_object=looks[:, 0],
        slots=_slots(looks),
        first_slot=np.cumsum([0, *looks[:, 2]], dtype=np.int32),
    )
    geometry = join_meshes(meshes, instances, (), any(mesh.uv is not None for mesh in meshes))
    # Joined mesh by mesh.
    order = np.argsort(placed[:, 0], kind="stable")
    ends = np.cumsum([len(meshes[number].triangles) for number in placed[order, 0]])
    keys = list(placements)
    ranges = {
        keys[which]: slice(int(end) - len(meshes[placed[which, 0]].triangles), int(end))
        for which, end in zip(order.tolist(), ends, strict=True)
    }
    return geometry, ranges


def _slots(looks: NDArray[np.int32]) -> NDArray[np.int32]:
    """The numbers of all looks of objects one after the other. looks: (L, 3), as in ``Placement``."""
    counts = looks[:, 2]
    start = np.repeat(looks[:, 1] - (np.cumsum(counts) - counts), counts)
    return (start + np.arange(len(start))).astype(np.int32)
