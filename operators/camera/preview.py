# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes preview: switch it on and off, and show its viewport."""

import bpy

from ...scfpf_addon.bridge.blender.unstored_edits import note_edit
from ...scfpf_addon.bridge.blender.user_errors import USER_ERRORS
from ...scfpf_addon.bridge.camera.read_projection import read_projection
from ...scfpf_addon.bridge.layers.read_image_layers import not_here
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.scanline.preview import preview_building
from ...scfpf_addon.scanline.preview.preview import moved, show, switch_off, switched_on
from ...scfpf_addon.scanline.preview.preview_data import is_flat, preview_of
from ...scfpf_addon.scanline.preview.preview_viewports import viewports_of
from ..common.errors import failed, refused
from ..common.modal_job import NOTHING_CHANGED, ModalJob, in_window
from ..common.target import camera_of, poll_flexible_camera_in_any_mode
from ..common.tool import Action, plain
from ..common.words import report_text, translated_report

FLAT = (
    "The nodes preview cannot show this volume, which is flat: all its projectors lie in one surface. "
    "Press Render instead"
)


class SCFPF_OT_preview_toggle(ModalJob, bpy.types.Operator):
    """Show the flexible camera's picture in a second viewport, by Geometry Nodes, in Solid or Material
    Preview shading, or remove it: lights have no effect, hidden objects that render are shown, and hair,
    points, particles, Grease Pencil and materials linked to objects are left out"""

    bl_idname = "scfpf.preview_toggle"
    bl_label = "Nodes Preview"
    bl_options = {"REGISTER", "UNDO"}

    # Between two steps, in which Blender shows the progress and handles the Esc key.
    seconds = 0.01
    canceled = NOTHING_CHANGED

    poll = classmethod(poll_flexible_camera_in_any_mode)

    @classmethod
    def description(cls, context, _properties):
        price = preview_building.price(context.view_layer, context.evaluated_depsgraph_get())
        return f"{plain(cls.__doc__)}.\n\nPrice: {price}"

    def invoke(self, context, _event):
        camera = camera_of(context)
        is_on = preview_of(camera, context.scene) is not None
        if is_on or preview_building.is_built() or not in_window(context):
            return self.execute(context)
        self._building, self._camera = preview_building.Building(camera), camera.name
        outcome = self.begin(context)
        self._show_progress(context)
        return outcome

    def tick(self, context):
        more = self._building.step()
        self._show_progress(context)
        if more:
            return {"RUNNING_MODAL"}
        self.leave()
        # A modal operator's context lacks the camera of the button's panel.
        camera = context.scene.objects.get(self._camera)
        return self._switch(context, camera) if camera is not None else {"CANCELLED"}

    def give_up(self, _context):
        """Remove the groups that are built."""
        self._building.give_up()

    def abandon(self, _context):
        """Leave the groups that are built: the file cannot be changed meanwhile."""

    def _show_progress(self, context) -> None:
        share = self._building.progress
        text = report_text("{0}: {1} % of the node groups    Esc: cancel", self.bl_label, round(100 * share))
        self.show(context, text, share)

    def execute(self, context):
        return self._switch(context, camera_of(context))

    def _switch(self, context, camera):
        note_edit()
        source = preview_of(camera, context.scene)
        try:
            if source is not None and source.scfpf_preview.view_layer == context.view_layer.name:
                switch_off(source)
                return {"FINISHED"}
            # That of another view layer is moved.
            is_new = source is None
            with switched_on(context, camera) if is_new else moved(context, source) as source:
                texts = self._cautions(context, camera, source)
        except USER_ERRORS as error:
            return refused(self, error)
        except Exception as error:
            return failed(self, error)
        for text in texts:
            self.report({"WARNING"}, text)
        if bpy.app.background:
            self.report(
                {"INFO"}, "The nodes preview is ready: open the file in a Blender with a window to see it"
            )
        return {"FINISHED"}

    def _cautions(self, context, camera, source) -> list[str]:
        """Warnings about a new preview."""
        found, depsgraph = [], context.evaluated_depsgraph_get()
        try:
            read_projection(camera, depsgraph, image_aspect(context.scene))
        except USER_ERRORS as error:
            # The preview stays and follows as soon as the volume is valid.
            found.append(translated_report(error))
        else:
            if is_flat(source, depsgraph):
                found.append(FLAT)
        if text := not_here(camera):
            found.append(translated_report(text))
        return found


class SCFPF_OT_preview_show(Action, bpy.types.Operator):
    """Open the viewport of the nodes preview again"""

    bl_idname = "scfpf.preview_show"
    bl_label = "Show Nodes Preview"
    bl_options = {"REGISTER"}

    @classmethod
    def poll(cls, context):
        camera = camera_of(context)
        source = preview_of(camera, context.scene) if camera is not None else None
        if source is None or context.window is None:
            cls.poll_message_set("The camera has no nodes preview: press Nodes first")
            return False
        if viewports_of(source):
            cls.poll_message_set("A viewport already shows the nodes preview")
            return False
        return True

    def act(self, context):
        show(context, preview_of(camera_of(context), context.scene))


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_preview_toggle, SCFPF_OT_preview_show))
