# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a scene is built: the part that a volume can meet, and the rest for shadows."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from ...casting.common.geometry import Geometry
from ...casting.common.hits import NothingToCastAt
from ...casting.common.ray_visibility import CAMERA, SHADOW, visible_to
from ...casting.scene.cast_scene import CastScene
from ...casting.scene.culling import within_volume
from ...casting.scene.prisms import require_room_for_prisms
from ...projection.typing import Array
from ...projection.volume.viewing_volume import Projection
from ..scene.shading_scene import Scene
from .shadow_culling import cull_shadow_casters


def cull_scene(
    scene: Scene, projection: Projection, alone: bool = True, exact: bool = False
) -> tuple[Scene, CastScene | None]:
    """The part of a scene that a projection can meet, built to cast at; the rest is left for shadows.

    None where nothing can be met. alone: no other projection will see it; else all is built.
    exact: it is to be cast at exactly; CastError, before anything is built, where memory does not hold that.
    """
    try:
        return _within_reach(scene, projection, alone, exact)
    except NothingToCastAt:
        # Faces without an area: things may be scaled to nothing in some frames of an animation.
        return scene, None


def _within_reach(
    scene: Scene, projection: Projection, alone: bool, exact: bool
) -> tuple[Scene, CastScene | None]:
    whole = scene.geometry
    if not len(whole.triangles):
        return scene, None
    if not alone:
        return scene, _built(whole, exact)
    kept = within_volume(whole.vertices, whole.triangles, projection.volume)
    seen = visible_to(whole.visibility, CAMERA)
    if seen is not None:
        kept &= seen
    # Mirrors and glass show what lies beyond, too; shadows that some things do not cast ask for parts of all.
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
        """All vertices (V, 3), and the triangles (K, 3) outside the volume that may shade what is in it."""
        rest = cull_shadow_casters(scene, part.geometry, projection.volume)
        rest &= ~kept
        return whole.vertices, whole.triangles.take(np.flatnonzero(rest), axis=0)

    return part, _built(part.geometry, exact, beyond)


def _built(
    geometry: Geometry, exact: bool, beyond: Callable[[], tuple[Array, NDArray[np.int32]]] | None = None
) -> CastScene:
    if exact:
        require_room_for_prisms(len(geometry.triangles))
    return CastScene(geometry.vertices, geometry.triangles, beyond)
