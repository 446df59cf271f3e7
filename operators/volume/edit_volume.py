# SPDX-License-Identifier: GPL-3.0-or-later
"""The Edit Volume mode of a flexible camera."""

import bpy

from ...scfpf_addon.bridge.volume.edit_mode import set_edit_volume
from ..common.tool import Tool
from .surfaces import poll_slot


class SCFPF_OT_edit_volume(Tool, bpy.types.Operator):
    """Show this camera's control surfaces in front of the scene and make them selectable; press again to
    end that"""

    bl_idname = "scfpf.edit_volume"
    bl_label = "Edit Volume"

    poll = classmethod(poll_slot)

    def edit(self, context, camera):
        settings = camera.scfpf
        set_edit_volume(camera, not settings.edit_volume)
        # An empty slot is no active object.
        surfaces = {slot.object for slot in settings.surfaces} - {None}
        if not settings.edit_volume and context.object in surfaces:
            # What cannot be clicked is no longer selected: the camera takes over, and its panels stay.
            context.object.select_set(False)
            context.view_layer.objects.active = camera
            camera.select_set(True)


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_edit_volume,))
