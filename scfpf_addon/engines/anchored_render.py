# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of a flexible camera by the scene's own engine: its anchors, render by render, and their join."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from ..anchors.anchor import Anchor
from ..anchors.anchor_view import AnchorView, traced_views
from ..anchors.completion import completed
from ..anchors.join import find_texels, join_sky
from ..anchors.plan import AnchorPlan, PlanLimits, plan_anchors, sky_anchors, sky_points
from ..anchors.shown_points import shown_points
from ..bridge.render.render_inputs import RenderInputs, read_inputs, ready_size
from ..bridge.scene.read_visibility import rendered_objects
from ..bridge.scene.render_depsgraph import with_render_depsgraph
from ..casting.common.ray_visibility import CAMERA, visible_to
from ..casting.scene.cast_scene import CastScene
from ..casting.tiles import TileJob, image_tiles, run_tiles
from ..cycles.engine_choice import engine_name
from ..cycles.layers.exr_passes import Pass, read_passes
from ..projection.user_error import Message, UserError
from ..projection.volume.viewing_volume import Projection
from ..shading.frame import render_frame
from ..shading.sampling.sample_positions import SamplePositions
from ..shading.typing import Single
from .anchor_scene import AnchorScene

COMBINED = "Combined"
# The largest radiance that is taken from an engine's pixels.
LARGEST = 1e6
NOTHING = "The picture shows nothing that has faces: add a mesh, or show one in renders"
LAYERS = "Layers are not joined from renders by '{0}': render with SCFPF, or layers with Cycles"
HOLES = "{0:.2%} of the picture is seen by none of its {1} renders: SCFPF has colored it"
LEFT_OUT = "Left out of pictures that are joined: {0}"
AS_IT_COMES = "Shown only where an ordinary render has it in front of faces, not along projectors: {0}"
# Types of objects without faces that engines draw.
FACELESS = {"GREASEPENCIL": "Grease Pencil", "CURVES": "hair", "POINTCLOUD": "points", "VOLUME": "smoke"}


@dataclass
class Pictures:
    """The pictures of anchors. colors: (H, W, 4) float32 each, row 0 at the bottom."""

    views: list[AnchorView]
    colors: list[Single] = field(default_factory=list)


class AnchoredRender:
    """One picture: ``pixels`` after the last of its ``steps``, (H, W, 4), row 0 at the bottom.

    passes: none. warnings: what it does not show as asked. total: the number of its renders, once known.
    """

    def __init__(self, passing: AnchorScene) -> None:
        self._passing = passing
        self.warnings: list[str] = []
        self.pixels: Single | None = None
        self.passes: dict[str, Pass] = {}
        self.total = 0
        self.plan: AnchorPlan | None = None

    def steps(self, camera) -> Iterator[str]:
        """Yield the name of what is to be rendered: the caller has Blender render the passing scene.

        Raises USER_ERRORS.
        """
        inputs, axes = self._read(camera)
        if inputs.is_ordinary:
            self.total = 1
            self._passing.look_as(camera)
            yield Message("the camera's own view")
            self.pixels = read_passes(self._passing.path, (COMBINED,))[COMBINED].values
            return
        del camera
        geometry, settings = inputs.scene.geometry, inputs.settings
        size = settings.width, settings.height
        cast_scene = CastScene(geometry.vertices, geometry.triangles)
        shown = cast_scene.only(visible_to(geometry.visibility, CAMERA))
        if shown is None:
            raise UserError(NOTHING)
        self.plan = plan_anchors(shown, [inputs.projection], size, axes, PlanLimits())
        views = traced_views(shown, self.plan.anchors, settings.threads)
        done = completed(shown, inputs.projection, size, views, PlanLimits(), settings.threads)
        seen = Pictures(list(done.views))
        sky: list[Anchor] = []
        if not settings.transparent and not self.plan.is_one_eye:
            sky = sky_anchors(shown, inputs.projection, size, axes, PlanLimits())
        self.total = len(seen.views) + len(sky)
        self.warnings += self._cautions(settings.depth_of_field is not None)
        for view in seen.views:
            color = yield from self._rendered(view.anchor)
            seen.colors.append(color)
        # Beyond the far surface an anchor may see things where the picture shows the sky.
        if not settings.transparent and self.plan.is_one_eye:
            sky = lacking_sky(shown, inputs.projection, size, axes, seen)
            self.total += len(sky)
        if sky:
            self._passing.show_world_alone()
        nothing = (np.full(anchor.size[::-1], np.inf, np.float32) for anchor in sky)
        worlds = Pictures([AnchorView(*each) for each in zip(sky, nothing, strict=True)])
        for anchor in sky:
            color = yield from self._rendered(anchor)
            worlds.colors.append(color)
        self.pixels = self._joined(inputs, shown, seen, worlds if sky else seen)

    def _read(self, camera) -> tuple[RenderInputs, np.ndarray]:
        """The inputs of the picture, and the axes (3, 3) of its camera. Raises USER_ERRORS."""
        scene = self._passing.scene
        size = ready_size(scene, camera)

        def read(depsgraph):
            inputs = read_inputs(depsgraph, camera, size)
            # Any rotation serves: one that shears or mirrors would not.
            turn = camera.evaluated_get(depsgraph).matrix_world.to_quaternion().to_matrix()
            return inputs, np.array(turn, np.float64)

        inputs, axes = with_render_depsgraph(scene, scene.view_layers[0], read)
        if inputs.projection.layers:
            raise UserError(LAYERS, engine_name(scene))
        return inputs, axes

    def _cautions(self, has_lens: bool) -> list[str]:
        """Name what the picture does not show as the scene says."""
        scene = self._passing.scene
        shown = rendered_objects(scene.view_layers[0])
        found = {FACELESS[obj.type] for obj in shown if obj.type in FACELESS and not obj.hide_render}
        left = [*self._passing.left_out, *(["depth of field"] if has_lens else [])]
        texts = [Message(LEFT_OUT, ", ".join(left))] if left else []
        return texts + ([Message(AS_IT_COMES, ", ".join(sorted(found)))] if found else [])

    def _rendered(self, anchor: Anchor) -> Iterator[str]:
        """Render an anchor and return its colours (H, W, 4), which are in a file."""
        self._passing.look_through(anchor)
        yield Message("{0} × {1}", *anchor.size)
        color = read_passes(self._passing.path, (COMBINED,))[COMBINED].values
        # A neighbour that does not count is multiplied by 0, which leaves NaN and infinity as they are.
        np.nan_to_num(color, copy=False, posinf=LARGEST, neginf=-LARGEST)
        return self._passing.kept(color)

    def _joined(
        self,
        inputs: RenderInputs,
        scene: CastScene,
        seen: Pictures,
        worlds: Pictures,
    ) -> Single:
        settings, projection = inputs.settings, inputs.projection
        width, height, angle = settings.width, settings.height, PlanLimits().angle
        positions = SamplePositions(width, height, settings.samples, settings.pixel_filter)
        pixel_size = 1.0 / width, 1.0 / height
        pixels = np.zeros((height, width, 4), np.float32)
        holes = np.zeros((height, width), bool)

        def work(job: TileJob) -> tuple[Single, np.ndarray]:
            """The colours (n, 4) of the pixels of a tile, and which of them have none."""
            count = (job.rows.stop - job.rows.start) * width
            color, weight = np.zeros((count, 4), np.float32), np.zeros(count, np.float32)
            for sample in range(settings.samples):
                x, y = positions.of_rows(job.rows, sample)
                points = shown_points(scene, projection, x, y, pixel_size, settings.pixel_error)
                # Where there is no projector, the picture shows nothing.
                present = np.zeros(count, bool)
                present[points.number] = True
                weight[~present] += 1.0
                things = points.take(np.flatnonzero(points.is_hit))
                found = find_texels(things, seen.views, angle)
                color[things.number] += found.colors(seen.colors)
                weight[things.number] += ~found.is_hole
                if settings.transparent:
                    weight[points.number[~points.is_hit]] += 1.0
                else:
                    beyond = points.take(np.flatnonzero(~points.is_hit))
                    own, lacks = join_sky(beyond, worlds.views, worlds.colors)
                    color[beyond.number] += own
                    weight[beyond.number] += ~lacks
            empty = weight <= 0.0
            return color / np.where(empty, np.float32(1.0), weight)[:, None], empty

        def finished(rows: slice, made: tuple[Single, np.ndarray]) -> None:
            """Write a tile into the picture."""
            pixels[rows] = made[0].reshape(-1, width, 4)
            holes[rows] = made[1].reshape(-1, width)

        run_tiles(work, image_tiles(width, height), settings.threads, finished)
        if holes.any():
            frame = render_frame(projection, inputs.scene, replace(settings, samples=1, stylised=None))
            if frame is not None:
                pixels[holes] = frame.pixels[holes]
            self.warnings.append(Message(HOLES, float(holes.mean()), len(seen.views)))
        return pixels


def lacking_sky(
    scene: CastScene,
    projection: Projection,
    size: tuple[int, int],
    axes: np.ndarray,
    seen: Pictures,
) -> list[Anchor]:
    """Plan anchors of the world alone if pictures do not show all of the sky that a projection shows."""
    points = sky_points(scene, projection, size)
    if not len(points.number) or not join_sky(points, seen.views, seen.colors)[1].any():
        return []
    return sky_anchors(scene, projection, size, axes, PlanLimits())
