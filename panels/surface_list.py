# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of a camera's control surfaces, from near to far."""

import bpy

from ..scfpf_addon.bridge.blender.scene_objects import absence, is_absent
from ..scfpf_addon.bridge.surfaces.kinds import icon_of

# Of a weight in the list, in the interface's units: six digits.
WEIGHT_WIDTH = 3


def absence_of(scene, slot) -> str:
    """The reason why a scene does not have a slot's object, in two or three words; empty if it has it."""
    if slot.object is None:
        return "deleted"
    # A visible object is there; finding an object in a scene takes longer the more there are.
    if scene == bpy.context.scene and slot.object.visible_get():
        return ""
    return absence(slot.object, scene) if is_absent(slot.object, scene) else ""


class SCFPF_UL_surfaces(bpy.types.UIList):
    """Control surfaces from near to far"""

    def draw_item(self, context, layout, data, item, _icon, _active_data, _active_property, index):
        row = layout.row(align=True)
        if where := absence_of(context.scene, item):
            row.alert = True
            text = "Deleted" if item.object is None else f"{item.object.name} ({where})"
            row.label(text=text, icon="ERROR")
            return
        row.prop(item.object, "name", text="", emboss=False, icon=icon_of(item.object))
        end = (
            ""
            if len(data.surfaces) == 1
            else "Near"
            if index == 0
            else "Far"
            if index == len(data.surfaces) - 1
            else ""
        )
        if end and end not in item.object.name:
            place = row.row()
            place.alignment = "RIGHT"
            place.active = False
            place.label(text=end)
        if data.basis == "NURBS":
            weight = row.row()
            weight.ui_units_x = WEIGHT_WIDTH
            # The panel splits its properties into name and value, for which there is no room here.
            weight.use_property_split = weight.use_property_decorate = False
            weight.prop(item, "weight", text="", emboss=False)
        row.operator("scfpf.surface_select", text="", icon="RESTRICT_SELECT_OFF", emboss=False).index = index


register, unregister = bpy.utils.register_classes_factory((SCFPF_UL_surfaces,))
