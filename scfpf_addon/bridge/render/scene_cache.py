# SPDX-License-Identifier: GPL-3.0-or-later
"""What is built of a scene's triangles, kept from one picture to the next."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...casting.common.geometry import Geometry
from ...casting.scene.cast_scene import CastScene, NothingToCastAt


@dataclass(frozen=True)
class SceneCache:
    """What is built of a geometry, kept for as long as that stays the same."""

    geometry: Geometry
    cast_scene: CastScene | None

    @classmethod
    def of(cls, geometry: Geometry, kept: SceneCache | None) -> SceneCache:
        """Of ``kept`` where its triangles are the same, built anew otherwise. Raises CastError."""
        if kept is not None and same_triangles(geometry, kept.geometry):
            return kept
        try:
            return cls(geometry, CastScene(geometry.vertices, geometry.triangles))
        except NothingToCastAt:
            return cls(geometry, None)


def same_triangles(a: Geometry, b: Geometry) -> bool:
    """Whether two geometries have the same triangles in the same places."""
    return np.array_equal(a.triangles, b.triangles) and np.array_equal(a.vertices, b.vertices)
