# SPDX-License-Identifier: GPL-3.0-or-later
"""Apply a ready-made style to a scene's Drawn Style."""

import bpy
from bpy.props import BoolProperty, EnumProperty

from ...scfpf_addon.bridge.blender.all_or_nothing import keep
from ...scfpf_addon.bridge.settings.stylised_styles import STYLES, apply_style
from ..common.target import poll_scene
from ..common.tool import Action


class SCFPF_OT_drawn_style(Action, bpy.types.Operator):
    """Switch Drawn Style on with all settings of a style"""

    bl_idname = "scfpf.drawn_style"
    bl_label = "Drawn Style"

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

    def act(self, context):
        keep(context.scene.scfpf_drawn)
        keep(context.scene.view_settings, "view_transform", "look")
        apply_style(context.scene, self.style, self.plain_view)


register, unregister = bpy.utils.register_classes_factory((SCFPF_OT_drawn_style,))
