# SPDX-License-Identifier: GPL-3.0-or-later
"""Fit a volume to the resolution, after that was changed."""

import bpy

from ...scfpf_addon.bridge.camera.image_fit import fit_to_picture
from ...scfpf_addon.bridge.render.image_size import image_aspect
from ..common.tool import Tool


class SCFPF_OT_volume_fit_picture(Tool, bpy.types.Operator):
    """Fit the volume to the aspect of the resolution, so that nothing in the picture looks stretched"""

    bl_idname = "scfpf.volume_fit_picture"
    bl_label = "Fit to Resolution"

    def edit(self, context, camera):
        fit_to_picture(camera, context.evaluated_depsgraph_get(), image_aspect(context.scene))


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_volume_fit_picture,))
