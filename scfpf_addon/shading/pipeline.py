# SPDX-License-Identifier: GPL-3.0-or-later
"""The pipeline of a frame: the tables and views that its tiles share, prepared once."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..casting.common.cancellation import raise_if_cancelled
from ..casting.layers.layer_parts import LayerParts
from ..casting.scene.cast_scene import CastScene
from ..projection.typing import Array
from ..projection.volume.viewing_volume import Projection
from .lights.ray_visibility import camera_scene
from .lights.scene_culling import cull_scene
from .passes.data_passes import PassSource
from .sample_casting import SampleCaster
from .sampling.sample_positions import SamplePositions
from .scene.motion import Moment
from .scene.shading_scene import Scene
from .settings.frame_settings import FrameSettings
from .stylised.drawing import Drawing
from .stylised.tones import StylisedShading
from .tracing.hit_colors import Shading
from .tracing.scene_view import SceneView


@dataclass(frozen=True, kw_only=True)
class Pipeline:
    """The data that the threads share while they render the tiles of a frame.

    view: of the frame's own time, which data passes show. background: (3,) radiance where nothing is hit.
    caster: casts the samples of the image. passes: None without data passes. drawing: draws over finished
    tiles, None unless the image is stylised.
    """

    settings: FrameSettings
    view: SceneView
    background: Array
    caster: SampleCaster
    passes: PassSource | None
    drawing: Drawing | None

    @classmethod
    def of(
        cls,
        projection: Projection,
        scene: Scene,
        settings: FrameSettings,
        cast_scene: CastScene | None = None,
        moments: tuple[Moment, ...] = (),
    ) -> Pipeline:
        """Prepare a frame; the parameters are those of ``render_frame``. Raises Cancelled and CastError."""
        alone = not moments and settings.sees_volume_alone
        view = _view(projection, scene, settings, cast_scene, alone)
        places = SamplePositions(
            settings.width,
            settings.height,
            settings.samples,
            settings.pixel_filter,
            scrambled=settings.scrambled or settings.adaptive is not None,
        )
        passes = None
        if view.cast_scene and view.shading and settings.passes.names:
            passes = PassSource(
                wanted=settings.passes,
                size=(settings.width, settings.height),
                projection=view.projection,
                scene=view.scene,
                cast_scene=view.cast_scene,
                surface=view.shading.surface,
            )
        return cls(
            settings=settings,
            view=view,
            background=np.asarray(scene.backdrop[0], np.float64),
            caster=SampleCaster(places, _moment_views(view, scene, moments) or (view,)),
            passes=passes,
            drawing=Drawing.of(view, settings.stylised) if settings.stylised else None,
        )

    @property
    def shaded(self) -> int:
        """The surfaces that paths have met so far, see ``Tally``."""
        found = {id(view.shading): view.shading for view in (self.view, *self.caster.views)}
        return sum(each.tracer.tally.shaded for each in found.values() if each and each.tracer)

    @property
    def empty_color(self) -> Array:
        """The colour (3,) of the image where nothing is hit."""
        return self.background if self.settings.paper is None else self.settings.paper


def _view(
    projection: Projection,
    scene: Scene,
    settings: FrameSettings,
    cast_scene: CastScene | None,
    alone: bool,
) -> SceneView:
    """The view of a scene; without ``cast_scene`` triangles that the volume cannot meet are left to shadows.

    projection: in world space. alone: no other projection sees the same scene.
    """
    if cast_scene is None:
        scene, cast_scene = cull_scene(scene, projection, alone, settings.pixel_error == 0.0)
    everything, cast_scene = cast_scene, cast_scene and camera_scene(scene.geometry, cast_scene)
    shading: Shading | None = None
    if everything and cast_scene:
        kind = StylisedShading if settings.stylised else Shading
        shading = kind.of(scene, everything, settings)
    view = SceneView(
        projection=projection,
        scene=scene,
        settings=settings,
        cast_scene=cast_scene,
        shading=shading,
        world=scene.backdrop[1] if settings.paper is None else None,
        depth_of_field=None,
    )
    view = view.seen_by(projection, settings.depth_of_field)
    if cast_scene is None:
        return view
    return replace(view, parts=LayerParts.of(scene.geometry.image_layer, cast_scene, view.projection.layers))


def _moment_views(view: SceneView, scene: Scene, moments: tuple[Moment, ...]) -> tuple[SceneView, ...]:
    """The views of the moments of the open shutter; view: of the frame's own time and scene."""
    made = [(scene, view)]
    for moment in moments:
        raise_if_cancelled()
        lens = moment.depth_of_field
        same = next((known for seen, known in made if seen is moment.scene), None)
        if same is None:
            own = replace(view.settings, depth_of_field=lens)
            each = _view(moment.projection, moment.scene, own, None, False)
        else:
            each = same.seen_by(moment.projection, lens)
        made.append((moment.scene, each))
    return tuple(each for _, each in made[1:])
