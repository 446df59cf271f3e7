# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of a flexible camera by the scene's own engine: its anchors, render by render, and their join."""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..anchors.anchor import Anchor
from ..anchors.anchor_view import AnchorView, ViewSet, traced_views, without_unused
from ..anchors.completion import completed
from ..anchors.join import join_sky
from ..anchors.kept_plan import KeptPlan, digest
from ..anchors.plan import PlanLimits, plan_anchors, sky_anchors, sky_points
from ..anchors.seen_scene import SeenScene
from ..anchors.shot import AnchorSet, LookedAt, Shot, completed_sets
from ..bridge.render.render_inputs import RenderInputs, read_inputs, synced_image_size
from ..bridge.scene.render_depsgraph import with_render_depsgraph
from ..bridge.volume.screens import screens_of
from ..casting.common.ray_visibility import CAMERA, visible_to
from ..casting.scene.cast_scene import CastScene
from ..cycles.engine_choice import engine_name
from ..cycles.layers.pass_files import Pass, read_passes
from ..projection.typing import BoolArray
from ..projection.user_error import Message, UserError
from ..projection.volume.viewing_volume import Projection
from ..shading.frame import render_frame
from ..shading.typing import Single
from .anchor_scene import AnchorScene
from .backface_culling import one_sided
from .cautions import cautions
from .joined_tiles import Pictures, joined_pixels
from .render_times import TakenTime, note_time

COMBINED = "Combined"
# What of a geometry rays meet.
SHAPE = ("vertices", "triangles", "visibility")
# The largest radiance that is taken from an engine's pixels.
LARGEST = 1e6
NOTHING = "The picture shows nothing that has faces: add a mesh, or show one in renders"
LAYERS = "Layers are not joined from renders by '{0}': render with Flexible Projection, or layers with Cycles"
SCREEN = (
    "'{0}' hides what pops out of it from '{1}': switch it off in renders, or render with Flexible "
    "Projection or Cycles"
)
BACKS = "Data passes show the backs of faces that the other engine leaves out"
HOLES = "{0:.2%} of the picture is seen by none of its {1} renders: Flexible Projection has colored it"


class AnchoredRender:
    """One picture: ``pixels`` after the last of its ``steps``, (H, W, 4), row 0 at the bottom.

    passes: by name. warnings: what it does not show as asked. total: the number of its renders, once known.
    plan: its anchors, once planned; None in an animation, whose frames are planned together.
    """

    def __init__(self, passing: AnchorScene, shot: Shot | None = None) -> None:
        """shot: of an animation, of which the picture is the scene's present frame."""
        self._passing, self._shot = passing, shot
        self.warnings: list[str] = []
        self.pixels: Single | None = None
        self.passes: dict[str, Pass] = {}
        self.total = 0
        self.plan: KeptPlan | None = None
        self._taken = TakenTime()

    def make_plan(self, camera) -> KeptPlan | None:
        """Plan the picture without rendering it; None if the camera's own view is all.

        The warnings are those of the picture. Raises USER_ERRORS.
        """
        inputs, axes = self._read(camera)
        if not inputs.is_ordinary:
            self._planned(self._seen(inputs), inputs, axes, camera)
        return self.plan

    def steps(self, camera) -> Iterator[str]:
        """Yield the name of what is to be rendered: the caller has Blender render the passing scene.

        Raises USER_ERRORS.
        """
        inputs, axes = self._read(camera)
        if inputs.is_ordinary:
            self.total = 1
            self._passing.look_as(camera)
            yield Message("the camera's own view")
            found = read_passes(self._passing.path, (COMBINED,))
            channels = self._passing.passes.channels(found)
            self._deliver(channels, inputs, np.zeros(channels.shape[:2], bool), False)
            return
        settings = inputs.settings
        size = settings.width, settings.height
        shown = self._seen(inputs)
        seen, is_one_eye = self._planned(shown, inputs, axes, camera)
        del camera
        sky: list[Anchor] = []
        if not settings.transparent and not is_one_eye:
            sky = sky_anchors(shown, inputs.projection, size, axes, PlanLimits())
        self.total = len(seen.views) + len(sky)
        for view in seen.views:
            color = yield from self._rendered(view.anchor)
            seen.colors.append(color)
        # Beyond the far surface an anchor may see things where the picture shows the sky.
        if not settings.transparent and is_one_eye:
            sky = lacking_sky(shown, inputs.projection, size, axes, seen)
            self.total += len(sky)
        if sky:
            self._passing.show_world_alone()
        nothing = (np.full(anchor.size[::-1], np.inf, np.float32) for anchor in sky)
        worlds = Pictures([AnchorView(*each) for each in zip(sky, nothing, strict=True)])
        for anchor in sky:
            color = yield from self._rendered(anchor)
            worlds.colors.append(color)
        note_time(self._passing.engine, self._taken)
        channels, holes = joined_pixels(inputs, shown, seen, worlds if sky else seen)
        if holes.any():
            self.warnings.append(Message(HOLES, float(holes.mean()), len(seen.views)))
        self._deliver(channels, inputs, holes, shown.one_sided is not None)

    def _deliver(self, channels: Single, inputs: RenderInputs, holes: BoolArray, has_backs: bool) -> None:
        """Make the picture and its passes of joined channels (H, W, C).

        holes: (H, W), what no anchor shows, which the engine colors unless the others leave out backs.
        """
        passes, settings, frame = self._passing.passes, inputs.settings, None
        if passes.data:
            frame = render_frame(inputs.projection, inputs.scene, replace(settings, stylised=None))
            self.warnings += [Message(BACKS)] if has_backs else []
        elif holes.any() and not has_backs:
            frame = render_frame(inputs.projection, inputs.scene, replace(settings, samples=1, stylised=None))
        if frame is not None and not has_backs:
            channels[holes, :4] = frame.pixels[holes]
        self.pixels = np.ascontiguousarray(channels[..., :4])
        self.passes = passes.passes(channels, frame)
        self.warnings += passes.warnings

    def _read(self, camera) -> tuple[RenderInputs, np.ndarray]:
        """The inputs of the picture, and the axes (3, 3) of its camera. Raises USER_ERRORS."""
        scene = self._passing.scene
        size = synced_image_size(scene, camera)
        names = tuple(each.source for each in self._passing.passes.data)

        def read(depsgraph):
            inputs = read_inputs(depsgraph, camera, size, passes=names)
            # Any rotation serves: one that shears or mirrors would not.
            turn = camera.evaluated_get(depsgraph).matrix_world.to_quaternion().to_matrix()
            return inputs, np.array(turn, np.float64)

        inputs, axes = with_render_depsgraph(scene, scene.view_layers[0], read)
        if inputs.projection.layers:
            raise UserError(LAYERS, engine_name(scene))
        for screen in screens_of(camera):
            if not screen.hide_render:
                raise UserError(SCREEN, screen.name, engine_name(scene))
        return inputs, axes

    def _seen(self, inputs: RenderInputs) -> SeenScene:
        """The scene as the engine's cameras see it. Raises CastError, and UserError if it is empty."""
        geometry = inputs.scene.geometry
        scene = CastScene(geometry.vertices, geometry.triangles)
        shown = scene.only(visible_to(geometry.visibility, CAMERA))
        if shown is None:
            raise UserError(NOTHING)
        names = inputs.scene.material_names
        return SeenScene(shown, one_sided(self._passing.scene, names, geometry.material))

    def _planned(
        self, shown: SeenScene, inputs: RenderInputs, axes: np.ndarray, camera
    ) -> tuple[Pictures, bool]:
        """The views of the picture's anchors without colors, and whether all its projectors have one eye."""
        settings, projection = inputs.settings, inputs.projection
        has_lens = camera.data.dof.use_dof
        self.warnings += cautions(self._passing.scene, self._passing.left_out, has_lens)
        size, threads = (settings.width, settings.height), settings.threads
        kept = KeptPlan.read(camera.scfpf.anchor_plan)
        if self._shot is not None and (
            sets := self._sets_of_shot(self._shot, shown, inputs, axes, camera, kept)
        ):
            return Pictures(*completed_sets(shown, projection, size, sets, threads)), False
        made_for = digest_of(inputs)
        if kept is not None and kept.made_for == made_for:
            self.plan, views = kept, traced_views(shown, kept.anchors, threads)
            return Pictures(views, [ViewSet(tuple(range(len(views))))]), kept.is_one_eye
        plan = plan_anchors([shown], [projection], size, axes)
        done = completed(shown, projection, size, traced_views(shown, plan.anchors, threads), threads=threads)
        # A still picture is the better for what was made for its smallest parts.
        views, sets = without_unused(done.views, [ViewSet((*done.own.first, *done.own.rest))])
        anchors = tuple(view.anchor for view in views)
        self.plan = KeptPlan(anchors, made_for, size, done.shown, plan.is_one_eye)
        return Pictures(views, sets), plan.is_one_eye

    def _sets_of_shot(
        self,
        shot: Shot,
        shown: SeenScene,
        inputs: RenderInputs,
        axes: np.ndarray,
        camera,
        kept: KeptPlan | None,
    ) -> list[AnchorSet]:
        """The sets of anchors that a shot has for the picture, [] if it has none."""
        frame, size = self._passing.scene.frame_current, (inputs.settings.width, inputs.settings.height)
        for chunk in shot.missing(frame):
            looked_at = []
            for each in self._read_frames(camera, shot.frames(chunk)):
                pairs = (
                    (getattr(each.scene.geometry, name), getattr(inputs.scene.geometry, name))
                    for name in SHAPE
                )
                is_same = all(np.array_equal(one, other) for one, other in pairs)
                scene = shown if is_same else self._seen(each)
                looked_at.append(LookedAt(scene, each.projection, digest_of(each)))
            shot.plan(chunk, looked_at, size, axes, kept, inputs.settings.threads)
        return shot.sets(frame)

    def _read_frames(self, camera, frames: Sequence[int]) -> list[RenderInputs]:
        """The inputs of other frames. Raises USER_ERRORS."""
        scene = self._passing.scene
        size = synced_image_size(scene, camera)
        present = scene.frame_current

        def read(depsgraph, set_frame):
            found = []
            for frame in frames:
                set_frame(frame, subframe=0.0)
                found.append(read_inputs(depsgraph, camera, size))
            set_frame(present, subframe=0.0)
            return found

        return with_render_depsgraph(scene, scene.view_layers[0], read, with_time=True)

    def _rendered(self, anchor: Anchor) -> Iterator[str]:
        """Render an anchor and return its colours and passes (H, W, C), which are in a file."""
        self._passing.look_through(anchor)
        begun = time.monotonic()
        yield Message("{0} × {1}", *anchor.size)
        renders, pixels, seconds = self._taken
        self._taken = TakenTime(renders + 1, pixels + anchor.count, seconds + time.monotonic() - begun)
        color = self._passing.passes.channels(read_passes(self._passing.path, (COMBINED,)))
        # A neighbour that does not count is multiplied by 0, which leaves NaN and infinity as they are.
        np.nan_to_num(color, copy=False, posinf=LARGEST, neginf=-LARGEST)
        return self._passing.kept(color)


def digest_of(inputs: RenderInputs) -> str:
    """The digest of what a plan of the picture depends on."""
    geometry, settings = inputs.scene.geometry, inputs.settings
    shown = visible_to(geometry.visibility, CAMERA)
    size = settings.width, settings.height
    return digest(geometry.vertices, geometry.triangles, shown, inputs.projection, size)


def lacking_sky(
    scene: SeenScene,
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
