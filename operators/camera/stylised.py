# SPDX-License-Identifier: GPL-3.0-or-later
"""Apply a ready-made style to a scene's Drawn Style."""

import bpy
from bpy.props import BoolProperty, EnumProperty

from ...scfpf_addon.bridge.blender.unstored_edits import note_edit
from ...scfpf_addon.bridge.settings.stylised_styles import STYLES, apply_style
from ..common.target import poll_scene


class SCFPF_OT_drawn_style(bpy.types.Operator):
    """Switch Drawn Style on with all settings of a style"""

    bl_idname = "scfpf.drawn_style"
    bl_label = "Drawn Style"
    bl_options = {"REGISTER", "UNDO"}

    style: EnumProperty(
        name="Style",
        description="The style to apply",
        items=[(identifier, style.name, style.description) for identifier, style in STYLES.items()],
        default="PAPER",
    )
    plain_view: BoolProperty(
        name="Standard View",
        description="Set the scene's view transform to Standard, which shows white paper as white; "
        "others make it gray",
        default=True,
    )

    poll = classmethod(poll_scene)

    @classmethod
    def description(cls, _context, properties):
        return STYLES[properties.style].description

    def execute(self, context):
        note_edit()
        apply_style(context.scene, self.style, self.plain_view)
        return {"FINISHED"}


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_drawn_style,))
