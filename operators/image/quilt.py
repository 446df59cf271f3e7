# SPDX-License-Identifier: GPL-3.0-or-later
"""Render a quilt: a grid of views of one volume, for light-field and lenticular displays."""

import math

import bpy
import numpy as np
from bpy.props import FloatProperty, IntProperty

from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from ...scfpf_addon.bridge.render import render_job
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.bridge.render.quilt import Quilt, read_quilt
from ...scfpf_addon.bridge.render.result_image import keep_result, result_image, show_progress
from ...scfpf_addon.projection.user_error import UserError
from ..common.errors import refused
from ..common.modal_job import ModalJob, in_window
from ..common.scene_box import scene_boxes, transformed
from ..common.target import flexible_camera_of, poll_flexible, take_up_edits
from ..common.words import report_text, translated_report
from .image_editors import image_editors
from .preparation import poll_no_render, redraw_interface

# Seconds between two checks of the running job.
TICK = 0.2
# The least share of the distance to the middle of the things at which views meet.
NEAREST = 0.05


class SCFPF_OT_quilt(ModalJob, bpy.types.Operator):
    """Render a quilt of views from left to right into one picture, for light-field displays and lenticular
    prints; each view has the scene's resolution"""

    bl_idname = "scfpf.quilt"
    bl_label = "Render Quilt"
    bl_options = {"REGISTER"}

    seconds = TICK
    canceled = "Render canceled: the previous picture is unchanged"

    columns: IntProperty(name="Columns", description="Views side by side", default=8, min=1, max=64)
    rows: IntProperty(name="Rows", description="Rows of views, from the bottom up", default=6, min=1, max=64)
    cone: FloatProperty(
        name="View Cone",
        description="Angle between the first and the last view",
        default=math.radians(35.0),
        min=0.0,
        max=math.radians(120.0),
        subtype="ANGLE",
    )
    focus: FloatProperty(
        name="Focus",
        description="Distance from the camera of what seems to lie in the display; 0 for the scene's middle",
        default=0.0,
        min=0.0,
        subtype="DISTANCE",
    )

    @classmethod
    def poll(cls, context):
        return poll_flexible(cls, context) and poll_no_render(cls, context)

    def invoke(self, context, _event):
        self._is_asked = in_window(context)
        return context.window_manager.invoke_props_dialog(self) if self._is_asked else self.execute(context)

    def execute(self, context):
        try:
            self._read(context)
            if getattr(self, "_is_asked", False):
                self._next()
                return self.begin(context)
            while self._waiting:
                self._next()
                self._take_view()
            return self._deliver(context)
        except USER_ERRORS as error:
            render_job.forget()
            return refused(self, error)

    def tick(self, context):
        if self._job.running:
            done = self._quilt.count - len(self._waiting)
            self.show(context, report_text("SCFPF: view {0} of {1}    Esc: cancel", done, self._quilt.count))
            return {"PASS_THROUGH"}
        self._take_view()
        if self._waiting:
            self._next()
            return {"PASS_THROUGH"}
        return self._deliver(context)

    def respond(self, _context, _event):
        return {"PASS_THROUGH"}

    def give_up(self, _context):
        """End the view in the making; the old picture stays."""
        render_job.forget()

    def _read(self, context) -> None:
        """Read the views. Raises USER_ERRORS."""
        camera = flexible_camera_of(context)
        take_up_edits(context)
        self._quilt = Quilt(self.columns, self.rows, self.cone, self.focus or _middle(context, camera))
        self._waiting = read_quilt(context.scene, context.view_layer, camera, self._quilt)
        for warning in self._waiting[0].scene.warnings:
            self.report({"WARNING"}, translated_report(warning))
        if context.scene.render.use_motion_blur:
            self.report({"WARNING"}, "Motion blur is left out of quilts")
        settings = self._waiting[0].settings
        self._size = settings.width, settings.height
        shape = self._size[1] * self.rows, self._size[0] * self.columns, 4
        self._pixels = np.zeros(shape, np.float32)
        self._aspect = image_aspect(context.scene)

    def _next(self) -> None:
        """Start to render the next view. Raises UserError."""
        # The views share one scene, which is built once.
        self._job = render_job.start(self._waiting.pop(0), keep=True)

    def _take_view(self) -> None:
        """Wait for the view in the making, and put it into its place. Raises USER_ERRORS."""
        frame = self._job.result()
        render_job.stop()
        if frame is None:
            raise UserError("The render was canceled")
        place = self._quilt.place(self._quilt.count - len(self._waiting) - 1, self._size)
        self._pixels[place] = frame.pixels

    def _deliver(self, context):
        render_job.forget()
        show_progress(self._pixels)
        del self._pixels
        if warning := keep_result():
            self.report({"WARNING"}, translated_report(warning))
        for space in image_editors(context.window_manager)[:1]:
            space.image = result_image()
        ending = f"_qs{self.columns}x{self.rows}a{self._aspect:.2f}"
        self.report(
            {"INFO"}, report_text("Save it with {0} at the end of its name, for players of quilts", ending)
        )
        redraw_interface(context.window_manager)
        if bpy.ops.ed.undo_push.poll():
            bpy.ops.ed.undo_push(message=self.bl_label)
        return {"FINISHED"}


def _middle(context, camera) -> float:
    """The depth of the middle of the scene's things, or of the volume's own middle."""
    boxes = scene_boxes(context)
    inverse = camera.matrix_world.inverted_safe()
    if boxes is not None:
        depth = -float(transformed(inverse, boxes.things.centre[None])[0, 2])
        reach = float(np.linalg.norm(transformed(inverse, boxes.things.centre[None])[0]))
        if depth > NEAREST * reach:
            return depth
    return max(math.sqrt(camera.data.clip_start * camera.data.clip_end), 1e-6)


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_quilt,))
