# SPDX-License-Identifier: GPL-3.0-or-later
"""The triangles of a scene, prepared for casting.

Embree works in float32, where a scene far from the origin falls apart; so the
triangles are re-centred and scaled in float64 first. That space is *cast
space*; ``CastScene.matrix`` leads into it. Embree only names candidates there:
what a hit is, is computed from the float64 triangles.
"""

from __future__ import annotations

import sys
from collections.abc import Callable
from copy import copy
from functools import cache
from importlib.metadata import version
from threading import Lock
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, Float32Array, IndexArray
from ...projection.volume.median import median
from ..common.cancellation import raise_if_cancelled, uncancellable
from ..common.geometry import renumbered
from ..common.memory import shortage
from ..common.parallel import beside, chunks, parallel_map
from .embree_meshes import cut_off_library, mesh_in_embree
from .neighbours import edge_neighbours
from .occupancy import Occupancy
from .prism_scene import PrismScene
from .prisms import BYTES_PER_TRIANGLE, Prisms
from .quads import Quads

# The first embreex on Embree 4 whose run() releases the GIL and takes any strides.
EMBREEX_MINIMUM = (4, 4)
REMEDY = "install SCFPF again from the zip for this system, which brings embreex {} or later"

# A larger coordinate cannot be squared twice in float64; it counts as not finite.
LARGEST_COORDINATE = 1e60

# A triangle whose height is a smaller share of its length has no usable
# barycentric coordinates: float64 keeps 16 digits, the inside test needs some.
FLATTEST = 1e-12

# Secondary rays start this share of the triangle's largest coordinate off its
# plane: 32 float32 roundings (2⁻²³), since Embree rounds the triangle's corners
# and the ray's origin. After Wächter & Binder, Ray Tracing Gems (2019), ch. 6.
ORIGIN_OFFSET = 2.0**-18

# A shadow ray ends this share before the lamp, which may stand in a surface.
SHADOW_END = 1e-4

# The largest block, in bytes, that glibc can be made to keep (its limit is 32 MiB).
KEPT_BLOCK = 31 << 20

# Vertices of which the median is taken for that of all.
ENOUGH_FOR_MEDIAN = 1 << 15

# What is kept for different kinds of rays and for lamps' shadows, at most.
MOST_PARTS = 16


class CastError(ValueError):
    """Casting is impossible; the message says what to do."""


class NothingToCastAt(CastError):
    """No triangle could ever be hit."""


def _load_embreex() -> tuple[Any, Any]:
    """The embreex modules for scenes and meshes; CastError if missing, damaged, not loadable or too old."""
    remedy = REMEDY.format(".".join(map(str, EMBREEX_MINIMUM)))
    if "embreex" not in sys.modules and (damage := cut_off_library("embreex")):
        raise CastError(f"the ray caster embreex is damaged ({damage}): {remedy}")
    try:
        from embreex import mesh_construction, rtcore_scene

        found = version("embreex")
    except ModuleNotFoundError as error:
        raise CastError(f"the ray caster embreex is missing ({error}): {remedy}") from error
    except ImportError as error:
        raise CastError(f"the ray caster embreex cannot be loaded ({error}): {remedy}") from error
    if tuple(int(part) for part in found.split(".")[:2]) < EMBREEX_MINIMUM:
        raise CastError(f"the ray caster embreex {found} is too old: {remedy}")
    return rtcore_scene, mesh_construction


@cache
def caster_fault() -> str:
    """Why nothing can be cast, and what to do; empty where all is well. Asked once: it draws panels."""
    try:
        _load_embreex()
    except CastError as error:
        return str(error)
    return ""


def require_room_for_prisms(triangles: int) -> None:
    """Raise CastError where memory does not hold what exact casting makes of so many triangles."""
    short = shortage(BYTES_PER_TRIANGLE * triangles)
    if short:
        raise CastError(
            f"exact casting needs {short[0]} of memory for {triangles:,} triangles, "
            f"{short[1]} are free: set the pixel error above 0, "
            "or hide what the picture does not show"
        )


def _keep_freed_memory() -> None:
    """Let arrays of a tile's size reuse memory instead of asking the system anew.

    glibc returns freed memory above a threshold at once, and fetching it again page
    by page costs more than what NumPy does with it: casting takes 2.5 times as long.
    Freeing one large block, never touched, raises that threshold for good (mallopt(3),
    M_MMAP_THRESHOLD); other allocators ignore it.
    """
    np.empty(KEPT_BLOCK, np.uint8)


def _inverse(area: Array, usable: BoolArray) -> Array:
    """1 over the squared areas (n,), 0 of triangles without any."""
    return np.divide(1.0, area, out=np.zeros_like(area), where=usable)


def _cross(a: Array, b: Array) -> Array:
    """Vector products of two (3, n) arrays, (3, n); np.cross takes twice as long."""
    product, term = np.empty_like(a), np.empty(a.shape[1])
    for row, (i, j) in zip(product, ((1, 2), (2, 0), (0, 1)), strict=True):
        np.multiply(a[i], b[j], out=row)
        row -= np.multiply(a[j], b[i], out=term)
    return product


def _fill(rows: Array, gradient: Array, first: Array) -> None:
    """Write functions of the place (4, n) that grow by ``gradient`` (3, n) and vanish at ``first``."""
    rows[:3] = gradient
    rows[3] = -np.einsum("ct,ct->t", gradient, first)


class CastScene:
    """Triangles in cast space, in float64 and in Embree.

    vertices: (V, 3) float64, world space; triangles: (T, 3) int32. Triangles with
    a vertex that is not finite, and those without area, are never hit; indices of
    triangles stay what they were. beyond() gives vertices and triangles that no projector meets
    but that stand in the way of light: it is asked while Embree builds the others; ``occluded`` builds
    these when it is first asked.
    Raises CastError when embreex is missing or too old or an index is out of
    range, NothingToCastAt where no triangle is left.

    centre: (3,) world; scale: cast-space units in a world unit; matrix: (4, 4),
    world to cast space. lower, upper: (3,) bounds in cast space, within [-1, 1].
    planes: (4, T) unit normal and offset, so that planes[:3]·p + planes[3] is the
    height of p over the triangle. Safe to use from several threads.
    """

    def __init__(
        self,
        vertices: Array,
        triangles: NDArray[np.int32],
        beyond: Callable[[], tuple[Array, NDArray[np.int32]]] | None = None,
    ) -> None:
        _load_embreex()
        _keep_freed_memory()
        vertices = np.asarray(vertices, np.float64).reshape(-1, 3)
        self.triangles = np.ascontiguousarray(triangles, np.int32).reshape(-1, 3)
        if self.triangles.size and not 0 <= self.triangles.min() <= self.triangles.max() < len(vertices):
            raise CastError("a triangle names a vertex that does not exist")
        finite: BoolArray = np.ones(len(vertices), bool)
        usable: BoolArray = np.ones(len(self.triangles), bool)
        with np.errstate(invalid="ignore"):
            if not max(vertices.max(initial=0.0), -vertices.min(initial=0.0)) < LARGEST_COORDINATE:
                finite = np.all(np.abs(vertices) < LARGEST_COORDINATE, axis=1)
                usable = np.all(finite[self.triangles], axis=1)
        if not usable.any():
            raise NothingToCastAt("the scene has no triangles: add a mesh, or show one in renders")
        self._place(vertices, finite, usable)
        self._measure(usable)
        if not usable.any():
            raise NothingToCastAt("the scene has no triangle with an area: check the objects' scale")
        self._neighbours: NDArray[np.int32] | None = None
        self._beyond: tuple[Float32Array, NDArray[np.int32]] | None = None
        self._beyond_scene: Any = None
        self._parts: dict[bytes, CastScene] = {}
        self._build(usable, beyond)

    def _build(
        self, usable: BoolArray, beyond: Callable[[], tuple[Array, NDArray[np.int32]]] | None = None
    ) -> None:
        """Put the triangles ``usable`` (T,) into Embree; what is beyond is looked for meanwhile."""
        self._usable = usable
        if beyond is None:
            self._put_into_embree()
        else:
            # Embree's threads do not need the interpreter, which NumPy holds for much of its work.
            self._beyond = beside(self._put_into_embree, lambda: self._placed_beyond(*beyond()))
        self._prisms: PrismScene | None = None
        self._occupancy: Occupancy | None = None
        self._lock = Lock()
        # Another: prisms are made of weights.
        self._weights_lock = Lock()

    def _put_into_embree(self) -> None:
        faces, usable = self.triangles, self._usable
        self._quads = Quads.of(faces, usable)
        if self._quads:
            faces = self._quads.faces
        elif not usable.all():
            faces = np.where(usable[:, None], faces, faces[:, :1])
        self._embree, self._mesh, self._faces = mesh_in_embree(_load_embreex(), self.vertices.T, faces)

    def only(self, kept: BoolArray | None) -> CastScene | None:
        """The same triangles by the same numbers, of which only those in ``kept`` (T,) are ever hit.

        None for kept are all. Kept for the next time. None where nothing would be hit.
        """
        if kept is None or kept[self._usable].all():
            return self
        usable: BoolArray = self._usable & kept
        if not usable.any():
            return None
        key = np.packbits(kept).tobytes()
        if key not in self._parts:
            if len(self._parts) == MOST_PARTS:
                self._parts.clear()
            part = copy(self)
            part._beyond, part._beyond_scene, part._parts = None, None, {}
            part._build(usable)
            self._parts[key] = part
        return self._parts[key]

    def _place(self, vertices: Array, finite: BoolArray, usable: BoolArray) -> None:
        """Choose cast space and put the vertices, (3, V), into it."""
        used = np.zeros(len(vertices), bool)
        used[self.triangles if usable.all() else self.triangles[usable]] = True
        points = vertices if used.all() else vertices[used]
        # The median, not the middle of the bounds: float32 is finest at the
        # origin, which so falls among the objects and not in the middle of a sky. Some tell it well enough.
        some = points[:: 1 + len(points) // ENOUGH_FOR_MEDIAN]
        self.centre: Array = np.array([median(places) for places in some.T])
        # Axis by axis: NumPy takes several times as long for all three at once.
        reach = max(
            float(max(places.max() - middle, middle - places.min()))
            for places, middle in zip(points.T, self.centre, strict=True)
        )
        self.scale = 1.0 / reach if reach > 0.0 else 1.0
        self.matrix: Array = np.diag([self.scale, self.scale, self.scale, 1.0])
        self.matrix[:3, 3] = -self.scale * self.centre
        # What no usable triangle has stays in the middle.
        kept = finite & used
        self.vertices: Array = np.zeros((3, len(vertices)))
        for row, places, middle in zip(self.vertices, vertices.T, self.centre, strict=True):
            np.subtract(places, middle, out=row, where=kept)
        self.vertices *= self.scale
        self.lower: Array = self.vertices.min(axis=1)
        self.upper: Array = self.vertices.max(axis=1)

    def _measure(self, usable: BoolArray) -> None:
        """Planes of the triangles; ``usable`` loses those without area."""
        self.planes: Array = np.empty((4, len(usable)))
        self._reach = np.empty(len(usable), np.float32)
        self._weights: Array | None = None
        largest = np.abs(self.vertices).max(axis=0).astype(np.float32)

        def measure(some: slice) -> None:
            """Planes and sizes of some triangles."""
            corners = self._corners_of(some)
            first, along, across = self._edges(corners)
            normal = _cross(along, across)
            area = np.einsum("ct,ct->t", normal, normal)
            longest = np.maximum(np.einsum("ct,ct->t", along, along), np.einsum("ct,ct->t", across, across))
            usable[some] &= area > (FLATTEST * longest) ** 2
            normal *= np.sqrt(_inverse(area, usable[some]))
            _fill(self.planes[:, some], normal, first)
            reach = [largest.take(corner, mode="clip") for corner in corners]
            np.maximum(np.maximum(reach[0], reach[1]), reach[2], out=self._reach[some])

        parallel_map(measure, chunks(len(usable)))

    def _corners_of(self, some: slice) -> IndexArray:
        """The vertices of some triangles, (3, n), as NumPy takes them quickest."""
        return self.triangles[some].T.astype(np.intp, order="C")

    def _edges(self, corners: IndexArray) -> tuple[Array, Array, Array]:
        """The first of corners (3, n), and what leads from them to the second and third, (3, n)."""
        first, along, across = (self.vertices.take(corner, 1, mode="clip") for corner in corners)
        along -= first
        across -= first
        return first, along, across

    @property
    def _corners(self) -> Array:
        """(8, T): gradients and offsets of the triangles' barycentric weights; see ``_weights_made``."""
        weights = self._weights
        if weights is None:
            with self._weights_lock:
                weights = self._weights = self._weights_made() if self._weights is None else self._weights
        return weights

    def _weights_made(self) -> Array:
        """The weights of the second and third corner. Made at first use: flat shading needs none."""
        weights: Array = np.empty((8, len(self._usable)))

        def weigh(some: slice) -> None:
            """Gradients and offsets of some triangles' weights."""
            first, along, across = self._edges(self._corners_of(some))
            normal = _cross(along, across)
            inverse = _inverse(np.einsum("ct,ct->t", normal, normal), self._usable[some])
            _fill(weights[:4, some], _cross(across, normal) * inverse, first)
            _fill(weights[4:, some], _cross(normal, along) * inverse, first)

        parallel_map(weigh, chunks(len(self._usable)))
        return weights

    @property
    def neighbours(self) -> NDArray[np.int32]:
        """(3, T): the triangle across the edge opposite each corner, -1 where none is.

        Made at first use: straight casting does not need it.
        """
        with self._lock:
            if self._neighbours is None:
                self._neighbours = edge_neighbours(self.triangles)
            return self._neighbours

    @property
    def prisms(self) -> PrismScene:
        """What exact casting walks through. Made at first use: it takes memory and time.

        Raises CastError where there is not enough memory for it.
        """
        with self._lock:
            if self._prisms is None:
                with uncancellable():
                    self._prisms = self._prisms_made()
            return self._prisms

    def _prisms_made(self) -> PrismScene:
        require_room_for_prisms(len(self.triangles))
        corners = np.stack([self.vertices.take(self.triangles[:, k], 1) for k in range(3)])
        second, third = self._corners[:3], self._corners[4:7]
        raise_if_cancelled()
        slopes = np.stack([second, third, second + third])
        steepest = np.sqrt((slopes**2).sum(axis=1).max(axis=0))
        return PrismScene(Prisms.of(corners, self.planes[:3], self._usable), steepest, _load_embreex())

    @property
    def occupancy(self) -> Occupancy:
        """Which parts of the scene are empty; made at first use."""
        with self._lock:
            if self._occupancy is None:
                with uncancellable():
                    corners = self.vertices.take(self.triangles[self._usable].T, 1)
                    self._occupancy = Occupancy.of(corners.swapaxes(0, 1))
            return self._occupancy

    def trace(
        self, origins: Float32Array, directions: Float32Array, limits: Float32Array
    ) -> NDArray[np.int32]:
        """The first triangle on each ray, (N,) int32, -1 where none is.

        origins, directions: (3, N) float32, cast space; limits: (N,) float32, in
        units of the direction's length; a negative limit switches a ray off.
        """
        raise_if_cancelled()
        if self._quads:
            # embreex overwrites the array of limits.
            rays = origins.T, directions.T, limits.copy()
            return self._quads.triangles(self._embree.run(*rays, output=True), self._faces)
        found: NDArray[np.int32] = self._embree.run(origins.T, directions.T, limits)
        return found

    def trace_weights(
        self, origins: Float32Array, directions: Float32Array, limits: Float32Array
    ) -> tuple[NDArray[np.int32], tuple[Float32Array, Float32Array]]:
        """As ``trace``, with Embree's own weights, each (N,), of the second and third corner.

        The limits are used up.
        """
        raise_if_cancelled()
        found = self._embree.run(origins.T, directions.T, limits, output=True)
        if self._quads:
            return self._quads.weights(found, self._faces)
        return found["primID"], (found["u"], found["v"])

    def trace_distance(
        self, origins: Float32Array, directions: Float32Array, limits: Float32Array
    ) -> Float32Array:
        """Embree's own distance to the first triangle, (N,) float32; the limit where none is."""
        raise_if_cancelled()
        # embreex overwrites the array of limits.
        found: Float32Array = self._embree.run(origins.T, directions.T, limits.copy(), query="DISTANCE")
        return found

    def occluded(self, origins: NDArray[Any], directions: NDArray[Any], distances: NDArray[Any]) -> BoolArray:
        """Whether anything lies on each ray before its distance.

        origins: (3, N), directions: (3, N) or (3, 1), distances: (N,) or (1,) in units of the direction's
        length (inf is allowed), cast space. The last SHADOW_END of the
        way is left out; origins are taken as they are (see ``offset_origins``).
        """
        raise_if_cancelled()
        with np.errstate(invalid="ignore", over="ignore"):
            start = origins.astype(np.float32, copy=False)
            way, limits = directions.astype(np.float32, copy=False), np.empty(start.shape[1], np.float32)
            # embreex takes a negative limit for a hit here; a limit that is no number becomes 0.
            limits[:] = np.fmax(distances * (1.0 - SHADOW_END), 0.0)
            # One sum tells that all is finite, or that each has to be looked at.
            if not np.isfinite(start.sum() + way.sum()):
                dead = ~np.isfinite(start.sum(axis=0) + way.sum(axis=0))
                start, way = np.where(dead, np.float32(0), start), np.where(dead, np.float32(0), way)
                limits[dead] = 0.0
        rays = start.T, np.broadcast_to(way, start.shape).T, limits
        hit: BoolArray = self._embree.run(*rays, query="OCCLUDED") >= 0
        beyond = self._beyond_embree()
        if beyond is not None:
            # What is hit already stays so, and costs next to nothing.
            np.putmask(limits, hit, np.float32(-1))
            hit = beyond.run(*rays, query="OCCLUDED") >= 0
        return hit

    def _placed_beyond(
        self, vertices: Array, triangles: NDArray[np.int32]
    ) -> tuple[Float32Array, NDArray[np.int32]] | None:
        """What is beyond in cast space: (3, n) of the vertices that are used; None where there is nothing."""
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

    def _beyond_embree(self) -> Any:
        """What no projector meets, in Embree; None where there is nothing."""
        with self._lock:
            if self._beyond is not None:
                vertices, triangles = self._beyond
                quads = Quads.of(triangles, np.ones(len(triangles), bool))
                self._beyond_scene, self._beyond_mesh, _ = mesh_in_embree(
                    _load_embreex(), vertices.T, quads.faces if quads else triangles
                )
                self._beyond = None
            return self._beyond_scene

    def offset_origins(self, positions: Array, triangles: IndexArray, directions: NDArray[Any]) -> Array:
        """Origins (3, N) of secondary rays that leave ``triangles`` (N,) at ``positions`` (3, N).

        Moved off the triangle's plane to the side that ``directions`` (3, N) go to,
        by ORIGIN_OFFSET of the triangle's largest coordinate.
        """
        normal = self.normals(triangles)
        side = np.copysign(ORIGIN_OFFSET, np.einsum("cn,cn->n", normal, directions))
        origins: Array = positions + normal * (side * self._reach.take(triangles))
        return origins

    def offsets(self, triangles: IndexArray) -> Float32Array:
        """How far off ``triangles`` (N,) the origins of ``offset_origins`` are, (N,) float32."""
        offsets: Float32Array = self._reach.take(triangles, mode="wrap")
        offsets *= np.float32(ORIGIN_OFFSET)
        return offsets

    def normals(self, triangles: IndexArray) -> Array:
        """Unit geometric normals (3, N), counter-clockwise corners seen from their tip."""
        normals: Array = self.planes[:3].take(triangles, 1)
        return normals

    def heights(self, positions: Array, triangles: IndexArray) -> Array:
        """How high positions (3, N) are over the triangles' planes, (N,)."""
        plane = self.planes.take(triangles, 1)
        height: Array = np.einsum("cn,cn->n", plane[:3], positions)
        height += plane[3]
        return height

    def barycentric(self, positions: Array, triangles: IndexArray) -> Array:
        """Weights (2, N) of the triangles' second and third corners at positions (3, N)."""
        rows = self._corners.take(triangles, 1, mode="wrap")
        weights = np.empty((2, positions.shape[1]))
        for target, row in zip(weights, (rows[:4], rows[4:]), strict=True):
            np.einsum("cn,cn->n", row[:3], positions, out=target)
            target += row[3]
        return weights
