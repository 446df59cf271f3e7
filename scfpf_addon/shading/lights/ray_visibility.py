# SPDX-License-Identifier: GPL-3.0-or-later
"""Ray visibility: the parts of a scene that projectors and shadow rays can meet, holdouts and catchers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...casting.common.geometry import Geometry
from ...casting.common.ray_visibility import CAMERA, CATCHER, HOLDOUT, SHADOW, visible_to
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import BoolArray
from .lamps import Lamp


def camera_scene(geometry: Geometry, cast_scene: CastScene) -> CastScene | None:
    """The part of a scene that projectors can meet; None if it is empty."""
    return cast_scene.only(visible_to(geometry.visibility, CAMERA))


def holdouts(geometry: Geometry) -> BoolArray | None:
    """Return whether each triangle leaves a hole in the image, (T,); None without holdouts."""
    if geometry.visibility is None:
        return None
    held: BoolArray = (geometry.visibility & HOLDOUT) != 0
    return held if held.any() else None


def has_catchers(geometry: Geometry) -> bool:
    """Return whether any object is a shadow catcher."""
    return geometry.visibility is not None and bool((geometry.visibility & CATCHER).any())


def without_catchers(geometry: Geometry) -> Geometry:
    """The geometry with its shadow catchers as ordinary objects."""
    if geometry.visibility is None or not has_catchers(geometry):
        return geometry
    return replace(geometry, visibility=geometry.visibility & np.uint8(0xFF ^ CATCHER))


def shadow_scene(geometry: Geometry, cast_scene: CastScene) -> CastScene | None:
    """The part of a scene that casts shadows; None if it is empty."""
    return cast_scene.only(visible_to(geometry.visibility, SHADOW))


def with_occluders(
    lamp: Lamp, geometry: Geometry, cast_scene: CastScene, some: BoolArray | None = None
) -> Lamp:
    """The lamp with the part of the scene that casts its shadows; some: (T,), of these triangles alone."""
    if not lamp.light.casts_shadow:
        return lamp
    kept, blockers = visible_to(geometry.visibility, SHADOW), lamp.light.blockers
    if blockers is not None and geometry.linked is not None:
        linked: BoolArray = blockers.take(geometry.linked)
        kept = linked if kept is None else kept & linked
    if some is not None:
        kept = some if kept is None else kept & some
    part = cast_scene.only(kept)
    if part is None:
        return replace(lamp, light=replace(lamp.light, casts_shadow=False))
    return lamp if part is cast_scene else replace(lamp, occluders=part)
