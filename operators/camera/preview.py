# SPDX-License-Identifier: GPL-3.0-or-later
"""The nodes preview: switch it on and off, and show its viewport."""

import bpy

from ...scfpf_addon.bridge.camera.flexible_camera import control_objects
from ...scfpf_addon.bridge.camera.read_projection import read_projection
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ...scfpf_addon.bridge.render.render_errors import reason
from ...scfpf_addon.scanline.preview.preview import show, switch_off, switch_on
from ...scfpf_addon.scanline.preview.preview_data import is_flat, preview_of
from ...scfpf_addon.scanline.preview.preview_viewports import viewports_of
from ..common.errors import BAD_INPUT, refused
from ..common.target import camera_of, poll_flexible_camera_in_any_mode
from ..common.tool import Action, plain

FLAT = (
    "The nodes preview cannot show this volume, which is flat: all its projectors lie in one surface. "
    "Press Render instead"
)


class SCFPF_OT_preview_toggle(bpy.types.Operator):
    """Show the flexible camera's picture in a second viewport, by Geometry Nodes, in Solid or Material
    Preview shading; press again to remove it. Lights have no effect, and highlights follow the camera's axis.
    Hidden objects that render are shown; hair, points, particles and Grease Pencil are not. Materials that
    are linked to objects are ignored"""

    bl_idname = "scfpf.preview_toggle"
    bl_label = "Nodes Preview"
    bl_options = {"REGISTER", "UNDO"}

    poll = classmethod(poll_flexible_camera_in_any_mode)

    @classmethod
    def description(cls, context, _properties):
        depsgraph, own = context.evaluated_depsgraph_get(), control_objects()
        shown = (instance.object for instance in depsgraph.object_instances)
        faces = sum(
            len(obj.data.polygons) for obj in shown if obj.type == "MESH" and obj.name_full not in own
        )
        return f"{plain(cls.__doc__)}.\n\nPrice: the nodes place {faces:,} faces anew after each change"

    def execute(self, context):
        camera = camera_of(context)
        source = preview_of(camera, context.scene)
        if source is not None and source.scfpf_preview.view_layer == context.view_layer.name:
            switch_off(source)
            return {"FINISHED"}
        if source is not None:
            # A preview of another view layer is replaced.
            switch_off(source)
        try:
            source = switch_on(context, camera)
        except BAD_INPUT as error:
            return refused(self, error)
        depsgraph = context.evaluated_depsgraph_get()
        try:
            read_projection(camera, depsgraph, image_aspect(context.scene))
        except BAD_INPUT as error:
            # The preview stays and follows as soon as the volume is valid.
            self.report({"WARNING"}, reason(error))
        else:
            if is_flat(source, depsgraph):
                self.report({"WARNING"}, FLAT)
        if bpy.app.background:
            self.report(
                {"INFO"}, "The nodes preview is ready: open the file in a Blender with a window to see it"
            )
        return {"FINISHED"}


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
