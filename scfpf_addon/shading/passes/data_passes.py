# SPDX-License-Identifier: GPL-3.0-or-later
"""Data passes: numbers about the hit of the projector through each pixel's centre, without a filter."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ...casting.chord_map import ChordMap
from ...casting.common.hits import Hits
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, IndexArray
from ...projection.volume.viewing_volume import Projection
from ..scene.shading_scene import Scene
from ..scene.surface import SurfaceTable
from ..typing import Single
from ..vectors import unit
from .cryptomatte import CRYPTO_KINDS, CRYPTO_PASS, MOST_LAYERS
from .depths import perspective_depth, projector_length
from .light_passes import LIGHT_MISS, LIGHT_PASSES
from .motion_vectors import MotionSample, Neighbour, moved_places

# Depth where nothing is hit, as in Blender's own engines.
FARTHEST_DEPTH = 1e10


@dataclass(frozen=True)
class DataPasses:
    """The passes of a frame.

    names: of PASSES. depth_plane: (4,) (a, b, c, d), depth is a·x + b·y + c·z + d in world space, the
    distance from an ordinary camera along its axis; None for the length of the projector from the near
    surface. layer_planes: those of the image's layers, () if it has none. neighbours: the frames before and
    after, for motion vectors. identifiers: numbers that stand for each object ("OBJECT") and material
    ("MATERIAL") in cryptomattes, by their index.
    """

    names: tuple[str, ...] = ()
    depth_plane: Array | None = None
    layer_planes: tuple[Array | None, ...] = ()
    neighbours: tuple[Neighbour, Neighbour] | None = None
    identifiers: dict[str, Single] = field(default_factory=dict)

    @property
    def central(self) -> bool:
        """Return whether any pass shows the projector through the pixel's centre, not the image's samples."""
        return any(PASSES[name].central for name in self.names)

    @property
    def weighted(self) -> bool:
        """Return whether any pass needs barycentric weights."""
        return any(PASSES[name].weighted for name in self.names)

    def crypto_layers(self) -> dict[str, int]:
        """The number of cryptomatte layers of each kind that has any."""
        layers = {
            kind: sum(CRYPTO_PASS.format(kind, layer) in self.names for layer in range(MOST_LAYERS))
            for kind in CRYPTO_KINDS
        }
        return {kind: count for kind, count in layers.items() if count}


class PassSamples(NamedTuple):
    """The hits of n central projectors. x, y: (n,) image positions. hits: in cast space, no misses."""

    x: Array
    y: Array
    hits: Hits


@dataclass(frozen=True)
class PassSource:
    """The scene and the projection that data passes show.

    size: of the image in pixels. projection: in cast space, that of ``cast_scene``.
    """

    wanted: DataPasses
    size: tuple[int, int]
    projection: Projection
    scene: Scene
    cast_scene: CastScene
    surface: SurfaceTable

    def of_layers(self) -> Iterator[PassSource]:
        """The source of each layer of the image, by number: its hits lie on projectors of its own."""
        planes = self.wanted.depth_plane, *self.wanted.layer_planes
        for number, projection in enumerate(self.projection.of_layers):
            wanted = replace(self.wanted, depth_plane=planes[number] if number < len(planes) else None)
            if wanted.neighbours is not None:
                before, after = (
                    each._replace(projection=each.projection.of_layers[number]) for each in wanted.neighbours
                )
                wanted = replace(wanted, neighbours=(before, after))
            yield replace(self, projection=projection, wanted=wanted)

    def position(self, samples: PassSamples) -> Array:
        """World position, (3, n)."""
        position: Array = samples.hits.position / self.cast_scene.scale + np.reshape(
            self.cast_scene.centre, (3, 1)
        )
        return position

    def depth(self, samples: PassSamples) -> Array:
        """The distance along the camera's axis or along the projector, see ``DataPasses``, (1, n)."""
        plane = self.wanted.depth_plane
        if plane is not None:
            # Not a matrix product, whose rounding may depend on how many there are.
            x, y, z = self.position(samples)
            depth: Array = plane[0] * x + plane[1] * y + plane[2] * z + plane[3]
            return depth[None]
        points = self.projection.projectors(samples.x, samples.y).points
        length = projector_length(self.projection.volume.spans, points, samples.hits.t)
        return length[None] / self.cast_scene.scale

    def normal(self, samples: PassSamples) -> Array:
        """Shading normal on the side of the viewer, unit, world axes, (3, n)."""
        hits = samples.hits
        points = self.surface.points(hits.triangle, hits.barycentric, hits.position, hits.tangent)
        return points.normal.astype(np.float64)

    def uv(self, samples: PassSamples) -> Array:
        """Texture coordinates and 1 as in Cycles, 0 where a mesh has none, (3, n)."""
        corners = self.scene.geometry.uv
        if corners is None:
            raise ValueError("the scene was read without texture coordinates")
        first, second, third = corners[samples.hits.triangle].astype(np.float64).transpose(1, 2, 0)
        weight = samples.hits.barycentric
        u, v = first + (second - first) * weight[0] + (third - first) * weight[1]
        there = ~np.isnan(u)
        return np.where(there, np.stack([u, v, np.ones_like(u)]), 0.0)

    def parameters(self, samples: PassSamples) -> Array:
        """(u, v, t) of the hit, (3, n)."""
        image = self.projection.parameters(samples.x, samples.y)
        return np.stack([image.u, image.v, samples.hits.t])

    def perspective_depth(self, samples: PassSamples) -> Array:
        """The depth of linear perspective, 0 to 1 from the near to the far surface, (1, n)."""
        image = self.projection.parameters(samples.x, samples.y)
        return perspective_depth(self.projection.volume, image.u, image.v, samples.hits.t)[None]

    def tangent(self, samples: PassSamples) -> Array:
        """The projector's direction at the hit, away from the viewer, unit, world axes, (3, n)."""
        return unit(samples.hits.tangent)

    def vector(self, samples: PassSamples) -> Array:
        """Motion of the hits in the image as in Cycles, (4, n), in pixels along x and y.

        First from here to the place in the frame before, then from the place in the frame after to here.
        """
        if self.wanted.neighbours is None:
            raise ValueError("motion vectors need the frames before and after")
        geometry, hits = self.scene.geometry, samples.hits
        motion = MotionSample(
            position=self.position(samples),
            corners=geometry.triangles[hits.triangle],
            weight=hits.barycentric,
            parameters=self.parameters(samples),
            x=samples.x,
            y=samples.y,
        )
        before, after = (moved_places(each, geometry.vertices, motion) for each in self.wanted.neighbours)
        pixels = np.reshape(self.size, (2, 1))
        return np.concatenate([before * pixels, -after * pixels])

    def object_index(self, samples: PassSamples) -> Array:
        """The user's number of the object, (1, n); the scene must have them."""
        number = self.scene.geometry.object_index[samples.hits.triangle]
        return np.array(self.scene.object_index, np.float64).take(number)[None]

    def material_index(self, samples: PassSamples) -> Array:
        """The user's number of the material, (1, n); the scene must have them."""
        number = self.scene.geometry.material[samples.hits.triangle]
        return np.array(self.scene.material_index, np.float64).take(number)[None]


class PassKind(NamedTuple):
    """A pass: everything that rendering knows of it.

    channels: count. miss: value where nothing is hit. values: of hits, (channels, n); None for passes of
    chords and for those that the image's samples make. weighted: whether ``values`` needs barycentric
    weights. chords: values (n,) of the pass by chords, hit or not.
    """

    channels: int
    miss: float = 0.0
    values: Callable[[PassSource, PassSamples], Array] | None = None
    weighted: bool = False
    chords: Callable[[ChordMap], Array] | None = None

    @property
    def central(self) -> bool:
        """Return whether the pass shows the projector through the pixel's centre."""
        return self.values is not None or self.chords is not None


PASSES = {
    "DEPTH": PassKind(1, FARTHEST_DEPTH, PassSource.depth),
    "POSITION": PassKind(3, values=PassSource.position),
    "NORMAL": PassKind(3, values=PassSource.normal),
    "UV": PassKind(3, values=PassSource.uv, weighted=True),
    "PARAMETERS": PassKind(3, values=PassSource.parameters),
    "PERSPECTIVE_DEPTH": PassKind(1, 1.0, PassSource.perspective_depth),
    "TANGENT": PassKind(3, values=PassSource.tangent),
    "VECTOR": PassKind(4, values=PassSource.vector, weighted=True),
    "CHORD_COUNT": PassKind(1, chords=lambda chords: chords.count),
    "CHORD_ERROR": PassKind(1, chords=lambda chords: chords.error),
    "OBJECT_INDEX": PassKind(1, values=PassSource.object_index),
    "MATERIAL_INDEX": PassKind(1, values=PassSource.material_index),
}
PASSES |= {
    CRYPTO_PASS.format(kind, layer): PassKind(4) for kind in CRYPTO_KINDS for layer in range(MOST_LAYERS)
}
PASSES |= {name: PassKind(3, LIGHT_MISS.get(name, 0.0)) for name in LIGHT_PASSES}


def empty_passes(wanted: DataPasses, height: int, width: int) -> dict[str, Single]:
    """The passes of an image in which nothing is hit, each (height, width, channels)."""
    return {
        name: np.full((height, width, PASSES[name].channels), PASSES[name].miss, np.float32)
        for name in wanted.names
    }


def fill_passes(source: PassSource, samples: PassSamples, where: IndexArray, into: dict[str, Single]) -> None:
    """Write the values of hits at the pixels ``where`` (n,) into a tile's passes (pixels, channels)."""
    for name, pixels in into.items():
        values = PASSES[name].values
        if values is not None:
            pixels[where] = values(source, samples).T


def fill_chord_passes(chords: ChordMap, inside: IndexArray | None, into: dict[str, Single]) -> None:
    """Write the passes of chords; inside: the pixels that the passes hold, None for all."""
    for name, pixels in into.items():
        if shown := PASSES[name].chords:
            values = shown(chords)
            pixels[:, 0] = values if inside is None else values[inside]
