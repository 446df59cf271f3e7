# SPDX-License-Identifier: GPL-3.0-or-later
"""The Cycles rig's panel: the switch, what the chords cost, and what stands in the way."""

import bpy

from ..scfpf_addon.cycles.rig import cautions
from ..scfpf_addon.cycles.rig_data import rig_of
from .camera_panels import _DataTab, _Sidebar, _Subsection, draw_text

# What passes and settings do otherwise than with an ordinary camera, a line each.
DIFFERENCES = (
    "Depth, Mist: use t and depth instead",
    "The camera's motion is not blurred",
)


def facts(settings) -> list[str]:
    """What a rig costs, a line each."""
    count = f"{settings.chords} chord{'s' * (settings.chords != 1)}"
    return [
        f"{count}, off by {settings.error:.2g} px",
        f"About {settings.cost:.1f} × an ordinary camera",
    ]


class _CyclesSection(_Subsection):
    bl_label = "Cycles"
    bl_order = 4
    bl_options = {"DEFAULT_CLOSED"}

    def draw_settings(self, context, camera, _settings):
        layout = self.layout
        rig = rig_of(context.scene)
        is_on = rig is not None and rig.scfpf_rig.camera == camera
        row = layout.row(align=True)
        row.operator("scfpf.cycles_rig", icon="SHADING_RENDERED", depress=is_on)
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
        for text in (*facts(rig.scfpf_rig), *DIFFERENCES) if is_on else DIFFERENCES:
            column.label(text=text)


class SCFPF_PT_data_cycles(_CyclesSection, _DataTab, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_data"


class SCFPF_PT_view_cycles(_CyclesSection, _Sidebar, bpy.types.Panel):
    bl_parent_id = "SCFPF_PT_view"


register, unregister = bpy.utils.register_classes_factory((SCFPF_PT_data_cycles, SCFPF_PT_view_cycles))
