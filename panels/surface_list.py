# SPDX-License-Identifier: GPL-3.0-or-later
"""The list of a camera's control surfaces, from near to far, and the settings of the active one."""

import bpy

from ..operators.common.words import label_text
from ..scfpf_addon.bridge.blender.scene_objects import absence, is_absent, is_being_edited
from ..scfpf_addon.bridge.camera.by_distance import is_by_distance
from ..scfpf_addon.bridge.camera.surface_scale import is_scaled, whole_scale, world_sizes
from ..scfpf_addon.bridge.surfaces.kinds import icon_of
from ..scfpf_addon.bridge.surfaces.surface_object import parameter_properties
from ..scfpf_addon.projection.user_error import Message, UserError
from ..scfpf_addon.projection.volume.basis import WEIGHTED
from .base import draw_text

# The width of a weight in the list, in the interface's units: six digits.
WEIGHT_WIDTH = 3


def absence_of(scene, slot) -> str:
    """The reason why a scene lacks a slot's object, in two or three words; empty if the scene has it."""
    if slot.object is None:
        return Message("deleted")
    # A visible object is in the scene; searching a scene takes longer the more objects it has.
    if scene == bpy.context.scene and slot.object.visible_get():
        return ""
    return absence(slot.object, scene) if is_absent(slot.object, scene) else ""


class SCFPF_UL_surfaces(bpy.types.UIList):
    """Control surfaces from near to far"""

    def draw_item(self, context, layout, data, item, _icon, _active_data, _active_property, index):
        row = layout.row(align=True)
        if where := absence_of(context.scene, item):
            row.alert = True
            if item.object is None:
                row.label(text="Deleted", icon="ERROR")
            else:
                row.label(
                    text=label_text("{0} ({1})", item.object.name, where), icon="ERROR", translate=False
                )
            return
        row.prop(item.object, "name", text="", emboss=False, icon=icon_of(item.object))
        last = len(data.surfaces) - 1
        end = {0: "Near", last: "Far"}.get(index, "") if last > 0 else ""
        if end and end not in item.object.name:
            place = row.row()
            place.alignment = "RIGHT"
            place.active = False
            place.label(text=end)
        if data.basis in WEIGHTED and not item.object.scfpf_surface.is_by_distance:
            weight = row.row()
            weight.ui_units_x = WEIGHT_WIDTH
            # A row has no room for the panel's split into name and value.
            weight.use_property_split = weight.use_property_decorate = False
            weight.prop(item, "weight", text="", emboss=False)
        row.operator("scfpf.surface_select", text="", icon="RESTRICT_SELECT_OFF", emboss=False).index = index


def draw_surfaces(layout, context, settings) -> None:
    """Draw the list of a camera's control surfaces with its buttons, and the active surface."""
    row = layout.row()
    row.template_list(
        "SCFPF_UL_surfaces", "", settings, "surfaces", settings, "active_surface", rows=4, sort_lock=True
    )
    column = row.column(align=True)
    if is_by_distance(settings.id_data):
        column.operator("scfpf.distance_add", text="", icon="ADD")
    else:
        column.menu("SCFPF_MT_surface_add", text="", icon="ADD")
    column.operator("scfpf.surface_remove", text="", icon="REMOVE")
    column.separator()
    column.operator("scfpf.surface_move", text="", icon="TRIA_UP").direction = "UP"
    column.operator("scfpf.surface_move", text="", icon="TRIA_DOWN").direction = "DOWN"
    column.separator()
    column.menu("SCFPF_MT_surface_specials", text="", icon="DOWNARROW_HLT")
    row = layout.row(align=True)
    row.operator("scfpf.edit_volume", icon="EDITMODE_HLT", depress=settings.edit_volume)
    row.operator("scfpf.volume_frame", text="", icon="VIEW_PAN")
    if settings.active_surface < len(settings.surfaces):
        _draw_surface(layout, context, settings.surfaces[settings.active_surface], settings.basis)


def _draw_surface(layout, context, slot, basis: str) -> None:
    """Draw the weight, kind and sizes of a control surface."""
    if where := absence_of(context.scene, slot):
        is_gone = where == "deleted"
        layout.label(
            text="Remove it from the list with -" if is_gone else "Link it to the scene, or press -",
            icon="ERROR",
        )
        return
    column = layout.column()
    if basis in WEIGHTED and not slot.object.scfpf_surface.is_by_distance:
        column.prop(slot, "weight", text="Weight" if basis == "NURBS" else "Place")
    own = slot.object.scfpf_surface
    if own.is_by_distance:
        for name in ("distance", "angle", "shift"):
            column.prop(own, name)
        return
    try:
        parameters = parameter_properties(slot.object)
    except UserError as error:
        draw_text(column, error, "ERROR")
        return
    header, sizes = layout.panel("scfpf_surface_sizes", default_closed=True)
    header.label(text="Kind and Sizes")
    if sizes is None:
        return
    kind = sizes.row()
    kind.enabled = not is_being_edited(slot.object)
    kind.prop(own, "kind")
    for label, owner, name in parameters:
        sizes.prop(owner, name, text=label)
    if is_scaled(slot.object):
        _draw_world_sizes(sizes.column(align=True), context.scene, slot.object)


def _draw_world_sizes(layout, scene, surface) -> None:
    """Draw the sizes of a scaled surface in world units, and the button that applies the scale to them."""
    units = scene.unit_settings
    try:
        sizes = world_sizes(surface)
    except UserError:
        factors = " × ".join(f"{factor:.4g}" for factor in whole_scale(surface))
        layout.label(text=label_text("In the World: Scaled {0}", factors), icon="INFO")
    else:
        for number, (label, length) in enumerate(sizes):
            text = f"{length:.4g}"
            if units.system != "NONE":
                text = bpy.utils.units.to_string(
                    units.system, "LENGTH", length * units.scale_length, precision=4, split_unit=False
                )
            layout.label(
                text=label_text("{0} in the World: {1}", label, text), icon="BLANK1" if number else "INFO"
            )
    layout.operator("scfpf.surface_apply_scale", icon="CON_SIZELIKE")


register, unregister = bpy.utils.register_classes_factory((SCFPF_UL_surfaces,))
