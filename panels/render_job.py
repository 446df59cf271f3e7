# SPDX-License-Identifier: GPL-3.0-or-later
"""The button of render jobs, at the end of Blender's panel Output."""

import bpy

from ..scfpf_addon.bridge.blender.rig_mark import camera_behind


def draw_export(self, context):
    """Draw the button for scenes whose camera is flexible."""
    camera = camera_behind(context.scene.camera)
    if camera is not None and camera.scfpf.enabled:
        self.layout.operator("scfpf.render_job_export", icon="EXPORT")


def register():
    bpy.types.RENDER_PT_output.append(draw_export)


def unregister():
    bpy.types.RENDER_PT_output.remove(draw_export)
