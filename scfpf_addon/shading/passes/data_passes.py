# SPDX-License-Identifier: GPL-3.0-or-later
"""Data passes: what the projector through a pixel's centre hits, as numbers and without a filter."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from itertools import pairwise
from typing import NamedTuple

import numpy as np

from ...casting.common.geometry import Geometry
from ...casting.common.hits import Hits
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, IndexArray
from ...projection.volume.basis import SpanBasis
from ...projection.volume.viewing_volume import Projection, ViewingVolume
from ..scene.shading_scene import Scene
from ..scene.surface import SurfaceTable
from ..typing import Single
from .cryptomatte import MOST_LAYERS, CryptoFilm
from .light_passes import LIGHT_MISS, LIGHT_PASSES
from .motion_vectors import MotionSample, Neighbour, moved_places

# Depth where nothing is hit, as in Blender's own engines.
FARTHEST_DEPTH = 1e10
# Nodes of the Gauss quadrature of a projector's length, a span: 1e-6 for a half turn.
LENGTH_NODES = 12


@dataclass(frozen=True)
class DataPasses:
    """Which data passes a frame has.

    names: of PASSES. depth_plane: (4,) (a, b, c, d), depth is a·x + b·y + c·z + d in world
    space, the distance from an ordinary camera along its axis; None for the
    length of the projector from the near surface. neighbours: the frames before and after, for
    motion vectors. identifiers: what stands for each object ("OBJECT") and material ("MATERIAL") in
    cryptomattes, by their numbers.
    """

    names: tuple[str, ...] = ()
    depth_plane: Array | None = None
    neighbours: tuple[Neighbour, Neighbour] | None = None
    identifiers: dict[str, Single] = field(default_factory=dict)

    @property
    def central(self) -> bool:
        """Whether any is made of the projector through the pixel's centre, not of the picture's samples."""
        return any(name not in LIGHT_PASSES and not name.startswith("CRYPTO") for name in self.names)

    @property
    def weighted(self) -> bool:
        """Whether barycentric weights are wanted."""
        return not {"UV", "VECTOR"}.isdisjoint(self.names)

    def crypto_layers(self, kind: str) -> int:
        """How many cryptomatte layers of "OBJECT" or "MATERIAL" there are."""
        return sum(name.startswith(f"CRYPTO_{kind}_") for name in self.names)


class PassSamples(NamedTuple):
    """The n projectors of a tile that hit, in cast space.

    x, y: (n,) where in the image. hits: of all the same.
    """

    x: Array
    y: Array
    hits: Hits


@dataclass(frozen=True)
class PassSource:
    """All that data passes are made of. projection: in cast space, that of ``cast_scene``.

    size: of the image in pixels.
    """

    wanted: DataPasses
    size: tuple[int, int]
    projection: Projection
    scene: Scene
    cast_scene: CastScene
    surface: SurfaceTable

    def position(self, seen: PassSamples) -> Array:
        """World position, (3, n)."""
        position: Array = seen.hits.position / self.cast_scene.scale + np.reshape(
            self.cast_scene.centre, (3, 1)
        )
        return position

    def depth(self, seen: PassSamples) -> Array:
        """See ``DataPasses.depth_plane``, (1, n)."""
        plane = self.wanted.depth_plane
        if plane is not None:
            # Not a matrix product, whose rounding may depend on how many there are.
            x, y, z = self.position(seen)
            depth: Array = plane[0] * x + plane[1] * y + plane[2] * z + plane[3]
            return depth[None]
        points = self.projection.projectors(seen.x, seen.y).points
        length = projector_length(self.projection.volume.spans, points, seen.hits.t)
        return length[None] / self.cast_scene.scale

    def normal(self, seen: PassSamples) -> Array:
        """Shading normal on the side of the viewer, unit, world axes, (3, n)."""
        hits = seen.hits
        points = self.surface.points(hits.triangle, hits.barycentric, hits.position, hits.tangent)
        return points.normal.astype(np.float64)

    def uv(self, seen: PassSamples) -> Array:
        """Texture coordinates and 1, as Cycles has it, or 0 where a mesh has none, (3, n)."""
        corners = self.scene.geometry.uv
        if corners is None:
            raise ValueError("the scene was read without texture coordinates")
        first, second, third = corners[seen.hits.triangle].astype(np.float64).transpose(1, 2, 0)
        weight = seen.hits.barycentric
        u, v = first + (second - first) * weight[0] + (third - first) * weight[1]
        there = ~np.isnan(u)
        return np.where(there, np.stack([u, v, np.ones_like(u)]), 0.0)

    def parameters(self, seen: PassSamples) -> Array:
        """(u, v, t) of the hit, (3, n)."""
        image = self.projection.parameters(seen.x, seen.y)
        return np.stack([image.u, image.v, seen.hits.t])

    def perspective_depth(self, seen: PassSamples) -> Array:
        """See ``perspective_depth``, (1, n)."""
        image = self.projection.parameters(seen.x, seen.y)
        return perspective_depth(self.projection.volume, image.u, image.v, seen.hits.t)[None]

    def tangent(self, seen: PassSamples) -> Array:
        """The projector's direction at the hit, away from the viewer, unit, world axes, (3, n)."""
        tangent = seen.hits.tangent
        length = np.sqrt(np.einsum("cn,cn->n", tangent, tangent))
        return tangent / np.where(length > 0.0, length, 1.0)

    def vector(self, seen: PassSamples) -> Array:
        """From where a hit is in the image to where it was in the frame before, and from where it will be in
        the frame after to where it is: pixels along x and y of each, (4, n), as Cycles has it.
        """
        if self.wanted.neighbours is None:
            raise ValueError("motion vectors need the frames before and after")
        geometry, hits = self.scene.geometry, seen.hits
        now = MotionSample(
            self.position(seen),
            geometry.triangles[hits.triangle],
            hits.barycentric,
            self.parameters(seen),
            seen.x,
            seen.y,
        )
        before, after = (moved_places(each, geometry.vertices, now) for each in self.wanted.neighbours)
        pixels = np.reshape(self.size, (2, 1))
        return np.concatenate([before * pixels, -after * pixels])

    def object_index(self, seen: PassSamples) -> Array:
        """The user's number of the object, (1, n); the scene must know them."""
        number = self.scene.geometry.object_index[seen.hits.triangle]
        return np.array(self.scene.object_index, np.float64).take(number)[None]

    def material_index(self, seen: PassSamples) -> Array:
        """The user's number of the material, (1, n); the scene must know them."""
        number = self.scene.geometry.material[seen.hits.triangle]
        return np.array(self.scene.material_index, np.float64).take(number)[None]


class PassKind(NamedTuple):
    """channels: how many; miss: their value where nothing is hit; values: (channels, n) of what is, None
    where others fill them.
    """

    channels: int
    miss: float
    values: Callable[[PassSource, PassSamples], Array] | None


PASSES = {
    "DEPTH": PassKind(1, FARTHEST_DEPTH, PassSource.depth),
    "POSITION": PassKind(3, 0.0, PassSource.position),
    "NORMAL": PassKind(3, 0.0, PassSource.normal),
    "UV": PassKind(3, 0.0, PassSource.uv),
    "PARAMETERS": PassKind(3, 0.0, PassSource.parameters),
    "PERSPECTIVE_DEPTH": PassKind(1, 1.0, PassSource.perspective_depth),
    "TANGENT": PassKind(3, 0.0, PassSource.tangent),
    "VECTOR": PassKind(4, 0.0, PassSource.vector),
    "CHORD_COUNT": PassKind(1, 0.0, None),
    "CHORD_ERROR": PassKind(1, 0.0, None),
    "OBJECT_INDEX": PassKind(1, 0.0, PassSource.object_index),
    "MATERIAL_INDEX": PassKind(1, 0.0, PassSource.material_index),
}
# The pass of a layer of a kind.
CRYPTO_PASS = "CRYPTO_{}_{:02d}"
CRYPTO_KINDS = ("OBJECT", "MATERIAL")
PASSES |= {
    CRYPTO_PASS.format(kind, layer): PassKind(4, 0.0, None)
    for kind in CRYPTO_KINDS
    for layer in range(MOST_LAYERS)
}
PASSES |= {name: PassKind(3, LIGHT_MISS.get(name, 0.0), None) for name in LIGHT_PASSES}


def empty_passes(wanted: DataPasses, height: int, width: int) -> dict[str, Single]:
    """The passes of a picture in which nothing is hit, each (height, width, channels)."""
    return {
        name: np.full((height, width, PASSES[name].channels), PASSES[name].miss, np.float32)
        for name in wanted.names
    }


def fill_passes(source: PassSource, seen: PassSamples, where: IndexArray, into: dict[str, Single]) -> None:
    """Write what is seen at the pixels ``where`` (n,) into the passes of a tile, each (pixels, channels)."""
    for name, pixels in into.items():
        values = PASSES[name].values
        if values is not None:
            pixels[where] = values(source, seen).T


class CryptoPasses:
    """The cryptomattes of a tile of ``count`` pixels, as its samples are taken."""

    def __init__(self, source: PassSource | None, count: int) -> None:
        self._source = source
        self._films: dict[str, CryptoFilm] = {}
        if source:
            layers = {kind: source.wanted.crypto_layers(kind) for kind in CRYPTO_KINDS}
            self._films = {kind: CryptoFilm(count, many) for kind, many in layers.items() if many}

    @property
    def wanted(self) -> bool:
        """Whether there are any."""
        return bool(self._films)

    def add(self, pixel: IndexArray, geometry: Geometry, triangle: IndexArray) -> None:
        """What samples of the tile's pixels (m,) hit: triangles (m,) of a geometry."""
        for kind, film in self._films.items():
            numbers = geometry.object_index if kind == "OBJECT" else geometry.material
            film.add(pixel, numbers[triangle])

    def develop(self, pixel: IndexArray, samples: Single | float, into: dict[str, Single]) -> None:
        """Write the layers of pixels (m,) into the passes, each (m, channels)."""
        for kind, film in self._films.items():
            if self._source:
                made = film.develop(pixel, samples, self._source.wanted.identifiers[kind])
                for layer in range(made.shape[1] // 4):
                    into[CRYPTO_PASS.format(kind, layer)][:] = made[:, 4 * layer : 4 * layer + 4]


def projector_length(spans: SpanBasis, points: Array, t: Array) -> Array:
    """Length of projectors with control points (K, 3, n) from the near surface to t (n,), (n,)."""
    nodes, shares = np.polynomial.legendre.leggauss(1 if spans.is_polyline else LENGTH_NODES)
    length = np.zeros(len(t))
    for start, end in pairwise(spans.breaks):
        half = (np.clip(t, start, end) - start) / 2
        for node, share in zip(nodes, shares, strict=True):
            _, slopes = spans.weights(start + half * (1 + node))
            velocity = np.einsum("kn,kcn->cn", slopes, points)
            length += share * half * np.sqrt(np.einsum("cn,cn->n", velocity, velocity))
    return length


def perspective_depth(volume: ViewingVolume, u: Array, v: Array, t: Array) -> Array:
    """The depth of linear perspective in place of t, both (n,) in [0, 1] (paper §3.2, after Watt 2000).

    f (1 - d/z) / (f - d), where d, f and z are the distances from the centre of projection to the
    near and far plane and to the point. A volume at large has no centre; what stands for f/d
    is how much farther apart its projectors are at the far end, √(|Qu × Qv| far / near). That is
    f/d for every frustum and 1, which leaves t as it is, for parallel projectors.
    """
    near, far = (volume.evaluate(u, v, np.full_like(t, end)) for end in (0.0, 1.0))
    spread_near, spread_far = (
        np.sqrt(np.linalg.norm(np.cross(q.du, q.dv, axis=0), axis=0)) for q in (near, far)
    )
    # t f / ((1 - t) d + t f), with f and d up to a common factor.
    whole = (1.0 - t) * spread_near + t * spread_far
    return np.divide(t * spread_far, whole, out=t.copy(), where=whole > 0.0)
