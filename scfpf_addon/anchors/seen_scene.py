# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene as an engine's cameras see it: some engines leave out the backs of some materials' faces."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..casting.cast import cast, cast_at_nothing
from ..casting.common.hits import Hits
from ..casting.continuation import TileProjectors
from ..casting.layers.layer_parts import Box
from ..casting.layers.layered_cast import chances
from ..casting.scene.cast_scene import CastScene
from ..projection.typing import Array, BoolArray, Float32Array, IndexArray
from ..projection.volume.viewing_volume import ImageLayer, Projection
from ..shading.typing import Single
from .stand_ins import NO_BOXES, StandIns

# Backs that a ray passes, at most: what lies behind more is seen as the last of them.
MOST_PASSED = 64
# A ray begins anew behind a back, at most this share of its limit farther if it grazes the face.
LARGEST_STEP = 1e-4


@dataclass(frozen=True)
class Halo:
    """The surroundings that a layer of an image shows with its things.

    layer: in cast space. box: around its things, in cast space. is_own: (T,), which triangles these are.
    """

    layer: ImageLayer
    box: Box
    is_own: BoolArray

    def is_beyond(self, hits: Hits, x: Array, y: Array) -> BoolArray:
        """Return which hits (N,) of projectors through image positions (N,) are of what is not shown."""
        found: BoolArray = (hits.triangle >= 0) & ~self.is_own[hits.triangle]
        which = np.flatnonzero(found)
        share = self.layer.halo_share(self.box.distance(hits.position.take(which, 1)))
        found[which] = share <= chances(x[which], y[which])
        return found


@dataclass(frozen=True)
class SeenScene:
    """A scene as cameras see it.

    one_sided: (T,), the faces that are seen from the front only; None if all are seen from both sides.
    is_empty: whether nothing of the scene is seen. halo: of a layer, whose projectors pass what is beyond it.
    bare: the scene without stand-ins for what has no faces; None if it has none. whole: see ``StandIns``.
    directional: (T,), the faces whose look changes with the direction in which they are seen; None for none.
    """

    scene: CastScene
    one_sided: BoolArray | None = None
    is_empty: bool = False
    halo: Halo | None = None
    bare: SeenScene | None = None
    whole: Array = field(default_factory=lambda: NO_BOXES)
    directional: BoolArray | None = None

    def with_stand_ins(self, faces: StandIns | None) -> SeenScene:
        """The scene and faces, whose numbers come after its own, that stand for what has none."""
        if faces is None:
            return self
        scene, count = self.scene, len(faces.triangles)
        vertices = scene.vertices.T / scene.scale + scene.centre
        triangles = np.concatenate([scene.triangles, faces.triangles + np.int32(len(vertices))])
        shown = np.zeros_like(scene.usable) if self.is_empty else scene.usable
        usable = np.concatenate([shown, np.ones(count, bool)])
        whole = CastScene(np.concatenate([vertices, faces.vertices]), triangles).only(usable)
        assert whole is not None
        one_sided, directional = (
            None if of_faces is None else np.append(of_faces, np.zeros(count, bool))
            for of_faces in (self.one_sided, self.directional)
        )
        return SeenScene(whole, one_sided, bare=self, whole=faces.whole, directional=directional)

    @cached_property
    def two_sided(self) -> CastScene | None:
        """The faces that are seen from both sides, None if there are none."""
        return self.scene.only(None if self.one_sided is None else ~self.one_sided)

    def first_hits(
        self,
        projection: Projection,
        x: Array,
        y: Array,
        pixel_size: tuple[float, float],
        pixel_error: float,
    ) -> Hits:
        """The first hits of projectors that are seen. projection: in world space. See ``cast``."""
        projection = projection.transformed(self.scene.matrix)
        if self.is_empty:
            return cast_at_nothing(projection, x, y)
        hits = cast(self.scene, projection, x, y, pixel_size, pixel_error)
        if self.one_sided is None and self.halo is None:
            return hits
        tile = TileProjectors(self.scene, projection, x, y, hits.mask, pixel_size, pixel_error)
        for _ in range(MOST_PASSED):
            passed = self._is_back(hits.triangle, hits.tangent)
            if self.halo is not None:
                passed |= self.halo.is_beyond(hits, x, y)
            which = np.flatnonzero(passed)
            if not len(which):
                break
            hits.put(which, tile.next_hits(which, hits.t[which], hits.triangle[which]))
        return hits

    def distances(self, origin: Float32Array, way: Float32Array, limits: Float32Array) -> Single:
        """The distances (N,) of the first faces that rays see, the limit for none. See ``TracedMesh``."""
        if self.is_empty:
            return limits.copy()
        mesh = self.scene.mesh
        found: Single = mesh.trace_distance(origin, way, limits)
        if self.one_sided is None:
            return found
        triangle = mesh.trace(origin, way, limits)
        for _ in range(MOST_PASSED):
            which = np.flatnonzero(self._is_back(triangle, way))
            if not len(which):
                break
            start, own = origin.take(which, 1), way.take(which, 1)
            begin = found[which] + self._step(triangle[which], start + own * found[which], own, limits[which])
            rays = start + own * begin, own
            rest = np.maximum(limits[which] - begin, np.float32(0.0))
            found[which] = np.minimum(begin + mesh.trace_distance(*rays, rest), limits[which])
            triangle[which] = mesh.trace(*rays, rest)
        return found

    def _step(
        self, triangle: IndexArray, position: Float32Array, way: Float32Array, limits: Float32Array
    ) -> Float32Array:
        """The distances (n,) by which rays leave faces that they pass at positions (3, n)."""
        off = self.scene.offsets(triangle, position)
        speed = np.abs(np.einsum("cn,cn->n", self.scene.normals(triangle), way))
        largest = LARGEST_STEP * limits
        step = np.divide(off, speed, out=largest.astype(np.float64), where=speed * largest > off)
        left: Float32Array = step.astype(np.float32)
        return left

    def _is_back(self, triangle: IndexArray, way: NDArray[Any]) -> BoolArray:
        """Return which rays (N,) meet a face at its back that is not seen."""
        if self.one_sided is None:
            return np.zeros(len(triangle), bool)
        is_back: BoolArray = (triangle >= 0) & self.one_sided[triangle]
        which = np.flatnonzero(is_back)
        normal = self.scene.normals(triangle[which])
        is_back[which] = np.einsum("cn,cn->n", normal, way.take(which, 1)) > 0.0
        return is_back
