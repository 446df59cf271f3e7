# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Look Behind: the list of what the picture hides, and the buttons that show it."""

import bpy

from .base import Subsection, draw_lines, section_panels

# The ways to show a hidden thing, with their buttons' texts and icons.
WAYS = (("VIEW", "Add View", "VIEW_CAMERA"), ("LAYER", "Add Layer", "RENDERLAYERS"))


class SCFPF_UL_hidden(bpy.types.UIList):
    """The things that the picture hides"""

    def draw_item(self, _context, layout, data, item, _icon, _active_data, _active_property, index):
        row = layout.row(align=True)
        row.label(text=item.name, translate=False)
        right = row.row(align=True)
        right.alignment = "RIGHT"
        right.label(text=f"{item.share * item.hidden:.1%}".replace("%", " %"), translate=False)
        way, _text, icon = WAYS[0]
        button = right.operator("scfpf.hidden_show", text="", icon=icon, emboss=False)
        button.way, button.camera, button.index = way, data.id_data.name, index


class _LookBehindSection(Subsection):
    bl_label = "Look Behind"
    # Above the lists of Aim and of Layers, which grow when its buttons are pressed.
    bl_order = 0
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, _context, camera, settings):
        layout = self.layout
        layout.operator("scfpf.look_behind", icon="VIEWZOOM")
        if settings.hidden_message:
            draw_lines(layout, [settings.hidden_message])
        rows = settings.hidden_things
        if not len(rows):
            return
        layout.template_list(
            "SCFPF_UL_hidden", "", settings, "hidden_things", settings, "active_hidden", rows=4
        )
        if settings.active_hidden < len(rows):
            draw_lines(layout, rows[settings.active_hidden].message.split(" · "), height=1.0)
        buttons = layout.row(align=True)
        for way, text, icon in WAYS:
            button = buttons.operator("scfpf.hidden_show", text=text, icon=icon)
            button.way, button.camera = way, camera.name


register, unregister = bpy.utils.register_classes_factory(
    (SCFPF_UL_hidden, *section_panels(_LookBehindSection, "look_behind"))
)
