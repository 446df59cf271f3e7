# SPDX-License-Identifier: GPL-3.0-or-later
"""Add the scene of the tutorial."""

import bpy

from ...scfpf_addon.bridge.blender.all_or_nothing import keep
from ...scfpf_addon.bridge.render.tutorial_scene import BLOCK_SIZE, BLOCKS, new_tutorial_scene
from ..common.target import poll_object_mode
from ..common.tool import Action
from ..common.words import report_text


class SCFPF_OT_tutorial_scene(Action, bpy.types.Operator):
    """Add a new scene with the towers of the tutorial, and show it in this window"""

    bl_idname = "scfpf.tutorial_scene"
    bl_label = "Tutorial Scene"

    poll = classmethod(poll_object_mode)

    def act(self, context):
        scene = new_tutorial_scene()
        if context.space_data is not None and context.space_data.type == "VIEW_3D":
            if context.space_data.local_view is not None:
                bpy.ops.view3d.localview(frame_selected=False)
            view = context.space_data.region_3d
            view.view_perspective = "PERSP"
            view.view_location, view.view_distance = (0.0, 0.0, 0.0), 1.5 * BLOCKS * BLOCK_SIZE
        if context.window is not None:
            keep(context.window, "scene")
            context.window.scene = scene
        return report_text(
            "The scene '{0}' is new: add a flexible camera to it with Add > Camera", scene.name
        )


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_tutorial_scene,))
