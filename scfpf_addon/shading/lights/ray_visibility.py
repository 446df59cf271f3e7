# SPDX-License-Identifier: GPL-3.0-or-later
"""What single rays meet of a scene: projectors, shadow rays of a lamp; and holdouts."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ...casting.common.geometry import Geometry
from ...casting.common.ray_visibility import CAMERA, CATCHER, HOLDOUT, SHADOW, visible_to
from ...casting.scene.cast_scene import CastScene
from ...projection.typing import BoolArray
from .lamps import Lamp


def camera_scene(geometry: Geometry, cast_scene: CastScene) -> CastScene | None:
    """What of a scene projectors meet; None where that is nothing."""
    return cast_scene.only(visible_to(geometry.visibility, CAMERA))


def holdouts(geometry: Geometry) -> BoolArray | None:
    """Which triangles leave a hole in the picture, (T,); None for none."""
    if geometry.visibility is None:
        return None
    held: BoolArray = (geometry.visibility & HOLDOUT) != 0
    return held if held.any() else None


def has_catchers(geometry: Geometry) -> bool:
    """Whether of anything but shadows are seen."""
    return geometry.visibility is not None and bool((geometry.visibility & CATCHER).any())


def without_catchers(geometry: Geometry) -> Geometry:
    """As if all shadow catchers were things like others."""
    if geometry.visibility is None or not has_catchers(geometry):
        return geometry
    return replace(geometry, visibility=geometry.visibility & np.uint8(0xFF ^ CATCHER))


def shadow_scene(geometry: Geometry, cast_scene: CastScene) -> CastScene | None:
    """What of a scene casts shadows; None where that is nothing."""
    return cast_scene.only(visible_to(geometry.visibility, SHADOW))


def with_occluders(
    lamp: Lamp, geometry: Geometry, cast_scene: CastScene, some: BoolArray | None = None
) -> Lamp:
    """The lamp with those things in its way alone that cast its shadows; some: (T,), of these triangles."""
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
