# SPDX-License-Identifier: GPL-3.0-or-later
"""The Edit Volume mode of a flexible camera."""

import bpy

from ..scfpf_addon.bridge.edit_volume import set_edit_volume
from .errors import BAD_INPUT
from .surfaces import poll_slot
from .target import flexible_camera_of


class SCFPF_OT_edit_volume(bpy.types.Operator):
    """Show this camera's control surfaces in front of the scene and let them be clicked, or end that"""

    bl_idname = "scfpf.edit_volume"
    bl_label = "Edit Volume"
    bl_options = {"REGISTER", "UNDO"}

    poll = classmethod(poll_slot)

    def execute(self, context):
        camera = flexible_camera_of(context)
        settings = camera.scfpf
        try:
            set_edit_volume(camera, not settings.edit_volume)
        except BAD_INPUT as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if not settings.edit_volume and context.object in [slot.object for slot in settings.surfaces]:
            # What cannot be clicked is no longer selected: the camera takes over, and its panels stay.
            context.object.select_set(False)
            context.view_layer.objects.active = camera
            camera.select_set(True)
        return {"FINISHED"}


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_edit_volume,))
