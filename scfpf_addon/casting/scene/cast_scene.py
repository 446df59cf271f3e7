# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene of a cast: triangles in cast space and in Embree, and the structures built on demand."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from copy import copy
from functools import partial, reduce
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, Float32Array, IndexArray
from ..common.cancellation import raise_if_cancelled, uncancellable
from ..common.geometry import renumbered
from ..common.parallel import AtFirstUse, beside
from .cast_space import CastSpace
from .cast_triangles import CastTriangles
from .clipped_triangles import enclosed_mesh
from .embreex import load_embreex
from .graded_triangles import graded_mesh
from .occupancy import MOST_CELLS, SLACK, JoinedOccupancy, Occupancy
from .prisms import Prisms, PrismScene, require_room_for_prisms
from .shells import shells_of
from .traced_mesh import JoinedMesh, TracedMesh

# A shadow ray ends this share before the lamp, which may stand in a surface.
SHADOW_END = 1e-4

# The largest block, in bytes, that glibc can be made to keep (its limit is 32 MiB).
KEPT_BLOCK = 31 << 20

# Cells of the grid of a part's empty space, at least: it fills the part's own bounds, and a finer grid takes
# longer than it saves.
ENCLOSED_CELLS = 1 << 16

# Parts (``CastScene.only``) that are kept at most.
MOST_PARTS = 16

# Gives vertices (V, 3) and triangles (T, 3) that no projector meets but that cast shadows.
Beyond = Callable[[], tuple[Array, NDArray[np.int32]]]


class Shell(NamedTuple):
    """Some triangles of a scene as a scene of their own, whose world is the cast space of the whole.

    numbers: (n,), those of the triangles in the whole.
    """

    scene: CastScene
    numbers: IndexArray


class CastScene(CastTriangles):
    """Triangles (``CastTriangles``) that rays can be traced against, safe to use from several threads.

    mesh: the usable triangles in Embree. beyond: called while Embree builds these; its triangles are
    built when ``occluded`` is first called. space: see ``CastTriangles``. cells: see ``Occupancy.of``.
    parts: the scenes that this one joins, () for a scene that is built as a whole.
    Raises CastError also if embreex is missing or too old.
    """

    parts: tuple[CastScene, ...] = ()

    def __init__(
        self,
        vertices: Array,
        triangles: NDArray[np.int32],
        beyond: Beyond | None = None,
        space: CastSpace | None = None,
        cells: int | None = None,
    ) -> None:
        load_embreex()
        _keep_freed_memory()
        super().__init__(vertices, triangles, space)
        self._cells = cells
        self._build(beyond)

    @classmethod
    def joined(cls, parts: Sequence[CastScene]) -> CastScene:
        """Join scenes of one cast space, whose triangles come one after the other; nothing is built anew.

        embreex can neither change nor instance Embree's scenes. So what changes is a scene of its own.
        A part may have no usable triangle. What is ``beyond`` the parts casts no shadows.
        """
        scene = copy(parts[0])
        scene.parts = tuple(parts)
        first_vertex, first = (
            np.cumsum([0, *counts[:-1]], dtype=np.int32)
            for counts in zip(*((part.vertices.shape[1], len(part.usable)) for part in parts), strict=True)
        )
        shifted = (part.triangles + start for part, start in zip(parts, first_vertex, strict=True))
        scene.triangles = np.concatenate(list(shifted))
        scene.vertices = np.concatenate([part.vertices for part in parts], axis=1)
        scene.planes = np.concatenate([part.planes for part in parts], axis=1)
        scene.usable = np.concatenate([part.usable for part in parts])
        scene._largest = np.concatenate([part._largest for part in parts])
        scene.lower = np.stack([part.lower for part in parts]).min(axis=0)
        scene.upper = np.stack([part.upper for part in parts]).max(axis=0)
        scene._weights = AtFirstUse(lambda: np.concatenate([part.weights for part in parts], axis=1))
        scene._forget()
        scene._neighbours = AtFirstUse(partial(_joined_neighbours, parts, first))
        shown = [number for number, part in enumerate(parts) if part.usable.any()]
        scene._occupancy = AtFirstUse(
            lambda: reduce(JoinedOccupancy.of_both, [parts[number].occupancy for number in shown])
        )
        meshes = [parts[number].mesh for number in shown]
        scene.mesh = meshes[0] if shown == [0] else JoinedMesh(meshes, first[shown].tolist())
        return scene

    def _forget(self) -> None:
        """Begin without anything that is built on demand, but the weights."""
        triangles = self.vertices, self.triangles, self.usable
        self._find_neighbours()
        self._parts: dict[bytes, CastScene] = {}
        self._shells = AtFirstUse(partial(_shells_of, *triangles))
        self._prisms = AtFirstUse(partial(_prisms_of, *triangles, self.planes, self._weights))
        self._occupancy = AtFirstUse(partial(_occupancy_of, *triangles, self._cells))
        self._beyond: AtFirstUse[TracedMesh | None] = AtFirstUse(lambda: None)

    def _build(self, beyond: Beyond | None = None) -> None:
        """Build the usable triangles in Embree; ``beyond`` is called at the same time."""
        self._forget()
        if beyond is None:
            self._build_mesh()
        else:
            # Embree's threads do not need the interpreter, which NumPy holds for much of its work.
            placed = beside(self._build_mesh, lambda: self._placed_beyond(*beyond()))
            if placed is not None:
                self._beyond = AtFirstUse(partial(_beyond_mesh, *placed, self.core))

    def _build_mesh(self) -> None:
        self.mesh: TracedMesh = graded_mesh(self.vertices, self.triangles, self.usable, self.core)

    def only(self, kept: BoolArray | None) -> CastScene | None:
        """Return a scene of the same triangles, by the same indices, of which only ``kept`` (T,) can be hit.

        The scene itself if kept is None or leaves nothing out; None if no triangle is left. Answers are
        cached.
        """
        if kept is None or kept[self.usable].all():
            return self
        usable: BoolArray = self.usable & kept
        if not usable.any():
            return None
        if self.parts:
            ends = np.cumsum([len(part.usable) for part in self.parts])[:-1]
            owns = zip(self.parts, np.split(kept, ends), strict=True)
            return CastScene.joined([part.keeping(own) for part, own in owns])

        def build(part: CastScene) -> None:
            """Build the triangles that are kept."""
            part.usable = usable
            part._build()

        return self._part(np.packbits(kept).tobytes(), build)

    def keeping(self, kept: BoolArray) -> CastScene:
        """Return the scene without those triangles that are not ``kept`` (T,), perhaps without any.

        In contrast to ``only``, tables that take long are those of the whole scene: its empty space is a
        little less than there is. Answers are cached.
        """
        usable: BoolArray = self.usable & kept
        if usable.sum() == self.usable.sum():
            return self

        def build(part: CastScene) -> None:
            """Build the triangles that are kept."""
            part.usable = usable
            part._forget()
            part._neighbours = AtFirstUse(partial(_kept_neighbours, self._neighbours, usable))
            part._occupancy = self._occupancy
            if usable.any():
                part._build_mesh()

        return self._part(b"keeping" + np.packbits(kept).tobytes(), build)

    def enclosed(self, kept: BoolArray, lower: Array, upper: Array) -> CastScene | None:
        """Return a scene of those parts of the ``kept`` triangles that lie in a box, widened by roundings.

        lower, upper: (3,), cast space. Exact casting may hit the triangles beyond the box, too. The bounds of
        the scene, and of its empty space, are those of what can be hit. The triangles of joined scenes come
        whole.
        """
        if self.parts:
            return self.only(kept & self.within(lower, upper))
        which = np.flatnonzero(self.usable & kept & self.within(lower - SLACK, upper + SLACK))
        if not len(which):
            return None

        def build(part: CastScene) -> None:
            """Build whole triangles, and pieces of those that are not inside."""
            part.usable = np.zeros_like(self.usable)
            part.usable[which] = True
            part._forget()
            part.mesh, pieces = enclosed_mesh(self, which, lower - SLACK, upper + SLACK)
            part.lower, part.upper = pieces.min(axis=(0, 2)), pieces.max(axis=(0, 2))
            cells = min(max(ENCLOSED_CELLS, pieces.shape[2]), MOST_CELLS)
            part._occupancy = AtFirstUse(partial(_grid, pieces, cells))

        key = np.packbits(kept).tobytes() + np.concatenate([lower, upper]).tobytes()
        return self._part(key, build)

    def _part(self, key: bytes, build: Callable[[CastScene], None]) -> CastScene:
        """The part of a key, which is built if it is not cached."""
        if key not in self._parts:
            if len(self._parts) == MOST_PARTS:
                self._parts.clear()
            part = copy(self)
            build(part)
            self._parts[key] = part
        return self._parts[key]

    def points_of(self, which: BoolArray) -> Array:
        """The vertices (3, n) of triangles ``which`` (T,), cast space."""
        points: Array = self.vertices[:, renumbered(self.triangles[which], self.vertices.shape[1])[0]]
        return points

    def within(self, lower: Array, upper: Array) -> BoolArray:
        """Return whether the bounds of each triangle meet a box, (T,). lower, upper: (3,), cast space."""
        # Sides of the box beyond which vertices are, as bits: the corners of triangles outside share one.
        beyond = np.zeros(self.vertices.shape[1], np.uint8)
        for axis, (places, low, high) in enumerate(zip(self.vertices, lower, upper, strict=True)):
            beyond |= (places < low).view(np.uint8) << np.uint8(2 * axis)
            beyond |= (places > high).view(np.uint8) << np.uint8(2 * axis + 1)
        first, second, third = (beyond.take(corner) for corner in self.triangles.T)
        met: BoolArray = (first & second & third) == 0
        return met

    @property
    def prisms(self) -> PrismScene:
        """The prisms of exact casting. Made at first use, since they take memory and time.

        Raises CastError if the memory does not suffice.
        """
        return self._prisms.get()

    @property
    def shells(self) -> list[Shell]:
        """The triangles in parts that exact casting casts one by one, nearest first; [] if all are one."""
        return self._shells.get()

    @property
    def occupancy(self) -> Occupancy:
        """The grid of the scene's empty space; made at first use."""
        return self._occupancy.get()

    def prepare_exact(self) -> None:
        """Build what exact casting builds at first use. Raises CastError if the memory does not suffice."""
        for shell in self.shells:
            shell.scene.prepare_exact()
        if not self.shells:
            _ = self.prisms

    def occluded(self, origins: NDArray[Any], directions: NDArray[Any], distances: NDArray[Any]) -> BoolArray:
        """Return whether anything lies on each ray before its distance, (N,).

        origins: (3, N), directions: (3, N) or (3, 1), distances: (N,) or (1,) in units of the direction's
        length (inf is allowed), cast space. The last SHADOW_END of the distance is left out; origins are
        not offset (see ``offset_origins``).
        """
        with np.errstate(invalid="ignore", over="ignore"):
            start = origins.astype(np.float32, copy=False)
            way, limits = directions.astype(np.float32, copy=False), np.empty(start.shape[1], np.float32)
            # embreex takes a negative limit for a hit here; NaN becomes 0.
            limits[:] = np.fmax(distances * (1.0 - SHADOW_END), 0.0)
            # One sum tells whether all is finite; only otherwise each ray is checked.
            if not np.isfinite(start.sum() + way.sum()):
                dead = ~np.isfinite(start.sum(axis=0) + way.sum(axis=0))
                start, way = np.where(dead, np.float32(0), start), np.where(dead, np.float32(0), way)
                limits[dead] = 0.0
        way = np.broadcast_to(way, start.shape)
        hit = self.mesh.occluded(start, way, limits)
        beyond = self._beyond.get()
        if beyond is not None:
            # A ray that has hit keeps its hit at next to no cost.
            np.putmask(limits, hit, np.float32(-1))
            hit = beyond.occluded(start, way, limits)
        return hit

    def _placed_beyond(
        self, vertices: Array, triangles: NDArray[np.int32]
    ) -> tuple[Float32Array, NDArray[np.int32]] | None:
        """The used vertices (3, n) in cast space, and the triangles with finite ones; None if none."""
        used, triangles = renumbered(triangles, len(vertices))
        with np.errstate(invalid="ignore", over="ignore"):
            points = np.asarray(vertices, np.float64).take(used, axis=0)
            points -= self.centre
            points *= self.scale
            placed = points.T.astype(np.float32, order="C")
        finite: BoolArray = np.isfinite(placed).all(axis=0)
        if not finite.all():
            triangles = triangles[finite[triangles].all(axis=1)]
            placed[:, ~finite] = 0.0
        return (placed, triangles) if len(triangles) else None


def _occupancy_of(
    vertices: Array, triangles: NDArray[np.int32], usable: BoolArray, cells: int | None
) -> Occupancy:
    """The grid of the usable (T,) triangles."""
    return _grid(vertices.take(triangles[usable].T, 1).swapaxes(0, 1), cells)


def _grid(corners: Array, cells: int | None) -> Occupancy:
    """The grid of triangles (3 corners, 3, T)."""
    with uncancellable():
        return Occupancy.of(corners, cells=cells)


def _shells_of(vertices: Array, triangles: NDArray[np.int32], usable: BoolArray) -> list[Shell]:
    """The shells of the usable (T,) triangles as scenes."""
    shells = []
    with uncancellable():
        for numbers in shells_of(vertices, triangles, usable):
            used, own = renumbered(triangles[numbers], vertices.shape[1])
            shells.append(Shell(CastScene(vertices[:, used].T, own), numbers))
    return shells


def _prisms_of(
    vertices: Array,
    triangles: NDArray[np.int32],
    usable: BoolArray,
    planes: Array,
    weights: AtFirstUse[Array],
) -> PrismScene:
    """The prisms of the usable (T,) triangles. Raises CastError if the memory does not suffice."""
    with uncancellable():
        require_room_for_prisms(len(triangles))
        corners = np.stack([vertices.take(triangles[:, k], 1) for k in range(3)])
        second, third = weights.get()[:3], weights.get()[4:7]
        raise_if_cancelled()
        slopes = np.stack([second, third, second + third])
        steepest = np.sqrt((slopes**2).sum(axis=1).max(axis=0))
        return PrismScene(Prisms.of(corners, planes[:3], usable), steepest)


def _kept_neighbours(of_all: AtFirstUse[NDArray[np.int32]], kept: BoolArray) -> NDArray[np.int32]:
    """The neighbours of triangles among those that are ``kept`` (T,)."""
    neighbours = of_all.get()
    return np.where(kept.take(neighbours), neighbours, np.int32(-1))


def _joined_neighbours(parts: Sequence[CastScene], first: NDArray[np.int32]) -> NDArray[np.int32]:
    """The neighbours of the triangles of several scenes. first: the number of each scene's first triangle."""
    found = ((part.neighbours, start) for part, start in zip(parts, first, strict=True))
    return np.concatenate([np.where(own >= 0, own + start, own) for own, start in found], axis=1)


def _beyond_mesh(vertices: Float32Array, triangles: NDArray[np.int32], core: float) -> TracedMesh:
    """The triangles that no projector meets, in Embree."""
    return graded_mesh(vertices, triangles, np.ones(len(triangles), bool), core)


def _keep_freed_memory() -> None:
    """Let arrays of a tile's size reuse memory instead of requesting it from the system each time.

    glibc returns freed memory above a threshold at once, and fetching it again page by page costs more than
    NumPy's work on it: casting takes 2.5 times as long. Freeing one large block, never touched, raises
    that threshold for good (mallopt(3), M_MMAP_THRESHOLD); other allocators ignore it.
    """
    np.empty(KEPT_BLOCK, np.uint8)
