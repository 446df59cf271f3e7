# SPDX-License-Identifier: GPL-3.0-or-later
"""Straight shadow rays."""

from __future__ import annotations

import numpy as np

from ...casting.scene.cast_scene import CastScene
from ..scene.surface import SurfacePoints
from ..typing import Single
from ..vectors import dot
from .beams import Incidence

# Cosine of the light to a triangle below which shadow rays begin to start from the rounded
# surface. Facets of a convex solid shade each other at 0; the margin makes the change gradual.
GRAZING = np.float32(0.1)


def cut_shadows(received: Single, points: SurfacePoints, light: Incidence, cast_scene: CastScene) -> None:
    """Set the light that points in shadow receive to 0, in place: one straight ray from each lit point.

    Where light grazes a triangle or falls on its back, but on the front of the surface
    that smooth shading pretends, the ray starts on the latter: from the triangle it would
    meet the neighbouring facets, and their edges would show as steps.
    """
    lit = np.flatnonzero(received)
    if points.shadow is None or not len(lit):
        return
    directions, distances = light.direction, light.distance
    if directions.shape[1] > 1:
        directions = directions.take(lit, axis=1)
    if len(distances) > 1:
        distances = distances.take(lit)
    origins = points.shadow.origin.take(lit, axis=1)
    if points.shadow.height is not None:
        grazing = 1 - dot(points.shadow.flat.take(lit, axis=1), directions) / GRAZING
        height = points.shadow.height.take(lit) * np.clip(grazing, 0, 1)
        origins += points.normal.take(lit, axis=1) * height
    hidden = cast_scene.occluded(origins, directions, distances)
    received[lit[hidden]] = 0
