# SPDX-License-Identifier: GPL-3.0-or-later
"""The stages of a render: the scene is built for casting, then a coarse image and the image are made."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter
from typing import NamedTuple

import numpy as np

from ...casting.common.geometry import Geometry
from ...casting.common.hits import NothingToCastAt
from ...casting.scene.cast_scene import CastScene
from ...shading.frame import Frame, render_frame
from ...shading.lights.scene_culling import cull_scene
from ...shading.typing import Single
from .coarse_image import coarse_image
from .render_inputs import RenderInputs

# The text in a window's header during preparation.
BUILDING = "Building the acceleration structure, which cannot be canceled"


@dataclass(frozen=True)
class SceneCache:
    """A geometry built for casting, reused by the next image while the triangles stay the same."""

    geometry: Geometry
    cast_scene: CastScene | None

    @classmethod
    def of(cls, geometry: Geometry, cache: SceneCache | None) -> SceneCache:
        """Return ``cache`` if its triangles are the same, else build the geometry. Raises CastError."""
        if cache is not None and same_triangles(geometry, cache.geometry):
            return cache
        try:
            return cls(geometry, CastScene(geometry.vertices, geometry.triangles))
        except NothingToCastAt:
            return cls(geometry, None)


def same_triangles(a: Geometry, b: Geometry) -> bool:
    """Return whether two geometries have the same triangles in the same places."""
    return np.array_equal(a.triangles, b.triangles) and np.array_equal(a.vertices, b.vertices)


class PreparedScene(NamedTuple):
    """A scene that is ready for casting.

    inputs: with only the part of the scene that ``cast_scene`` was built from. cache: for the next image.
    triangles: of the whole scene. seconds: that preparation took.
    """

    inputs: RenderInputs
    cast_scene: CastScene | None
    cache: SceneCache | None
    triangles: int
    seconds: float

    def render(
        self,
        cancelled: Callable[[], bool],
        show_coarse: Callable[[Single], None] | None = None,
        **delivery,
    ) -> Frame | None:
        """Render the image, None when cancelled. Its report includes the preparation.

        show_coarse: is given a coarse image (H, W, 4) first. delivery: further arguments of ``render_frame``.
        """
        inputs = self.inputs
        if show_coarse is not None:
            coarse = coarse_image(inputs, self.cast_scene, cancelled)
            if coarse is not None:
                show_coarse(coarse)
        frame = render_frame(
            inputs.projection,
            inputs.scene,
            inputs.settings,
            self.cast_scene,
            cancelled=cancelled,
            moments=inputs.moments,
            **delivery,
        )
        if frame is None:
            return None
        report = frame.report
        seconds, building = report.seconds + self.seconds, report.build_seconds + self.seconds
        return frame._replace(
            report=replace(report, seconds=seconds, build_seconds=building, triangles=self.triangles)
        )


def prepare_scene(inputs: RenderInputs, cache: SceneCache | None, keep: bool) -> PreparedScene:
    """Build the scene that projectors are cast at. Raises CastError.

    cache: of the image before. keep: whether to cache (persistent data). Then the whole scene is built: a
    moving camera would need another part of it in the next image. Otherwise only the part is built that the
    volume can meet; the caller should hold no reference to ``inputs``, so that the rest is freed.
    """
    started, triangles = perf_counter(), len(inputs.scene.geometry.triangles)
    if keep:
        cache = SceneCache.of(inputs.scene.geometry, cache)
        cast_scene = cache.cast_scene
    else:
        settings = inputs.settings
        alone = not inputs.moments and settings.sees_volume_alone
        exact = settings.pixel_error == 0.0
        scene, cast_scene = cull_scene(inputs.scene, inputs.projection, alone, exact)
        inputs, cache = replace(inputs, scene=scene), None
    _build_on_demand_parts(inputs, cast_scene)
    return PreparedScene(inputs, cast_scene, cache, triangles, perf_counter() - started)


def _build_on_demand_parts(inputs: RenderInputs, cast_scene: CastScene | None) -> None:
    """Build the parts that casting would build at their first use, while no header announces it.

    Raises CastError if memory does not suffice.
    """
    if cast_scene is None or inputs.moments:
        return
    spans = inputs.projection.volume.spans
    if inputs.settings.pixel_error == 0.0:
        cast_scene.prepare_exact()
    elif not spans.is_polyline:
        _ = cast_scene.occupancy
    if any(light.casts_shadow for light in inputs.scene.lights):
        # The part beyond the volume is built when the first shadow ray is cast.
        cast_scene.occluded(np.zeros((3, 1)), np.zeros((3, 1)), np.zeros(1))
