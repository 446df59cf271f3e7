# SPDX-License-Identifier: GPL-3.0-or-later
"""Render pictures that several renders of Blender make: by Cycles with layers, or joined from any engine's.

In a window they are made render by render, for scripts and farms at once. The work in a window is done by
Blender's own render job, for which the operator waits.
"""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent
from bpy.props import BoolProperty, StringProperty

from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid
from ...scfpf_addon.bridge.blender.unstored_edits import note_edit
from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from ...scfpf_addon.bridge.render import type_registration
from ...scfpf_addon.bridge.render.result_image import result_image
from ...scfpf_addon.cycles.layers.layers_job import LOST, LayersJob, all_at_once
from ...scfpf_addon.engines.anchors_job import AnchorsJob, PlanJob
from ...scfpf_addon.engines.render_times import times_text
from ...scfpf_addon.projection.user_error import UserError
from ..common.errors import refused
from ..common.modal_job import ModalJob, in_window, is_running
from ..common.target import chosen_camera, poll_flexible_camera, take_up_edits
from ..common.tool import Action
from ..common.words import report_text, translated_report
from ..image.image_editors import image_editors
from ..image.joined_engines import RENDERERS, OfEngine
from ..image.preparation import poll_no_render, redraw_interface

# Seconds between two looks at Blender's render.
TICK = 0.1
PLAN_CANCELED = "Planning canceled: the earlier plan is kept"
CANCELED = "Render canceled: the previous picture is unchanged"
PLANNED = "{0} renders show {1:.2%} of the picture, with {2:.1f} times its pixels"
ONE_RENDER = "One render: the picture is the camera's own view"
LINKED = "'{0}' is linked from another file: make a library override of it first"
WAIT = "Blender is rendering: wait for it, or press Esc to cancel it"

# Whether Blender's render was cancelled while the operator runs.
_cancelled: list[bool] = []


@persistent
def _note_cancel(*_) -> None:
    _cancelled.append(True)


class OfFrames:
    """Operators that render a picture, or one for each frame."""

    animation: BoolProperty(
        name="Animation",
        description="Render all frames of the scene's range into files",
        default=False,
        options={"SKIP_SAVE"},
    )


class PicturesRender(ModalJob):
    """The base of operators whose pictures take several renders.

    Those have ``new_job``, which makes their ``LayersJob``; ``told`` is reported at the end.
    """

    seconds = TICK
    canceled = CANCELED
    told = ""

    camera: StringProperty(
        name="Camera",
        description="Name of the flexible camera; empty for the scene's camera, or else the active one",
        options={"SKIP_SAVE"},
    )
    filepath: StringProperty(
        name="File",
        description="The file to write, # for digits of the frame; empty for none, in an animation for the "
        "scene's output path",
        subtype="FILE_PATH",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context):
        if is_running(cls) or bpy.app.is_job_running("RENDER"):
            cls.poll_message_set(WAIT)
            return False
        return poll_no_render(cls, context)

    def execute(self, context):
        try:
            job = all_at_once(self.new_job(context, *self._wanted(context)))
        except USER_ERRORS as error:
            return refused(self, error)
        return self._finish(context, job)

    def invoke(self, context, _event):
        if not in_window(context):
            return self.execute(context)
        try:
            self._job = self.new_job(context, *self._wanted(context))
        except USER_ERRORS as error:
            return refused(self, error)
        _cancelled.clear()
        outcome = self.begin(context)
        bpy.app.handlers.render_cancel.append(_note_cancel)
        self.ends.callback(bpy.app.handlers.render_cancel.remove, _note_cancel)
        self.show(context, report_text("Flexible Projection: reading the scene"))
        return outcome

    def escape(self, _context):
        # Blender's own job sees Esc, too.
        _note_cancel()
        return {"PASS_THROUGH"}

    def respond(self, _context, event):
        # Edits would show in some of the renders only.
        return {"PASS_THROUGH"} if event.type in PASSED else {"RUNNING_MODAL"}

    def tick(self, context):
        if bpy.app.is_job_running("RENDER"):
            return {"PASS_THROUGH"}
        if _cancelled:
            return super().escape(context)
        if self._job.is_working:
            self.show_job(context)
            return {"PASS_THROUGH"}
        if wanted := self._job.step():
            self.show_job(context)
            if wanted == "RENDER":
                self._job.render(in_window=True)
            else:
                self._job.work.start()
            return {"RUNNING_MODAL"}
        self._job.close()
        return self._finish(context, self._job)

    def show_job(self, context) -> None:
        """Show what the job does."""
        self.show(context, report_text("Flexible Projection: {0}    Esc: cancel", self._job.progress))

    def give_up(self, _context):
        """Close the job. Blender may be rendering its scene as the extension is disabled."""
        type_registration.when_idle(self._job.close)

    def abandon(self, _context):
        """A timer closes the job if the file stays open."""
        job = self._job

        def close() -> float | None:
            if bpy.app.is_job_running("RENDER"):
                return TICK
            job.close()
            return None

        bpy.app.timers.register(close, first_interval=0.0)

    def _wanted(self, context):
        """The camera, frames and path. Raises USER_ERRORS."""
        camera, scene = chosen_camera(context, self.camera), context.scene
        take_up_edits(context)
        animated = getattr(self, "animation", False)
        frames = range(scene.frame_start, scene.frame_end + 1, scene.frame_step) if animated else ()
        return camera, frames, self.filepath or (scene.render.filepath if animated else "")

    def _finish(self, context, job: LayersJob):
        for warning in job.warnings:
            self.report({"WARNING"}, translated_report(warning))
        for space in image_editors(context.window_manager)[:1]:
            space.image = result_image()
        for text in filter(None, (job.outcome, self.told)):
            self.report({"INFO"}, text)
        # As after Render: without the option UNDO, whose redo panel would render at every change.
        if bpy.ops.ed.undo_push.poll():
            bpy.ops.ed.undo_push(message=self.bl_label)
        return {"FINISHED"}


# Events that reach Blender while the operator runs: views may be turned and windows be arranged.
PASSED = {"MOUSEMOVE", "MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "WINDOW_DEACTIVATE", "ESC"}


class SCFPF_OT_layers_render(OfFrames, PicturesRender, bpy.types.Operator):
    """Render the picture with its layers by Cycles, one render a layer; Esc cancels, the old picture stays"""

    bl_idname = "scfpf.layers_render"
    bl_label = "Render Layers with Cycles"
    bl_options = {"REGISTER"}

    def new_job(self, context, camera, frames, path):
        return LayersJob(context, camera, frames, path)


class SCFPF_OT_joined_render(OfEngine, OfFrames, PicturesRender, bpy.types.Operator):
    """Render by an engine that knows ordinary cameras only, and join the picture from a few of its renders;
    Esc cancels, the old picture stays"""

    bl_idname = "scfpf.joined_render"
    bl_label = "Render with Another Engine"
    bl_options = {"REGISTER"}

    def new_job(self, context, camera, frames, path):
        return AnchorsJob(context, camera, frames, path, RENDERERS[self.engine])


class SCFPF_OT_joined_plan(OfEngine, ModalJob, Action, bpy.types.Operator):
    """Find out how many renders of another engine the picture takes; Render uses the plan as long as camera,
    scene and size stay as they are"""

    bl_idname = "scfpf.joined_plan"
    bl_label = "Plan Renders"

    seconds = TICK
    canceled = PLAN_CANCELED

    camera: StringProperty(
        name="Camera",
        description="Name of the flexible camera; empty for the scene's camera, or else the active one",
        options={"SKIP_SAVE"},
    )

    @classmethod
    def poll(cls, context):
        return poll_flexible_camera(cls, context) and poll_no_render(cls, context)

    def invoke(self, context, _event):
        if not in_window(context):
            return self.execute(context)
        try:
            self._start(context)
        except USER_ERRORS as error:
            return refused(self, error)
        outcome = self.begin(context)
        self.show(context, report_text("Flexible Projection: reading the scene"))
        return outcome

    def act(self, context):
        self._start(context)
        try:
            while self._job.step():
                self._job.work.run()
        finally:
            self._job.close()
        return self._kept(context)

    def tick(self, context):
        if self._job.is_working:
            progress = self._job.work.progress
            self.show(
                context,
                report_text("Flexible Projection: {0}, {1:.0%}    Esc: cancel", self._job.text, progress),
            )
            return {"PASS_THROUGH"}
        if self._job.step():
            self._job.work.start()
            return {"RUNNING_MODAL"}
        note_edit()
        self._job.close()
        told = self._kept(context)
        self.report({"INFO"}, told)
        return {"FINISHED"}

    def respond(self, _context, event):
        # The plan is of the scene as it was.
        return {"PASS_THROUGH"} if event.type in PASSED else {"RUNNING_MODAL"}

    def give_up(self, _context):
        """Cancel the planning; the camera keeps its earlier plan."""
        self._job.close()

    def _start(self, context) -> None:
        """Begin to plan. Raises USER_ERRORS."""
        camera = chosen_camera(context, self.camera)
        if not camera.is_editable:
            raise UserError(LINKED, camera.name)
        take_up_edits(context)
        self._uid = camera.session_uid
        self._job = PlanJob(context, camera, RENDERERS[self.engine])

    def _kept(self, context) -> str:
        """Keep the plan on the camera; return what to report. Raises UserError."""
        plan, text, told = self._job.plan, "", report_text(ONE_RENDER)
        if plan is not None:
            text, told = plan.text, report_text(PLANNED, len(plan.anchors), plan.shown, plan.pixels)
        for warning in self._job.warnings:
            self.report({"WARNING"}, translated_report(warning))
        redraw_interface(context.window_manager)
        camera = object_by_uid(self._uid)
        if camera is None:
            raise UserError(LOST)
        # Both or none.
        times = times_text(camera.scfpf.anchor_times) if text else ""
        camera.scfpf.anchor_plan, camera.scfpf.anchor_times = text, times
        return told


register, unregister = bpy.utils.register_classes_factory(
    (SCFPF_OT_layers_render, SCFPF_OT_joined_render, SCFPF_OT_joined_plan)
)
