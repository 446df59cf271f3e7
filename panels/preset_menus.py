# SPDX-License-Identifier: GPL-3.0-or-later
"""Menus of presets: the shipped ones by group, and the artist's own, read whenever they are opened."""

import bpy
from bpy.app.translations import pgettext_iface

from ..operators.camera.own_presets import own_presets
from ..operators.camera.presets import preset_groups
from .thumbnails import draw_entries, own_thumbnail


def _group_menu(identifier: str, group: str, items, operator: str) -> type[bpy.types.Menu]:
    """A menu class for one group of presets, whose entries call an operator."""

    def draw(self, _context):
        self.layout.operator_context = "EXEC_REGION_WIN"
        draw_entries(self.layout, operator, sorted(items, key=lambda item: pgettext_iface(item[1])))

    contents = {"__doc__": f"Ready-made projections: {group}", "bl_label": group, "draw": draw}
    return type(identifier, (bpy.types.Menu,), contents)


def _group_menus(prefix: str, operator: str) -> tuple[type[bpy.types.Menu], ...]:
    return tuple(
        _group_menu(f"{prefix}_{number}", group, items, operator)
        for number, (group, items) in enumerate(preset_groups())
    )


APPLY_MENUS = _group_menus("SCFPF_MT_presets_group", "scfpf.preset_apply")
BLEND_MENUS = _group_menus("SCFPF_MT_blend_group", "scfpf.camera_blend_preset")
ADD_MENUS = _group_menus("SCFPF_MT_camera_add_group", "scfpf.camera_add")


class SCFPF_MT_presets(bpy.types.Menu):
    """Ready-made projections for this camera"""

    bl_label = "Projection Presets"

    def draw(self, _context):
        for menu in APPLY_MENUS:
            # Without an icon, names beside entries with icons are cut off.
            self.layout.menu(menu.__name__, icon="BLANK1")
        self.layout.separator()
        self.layout.menu("SCFPF_MT_presets_own", icon="USER")
        self.layout.operator(
            "scfpf.camera_from_camera", text="This Camera's Own Frustum", icon="OUTLINER_OB_CAMERA"
        )
        self.layout.operator("scfpf.by_distance", icon="DRIVER_DISTANCE")
        self.layout.operator("scfpf.dimetric", icon="MOD_LATTICE")
        self.layout.operator("scfpf.preset_load", text="From File...", icon="FILE_FOLDER")


class SCFPF_MT_camera_add_preset(bpy.types.Menu):
    """Flexible cameras with a ready-made projection"""

    bl_label = "Flexible Camera Preset"

    def draw(self, _context):
        for menu in ADD_MENUS:
            self.layout.menu(menu.__name__)


class SCFPF_MT_blend_presets(bpy.types.Menu):
    """Ready-made projections that this camera can be blended with"""

    bl_label = "Blend with Preset"

    def draw(self, _context):
        for menu in BLEND_MENUS:
            self.layout.menu(menu.__name__)


class SCFPF_MT_presets_own(bpy.types.Menu):
    """Projections that you have saved"""

    bl_label = "Your Own"

    def draw(self, _context):
        layout, found = self.layout, own_presets()
        layout.operator_context = "EXEC_REGION_WIN"
        draw_entries(layout, "scfpf.preset_apply_own", found, own_thumbnail, translate=False)
        if not found:
            layout.label(text="None yet: Save as Preset adds one")
        layout.separator()
        layout.operator_context = "INVOKE_REGION_WIN"
        layout.operator("scfpf.preset_save", text="Save as Preset...", icon="ADD")
        layout.menu("SCFPF_MT_presets_remove", icon="REMOVE")
        layout.separator()
        layout.operator("scfpf.preset_export", text="Export...", icon="EXPORT")
        layout.operator("scfpf.preset_import", text="Import...", icon="IMPORT")


class SCFPF_MT_presets_remove(bpy.types.Menu):
    """Projections that you have saved and may remove"""

    bl_label = "Remove"

    def draw(self, _context):
        self.layout.operator_context = "INVOKE_REGION_WIN"
        for stem, name, _text in own_presets():
            self.layout.operator("scfpf.preset_remove", text=name, translate=False).preset = stem


register, unregister = bpy.utils.register_classes_factory(
    (
        SCFPF_MT_presets_own,
        SCFPF_MT_presets_remove,
        *APPLY_MENUS,
        SCFPF_MT_presets,
        *ADD_MENUS,
        SCFPF_MT_camera_add_preset,
        *BLEND_MENUS,
        SCFPF_MT_blend_presets,
    )
)
