# SPDX-License-Identifier: GPL-3.0-or-later
"""The scene of Live View: triangles built for casting, and the tables by which hits get normals and looks."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...casting.common.geometry import Geometry, Layer
from ...casting.common.hits import NothingToCastAt
from ...casting.scene.cast_scene import CastScene
from ...casting.scene.cast_space import CastSpace
from ...projection.typing import Array, BoolArray
from ..typing import Single

# The layer of ``Geometry.layers`` that holds the meshes' active colour attributes.
COLOR_LAYER = "COLOR:"

# Cells of the grid of a moving part's empty space: a fine one takes longer than the images that it is for.
MOVING_CELLS = 1 << 12


class LiveTables(NamedTuple):
    """The attributes of T triangles besides their positions.

    normals: (T, 3, 3) float32, unit, of the corners, or None if all triangles are flat. look, object: (T,)
    int32, see ``LiveHits``. uv: (T, 3, 2) float32, 0 where a mesh has none, or None if no look asks for it.
    color: (T, 3, 3) float32, linear, 1 where a mesh has none, or None.
    """

    normals: Single | None
    look: NDArray[np.int32]
    object: NDArray[np.int32]
    uv: Single | None = None
    color: Single | None = None

    @classmethod
    def of(cls, geometry: Geometry) -> LiveTables:
        """The tables of a geometry, whose materials are numbers of looks."""
        uv = None if geometry.uv is None else np.nan_to_num(geometry.uv, posinf=0.0, neginf=0.0)
        layer = geometry.layers.get(COLOR_LAYER)
        color = None if layer is None else _layer_colors(layer)
        return cls(geometry.corner_normals, geometry.material, geometry.object_index, uv, color)

    def joined(self, others: LiveTables, planes: Array) -> LiveTables:
        """Join tables, with others after these. planes: of all triangles, whose normals flat ones get."""
        counts = len(self.look), len(others.look)
        normals = None
        if self.normals is not None or others.normals is not None:
            flat = planes[:3].T.astype(np.float32)[:, None].repeat(3, axis=1)
            normals = np.concatenate(
                [
                    flat[:count] if part is None else part
                    for part, flat, count in (
                        (self.normals, flat, counts[0]),
                        (others.normals, flat[counts[0] :], counts[1]),
                    )
                ]
            )
        return LiveTables(
            normals,
            np.concatenate([self.look, others.look]),
            np.concatenate([self.object, others.object]),
            _both(self.uv, others.uv, counts, 2, 0.0),
            _both(self.color, others.color, counts, 3, 1.0),
        )


def _layer_colors(layer: Layer) -> Single:
    """The colours of corners (T, 3, 3), white for triangles without the layer."""
    colors = layer.values[:, :, :3].take(layer.row.clip(0), axis=0)
    colors[layer.row < 0] = 1.0
    return colors


def _both(
    one: Single | None, other: Single | None, counts: tuple[int, int], channels: int, absent: float
) -> Single | None:
    """Two attributes of corners, one after the other; ``absent`` where one is missing, None if both are."""
    if one is None and other is None:
        return None
    parts = (
        np.full((count, 3, channels), absent, np.float32) if part is None else part
        for part, count in zip((one, other), counts, strict=True)
    )
    return np.concatenate(list(parts))


@dataclass(frozen=True)
class LiveScene:
    """A scene that projectors are cast at. cast_scene: None if it has no triangle that can be hit."""

    cast_scene: CastScene | None
    tables: LiveTables | None

    @classmethod
    def built(cls, geometry: Geometry, space: CastSpace | None = None) -> LiveScene:
        """Build a geometry, as a moving part if it has the cast space of another scene. Raises CastError."""
        cells = None if space is None else MOVING_CELLS
        try:
            cast_scene = CastScene(geometry.vertices, geometry.triangles, space=space, cells=cells)
        except NothingToCastAt:
            return cls(None, None)
        return cls(cast_scene, LiveTables.of(geometry))


class StillScene:
    """The part of a built scene that stands still. The rest of the scene moves, and is built on its own."""

    def __init__(self, whole: LiveScene, kept: BoolArray) -> None:
        self._tables, self._part = whole.tables, None
        if whole.cast_scene is not None and (whole.cast_scene.usable & kept).any():
            self._part = whole.cast_scene.keeping(kept)

    def with_moving(self, geometry: Geometry | None) -> LiveScene:
        """The scene with another geometry, None for none. Raises CastError."""
        part, tables = self._part, self._tables
        if part is None or tables is None:
            return LiveScene(None, None) if geometry is None else LiveScene.built(geometry)
        moving = LiveScene(None, None) if geometry is None else LiveScene.built(geometry, part.space)
        if moving.cast_scene is None or moving.tables is None:
            return LiveScene(CastScene.joined([part]), tables)
        both = CastScene.joined([part, moving.cast_scene])
        return LiveScene(both, tables.joined(moving.tables, both.planes))
