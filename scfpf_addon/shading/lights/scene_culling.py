# SPDX-License-Identifier: GPL-3.0-or-later
"""Scene culling: the part of a scene that a volume can meet is built, the rest only for shadow rays."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...casting.common.geometry import Geometry
from ...casting.common.hits import NothingToCastAt
from ...casting.common.ray_visibility import CAMERA, SHADOW, visible_to
from ...casting.scene.cast_scene import CastScene
from ...casting.scene.culling import within_projection
from ...casting.scene.prisms import require_room_for_prisms
from ...projection.typing import Array
from ...projection.volume.viewing_volume import Projection
from ..scene.shading_scene import Scene


def cull_scene(
    scene: Scene, projection: Projection, alone: bool = True, exact: bool = False
) -> tuple[Scene, CastScene | None]:
    """The part of a scene that a projection can meet, and its cast scene, None if that is empty.

    alone: no other projection will see the scene; otherwise all of it is built. exact: hits will be exact.
    Raises CastError, before anything is built, if memory is too small for exact hits.
    """
    try:
        return _within_reach(scene, projection, alone, exact)
    except NothingToCastAt:
        # No face has an area: animated objects may be scaled to 0 in some frames.
        return scene, None


def _within_reach(
    scene: Scene, projection: Projection, alone: bool, exact: bool
) -> tuple[Scene, CastScene | None]:
    whole = scene.geometry
    if not len(whole.triangles):
        return scene, None
    if not alone:
        return scene, _built(whole, exact)
    kept = within_projection(whole, projection)
    seen = visible_to(whole.visibility, CAMERA)
    if seen is not None:
        kept &= seen
    # Mirrors and glass show the rest of the scene, too. Objects without shadows need masks of all triangles.
    reflects = any(graph.reflects for graph in scene.materials.graphs.values())
    chosen = visible_to(whole.visibility, SHADOW) is not None or any(
        light.blockers is not None for light in scene.lights
    )
    if kept.all() or reflects or chosen:
        return scene, _built(whole, exact)
    if not kept.any():
        return scene, None
    part = replace(scene, geometry=whole.part(kept))

    def beyond() -> tuple[Array, NDArray[np.int32]]:
        """All vertices (V, 3), and the triangles (K, 3) outside the volume, which may shade it."""
        return whole.vertices, whole.triangles.take(np.flatnonzero(~kept), axis=0)

    return part, _built(part.geometry, exact, beyond)


def _built(
    geometry: Geometry, exact: bool, beyond: Callable[[], tuple[Array, NDArray[np.int32]]] | None = None
) -> CastScene:
    if exact:
        require_room_for_prisms(len(geometry.triangles))
    return CastScene(geometry.vertices, geometry.triangles, beyond)
