# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles over an image, cut along the sharp borders of maps, with own vertices on either side."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..typing import Array, BoolArray, IndexArray
from .blend_map import BlendMap
from .volume_edits import lattice

# A vertex this near to a border, as a share of the image's width, lies on it: roundings of float64.
ON_BORDER = 1e-10
# Steps of bisection for the place where an edge crosses a border: beyond float64's last digit.
BISECTIONS = 54
# Vertices are evaluated this far inside their part: five times the tolerance of look-ups in UV.
INSIDE = 2e-6
# Points of a triangle, as shares of its corners, at which the error of a mesh is measured.
PROBES: Array = np.array([[1 / 3, 1 / 3, 1 / 3], [0.6, 0.2, 0.2], [0.2, 0.6, 0.2], [0.2, 0.2, 0.6]])


@dataclass(frozen=True)
class SeamMesh:
    """Triangles over the image whose parts on either side of a border share no vertices.

    places: (V, 2) image positions. inner: (V, 2) the same, a little inside of the vertex's part. triangles:
    (T, 3). sides: (F, V) whether each vertex's part is within each map.
    """

    places: Array
    inner: Array
    triangles: IndexArray
    sides: BoolArray

    @property
    def probes(self) -> Array:
        """Image positions (P, T, 2) within the triangles, at PROBES."""
        probes: Array = np.einsum("pc,tcd->ptd", PROBES, self.inner[self.triangles])
        return probes


def seam_mesh(maps: Sequence[BlendMap], aspect: float, faces: int) -> SeamMesh:
    """Cut a lattice of ``faces`` squares along each axis at the borders of maps.

    aspect: width over height of the image. Straight borders are exact, others are polygons that have a
    corner on each line of the lattice: what is finer than it may be lost.
    """
    places = np.stack(lattice(faces + 1, faces + 1), axis=1)
    number = np.arange(len(places)).reshape(faces + 1, faces + 1)
    a, b, c, d = (
        part.ravel() for part in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1])
    )
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)])
    within: list[BoolArray] = []
    for blend_map in maps:
        inside = np.ones(len(triangles), bool)
        for k in range(len(blend_map.levels(places[:1, 0], places[:1, 1], aspect))):
            places, triangles, parent, is_above = _cut(places, triangles, blend_map, k, aspect)
            within, inside = [each[parent] for each in within], inside[parent] & is_above
        within.append(inside)
    return _parted(places, triangles, np.reshape(within, (len(maps), len(triangles))))


def _cut(
    places: Array, triangles: IndexArray, blend_map: BlendMap, k: int, aspect: float
) -> tuple[Array, IndexArray, IndexArray, BoolArray]:
    """Cut triangles where level ``k`` of a map is 0.

    Returns places and triangles, and of each triangle which one it is a part of, and whether the level is
    positive in it.
    """

    def level(at: Array) -> Array:
        """Level ``k`` of the map at places (N, 2)."""
        value: Array = blend_map.levels(at[:, 0], at[:, 1], aspect)[k]
        return value

    value = level(places)
    side = np.where(np.abs(value) <= ON_BORDER, 0, np.sign(value)).astype(np.int64)
    corner = side[triangles]
    crossed = (corner.max(axis=1) > 0) & (corner.min(axis=1) < 0)
    kept, corner = triangles[~crossed], corner[crossed]
    # The first corner is the one on the border, or the one that is alone on its side.
    touches = (corner == 0).any(axis=1)
    alone = corner == -np.sign(corner.sum(axis=1))[:, None]
    lead = np.where(touches, (corner == 0).argmax(axis=1), alone.argmax(axis=1))
    turned = np.take_along_axis(triangles[crossed], (lead[:, None] + np.arange(3)) % 3, axis=1)
    (a, b, c), (d, e, f) = turned[touches].T, turned[~touches].T
    edges = np.concatenate([np.stack(pair, axis=1) for pair in ((b, c), (d, e), (d, f))])
    edges, where = np.unique(np.sort(edges, axis=1), axis=0, return_inverse=True)
    low, high = places[edges[:, 0]], places[edges[:, 1]]
    is_low_inside = value[edges[:, 0]] > 0
    for _ in range(BISECTIONS):
        middle = 0.5 * (low + high)
        same = ((level(middle) > 0) == is_low_inside)[:, None]
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    made = where.reshape(-1) + len(places)
    m, p, q = np.split(made, [len(a), len(a) + len(d)])
    pieces = ((a, b, m), (a, m, c), (d, p, q), (p, e, f), (p, f, q))
    cut = [np.stack(piece, axis=1) for piece in pieces]
    # A corner that was there before tells the side of a piece; a triangle on the border its middle.
    kept_side = side[kept].sum(axis=1)
    flat = kept_side == 0
    kept_side[flat] = np.sign(level(places[kept[flat]].mean(axis=1)))
    is_above = np.concatenate([kept_side, *(side[corner] for corner in (b, c, d, e, f))]) > 0
    one, other = (np.flatnonzero(crossed)[which] for which in (touches, ~touches))
    parent = np.concatenate([np.flatnonzero(~crossed), one, one, other, other, other])
    return np.concatenate([places, 0.5 * (low + high)]), np.concatenate([kept, *cut]), parent, is_above


def _parted(places: Array, triangles: IndexArray, sides: BoolArray) -> SeamMesh:
    """Give each part of the image, the triangles within the same maps, vertices of its own.

    sides: (F, T), whether each triangle is within each map.
    """
    centres = places[triangles].mean(axis=1)
    _, part = np.unique(sides, axis=1, return_inverse=True)
    pairs = np.stack([triangles.ravel(), np.repeat(part.reshape(-1), 3)], axis=1)
    # Each vertex looks towards the middle of the largest triangle about it.
    across, up = np.moveaxis(places[triangles] - places[triangles[:, :1]], 1, 0)[1:]
    largest = np.argsort(-np.abs(across[:, 0] * up[:, 1] - across[:, 1] * up[:, 0]), kind="stable")
    pairs = pairs.reshape(-1, 3, 2)[largest].reshape(-1, 2)
    owned, first, corners = np.unique(pairs, axis=0, return_index=True, return_inverse=True)
    corners, first = corners.reshape(-1, 3), largest[first // 3]
    own = places[owned[:, 0]]
    away = centres[first] - own
    length = np.linalg.norm(away, axis=1, keepdims=True)
    inner = own + away * np.minimum(0.5, INSIDE / np.maximum(length, INSIDE))
    return SeamMesh(own, inner, corners, sides[:, first])
