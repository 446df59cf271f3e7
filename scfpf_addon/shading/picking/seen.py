# SPDX-License-Identifier: GPL-3.0-or-later
"""The first of many objects on one projector: only those whose boxes it meets have to be read."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...casting.common.hits import NothingToCastAt
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import Array, BoolArray
from ...projection.volume.viewing_volume import Projection
from .pick import first_hit, projector_at

# A projector is tested as so many boxes, each around so many of its straight pieces.
STRETCHES, PIECES = 64, 8


def may_be_met(projection: Projection, x: float, y: float, low: Array, high: Array) -> BoolArray:
    """Return whether the projector at (x, y) may meet boxes with corners low and high, (N, 3); (N,).

    projection: in the boxes' space. All False where there is no projector.
    """
    met: BoolArray = np.zeros(len(low), bool)
    curve_at = projector_at(projection, x, y)
    if curve_at is None:
        return met
    curve = curve_at(np.linspace(0.0, 1.0, STRETCHES * PIECES + 1))
    # The curve strays from its pieces by less than the second differences, an eighth of them if smooth.
    bend = np.zeros_like(curve)
    bend[1:-1] = np.abs(np.diff(curve, 2, axis=0))
    for start in range(0, STRETCHES * PIECES, PIECES):
        own = slice(start, start + PIECES + 1)
        slack = bend[max(start - 1, 0) : start + PIECES + 2].max(axis=0)
        least, most = curve[own].min(axis=0) - slack, curve[own].max(axis=0) + slack
        met |= ((low <= most) & (high >= least)).all(axis=1)
    return met


def may_be_met_in_layers(
    projection: Projection, x: float, y: float, low: Array, high: Array, layers: NDArray[np.uint8] | None
) -> BoolArray:
    """``may_be_met`` by the projector that shows each thing. layers: (N,) their numbers, None for 0."""
    if layers is None:
        return may_be_met(projection, x, y, low, high)
    met = np.zeros(len(low), bool)
    for number, each in enumerate(projection.of_layers):
        own = np.flatnonzero(layers == number)
        met[own] = may_be_met(each, x, y, low[own], high[own])
    return met


def first_seen(
    projection: Projection,
    meshes: Sequence[tuple[Array, NDArray[np.int32]]],
    x: float,
    y: float,
    pixel_size: tuple[float, float],
    layers: NDArray[np.uint8] | None = None,
) -> int:
    """The index of the mesh that the projector at (x, y) meets first, -1 for none.

    projection: in the meshes' space. meshes: vertices (V, 3) and triangles (T, 3) of each. pixel_size: a
    pixel's width and height as shares of the image. layers: (M,) number of the image layer of each mesh,
    None for 0. Raises CastError.
    """
    corners = [vertices[triangles] for vertices, triangles in meshes]
    corner = np.concatenate(corners) if corners else np.empty((0, 3, 3))
    # Of a large mesh few triangles are near the projector, and no others are worth building.
    ends = np.cumsum([len(own) for own in corners])
    number = None if layers is None else np.repeat(layers, [len(own) for own in corners])
    near = np.flatnonzero(
        may_be_met_in_layers(projection, x, y, corner.min(axis=1), corner.max(axis=1), number)
    )
    try:
        scene = CastScene(
            corner[near].reshape(-1, 3), np.arange(3 * len(near), dtype=np.int32).reshape(-1, 3)
        )
    except NothingToCastAt:
        return -1
    met, _t, _layer = first_hit(scene, projection, x, y, pixel_size, None if number is None else number[near])
    return int(np.searchsorted(ends, near[met], side="right")) if met >= 0 else -1
