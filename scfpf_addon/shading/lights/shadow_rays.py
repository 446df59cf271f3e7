# SPDX-License-Identifier: GPL-3.0-or-later
"""Straight shadow rays."""

from __future__ import annotations

import numpy as np

from ...casting.scene.cast_scene import CastScene
from ...projection.typing import IndexArray
from ..scene.surface import SurfacePoints
from ..typing import Single
from ..vectors import dot
from .beams import Incidence

# Cosine of the light to a triangle below which shadow rays begin to start from the rounded
# surface. Facets of a convex solid shade each other at 0; the margin makes the change gradual.
GRAZING = np.float32(0.1)
# The share of lit points beyond which rays start at all of them: picking the lit ones takes longer.
MOSTLY = 0.6


def cut_shadows(received: Single, points: SurfacePoints, light: Incidence, cast_scene: CastScene) -> None:
    """Set the light that points in shadow receive to 0, in place: one straight ray from each lit point.

    Where light grazes a triangle or falls on its back, but on the front of the surface
    that smooth shading pretends, the ray starts on the latter: from the triangle it would
    meet the neighbouring facets, and their edges would show as steps.
    """
    lit = np.flatnonzero(received)
    if points.shadow is None or not len(lit):
        return
    some: IndexArray | None = lit if len(lit) < MOSTLY * len(received) else None
    directions, distances = _taken(light.direction, some), _taken(light.distance, some)
    origins = _taken(points.shadow.origin, some)
    if points.shadow.height is not None:
        grazing = 1 - dot(_taken(points.shadow.flat, some), directions) / GRAZING
        height = _taken(points.shadow.height, some) * np.clip(grazing, 0, 1)
        origins = origins + _taken(points.normal, some) * height
    if some is None:
        # Rays without length cost nearly nothing.
        distances = np.where(received != 0, distances, np.float32(0))
    hidden = cast_scene.occluded(origins, directions, distances)
    if some is None:
        received[hidden] = 0
    else:
        received[some[hidden]] = 0


def _taken(values: Single, some: IndexArray | None) -> Single:
    """The columns ``some`` of values, all for None; the one column of values that all rays share."""
    return values if some is None or values.shape[-1] == 1 else values.take(some, axis=-1)
