# SPDX-License-Identifier: GPL-3.0-or-later
"""The Cycles rig's panel: the switch, what the chords cost, and what stands in the way."""

import textwrap

import bpy

from ..scfpf_addon.cycles.chord_planning import Price, price_of_rig
from ..scfpf_addon.cycles.prices import price
from ..scfpf_addon.cycles.rig import cautions
from ..scfpf_addon.cycles.rig_data import rig_of
from .camera_panels import LINE, _DataTab, _Sidebar, _Subsection, draw_text

# What passes and settings do otherwise than with an ordinary camera, a line each.
DIFFERENCES = (
    "Depth, Mist: use t and depth instead",
    "The camera's motion is not blurred",
)


def facts(price: Price) -> list[str]:
    """What a rig costs, a line each."""
    count = f"{price.chords} chord{'s' * (price.chords != 1)}"
    return [
        f"{count}, off by {price.error:.2g} px",
        f"A ray passes up to {price.portals} portals",
        f"{price.vertices:,} vertices, about {price.memory / 1e6:,.0f} MB",
        f"About {price.cost:.1f} × an ordinary camera",
    ]


def expected(camera, scene) -> list[str]:
    """The price of a rig that has not been made."""
    found = price(camera, scene)
    if found is None:
        return ["Working out what it costs ..."]
    return textwrap.wrap(found, LINE) if isinstance(found, str) else facts(found)


class _CyclesSection(_Subsection):
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
            layout.operator(
                "render.render", text="Render Image (F12)", icon="RENDER_STILL"
            ).use_viewport = False
            for text in cautions(context.scene, context.view_layer, rig):
                draw_text(layout, text, "ERROR")
            layout.operator("scfpf.cycles_passes", icon="RENDERLAYERS", depress=rig.scfpf_rig.passes)
        column = layout.column(align=True)
        column.scale_y = 0.8
        column.active = False
        lines = facts(price_of_rig(rig)) if is_on else expected(camera, context.scene)
        for text in (*lines, *DIFFERENCES):
            column.label(text=text)


class SCFPF_PT_data_cycles(_CyclesSection, _DataTab, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_data"


class SCFPF_PT_view_cycles(_CyclesSection, _Sidebar, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_view"


register, unregister = bpy.utils.register_classes_factory((SCFPF_PT_data_cycles, SCFPF_PT_view_cycles))
