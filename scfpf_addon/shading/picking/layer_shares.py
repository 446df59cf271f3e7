# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of an image in which each of its layers is seen."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...casting.common.hits import CastCounts
from ...casting.frame import pixel_centres
from ...projection.typing import Array
from ...projection.volume.viewing_volume import Projection
from ..scene.shading_scene import Scene
from .pick import layered_cast, visible_scene

# Pixels across the image that is counted.
COLUMNS = 192


class LayerShares(NamedTuple):
    """Shares of the image by layer, (L + 1,) each, that of no layer first.

    seen: where the layer is in front. alone: where its things would be seen without all others.
    """

    seen: Array
    alone: Array


def layer_shares(projection: Projection, scene: Scene) -> LayerShares:
    """Count the layers of an image. projection: in the scene's space. Raises CastError."""
    rows = max(round(COLUMNS / projection.aspect), 1)
    count = len(projection.of_layers)
    seen, alone = np.zeros(count), np.zeros(count)
    cast_scene = visible_scene(scene)
    pixel = 1 / COLUMNS, 1 / rows
    layered = cast_scene and layered_cast(cast_scene, projection, scene.geometry.image_layer, pixel)
    if layered:
        x, y = pixel_centres(COLUMNS, rows, (0, rows))
        hits, layer = layered.first_hits(x, y, CastCounts(), COLUMNS)
        seen += np.bincount(layer[hits.triangle >= 0], minlength=count) / len(x)
        for number in range(1, count):
            which = np.flatnonzero(layered.may_meet(number, x, y))
            own = layered.hits_of(number, which, x, y, CastCounts())
            alone[number] = np.count_nonzero(own.triangle >= 0) / len(x)
    return LayerShares(seen, alone)
