# SPDX-License-Identifier: GPL-3.0-or-later
"""The triangles of a scene, in world space, with the attributes that shading reads."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, IndexArray


@dataclass(frozen=True)
class Layer:
    """A mesh attribute of the triangles' corners: texture coordinates, colours or any other.

    row: (T,) int32, each triangle's row of ``values``, -1 if it has none. values: (R, 3, C) float32,
    a value for each corner; copies of a mesh share them.
    """

    row: NDArray[np.int32]
    values: NDArray[np.float32]


@dataclass(frozen=True)
class Geometry:
    """A triangle soup with shared vertices.

    vertices: (V, 3) float64, world space. triangles: (T, 3) int32.
    corner_normals: (T, 3, 3) float32, unit, world space: the shading normal at each corner. Flat
    triangles may share one normal in memory (stride 0); None for the geometric normals.
    material, object_index: (T,) int32, or one number broadcast to T. object_names: by index.
    uv: (T, 3, 2) float32, texture coordinates of the corners, NaN where a mesh has none;
    None if they were not requested. layers: by name, those that materials request.
    visibility: (T,), see ``ray_visibility``; None if every ray meets every triangle.
    linked: (T,) int32, the group of light linking of each triangle; None if no lamp is linked.
    image_layer: (T,) uint8, the number of the image layer that shows each triangle (``Projection.layers``), 0
    for the projection itself; None if it shows all.
    one_sided: (T,) bool, the triangles that projectors meet from the front only; None if there are none.
    """

    vertices: Array
    triangles: NDArray[np.int32]
    corner_normals: NDArray[np.float32] | None
    material: NDArray[np.int32]
    object_index: NDArray[np.int32]
    object_names: tuple[str, ...] = ()
    uv: NDArray[np.float32] | None = None
    layers: Mapping[str, Layer] = field(default_factory=dict)
    visibility: NDArray[np.uint8] | None = None
    linked: NDArray[np.int32] | None = None
    image_layer: NDArray[np.uint8] | None = None
    one_sided: BoolArray | None = None

    @property
    def flat(self) -> bool:
        """Return whether each triangle's corners share one normal in memory, or have its own."""
        return self.corner_normals is None or self.corner_normals.strides[1] == 0

    def part(self, kept: BoolArray) -> Geometry:
        """Return only the triangles ``kept`` (T,), with the vertices that they use."""
        # Indexing by numbers is several times as fast as by the mask.
        which = np.flatnonzero(kept)
        used, triangles = renumbered(self.triangles.take(which, axis=0), len(self.vertices))
        normals = self.corner_normals
        if normals is not None:
            some = normals[:, : 1 if self.flat else 3].take(which, axis=0)
            normals = np.broadcast_to(some, (len(which), 3, 3))
        return replace(
            self,
            vertices=self.vertices.take(used, axis=0),
            triangles=triangles,
            corner_normals=normals,
            material=_of(self.material, which),
            object_index=_of(self.object_index, which),
            uv=None if self.uv is None else self.uv.take(which, axis=0),
            layers={name: Layer(layer.row.take(which), layer.values) for name, layer in self.layers.items()},
            visibility=None if self.visibility is None else self.visibility.take(which),
            linked=None if self.linked is None else self.linked.take(which),
            image_layer=None if self.image_layer is None else self.image_layer.take(which),
            one_sided=None if self.one_sided is None else self.one_sided.take(which),
        )


def renumbered(triangles: NDArray[np.int32], vertices: int) -> tuple[IndexArray, NDArray[np.int32]]:
    """Return which of so many vertices triangles (K, 3) use, (U,), and the triangles in these numbers."""
    is_used = np.zeros(vertices, bool)
    is_used[triangles] = True
    used = np.flatnonzero(is_used)
    number = np.empty(vertices, np.int32)
    number[used] = np.arange(len(used), dtype=np.int32)
    return used, number.take(triangles)


def _of(numbers: NDArray[np.int32], which: IndexArray) -> NDArray[np.int32]:
    """The numbers of the triangles ``which``; a number broadcast to all stays broadcast."""
    if numbers.strides[0] == 0:
        return np.broadcast_to(numbers[:1], which.shape)
    return numbers.take(which)
