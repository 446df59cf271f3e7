# SPDX-License-Identifier: GPL-3.0-or-later
"""Which pictures are simple enough for a short way: straight projectors, lit by suns and even light alone."""

from __future__ import annotations

import numpy as np

from ...casting.scene.cast_scene import CastScene
from ...casting.visible_triangles import FlatRays
from ...projection.typing import Array
from ...projection.volume.viewing_volume import Projection
from ..lights.lighting import Lamp
from ..sampling.samples import SamplePlaces
from ..settings.frame_settings import FrameSettings
from ..tracing.hit_colors import Shading
from .sun_colors import SunColors
from .suns_alone import SunsAlone
from .suns_shadowed import SunsShadowed


def short_way(
    projection: Projection,
    settings: FrameSettings,
    places: SamplePlaces,
    background: Array,
    scene: CastScene | None,
    shading: Shading | None,
) -> SunsAlone | SunsShadowed | None:
    """What makes the picture, or None where it has to be made in the general way; ``background``: (3,)."""
    if scene is None or type(shading) is not Shading:
        return None
    if shading.tracer is not None or shading.held_out is not None or shading.coefficients.sky is not None:
        return None
    if shading.catchers is not None or any(lamp.light.kind != "SUN" for lamp in shading.lamps):
        return None
    if not projection.volume.spans.is_straight or type(projection) is not Projection:
        return None
    if settings.pixel_error == 0.0 or settings.depth_of_field is not None:
        return None
    behind = np.zeros(4, np.float32)
    if not settings.transparent:
        behind[:] = (*background, 1)
    rays = None if places.scrambled else FlatRays.of(projection, scene)
    if any(lamp.light.casts_shadow for lamp in shading.lamps):
        return SunsShadowed(places, scene, shading, rays, rays.window(scene), behind) if rays else None
    if places.scrambled and not all(_is_alike(lamp) for lamp in shading.lamps):
        return None
    colors = SunColors(shading.surface, shading.coefficients, shading.lamps, behind)
    return SunsAlone(projection, places, scene, colors, rays, rays.window(scene) if rays else None)


def _is_alike(lamp: Lamp) -> bool:
    """Whether a lamp is seen in one place by all samples."""
    return bool((lamp.places == lamp.places[:, :1]).all())
