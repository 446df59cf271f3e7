# SPDX-License-Identifier: GPL-3.0-or-later
"""The live preview's panel: the toggle, what the preview cannot show, and what it has left out."""

import bpy

from ..scfpf_addon.scanline.preview_data import is_flat, left_out, preview_of
from ..scfpf_addon.scanline.preview_viewports import viewports_of
from .camera_panels import _DataTab, _Sidebar, _Subsection

# What a picture by Render shows otherwise, a line each.
DIFFERENCES = (
    "Solid and Material Preview, no lamps",
    "All lit as seen from the camera's front",
    "For Rendered shading press Render",
    "Shows all that renders, hidden or not",
    "No hair, points or particles",
    "No Grease Pencil",
    "Materials of meshes, not of the object",
)
FLAT = ("No preview: this volume is flat,", "all its rays lie in one surface", "Press Render for its picture")
LEFT_OUT = (
    ("unreachable", "{:,} faces left out, wholly or in part: no ray there"),
    ("folded", "{:,} samples of the volume are folded"),
)


def reported(counts) -> list[str]:
    """What a preview's counts tell, in a line each; nothing for what is nought."""
    return [text.format(counts[key]) for key, text in LEFT_OUT if counts[key]]


class _PreviewSection(_Subsection):
    bl_label = "Live Preview"
    bl_order = 2

    def draw_settings(self, context, camera, _settings):
        layout = self.layout
        source = preview_of(camera, context.scene)
        row = layout.row(align=True)
        row.operator(
            "scfpf.preview_toggle",
            text="Live Preview",
            icon="HIDE_ON" if source is None else "HIDE_OFF",
            depress=source is not None,
        )
        if source is not None:
            if not viewports_of(source):
                row.operator("scfpf.preview_show", text="", icon="WINDOW")
            if source.scfpf_preview.problem:
                layout.label(text=source.scfpf_preview.problem, icon="ERROR")
            depsgraph = context.evaluated_depsgraph_get()
            if is_flat(source, depsgraph):
                column = layout.column(align=True)
                for text, icon in zip(FLAT, ("ERROR", "BLANK1", "BLANK1"), strict=True):
                    column.label(text=text, icon=icon)
            for text in reported(left_out(source, depsgraph)):
                layout.label(text=text, icon="INFO")
        column = layout.column(align=True)
        column.scale_y = 0.8
        column.active = False
        for text in DIFFERENCES:
            column.label(text=text)


class SCFPF_PT_data_preview(_PreviewSection, _DataTab, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_data"


class SCFPF_PT_view_preview(_PreviewSection, _Sidebar, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_view"


register, unregister = bpy.utils.register_classes_factory((SCFPF_PT_data_preview, SCFPF_PT_view_preview))
