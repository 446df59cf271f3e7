# SPDX-License-Identifier: GPL-3.0-or-later
"""Render pictures with layers by Cycles: render by render in a window, at once for scripts and farms."""

from __future__ import annotations

import bpy
from bpy.app.handlers import persistent
from bpy.props import BoolProperty, StringProperty

from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from ...scfpf_addon.bridge.render import type_registration
from ...scfpf_addon.bridge.render.result_image import result_image
from ...scfpf_addon.cycles.layers.layers_job import LayersJob, render_layers
from ..common import running
from ..common.errors import refused
from ..common.target import chosen_camera, take_up_edits
from ..common.words import report_text, translated_report
from ..image.image_editors import image_editors
from ..image.preparation import poll_no_render

# Seconds between two looks at Blender's render.
TICK = 0.1
WAIT = "Blender is rendering: wait for it, or press Esc to cancel it"

# Of the running operator: its job, and whether Blender's render was cancelled.
_jobs: list[LayersJob] = []
_cancelled: list[bool] = []


@persistent
def _note_cancel(*_) -> None:
    _cancelled.append(True)


class SCFPF_OT_layers_render(bpy.types.Operator):
    """Render the picture with its layers by Cycles, one render a layer; Esc cancels, the old picture stays"""

    bl_idname = "scfpf.layers_render"
    bl_label = "Render Layers with Cycles"
    bl_options = {"REGISTER"}

    camera: StringProperty(
        name="Camera",
        description="Name of the flexible camera; empty for the scene's camera, or else the active one",
        options={"SKIP_SAVE"},
    )
    animation: BoolProperty(
        name="Animation",
        description="Render all frames of the scene's range into files",
        default=False,
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
        if _jobs or bpy.app.is_job_running("RENDER"):
            cls.poll_message_set(WAIT)
            return False
        return poll_no_render(cls, context)

    def execute(self, context):
        try:
            job = render_layers(context, *self._wanted(context))
        except USER_ERRORS as error:
            return refused(self, error)
        return self._finish(context, job)

    def invoke(self, context, _event):
        if bpy.app.background or context.window is None:
            return self.execute(context)
        try:
            job = LayersJob(context, *self._wanted(context))
        except USER_ERRORS as error:
            return refused(self, error)
        _jobs.append(job)
        _cancelled.clear()
        bpy.app.handlers.render_cancel.append(_note_cancel)
        self._timer = context.window_manager.event_timer_add(TICK, window=context.window)
        self._workspaces = {context.workspace.name}
        context.window_manager.modal_handler_add(self)
        running.begin(self, context)
        context.workspace.status_text_set(report_text("SCFPF: reading the scene"))
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "ESC" and event.value == "PRESS":
            _note_cancel()
        if event.type != "TIMER":
            # Blender's own job sees Esc, too. Edits would show in some of the renders only.
            return {"PASS_THROUGH"} if event.type in PASSED else {"RUNNING_MODAL"}
        if bpy.app.is_job_running("RENDER"):
            return {"PASS_THROUGH"}
        job = _jobs[0]
        try:
            if _cancelled:
                self._leave(context)
                self.report({"INFO"}, "Render canceled: the previous picture is unchanged")
                return {"CANCELLED"}
            if job.step():
                context.workspace.status_text_set(report_text("SCFPF: {0}    Esc: cancel", job.progress))
                job.render(in_window=True)
                return {"RUNNING_MODAL"}
        except USER_ERRORS as error:
            self._leave(context)
            return refused(self, error)
        except Exception:
            self._leave(context)
            raise
        self._leave(context)
        return self._finish(context, job)

    def cancel(self, context):
        """Called when its window closes, a file is opened or Blender quits.

        The scene cannot be changed meanwhile: a timer does so if the file stays open.
        """
        job = _jobs[0]
        self._leave(context, is_closing=False)

        def close() -> float | None:
            if bpy.app.is_job_running("RENDER"):
                return TICK
            job.close()
            return None

        bpy.app.timers.register(close, first_interval=0.0)

    def disable(self, context):
        """Called when the extension is disabled: Blender may be rendering the scene to be removed."""
        job = _jobs[0]
        self._leave(context, is_closing=False)
        type_registration.when_idle(job.close)

    def _wanted(self, context):
        """The camera, frames and path. Raises USER_ERRORS."""
        camera, scene = chosen_camera(context, self.camera), context.scene
        take_up_edits(context)
        frames = range(scene.frame_start, scene.frame_end + 1, scene.frame_step) if self.animation else ()
        return camera, frames, self.filepath or (scene.render.filepath if self.animation else "")

    def _leave(self, context, is_closing: bool = True) -> None:
        """Remove what the operator has made in Blender and, closing the job, in the file."""
        context.window_manager.event_timer_remove(self._timer)
        if _note_cancel in bpy.app.handlers.render_cancel:
            bpy.app.handlers.render_cancel.remove(_note_cancel)
        for name in self._workspaces:
            if (workspace := bpy.data.workspaces.get(name)) is not None:
                workspace.status_text_set(None)
        jobs, _jobs[:] = [*_jobs], []
        running.end(self)
        for job in jobs if is_closing else ():
            job.close()

    def _finish(self, context, job: LayersJob):
        for warning in job.warnings:
            self.report({"WARNING"}, translated_report(warning))
        for space in image_editors(context.window_manager)[:1]:
            space.image = result_image()
        if job.outcome:
            self.report({"INFO"}, job.outcome)
        # As after Render: without the option UNDO, whose redo panel would render at every change.
        if bpy.ops.ed.undo_push.poll():
            bpy.ops.ed.undo_push(message="SCFPF Layers")
        return {"FINISHED"}


# Events that reach Blender while the operator runs: views may be turned and windows be arranged.
PASSED = {"MOUSEMOVE", "MIDDLEMOUSE", "WHEELUPMOUSE", "WHEELDOWNMOUSE", "WINDOW_DEACTIVATE", "ESC"}


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_layers_render,))
