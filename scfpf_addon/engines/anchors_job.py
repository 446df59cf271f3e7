# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures by a scene's own engine through anchors, render by render: a ``LayersJob`` with other renders."""

from __future__ import annotations

from collections.abc import Sequence

import bpy

from ..anchors.kept_plan import KeptPlan
from ..anchors.shot import LayeredShot
from ..bridge.blender.scene_objects import object_by_uid
from ..bridge.blender.user_errors import USER_ERRORS, reason
from ..bridge.render import command_line
from ..bridge.render.render_engine import ENGINE
from ..cycles.engine_choice import engine_name
from ..cycles.layers.layers_job import LayersJob, all_at_once
from ..projection.user_error import UserError
from .anchor_scene import AnchorScene
from .anchored_render import AnchoredRender
from .render_times import times_text
from .shared_renders import SharedRenders
from .standstill import stands_still

OWN_ENGINE = (
    "Choose another render engine than Flexible Projection first, such as EEVEE: its pictures are joined"
)


class AnchorsJob(LayersJob):
    """Pictures joined from ordinary renders, one a frame. See ``LayersJob``."""

    def __init__(
        self, context, camera, frames: Sequence[int] = (), path: str = "", renderer: str = ""
    ) -> None:
        """renderer: the identifier of a render engine, empty for the scene's own. Raises USER_ERRORS."""
        self._renderer = renderer or context.scene.render.engine
        super().__init__(context, camera, frames, path)
        # Farms render frames apart: the shot is the whole one of the scene.
        scene = context.scene
        self._shot = LayeredShot(scene.frame_start, scene.frame_end, scene.frame_step)
        self._shared = SharedRenders() if len(frames) > 1 else None

    def require(self, scene) -> None:
        """Raise UserError if the engine is our own."""
        if self._renderer == ENGINE:
            raise UserError(OWN_ENGINE)

    def picture(self, scene, view_layer):
        """The temporary scene of one picture, which has its name, and the picture's renders."""
        passing = AnchorScene(scene, view_layer, self._renderer)
        self.engine = engine_name(passing.scene)
        shared = self._shared
        if shared is not None:
            shared.begin_frame()
            shared = shared if stands_still(scene, self._renderer) else None
        return passing, AnchoredRender(passing, self._shot if self._is_animation else None, shared=shared)

    def close(self) -> None:
        """As of ``LayersJob``; renders that frames share go, too."""
        try:
            super().close()
        finally:
            if self._shared is not None:
                self._shared.remove()

    def _deliver(self) -> None:
        """Keep the finished picture, and the time of its renders beside a plan that the camera keeps."""
        super()._deliver()
        camera = object_by_uid(self._camera)
        if camera is not None and camera.is_editable and camera.scfpf.anchor_plan:
            camera.scfpf.anchor_times = times_text(camera.scfpf.anchor_times)


def render_anchors(
    context, camera, frames: Sequence[int] = (), path: str = "", renderer: str = ""
) -> AnchorsJob:
    """Do all of an ``AnchorsJob`` at once, and return it. Raises USER_ERRORS; earlier files stay then."""
    return all_at_once(AnchorsJob(context, camera, frames, path, renderer))


class PlanJob:
    """The plan of a picture's renders, step by step. Call ``close`` in any case.

    plan: None if the camera's own view is all. warnings: what the picture will not show as the scene says.
    work: what a thread is to do before the next step.
    """

    def __init__(self, context, camera, renderer: str = "") -> None:
        """renderer: the identifier of a render engine, empty for the scene's own. Raises USER_ERRORS."""
        self._passing: AnchorScene | None = AnchorScene(context.scene, context.view_layer, renderer)
        self._render = AnchoredRender(self._passing)
        self._steps = self._render.plan_steps(camera)
        self.text, self.work = "", None

    @property
    def plan(self) -> KeptPlan | None:
        """The plan, after the last step."""
        return self._render.plan

    @property
    def warnings(self) -> list[str]:
        """What the picture will not show as the scene says."""
        return self._render.warnings

    @property
    def is_working(self) -> bool:
        """Return whether a thread is still at work."""
        return self.work is not None and self.work.running

    def step(self) -> bool:
        """Prepare the next work; False if the plan is made. Raises USER_ERRORS."""
        wanted, self.work = next(self._steps, None), None
        if wanted is None:
            return False
        self.text, self.work = wanted
        return True

    def close(self) -> None:
        """Cancel what goes on, and remove everything that was made for it."""
        work, self.work = self.work, None
        passing, self._passing = self._passing, None
        try:
            if work is not None:
                work.cancel()
                work.wait()
            self._steps.close()
        finally:
            if passing is not None:
                passing.remove()


def plan_picture(context, camera, renderer: str = "") -> tuple[KeptPlan | None, list[str]]:
    """Do all of a ``PlanJob`` at once; return its plan and warnings. Raises USER_ERRORS."""
    job = PlanJob(context, camera, renderer)
    try:
        while job.step():
            job.work.run()
        return job.plan, job.warnings
    finally:
        job.close()


def render_for_command(renderer: str, camera, frames: Sequence[int], path: str) -> tuple[list[str], str]:
    """Render files for the command line; return warnings and what was rendered. Raises UserError."""
    try:
        job = render_anchors(bpy.context, camera, frames, path, renderer)
    except USER_ERRORS as error:
        raise UserError(reason(error)) from error
    return job.warnings, job.outcome


def register():
    command_line.ENGINE_RENDERS.append(render_for_command)


def unregister():
    command_line.ENGINE_RENDERS.clear()
