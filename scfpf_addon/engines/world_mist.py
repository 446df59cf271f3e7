# SPDX-License-Identifier: GPL-3.0-or-later
"""The pass Mist of pictures that are joined: the world's mist by the distances of the caster's hits."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..anchors.shown_points import ShownPoints
from ..cycles.aov_passes import TINY
from ..cycles.layers.layer_passes import Mist
from ..projection.typing import Array
from ..projection.volume.viewing_volume import Projection
from ..shading.passes.depths import projector_length
from ..shading.typing import Single


@dataclass(frozen=True)
class WorldMist:
    """A world's mist in a picture. planes: of depth, by the number of the layer, see ``DataPasses``."""

    mist: Mist
    planes: tuple[Array | None, ...]

    def density(self, number: int, projection: Projection, points: ShownPoints) -> Single:
        """The densities (n,) of points on things, 0 to 1, by the distance from an ordinary camera.

        In other volumes it is the length of the projector from the near surface. number: of the layer.
        projection: of that, in world space.
        """
        plane = self.planes[number]
        if plane is not None:
            depth = np.einsum("c,cn->n", plane[:3], points.position) + plane[3]
            length = depth / np.maximum(np.einsum("c,cn->n", plane[:3], points.direction), TINY)
        else:
            projectors = projection.projectors(*points.place).points
            length = projector_length(projection.volume.spans, projectors, points.t)
        share = np.clip((length - self.mist.start) / max(self.mist.range, TINY), 0.0, 1.0)
        density: Single = (share**self.mist.exponent).astype(np.float32)
        return density
