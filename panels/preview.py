# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Live Preview: the switch, what the preview cannot show, and what it has left out."""

import bpy

from ..operators.camera.preview import FLAT
from ..scfpf_addon.scanline.preview.preview_data import is_flat, left_out, preview_of
from ..scfpf_addon.scanline.preview.preview_viewports import viewports_of
from .base import Subsection, draw_lines, draw_text, section_panels

# Differences from an image by Render, one a line.
DIFFERENCES = (
    "Solid or Material Preview, no lights",
    "Rendered shading: press Render",
    "Highlights follow the camera's axis",
    "Shows hidden objects that render",
    "Not shown: hair, points, particles",
    "Not shown: Grease Pencil",
    "Ignores materials linked to objects",
)
LEFT_OUT = (
    ("unreachable", "{:,} faces are cut or left out: the volume does not reach them"),
    ("folded", "{:,} samples of the volume are folded: pull the control surfaces apart there"),
)


def reported(counts) -> list[str]:
    """A sentence for each count of a preview that is not 0."""
    return [text.format(counts[key]) for key, text in LEFT_OUT if counts[key]]


class _PreviewSection(Subsection):
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
                draw_text(layout, source.scfpf_preview.problem, "ERROR")
            depsgraph = context.evaluated_depsgraph_get()
            if is_flat(source, depsgraph):
                draw_text(layout, FLAT, "ERROR")
            for text in reported(left_out(source, depsgraph)):
                draw_text(layout, text, "INFO")
        draw_lines(layout, DIFFERENCES)


register, unregister = bpy.utils.register_classes_factory(section_panels(_PreviewSection, "preview"))
