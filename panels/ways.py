# SPDX-License-Identifier: GPL-3.0-or-later
"""The ways to see a flexible camera's picture in viewports and to render it, as rows of buttons."""

from ..operators.camera.preview import FLAT
from ..operators.camera.ways import is_any, is_live, is_rendered, rendered_camera
from ..operators.common.words import label_text
from ..scfpf_addon.anchors.kept_plan import KeptPlan
from ..scfpf_addon.bridge.blender import versions
from ..scfpf_addon.bridge.layers.read_image_layers import NOT_BY_F12, not_here, shown_layers
from ..scfpf_addon.bridge.render.image_size import image_size
from ..scfpf_addon.bridge.render.render_engine import ENGINE
from ..scfpf_addon.cycles.engine_choice import engine_name, ignored_camera, renders_by_cycles
from ..scfpf_addon.cycles.rig_data import CYCLES
from ..scfpf_addon.engines.render_times import estimated_seconds
from ..scfpf_addon.scanline.preview.preview_data import is_flat, left_out, preview_of
from ..scfpf_addon.scanline.preview.preview_viewports import viewports_of
from .base import draw_text
from .render_button import draw_ignored

LEFT_OUT = (
    ("unreachable", "{:,} faces are cut or left out: the volume does not reach them"),
    ("folded", "{:,} samples of the volume are folded: pull the control surfaces apart there"),
)


def reported(counts) -> list[str]:
    """A sentence for each count of a preview that is not 0."""
    return [text.format(counts[key]) for key, text in LEFT_OUT if counts[key]]


def draw_ways(layout, context, camera) -> None:
    """Draw the row of viewports, the state of the nodes preview, and the row of F12."""
    scene = context.scene
    column = layout.column(align=True)
    column.label(text="In Viewports")
    row = column.row(align=True)
    row.operator("scfpf.view_live", text="Live View", depress=is_any(context, camera, is_live))
    source = preview_of(camera, scene)
    row.operator("scfpf.preview_toggle", text="Nodes", depress=source is not None)
    row.operator("scfpf.view_rendered", text="Rendered", depress=is_any(context, camera, is_rendered))
    if source is not None:
        draw_preview(layout, context, source)
    if source is not None and (text := not_here(camera)):
        draw_text(layout, text, "INFO")
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
    if renders_by_cycles(scene, camera) and shown_layers(camera):
        draw_text(layout, NOT_BY_F12, "INFO")
    if shown != camera.name:
        text = label_text("F12 shows {0}", shown) if shown else "The scene has no camera for F12"
        draw_text(layout, label_text("{0}: a button above changes that", text), "INFO")


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


def draw_preview(layout, context, source) -> None:
    """Draw what is wrong with a nodes preview, what it leaves out, and the button of its viewport."""
    if not viewports_of(source):
        layout.operator("scfpf.preview_show", icon="WINDOW")
    if source.scfpf_preview.problem:
        draw_text(layout, source.scfpf_preview.problem, "ERROR")
    depsgraph = context.evaluated_depsgraph_get()
    if is_flat(source, depsgraph):
        draw_text(layout, FLAT, "ERROR")
    for text in reported(left_out(source, depsgraph)):
        draw_text(layout, text, "INFO")
