# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel Cycles: the switch, the price of the rig, and what keeps it from working."""

import textwrap

import bpy

from ..operators.common.words import label_text
from ..scfpf_addon.cycles.cautions import cautions
from ..scfpf_addon.cycles.chord_planning import Price, price_of_rig
from ..scfpf_addon.cycles.prices import price
from ..scfpf_addon.cycles.rig_data import rig_of
from .base import LINE, Subsection, draw_lines, draw_text, section_panels

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


def expected(camera, scene) -> list[str]:
    """The price that a rig for this camera would have, or that it is being computed."""
    found = price(camera, scene)
    if found is None:
        return ["Working out what it costs ..."]
    return textwrap.wrap(found, LINE) if isinstance(found, str) else facts(found)


class _CyclesSection(Subsection):
    bl_label = "Cycles"
    bl_order = 4
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, context, camera, _settings):
        layout = self.layout
        rig = rig_of(context.scene)
        is_on = rig is not None and rig.scfpf_rig.camera == camera
        row = layout.row(align=True)
        text = "Remove Cycles Setup" if is_on else "Set Up Cycles"
        row.operator("scfpf.cycles_rig", text=text, icon="X" if is_on else "SHADING_RENDERED")
        if is_on:
            row.operator("scfpf.cycles_rig_update", text="", icon="FILE_REFRESH")
            layout.operator("scfpf.cycles_render", text="Render Image (F12)", icon="RENDER_STILL")
            for text in cautions(context.scene, context.view_layer, rig):
                draw_text(layout, text, "ERROR")
            layout.operator("scfpf.cycles_passes", icon="RENDERLAYERS", depress=rig.scfpf_rig.passes)
            if rig.scfpf_rig.passes:
                if rig.scfpf_rig.is_own_view:
                    draw_text(layout, "Depth and Mist: as Cycles', of the camera's own view", "INFO")
                else:
                    draw_text(layout, "Depth and Mist: length of projectors from the near surface", "INFO")
        lines = facts(price_of_rig(rig)) if is_on else expected(camera, context.scene)
        if is_on and rig.scfpf_rig.travels_all:
            lines += textwrap.wrap(f"{ALL_CHORDS}: {rig.scfpf_rig.travels_all}", LINE)
        draw_lines(layout, lines)


register, unregister = bpy.utils.register_classes_factory(section_panels(_CyclesSection, "cycles"))
