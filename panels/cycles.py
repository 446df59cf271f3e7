# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Cycles of a camera with a rig: what keeps the rig from working, its passes and its price."""

import textwrap

import bpy

from ..operators.common.target import flexible_camera_of
from ..operators.common.words import label_text
from ..scfpf_addon.cycles.cautions import cautions
from ..scfpf_addon.cycles.prices import Price, price_of_rig
from ..scfpf_addon.cycles.rig_data import rig_of
from .base import LINE, Subsection, draw_lines, draw_text, section_panels, shows_internals

# Start of the line that says why rays skip no chord.
ALL_CHORDS = "Rays pass empty chords, too"


def facts(price: Price) -> list[str]:
    """The price of a rig, one fact a line."""
    portals = (
        label_text("about {0:.1f}", price.passed) if price.passed else label_text("up to {0}", price.portals)
    )
    count = label_text("{0} chord" if price.chords == 1 else "{0} chords", price.chords)
    return [
        label_text("{0}, off by {1:.2g} px", count, price.error),
        label_text("A ray passes {0} portals", portals),
        label_text("{0:,} vertices, about {1:,.0f} MB", price.vertices, price.memory / 1e6),
        label_text("About {0:.1f} × an ordinary camera", price.cost),
    ]


class _CyclesSection(Subsection):
    bl_label = "Cycles"
    bl_order = 8

    @classmethod
    def poll(cls, context):
        if not super().poll(context):
            return False
        rig = rig_of(context.scene)
        return rig is not None and rig.scfpf_rig.camera == flexible_camera_of(context)

    def draw_settings(self, context, _camera, _settings):
        layout = self.layout
        rig = rig_of(context.scene)
        layout.operator("scfpf.cycles_render", text="Render Image (F12)", icon="RENDER_STILL")
        layout.operator("scfpf.cycles_passes", icon="RENDERLAYERS", depress=rig.scfpf_rig.passes)
        row = layout.row(align=True)
        row.operator("scfpf.cycles_rig", text="Remove Cycles Setup", icon="X")
        row.operator("scfpf.cycles_rig_update", text="", icon="FILE_REFRESH")
        for text in cautions(context.scene, context.view_layer, rig):
            draw_text(layout, text, "ERROR")
        if rig.scfpf_rig.passes:
            if rig.scfpf_rig.is_own_view:
                draw_text(layout, "Depth and Mist: as Cycles', of the camera's own view", "INFO")
            else:
                draw_text(layout, "Depth and Mist: length of projectors from the near surface", "INFO")
        *details, cost = facts(price_of_rig(rig))
        draw_lines(layout, [*(details if shows_internals(context) else ()), cost])
        if rig.scfpf_rig.travels_all:
            draw_lines(layout, textwrap.wrap(f"{ALL_CHORDS}: {rig.scfpf_rig.travels_all}", LINE))


register, unregister = bpy.utils.register_classes_factory(section_panels(_CyclesSection, "cycles"))
