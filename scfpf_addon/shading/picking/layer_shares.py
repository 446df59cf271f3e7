# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of an image in which each of its layers is seen, as numbers and as an image."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...casting.common.hits import CastCounts, Hits
from ...casting.frame import pixel_centres
from ...projection.diagrams.line_colors import EMPTY, REST
from ...projection.typing import Array, IndexArray
from ...projection.volume.viewing_volume import Projection
from ..scene.shading_scene import Scene
from ..typing import Single
from .pick import layered_cast, visible_scene

# Pixels across the image that is counted.
COLUMNS = 320
# The brightness of a face that is seen from its side, in the image of shares.
DIM = 0.6


class LayerShares(NamedTuple):
    """Shares of the image by layer, (L + 1,) each. The first entry is for what is in no layer.

    seen: the share where the layer is in front. alone: the share that its things would have if nothing else
    were there. numbers:
    (H, W) the layer that each pixel shows, row 0 at the bottom; -1 if it shows nothing. facing: (H, W) the
    cosine of the angle between its projector and the face's normal.
    """

    seen: Array
    alone: Array
    numbers: IndexArray
    facing: Array

    def picture(self, colors: Sequence[tuple[float, float, float]]) -> Single:
        """The image (H, W, 4) of the layers in display colours. colors: of layers, from 1 on."""
        table = np.array([REST, *colors, EMPTY])
        light = np.where(self.numbers < 0, 1.0, DIM + (1.0 - DIM) * self.facing)
        pixels = np.ones((*self.numbers.shape, 4), np.float32)
        pixels[..., :3] = table[self.numbers] * light[..., None]
        return pixels


def layer_shares(projection: Projection, scene: Scene) -> LayerShares:
    """Count the layers of an image. projection: in the scene's space. Raises CastError."""
    rows = max(round(COLUMNS / projection.aspect), 1)
    count = len(projection.of_layers)
    seen, alone = np.zeros(count), np.zeros(count)
    numbers, facing = np.full(rows * COLUMNS, -1), np.zeros(rows * COLUMNS)
    cast_scene = visible_scene(scene)
    pixel = 1 / COLUMNS, 1 / rows
    layered = cast_scene and layered_cast(cast_scene, projection, scene.geometry.image_layer, pixel)
    if cast_scene is not None and layered:
        x, y = pixel_centres(COLUMNS, rows, (0, rows))
        hits, layer = layered.first_hits(x, y, CastCounts(), COLUMNS)
        met = hits.triangle >= 0
        seen += np.bincount(layer[met], minlength=count) / len(x)
        numbers = np.where(met, layer.astype(np.int64), -1)
        facing = _facing(scene, hits, np.linalg.inv(cast_scene.matrix[:3, :3]))
        for number in range(1, count):
            which = np.flatnonzero(layered.may_meet(number, x, y))
            own = layered.hits_of(number, which, x, y, CastCounts())
            alone[number] = np.count_nonzero(own.triangle >= 0) / len(x)
    return LayerShares(seen, alone, numbers.reshape(rows, -1), facing.reshape(rows, -1))


def _facing(scene: Scene, hits: Hits, outward: Array) -> Array:
    """The cosines (N,) between projectors and normals at their hits; 0 for misses.

    outward: (3, 3) from cast space to the scene's.
    """
    geometry, met = scene.geometry, np.flatnonzero(hits.triangle >= 0)
    a, b, c = np.moveaxis(geometry.vertices[geometry.triangles[hits.triangle[met]]].astype(np.float64), 1, 0)
    normal, along = np.cross(b - a, c - a), (outward @ hits.tangent[:, met]).T
    length = np.linalg.norm(normal, axis=1) * np.linalg.norm(along, axis=1)
    facing = np.zeros(len(hits.triangle))
    facing[met] = np.abs(np.einsum("nd,nd->n", normal, along)) / np.maximum(length, np.finfo(float).tiny)
    return facing
