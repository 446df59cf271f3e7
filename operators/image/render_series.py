# SPDX-License-Identifier: GPL-3.0-or-later
"""The base of operators whose one picture takes several renders by the caster, each of a part of it."""

from __future__ import annotations

import time
from collections.abc import Iterator

import bpy
import numpy as np

from ...scfpf_addon.bridge.blender.scene_objects import object_by_uid
from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from ...scfpf_addon.bridge.render import render_job
from ...scfpf_addon.bridge.render.render_inputs import RenderInputs
from ...scfpf_addon.bridge.render.result_image import keep_result, result_image, show_progress
from ...scfpf_addon.projection.user_error import UserError
from ...scfpf_addon.shading.typing import Single
from ..common.errors import failed, refused
from ..common.modal_job import ModalJob, in_window
from ..common.target import flexible_camera_of, poll_flexible, take_up_edits
from ..common.words import report_text, translated_report
from .image_editors import image_editors
from .preparation import poll_no_render, redraw_interface

# Seconds between two checks of the running job.
TICK = 0.2


class RenderSeries(ModalJob):
    """An operator that asks for its properties in a window, then renders part by part.

    Those have ``plan``, ``parts`` and ``paste``; ``told`` is reported at the end. keeps_scene: whether the
    parts share one scene, which then is built once.
    """

    seconds = TICK
    canceled = "Render canceled: the previous picture is unchanged"
    keeps_scene = False
    told = ""

    @classmethod
    def poll(cls, context):
        return poll_flexible(cls, context) and poll_no_render(cls, context)

    def plan(self, context) -> tuple[int, tuple[int, int]]:
        """Return the number of parts, and width and height of the picture. Raises USER_ERRORS."""
        raise NotImplementedError

    def parts(self, context) -> Iterator[RenderInputs]:
        """Yield the inputs of each part when it is to be rendered. Raises USER_ERRORS."""
        raise NotImplementedError

    def paste(self, number: int, pixels: Single) -> None:
        """Put the pixels of a part into ``self.picture``, (H, W, 4) float32."""
        raise NotImplementedError

    def invoke(self, context, _event):
        self._is_asked = in_window(context)
        return context.window_manager.invoke_props_dialog(self) if self._is_asked else self.execute(context)

    def execute(self, context):
        try:
            take_up_edits(context)
            self._camera, self._begun = flexible_camera_of(context).session_uid, time.monotonic()
            self._count, (width, height) = self.plan(context)
            self.picture: Single = np.zeros((height, width, 4), np.float32)
            self._done, self._parts = 0, self.parts(context)
            if getattr(self, "_is_asked", False):
                self._next()
                return self.begin(context)
            while self._next():
                self._take_part()
            return self._deliver(context)
        except USER_ERRORS as error:
            render_job.forget()
            return refused(self, error)
        except Exception as error:
            render_job.forget()
            return failed(self, error)

    def tick(self, context):
        if self._job.running:
            text = report_text(
                "Flexible Projection: part {0} of {1}    Esc: cancel", self._done + 1, self._count
            )
            self.show(context, text)
            return {"PASS_THROUGH"}
        self._take_part()
        return {"PASS_THROUGH"} if self._next() else self._deliver(context)

    def respond(self, _context, _event):
        return {"PASS_THROUGH"}

    def give_up(self, _context):
        """End the part in the making; the old picture stays."""
        render_job.forget()

    def _next(self) -> bool:
        """Start to render the next part; return whether there is one. Raises USER_ERRORS."""
        inputs = next(self._parts, None)
        if inputs is None:
            return False
        if not self._done:
            for warning in inputs.scene.warnings:
                self.report({"WARNING"}, translated_report(warning))
        self._job = render_job.start(inputs, keep=self.keeps_scene)
        return True

    def _take_part(self) -> None:
        """Wait for the part in the making, and put it into its place. Raises USER_ERRORS."""
        frame = self._job.result()
        render_job.stop()
        if frame is None:
            raise UserError("The render was canceled")
        self.paste(self._done, frame.pixels)
        self._done += 1

    def _deliver(self, context):
        render_job.forget()
        show_progress(self.picture)
        height, width = self.picture.shape[:2]
        del self.picture
        camera = object_by_uid(self._camera)
        if camera is not None and camera.is_editable:
            seconds = time.monotonic() - self._begun
            camera.scfpf.report = report_text(
                "{0}×{1} in {2:.2f} s, {3} parts", width, height, seconds, self._done
            )
        if warning := keep_result():
            self.report({"WARNING"}, translated_report(warning))
        for space in image_editors(context.window_manager)[:1]:
            space.image = result_image()
        if self.told:
            self.report({"INFO"}, self.told)
        redraw_interface(context.window_manager)
        if bpy.ops.ed.undo_push.poll():
            bpy.ops.ed.undo_push(message=self.bl_label)
        return {"FINISHED"}
