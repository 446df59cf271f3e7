# SPDX-License-Identifier: GPL-3.0-or-later
"""The ways to see a flexible camera's picture in viewports and to render it, as rows of buttons."""

from ..operators.camera.ways import is_any, is_live, is_rendered, rendered_camera
from ..operators.common.words import label_text
from ..scfpf_addon.anchors.kept_plan import KeptPlan
from ..scfpf_addon.bridge.blender import versions
from ..scfpf_addon.bridge.render.image_size import image_size
from ..scfpf_addon.bridge.render.render_engine import ENGINE
from ..scfpf_addon.cycles.engine_choice import engine_name, ignored_camera, renders_by_cycles
from ..scfpf_addon.cycles.rig_data import CYCLES
from ..scfpf_addon.engines.render_times import estimated_seconds
from ..scfpf_addon.scanline.preview.preview_data import preview_of
from .base import draw_text
from .render_button import draw_ignored


def draw_ways(layout, context, camera) -> None:
    """Draw the row of viewports and that of F12."""
    scene = context.scene
    column = layout.column(align=True)
    column.label(text="In Viewports")
    row = column.row(align=True)
    row.operator("scfpf.view_live", text="Live View", depress=is_any(context, camera, is_live))
    source = preview_of(camera, scene)
    row.operator("scfpf.preview_toggle", text="Nodes", depress=source is not None)
    row.operator("scfpf.view_rendered", text="Rendered", depress=is_any(context, camera, is_rendered))
    column = layout.column(align=True)
    if ignored_camera(scene) == camera:
        draw_ignored(column, scene)
    else:
        column.label(text="With F12")
    row = column.row(align=True)
    shown = rendered_camera(scene)
    by_engine = scene.render.engine == ENGINE and shown == camera.name
    row.operator("scfpf.engine_use", text="SCFPF Engine", depress=by_engine)
    row.operator("scfpf.cycles_use", text="Cycles", depress=renders_by_cycles(scene, camera))
    row = column.row(align=True)
    own = scene.render.engine in {ENGINE, CYCLES, versions.EEVEE}
    text = label_text("Render with {0}", "EEVEE" if own else engine_name(scene))
    found = row.operator("scfpf.joined_render", text=text)
    found.camera, found.engine = camera.name, "EEVEE" if own else "SCENE"
    found = row.operator("scfpf.joined_plan", text="", icon="PRESET")
    found.camera, found.engine = camera.name, "EEVEE" if own else "SCENE"
    row = column.row(align=True)
    row.operator("scfpf.quilt", text="Quilt")
    row.operator("scfpf.time_render", text="Over Time")
    row.operator("scfpf.time_assemble", text="", icon="RENDERLAYERS")
    draw_plan(column, scene, camera, versions.EEVEE if own else scene.render.engine)


def draw_plan(layout, scene, camera, renderer: str) -> None:
    """Draw what the kept plan says of renders by another engine."""
    plan = KeptPlan.read(camera.scfpf.anchor_plan)
    if plan is None:
        return
    if plan.size != image_size(scene):
        draw_text(layout, label_text("Plan of {0} × {1} pixels: plan again", *plan.size), "INFO")
        return
    count, pixels = len(plan.anchors), plan.pixels
    seconds = estimated_seconds(renderer, count, pixels * plan.size[0] * plan.size[1])
    text = label_text("Plan: {0} renders, {1:.2%}, {2:.1f} × the pixels", count, plan.shown, pixels)
    if seconds is not None:
        text = label_text("{0}, about {1:.0f} s", text, seconds)
    draw_text(layout, text, "INFO")
