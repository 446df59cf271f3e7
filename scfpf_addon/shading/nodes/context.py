# SPDX-License-Identifier: GPL-3.0-or-later
"""The inputs of material graphs at hits: everything about the surface that a node can read."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...casting.common.geometry import Geometry
from ...projection.typing import Array, IndexArray
from ..vectors import dot_row, unit
from .image import ImageData


@dataclass(frozen=True)
class ShadingContext:
    """The surface at n hits.

    triangle: (n,). barycentric: (2, n), weights of the second and third corner. position: (3, n) world space.
    normal: (3, n) unit, shading normal, on the side of the viewer. flat: (3, n) unit, of the triangle, on
    that side too. view: (3, n) unit, towards the viewer. back: (1, n) 1 if the back of the triangle is
    visible, else 0. All float64. images: by name, without missing ones. blur: angle between neighbouring
    directions of a map, in radians. variant: (n,) the graphs' numbers in their ``GraphKind``; None for one
    graph. rays: those that meet the hits, see ``light_path``; None for projectors that were not scattered.
    """

    geometry: Geometry
    images: Mapping[str, ImageData]
    triangle: IndexArray
    barycentric: Array
    position: Array
    normal: Array
    flat: Array
    view: Array
    back: Array
    blur: float = 0.0
    variant: IndexArray | None = None
    rays: Array | None = None

    @property
    def count(self) -> int:
        """The number of hits."""
        return len(self.triangle)

    def layer(self, name: str, channels: int) -> tuple[Array, Array]:
        """The values of a layer at the hits, (channels, n), and 1 or 0 whether the mesh has it, (1, n).

        Interpolated in float64 by the weights of the hit; 0 on meshes without the layer.
        """
        found = self.geometry.layers.get(name)
        if found is None:
            return np.zeros((channels, 1)), np.zeros((1, 1))
        row = found.row.take(self.triangle)
        there = row >= 0
        # Meshes without the layer read any row, and are set to 0 below.
        corners = found.values.take(row, axis=0, mode="clip").astype(np.float64)
        first, second, third = corners.transpose(1, 2, 0)
        value = first + (second - first) * self.barycentric[0] + (third - first) * self.barycentric[1]
        if not there.all():
            value = np.where(there, value, 0.0)
        return fit(value, channels), there[None].astype(np.float64)

    def corners(self) -> tuple[Array, Array, Array]:
        """The triangles' corners in world space, (3, n) each."""
        vertex = self.geometry.triangles.take(self.triangle, axis=0)
        first, second, third = (self.geometry.vertices.take(vertex[:, k], axis=0).T for k in range(3))
        return first, second, third

    def edge(self) -> Array:
        """Length of the longer of the triangles' edges at their first corner, (1, n)."""
        first, second, third = self.corners()
        along, across = second - first, third - first
        length: Array = np.sqrt(np.maximum(dot_row(along, along), dot_row(across, across)))
        return length

    def beside(self, step: Array) -> ShadingContext:
        """The hits moved by ``step`` (3, n) in the triangles' planes, with the same normals."""
        first, second, third = self.corners()
        along, across = second - first, third - first
        aa, ab, bb = dot_row(along, along), dot_row(along, across), dot_row(across, across)
        sa, sb = dot_row(step, along), dot_row(step, across)
        area = aa * bb - ab * ab
        inverse = np.divide(1.0, area, out=np.zeros_like(area), where=area > 0.0)
        moved = np.concatenate([bb * sa - ab * sb, aa * sb - ab * sa]) * inverse
        return replace(self, position=self.position + step, barycentric=self.barycentric + moved)

    def tangent(self, name: str) -> tuple[Array, Array]:
        """Direction (3, n) in which u grows, and the side (1, n), ±1, on which v does.

        name: of a layer of four channels: shares of the triangle's two edges from its first corner and of its
        normal, as long as the root of their product, and the side. Both are 0 on meshes without the layer.
        """
        if name not in self.geometry.layers:
            return np.zeros((3, 1)), np.zeros((1, 1))
        found = self.geometry.layers[name]
        row = found.row.take(self.triangle)
        there = (row >= 0)[None].astype(np.float64)
        corners = found.values.take(row, axis=0, mode="clip").astype(np.float64)
        first, second, third = self.corners()
        along, across = second - first, third - first
        up = np.cross(along, across, axis=0)
        # As long as the root of its length, to grow as edges do.
        up = up / np.maximum(np.power(dot_row(up, up), 0.25), np.finfo(np.float64).tiny)
        weight = (1.0 - self.barycentric.sum(axis=0), *self.barycentric)
        tangent = np.zeros((3, self.count))
        for shares, part in zip(corners.transpose(1, 2, 0), weight, strict=True):
            tangent += unit(along * shares[0] + across * shares[1] + up * shares[2]) * part
        # Not normalised again, as in Cycles.
        return tangent * there, np.where(corners[:, 0, 3] < 0.0, -1.0, 1.0) * there


def fit(values: Array, channels: int) -> Array:
    """The values with a given number of channels: cut, filled with 0, or a single one repeated."""
    have = len(values)
    if have == channels:
        return values
    if have == 1:
        return np.repeat(values, channels, axis=0)
    if have > channels:
        return values[:channels]
    return np.concatenate([values, np.zeros((channels - have, values.shape[1]))])
