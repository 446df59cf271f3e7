# SPDX-License-Identifier: GPL-3.0-or-later
"""The stack of image mappings: its list, and the settings of the selected mapping."""

import bpy

from ..operators.volume.mappings import active_mapping
from ..scfpf_addon.bridge.mappings.mapping_edits import curve_node
from ..scfpf_addon.bridge.settings.mapping_properties import MAPPING_KINDS

MAPPING_ICONS = {
    "RADIAL_CURVE": "FCURVE",
    "LENS": "VIEWZOOM",
    "DISTORTION": "CAMERA_DATA",
    "ST_MAP": "IMAGE_DATA",
    "GRID": "MESH_GRID",
    "DISPLAY": "DESKTOP",
    "CALIBRATION": "OUTLINER_DATA_CAMERA",
}
# The properties of each kind, drawn one below the other.
DRAWN = {
    "LENS": ("radius", "magnification", "falloff"),
    "DISTORTION": ("radius", "numerator", "denominator"),
    "DISPLAY": ("arc", "distance"),
    "CALIBRATION": ("calibration",),
}
# The kinds with a centre, which a click in the image can place.
PLACED = {"RADIAL_CURVE", "LENS", "DISTORTION"}


class SCFPF_MT_mapping_add(bpy.types.Menu):
    """The kinds of image mapping"""

    bl_label = "Image Mapping"

    def draw(self, _context):
        for kind, name, _text in MAPPING_KINDS:
            self.layout.operator("scfpf.mapping_add", text=name, icon=MAPPING_ICONS[kind]).kind = kind
        self.layout.separator()
        self.layout.operator("scfpf.attention", icon="ZOOM_SELECTED")


class SCFPF_UL_mappings(bpy.types.UIList):
    """Mappings of the picture; the first one is nearest to it"""

    def draw_item(self, _context, layout, _data, item, _icon, _active_data, _active_property, _index):
        row = layout.row(align=True)
        row.active = item.enabled
        # A row has no room for the panel's split into name and value.
        row.use_property_split = row.use_property_decorate = False
        row.prop(item, "name", text="", emboss=False, icon=MAPPING_ICONS[item.kind])
        row.prop(
            item, "enabled", text="", emboss=False, icon="CHECKBOX_HLT" if item.enabled else "CHECKBOX_DEHLT"
        )


def draw_stack(layout, camera) -> None:
    """Draw the list of a camera's mappings with its buttons, and the selected mapping."""
    settings = camera.scfpf
    row = layout.row()
    row.template_list(
        "SCFPF_UL_mappings", "", settings, "mappings", settings, "active_mapping", rows=4, sort_lock=True
    )
    column = row.column(align=True)
    column.menu("SCFPF_MT_mapping_add", text="", icon="ADD")
    column.operator("scfpf.mapping_remove", text="", icon="REMOVE")
    column.separator()
    column.operator("scfpf.mapping_move", text="", icon="TRIA_UP").direction = "UP"
    column.operator("scfpf.mapping_move", text="", icon="TRIA_DOWN").direction = "DOWN"
    mapping = active_mapping(camera)
    if mapping is not None:
        _draw_mapping(layout, mapping)
    layout.operator("scfpf.st_map_write", icon="EXPORT")


def _draw_mapping(layout, mapping) -> None:
    column = layout.column()
    column.active = mapping.enabled
    column.prop(mapping, "kind")
    if mapping.kind in PLACED:
        row = column.row(align=True)
        row.prop(mapping, "centre")
        row.operator("scfpf.mapping_place", text="", icon="EYEDROPPER")
    for name in DRAWN.get(mapping.kind, ()):
        column.prop(mapping, name)
    if mapping.kind == "RADIAL_CURVE":
        node = curve_node(mapping.curve)
        if node is not None:
            column.template_curve_mapping(node, "mapping")
    elif mapping.kind == "ST_MAP":
        column.template_ID(mapping, "image", open="image.open")
        if mapping.image is not None and not mapping.image.is_float:
            column.label(text="8 bits are coarse: use a float image", icon="ERROR")
    elif mapping.kind == "GRID":
        row = column.row(align=True)
        row.prop(mapping, "grid")
        row.operator("scfpf.mapping_grid_select", text="", icon="RESTRICT_SELECT_OFF")
    column.prop(mapping, "influence")
    column.prop(mapping, "backwards")


register, unregister = bpy.utils.register_classes_factory((SCFPF_MT_mapping_add, SCFPF_UL_mappings))
