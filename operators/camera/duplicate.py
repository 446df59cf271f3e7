# SPDX-License-Identifier: GPL-3.0-or-later
"""Duplicate a flexible camera with its control surfaces, as Blender duplicates a rig."""

import bpy

from ...scfpf_addon.bridge.blender.all_or_nothing import Kept
from ...scfpf_addon.bridge.camera.volume_edits import make_single_user
from ...scfpf_addon.projection.user_error import UserError
from ..common.target import selected_objects
from ..common.tool import Tool, wholly_made


class SCFPF_OT_camera_duplicate(Tool, bpy.types.Operator):
    """Duplicate the camera together with its control surfaces, which a copy by Shift-D would share, and
    move the copy"""

    bl_idname = "scfpf.camera_duplicate"
    bl_label = "Duplicate Flexible Camera"

    def invoke(self, context, _event):
        done = self.execute(context)
        if done == {"FINISHED"} and context.area is not None and context.area.type == "VIEW_3D":
            bpy.ops.transform.translate("INVOKE_DEFAULT")
        return done

    def edit(self, context, camera):
        originals = [camera, *(slot.object for slot in camera.scfpf.surfaces if slot.object is not None)]
        if not camera.visible_get():
            raise UserError("'{0}' is hidden: show it in the Outliner first", camera.name)
        with wholly_made(context):
            self._duplicate(context, camera, originals)

    def _duplicate(self, context, camera, originals: list) -> None:
        for obj in selected_objects(context):
            obj.select_set(False)
        for obj in originals:
            # Hidden surfaces cannot be selected; ``make_single_user`` copies them.
            if obj.name in context.view_layer.objects:
                obj.select_set(True)
        context.view_layer.objects.active = camera
        hidden = [obj for obj in originals if obj.hide_select and obj.is_editable]
        with Kept() as kept:
            for obj in hidden:
                kept.keep(obj, "hide_select")
                obj.hide_select = False
            bpy.ops.object.duplicate(linked=False)
        copy = context.view_layer.objects.active
        make_single_user(copy)
        for obj in selected_objects(context):
            obj.select_set(obj == copy)


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_camera_duplicate,))
