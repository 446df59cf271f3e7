# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Layers: the collections that other cameras see in the picture, and the settings of one."""

import bpy

from ..scfpf_addon.bridge.layers.read_image_layers import lacking
from .base import Subsection, section_panels

# Sizes of the picture of layers and of the color of one, in units of Blender's interface.
PICTURE, SWATCH = 9.0, 0.8


class SCFPF_UL_layers(bpy.types.UIList):
    """The layers of the picture, the first one on top"""

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property, _index):
        row = layout.row(align=True)
        row.active = item.is_on
        # A row has no room for the panel's split into name and value.
        row.use_property_split = row.use_property_decorate = False
        row.prop(item, "name", text="", emboss=False, icon="ERROR" if lacking(item) else "RENDERLAYERS")
        if item.is_on and item.share >= 0.0:
            right = row.row()
            right.alignment = "RIGHT"
            right.alert = item.share == 0.0
            right.label(text=f"{item.share:.1%}".replace("%", " %"))
        color = row.row()
        color.ui_units_x = SWATCH
        color.prop(item, "color", text="")
        icon = "CHECKBOX_HLT" if item.is_on else "CHECKBOX_DEHLT"
        row.prop(item, "is_on", text="", emboss=False, icon=icon)


class _LayersSection(Subsection):
    bl_label = "Layers"
    bl_order = 2
    # Its button makes an ordinary camera flexible.
    takes_ordinary = True

    def draw_settings(self, _context, camera, settings):
        layout = self.layout
        if not (settings.enabled and len(settings.layers)):
            layout.operator("scfpf.layer_add", icon="RENDERLAYERS")
            return
        row = layout.row()
        row.template_list(
            "SCFPF_UL_layers", "", settings, "layers", settings, "active_layer", rows=4, sort_lock=True
        )
        column = row.column(align=True)
        column.operator("scfpf.layer_add", text="", icon="ADD")
        column.operator("scfpf.layer_remove", text="", icon="REMOVE")
        column.separator()
        column.operator("scfpf.layer_move", text="", icon="TRIA_UP").direction = "UP"
        column.operator("scfpf.layer_move", text="", icon="TRIA_DOWN").direction = "DOWN"
        if settings.active_layer < len(settings.layers):
            draw_layer(layout, settings.layers[settings.active_layer])
        row = layout.row(align=True)
        row.operator("scfpf.layers_render", icon="SHADING_RENDERED").camera = camera.name
        animation = row.operator("scfpf.layers_render", text="", icon="RENDER_ANIMATION")
        animation.camera, animation.animation = camera.name, True
        layout.operator("scfpf.layer_check", icon="VIEWZOOM")
        draw_picture(layout, settings.layer_image)


def draw_picture(layout, image) -> None:
    """Draw the picture of layers small, and the button that shows it in an Image Editor."""
    if image is None:
        return
    box = layout.box()
    box.template_icon(icon_value=box.icon(image), scale=PICTURE)
    box.operator("scfpf.layer_image_show", icon="IMAGE_DATA")


def draw_layer(layout, layer) -> None:
    """Draw the settings of a layer."""
    layout.operator("scfpf.layer_drag", icon="VIEW_PAN")
    column = layout.column()
    column.active = layer.is_on
    for name in ("collection", "camera", "position", "size", "front"):
        column.prop(layer, name)
    header, border = layout.panel("scfpf_layer_border", default_closed=True)
    header.label(text="Border")
    if border is None:
        return
    border.active = layer.is_on
    border.prop(layer, "mask")
    border.prop(layer, "halo")
    row = border.row()
    row.active = layer.halo > 0.0
    row.prop(layer, "feather")


register, unregister = bpy.utils.register_classes_factory(
    (SCFPF_UL_layers, *section_panels(_LayersSection, "layers"))
)
