# SPDX-License-Identifier: GPL-3.0-or-later
"""The triangles of a scene, as the reader hands them over."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, IndexArray


@dataclass(frozen=True)
class Layer:
    """What is painted on triangles: texture coordinates, colours, any attribute.

    row: (T,) int32, which row of ``values`` is a triangle's, -1 for none. values:
    (R, 3, C) float32, a value for each corner; copies of a mesh share them.
    """

    row: NDArray[np.int32]
    values: NDArray[np.float32]


@dataclass(frozen=True)
class Geometry:
    """A triangle soup with shared vertices.

    vertices: (V, 3) float64, world space. triangles: (T, 3) int32.
    corner_normals: (T, 3, 3) float32, unit, world space: the shading normal at
    each corner; where nothing is smooth it may be one that is shown thrice, or None for the triangles' own.
    material, object_index: (T,) int32, or one number that is shown T times. object_names: one name an index.
    uv: (T, 3, 2) float32, texture coordinates of the corners, NaN where a mesh has none;
    None where they were not asked for. layers: by name, those that materials ask for.
    visibility: (T,), see ``visibility``; None where every ray meets everything. linked: (T,) int32, the
    number by which lamps know what a triangle belongs to; None where no lamp asks.
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

    @property
    def flat(self) -> bool:
        """Whether each triangle's corners share one normal in memory, or have its own."""
        return self.corner_normals is None or self.corner_normals.strides[1] == 0

    def part(self, kept: BoolArray) -> Geometry:
        """The triangles ``kept`` (T,) alone, with the vertices that they use."""
        # By number: several times as quick as by the mask.
        which = np.flatnonzero(kept)
        used, triangles = renumbered(self.triangles.take(which, axis=0), len(self.vertices))
        normals = self.corner_normals
        if normals is not None:
            some = normals[:, : 1 if self.flat else 3].take(which, axis=0)
            normals = np.broadcast_to(some, (len(which), 3, 3))
        return Geometry(
            self.vertices.take(used, axis=0),
            triangles,
            normals,
            _of(self.material, which),
            _of(self.object_index, which),
            self.object_names,
            None if self.uv is None else self.uv.take(which, axis=0),
            {name: Layer(layer.row.take(which), layer.values) for name, layer in self.layers.items()},
            None if self.visibility is None else self.visibility.take(which),
            None if self.linked is None else self.linked.take(which),
        )


def renumbered(triangles: NDArray[np.int32], vertices: int) -> tuple[IndexArray, NDArray[np.int32]]:
    """Which of so many vertices triangles (K, 3) use, (U,), and the triangles by these."""
    is_used = np.zeros(vertices, bool)
    is_used[triangles] = True
    used = np.flatnonzero(is_used)
    number = np.empty(vertices, np.int32)
    number[used] = np.arange(len(used), dtype=np.int32)
    return used, number.take(triangles)


def _of(numbers: NDArray[np.int32], which: IndexArray) -> NDArray[np.int32]:
    """The numbers of the triangles ``which``; one that all share need not be written for each."""
    if numbers.strides[0] == 0:
        return np.broadcast_to(numbers[:1], which.shape)
    return numbers.take(which)
