# SPDX-License-Identifier: GPL-3.0-or-later
"""How far along the projectors of a flexible camera the things are that its image shows."""

from __future__ import annotations

import numpy as np

from ...casting.cast import cast
from ..camera.read_projection import read_projection
from ..render.image_size import image_aspect
from .live_view import source_of

# Positions along each side of the image, and the error of hits in steps between them.
POSITIONS, STEP_ERROR = 33, 0.1


def median_depth(camera, depsgraph) -> float | None:
    """The median t at which projectors meet what the image shows, in [0, 1]; None if they meet nothing.

    A Live View of the scene has what is needed; else it is built. Raises USER_ERRORS.
    """
    source = source_of(depsgraph)
    scene = source.kept.updated(source.objects.read(depsgraph)).cast_scene
    if scene is None:
        return None
    projection = read_projection(camera, depsgraph, image_aspect(depsgraph.scene))
    middles = (np.arange(POSITIONS) + 0.5) / POSITIONS
    x, y = (axis.ravel() for axis in np.meshgrid(middles, middles))
    step = 1.0 / POSITIONS, 1.0 / POSITIONS
    hits = cast(scene, projection.transformed(scene.matrix), x, y, step, STEP_ERROR)
    met = hits.t[hits.triangle >= 0]
    return float(np.median(met)) if len(met) else None
