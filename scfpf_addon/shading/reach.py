# SPDX-License-Identifier: GPL-3.0-or-later
"""What of a scene is built: the part that a volume can meet, and the rest for shadows."""

from __future__ import annotations

from dataclasses import replace

from ..casting.culling import within_volume
from ..casting.scene import CastScene, NothingToCastAt
from ..casting.visibility import CAMERA, SHADOW, visible_to
from ..projection.volume import Projection
from .casters import may_shade
from .scene import Scene


def within_reach(scene: Scene, projection: Projection, alone: bool = True) -> tuple[Scene, CastScene | None]:
    """The part of a scene that a projection can meet, built to cast at; the rest is left for shadows.

    None where nothing can be met. alone: no other projection will see it; else all is built.
    """
    try:
        return _within_reach(scene, projection, alone)
    except NothingToCastAt:
        # Faces without an area: things may be scaled to nothing in some frames of an animation.
        return scene, None


def _within_reach(scene: Scene, projection: Projection, alone: bool) -> tuple[Scene, CastScene | None]:
    whole = scene.geometry
    if not len(whole.triangles):
        return scene, None
    if not alone:
        return scene, CastScene(whole.vertices, whole.triangles)
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
        return scene, CastScene(whole.vertices, whole.triangles)
    if not kept.any():
        return scene, None
    rest = ~kept
    rest &= may_shade(scene, kept, projection.volume)
    beyond = (whole.vertices, whole.triangles[rest]) if rest.any() else None
    part = replace(scene, geometry=whole.part(kept))
    return part, CastScene(part.geometry.vertices, part.geometry.triangles, beyond)
