# SPDX-License-Identifier: GPL-3.0-or-later
"""A picture of a flexible camera by the scene's own engine: its anchors, render by render, and their join."""

from __future__ import annotations

import time
from collections.abc import Generator, Iterator
from dataclasses import replace

import numpy as np

from ..anchors.anchor import Anchor
from ..anchors.anchor_view import AnchorView
from ..anchors.image_parts import ImagePart
from ..anchors.join import join_sky
from ..anchors.kept_plan import KeptPlan
from ..anchors.plan import sky_anchors, sky_points
from ..anchors.shot import LayeredShot
from ..bridge.camera.stereo_views import Eye
from ..bridge.tasks.background import AwaitedWork, in_background
from ..bridge.tasks.task import Task
from ..cycles.layers.layer_passes import Mist
from ..cycles.layers.pass_files import Pass, read_passes
from ..projection.typing import BoolArray
from ..projection.user_error import Message
from ..shading.frame import Frame, draw_over_frame, render_frame
from ..shading.passes.data_passes import DataPasses
from ..shading.typing import Single
from .anchor_scene import AnchorScene
from .cautions import LEFT_OUT_SETTINGS, cautions, fill_cautions
from .joined_tiles import Pictures, joined_pixels
from .picture_plan import PicturePlan, ReadPicture, plan_picture_steps, read_picture
from .render_times import TakenTime, note_time
from .shared_renders import RenderKey, SharedRenders
from .world_mist import WorldMist

COMBINED, DEPTH = "Combined", "Depth"
# The largest radiance that is taken from an engine's pixels.
LARGEST = 1e6
HOLES = "{0:.2%} of the picture is seen by none of its {1} renders: Flexible Projection has colored it"
JOINING = Message("joining the renders")
SHADING = Message("rendering by Flexible Projection for passes and holes")
DRAWING = Message("drawing lines")

# What steps yield: the name of a render for Blender, or work for a thread.
Steps = Iterator[str | AwaitedWork]


class AnchoredRender:
    """One picture: ``pixels`` after the last of its ``steps``, (H, W, 4), row 0 at the bottom.

    passes: by name. warnings: what it does not show as asked. total: the number of its renders, once known.
    plan: its anchors, once planned; None in an animation, whose frames are planned together.
    """

    def __init__(
        self,
        passing: AnchorScene,
        shot: LayeredShot | None = None,
        eye: Eye = "",
        shared: SharedRenders | None = None,
    ) -> None:
        """shot: of an animation, of which the picture is the scene's present frame. eye: that sees it.

        shared: renders of earlier frames, if the scene stands still.
        """
        self._passing, self._shot, self._eye, self._shared = passing, shot, eye, shared
        self.warnings: list[str] = []
        self.pixels: Single | None = None
        self.passes: dict[str, Pass] = {}
        self.total = 0
        self.plan: KeptPlan | None = None
        self._taken = TakenTime()

    def plan_steps(self, camera) -> Steps:
        """Yield the work of planning the picture without rendering it.

        ``plan`` stays None if the camera's own view is all. The warnings are those of the picture. Raises
        USER_ERRORS.
        """
        picture, asked = read_picture(self._passing, camera), (camera.session_uid, camera.data.dof.use_dof)
        del camera
        self.warnings += fill_cautions(picture.inputs.settings.stylised)
        if not picture.inputs.is_ordinary:
            yield from self._planned(picture, *asked)

    def steps(self, camera) -> Steps:
        """Yield the name of what is to be rendered, which the caller has Blender do, or work for a thread.

        Close the iterator to end early. Raises USER_ERRORS.
        """
        picture = read_picture(self._passing, camera, eye=self._eye)
        inputs, size = picture.inputs, picture.size
        self.warnings += fill_cautions(inputs.settings.stylised)
        if inputs.settings.paper is not None:
            self._passing.leave_out_sky()
            inputs = replace(inputs, settings=replace(inputs.settings, transparent=True))
        if inputs.is_ordinary and (not self._eye or picture.eye_lens is not None):
            self.total = 1
            if picture.eye_lens is None:
                self._passing.look_as(camera)
            else:
                self._passing.look_as_eye(camera, *picture.eye_lens)
            self._passing.passes.take_mist(self._passing.scene.view_layers[0])
            del camera
            yield Message("the camera's own view")
            found = read_passes(self._passing.path, (COMBINED,))
            channels = self._passing.passes.channels(found)
            yield from self._deliver(channels, picture, np.zeros(channels.shape[:2], bool))
            return
        asked = camera.session_uid, camera.data.dof.use_dof
        del camera
        plan = yield from self._planned(picture, *asked)
        rest, shows_sky = plan.parts[0], not inputs.settings.transparent
        sky: list[Anchor] = []
        if shows_sky and not plan.is_one_eye:
            sky = sky_anchors(rest.part.scene, rest.part.projection, size, picture.axes, picture.limits)
        self.total = plan.count + len(sky)
        for part, pictures, _faces in plan.parts:
            for view in pictures.views:
                seen = part.scene
                if seen.bare is not None:
                    # One eye sees strokes in front of the right things also where their depth is lost.
                    lacks = not plan.is_one_eye and bool(view.anchor.cuts(seen.whole).any())
                    pictures.lack.append(lacks)
                    self._passing.show_faceless(strokes=not lacks)
                color, depth = yield from self._rendered(view.anchor, part)
                pictures.colors.append(color)
                if seen.bare is not None and depth is not None:
                    pictures.depths.append(depth)
        # Beyond the far surface an anchor may see things where the picture shows the sky.
        if shows_sky and plan.is_one_eye:
            sky = lacking_sky(rest.part, picture, rest.pictures)
            self.total += len(sky)
        if sky:
            self._passing.show_world_alone()
        nothing = (np.full(anchor.size[::-1], np.inf, np.float32) for anchor in sky)
        worlds = Pictures([AnchorView(*each) for each in zip(sky, nothing, strict=True)])
        for anchor in sky:
            color, _depth = yield from self._rendered(anchor, is_world=True)
            worlds.colors.append(color)
        note_time(self._passing.engine, self._taken)

        seen_sky = worlds if sky else rest.pictures
        planes = inputs.settings.passes.depth_plane, *inputs.settings.passes.layer_planes
        has_mist = self._passing.passes.has_mist
        mist = WorldMist(Mist.of(self._passing.scene.world), planes) if has_mist else None

        def work(task: Task[tuple[Single, BoolArray]]) -> tuple[Single, BoolArray]:
            return joined_pixels(inputs, plan.parts, seen_sky, mist, lambda share: _tell(task, share))

        channels, holes = yield from in_background(JOINING, work)
        if holes.any():
            self.warnings.append(Message(HOLES, float(holes.mean()), plan.count))
        yield from self._deliver(channels, picture, holes)

    def _planned(
        self, picture: ReadPicture, camera_uid: int, has_lens: bool
    ) -> Generator[AwaitedWork, None, PicturePlan]:
        """Plan the picture. has_lens: whether depth of field is on. Raises USER_ERRORS."""
        layers = picture.inputs.image_layers
        self.warnings += layers.warnings_of(picture.inputs.scene.geometry, False)
        left_out = self._passing.left_out
        if self._eye:
            left_out = [text for text in left_out if text != LEFT_OUT_SETTINGS["use_multiview"]]
        self.warnings += cautions(self._passing.scene, left_out, has_lens, layers.members)
        self._passing.members, self._passing.instancers = layers.members, picture.instancers
        plan = yield from plan_picture_steps(self._passing, camera_uid, picture, self._shot)
        self.plan = plan.kept
        return plan

    def _deliver(
        self, channels: Single, picture: ReadPicture, holes: BoolArray
    ) -> Generator[AwaitedWork, None, None]:
        """Make the picture and its passes of joined channels (H, W, C).

        holes: (H, W), what no anchor shows, which our own engine colors.
        """
        passes, inputs, frame = self._passing.passes, picture.inputs, None
        settings = replace(inputs.settings, stylised=None)
        if not passes.data:
            settings = replace(settings, samples=1)
        if passes.data or holes.any():
            geometry = replace(inputs.scene.geometry, one_sided=picture.one_sided)

            def work(task: Task[Frame]) -> Frame | None:
                told, scene = (lambda share: _tell(task, share)), replace(inputs.scene, geometry=geometry)
                return render_frame(inputs.projection, scene, settings, None, told, lambda: task.cancelled)

            frame = yield from in_background(SHADING, work)
            channels[holes, :4] = frame.pixels[holes]
        pixels = np.ascontiguousarray(channels[..., :4])
        if inputs.settings.stylised is not None:
            yield from self._drawn_over(pixels, picture)
        self.pixels = pixels
        self.passes = passes.passes(channels, frame)
        self.warnings += passes.warnings

    def _drawn_over(self, pixels: Single, picture: ReadPicture) -> Generator[AwaitedWork, None, None]:
        """Draw the paper, hatching and lines of Drawn Style over joined pixels (H, W, 4)."""
        inputs, style = picture.inputs, picture.inputs.settings.stylised
        settings = replace(inputs.settings, stylised=replace(style, fill="RENDERED"), passes=DataPasses())
        geometry = replace(inputs.scene.geometry, one_sided=picture.one_sided)
        scene = replace(inputs.scene, geometry=geometry)

        def work(task: Task[bool]) -> bool:
            told = (lambda share: _tell(task, share)), (lambda: task.cancelled)
            return draw_over_frame(inputs.projection, scene, settings, pixels, *told)

        yield from in_background(DRAWING, work)

    def _rendered(
        self, anchor: Anchor, part: ImagePart | None = None, is_world: bool = False
    ) -> Generator[str, None, tuple[Single, Single | None]]:
        """Render an anchor of a part, or use an earlier render.

        Returns colours and passes (H, W, C), which are in a file, and depths (H, W) if there are any.
        is_world: whether the world alone is shown.
        """
        number, has_halo = (0, False) if part is None else (part.number, part.scene.halo is not None)
        key = RenderKey.of(anchor, number, has_halo, self._passing.shows_strokes, is_world)
        if self._shared is not None and (known := self._shared.find(key)) is not None:
            self.total -= 1
            return known
        self._passing.look_through(anchor)
        begun = time.monotonic()
        with self._passing.showing(number, has_halo):
            yield Message("{0} × {1}", *anchor.size)
        renders, pixels, seconds = self._taken
        self._taken = TakenTime(renders + 1, pixels + anchor.count, seconds + time.monotonic() - begun)
        found = read_passes(self._passing.path, (COMBINED,))
        depth = found.pop(DEPTH, None)
        color = self._passing.passes.channels(found)
        # A neighbour that does not count is multiplied by 0, which leaves NaN and infinity as they are.
        np.nan_to_num(color, copy=False, posinf=LARGEST, neginf=-LARGEST)
        depths = None if depth is None else np.ascontiguousarray(depth.values[..., 0])
        if self._shared is not None:
            return self._shared.keep(key, color, depths)
        kept = self._passing.kept
        return kept(color), None if depths is None else kept(depths)


def _tell(task: Task, share: float) -> None:
    """Tell the share of a task that is done."""
    task.progress = share


def lacking_sky(part: ImagePart, picture: ReadPicture, seen: Pictures) -> list[Anchor]:
    """Plan anchors of the world alone if pictures do not show all of the sky that a part shows."""
    points = sky_points(part.scene, part.projection, picture.size)
    if not len(points.number) or not join_sky(points, seen.views, seen.colors)[1].any():
        return []
    return sky_anchors(part.scene, part.projection, picture.size, picture.axes, picture.limits)
