# SPDX-License-Identifier: GPL-3.0-or-later
"""Menus of an artist's own presets, which are looked for whenever they are opened."""

import bpy

from ..operators.camera.own_presets import own_presets
from .thumbnails import draw_entries, own_thumbnail


class SCFPF_MT_presets_own(bpy.types.Menu):
    """Projections that you have saved"""

    bl_label = "Your Own"

    def draw(self, _context):
        layout, found = self.layout, own_presets()
        layout.operator_context = "EXEC_REGION_WIN"
        draw_entries(layout, "scfpf.preset_apply_own", found, own_thumbnail)
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
            self.layout.operator("scfpf.preset_remove", text=name).preset = stem


register, unregister = bpy.utils.register_classes_factory((SCFPF_MT_presets_own, SCFPF_MT_presets_remove))
