# SPDX-License-Identifier: GPL-3.0-or-later
"""Render an image through a flexible camera, and show it."""

import time

import bpy
from bpy.props import StringProperty

from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid
from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from ...scfpf_addon.bridge.render import render_job
from ...scfpf_addon.bridge.render.result_image import (
    discard_progress,
    keep_result,
    only_in_memory,
    result_image,
    show_progress,
)
from ..common.errors import refused
from ..common.modal_job import ModalJob, in_window
from ..common.target import chosen_camera
from ..common.words import report_text, translated_report
from .image_editors import image_editors, open_image_editor
from .preparation import poll_no_render, prepared_inputs, redraw_interface

# Seconds between two checks of the running job.
TICK = 0.2
# Seconds between two updates of the image in the making: passing one of 4K to Blender takes a tenth.
IMAGE_TICK = 0.5


class SCFPF_OT_render(ModalJob, bpy.types.Operator):
    """Render a picture through the flexible camera into an image; Esc cancels and keeps the old picture"""

    bl_idname = "scfpf.render"
    bl_label = "Render Flexible Camera"
    bl_options = {"REGISTER"}

    seconds = TICK

    camera: StringProperty(
        name="Camera",
        description="Name of the flexible camera; empty for the scene's camera, or else the active one",
        options={"SKIP_SAVE"},
    )

    poll = classmethod(poll_no_render)

    def execute(self, context):
        try:
            self._start(context, with_tiles=False)
            return self._deliver(context)
        except USER_ERRORS as error:
            return refused(self, error)

    def invoke(self, context, _event):
        if not in_window(context):
            return self.execute(context)
        try:
            self._start(context, with_tiles=True)
        except USER_ERRORS as error:
            return refused(self, error)
        self._image_time = time.monotonic()
        self._is_image_shown = False
        self._may_open = True
        outcome = self.begin(context)
        self.ends.callback(_redraw)
        self._show_progress(context)
        return outcome

    def escape(self, context):
        if self._job.cancelled:
            return {"PASS_THROUGH"}
        self._job.cancel()
        self._show_progress(context)
        return {"RUNNING_MODAL"}

    def respond(self, _context, _event):
        return {"PASS_THROUGH"}

    def tick(self, context):
        if self._job.running or self._may_open:
            # Not in invoke, which a button of the replaced editor may have called, and not in the last
            # call: Blender ignores that an operator has finished if it opens a window.
            self._open_editor(context)
            self._show_progress(context)
            self._show_image(context)
            return {"PASS_THROUGH"}
        self.leave()
        return self._deliver(context)

    def give_up(self, _context):
        """End the job and bring the old picture back."""
        render_job.stop()
        if self._is_image_shown:
            discard_progress()

    def _start(self, context, with_tiles: bool) -> None:
        """Read the inputs and start the job. Raises USER_ERRORS."""
        camera = chosen_camera(context, self.camera)
        self._camera_uid = camera.session_uid
        inputs = prepared_inputs(context, camera)
        keep = context.scene.render.use_persistent_data
        self._job = render_job.start(inputs, with_tiles, keep)
        for warning in inputs.scene.warnings:
            self.report({"WARNING"}, translated_report(warning))

    def _deliver(self, context):
        """Write the finished image; nothing changes if the job was cancelled or has failed.

        Raises USER_ERRORS.
        """
        try:
            frame = self._job.result()
        finally:
            render_job.stop()
        if frame is None:
            self.report({"INFO"}, "Render canceled: the previous picture is unchanged")
            return {"CANCELLED"}
        show_progress(frame.pixels)
        outcome, statistics = frame.report.outcome(), frame.report.statistics()
        # Blender has the pixels. Packing takes as much memory again, and the job holds them, too.
        del frame, self._job
        warning = keep_result()
        if warning:
            self.report({"WARNING"}, translated_report(warning))
        camera = object_by_uid(self._camera_uid)
        if camera is not None and camera.is_editable:
            camera.scfpf.report, camera.scfpf.statistics = outcome, statistics
        editors = image_editors(context.window_manager)
        if editors:
            editors[0].image = result_image()
            self.report({"INFO"}, outcome)
        else:
            self.report({"INFO"}, report_text("{0}. Show Picture, the icon beside Render, opens it", outcome))
        # The operator has no UNDO option, whose redo panel would render again at every change.
        if bpy.ops.ed.undo_push.poll():
            bpy.ops.ed.undo_push(message="Render Flexible Camera")
        return {"FINISHED"}

    def _show_progress(self, context):
        percent = int(100 * self._job.progress)
        text = report_text("Flexible Projection: rendering, {0} %    Esc: cancel", percent)
        if self._job.building:
            text = "Flexible Projection: building the acceleration structure, which cannot be canceled"
        elif self._job.cancelled:
            text = "Flexible Projection: canceling"
        if self.show(context, text):
            _redraw()

    def _open_editor(self, context):
        """Open an Image Editor as F12 would, once, and let Esc cancel in its window, too."""
        if not self._may_open:
            return
        self._may_open = False
        window = open_image_editor(context)
        if window is None or window == context.window:
            return
        with context.temp_override(window=window):
            # A render that is done before the first tick cannot be cancelled.
            if bpy.ops.scfpf.render_escape.poll():
                bpy.ops.scfpf.render_escape("INVOKE_DEFAULT")

    def _show_image(self, context):
        """Show the tiles so far, unless another image would be replaced: cancelling restores everything."""
        if time.monotonic() - self._image_time < IMAGE_TICK or self._job.cancelled:
            return
        if not self._is_image_shown and only_in_memory():
            return
        editors = image_editors(context.window_manager)
        if not editors or editors[0].image not in (None, result_image()):
            return
        tiles = self._job.new_tiles()
        if tiles is not None:
            editors[0].image = show_progress(tiles)
            self._is_image_shown = True
            self._image_time = time.monotonic()


def _redraw() -> None:
    redraw_interface(bpy.context.window_manager)


class SCFPF_OT_render_cancel(bpy.types.Operator):
    """Cancel the render; the old picture stays as it was"""

    bl_idname = "scfpf.render_cancel"
    bl_label = "Cancel Render"
    bl_options = {"INTERNAL"}

    @classmethod
    def poll(cls, _context):
        return render_job.current() is not None

    def execute(self, _context):
        job = render_job.current()
        if job is not None:
            job.cancel()
        return {"FINISHED"}


class SCFPF_OT_render_escape(ModalJob, bpy.types.Operator):
    """Let Esc in the window that shows the render cancel it"""

    bl_idname = "scfpf.render_escape"
    bl_label = "Cancel Render by Esc"
    bl_options = {"INTERNAL"}

    seconds = TICK

    poll = SCFPF_OT_render_cancel.poll

    def invoke(self, context, _event):
        return self.begin(context)

    def escape(self, context):
        job = render_job.current()
        if job is None or job.cancelled:
            return self.tick(context)
        job.cancel()
        return {"RUNNING_MODAL"}

    def respond(self, context, _event):
        return self.tick(context)

    def tick(self, _context):
        return {"PASS_THROUGH"} if render_job.current() is not None else {"FINISHED", "PASS_THROUGH"}


class SCFPF_OT_result_show(bpy.types.Operator):
    """Show the last picture: in an open Image Editor, or else where F12 would show its own"""

    bl_idname = "scfpf.result_show"
    bl_label = "Show Picture"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, _context):
        if result_image() is None:
            cls.poll_message_set("There is no picture yet: press Render first")
            return False
        return True

    def execute(self, context):
        if bpy.app.background:
            self.report(
                {"ERROR"}, "Blender runs in the background: open the file in a window to see the picture"
            )
            return {"CANCELLED"}
        open_image_editor(context)
        editors = image_editors(context.window_manager)
        if not editors:
            bpy.ops.wm.window_new()
            area = context.window_manager.windows[-1].screen.areas[0]
            area.ui_type = "IMAGE_EDITOR"
            editors = [area.spaces.active]
        editors[0].image = result_image()
        return {"FINISHED"}


_register_classes, _unregister_classes = bpy.utils.register_classes_factory(
    (SCFPF_OT_render, SCFPF_OT_render_cancel, SCFPF_OT_render_escape, SCFPF_OT_result_show)
)


register = _register_classes


def unregister():
    # Before the classes are removed, because their thread may still be at work.
    render_job.forget()
    _unregister_classes()
