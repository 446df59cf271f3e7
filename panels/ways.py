# SPDX-License-Identifier: GPL-3.0-or-later
"""The ways to see a flexible camera's picture in viewports and to render it, as rows of buttons."""

from ..operators.camera.ways import is_any, is_live, is_rendered, joined_engine, rendered_camera
from ..operators.common.words import label_text
from ..scfpf_addon.bridge.blender import versions
from ..scfpf_addon.bridge.render.render_engine import ENGINE
from ..scfpf_addon.cycles.engine_choice import engine_name, ignored_camera, renders_by_cycles
from ..scfpf_addon.scanline.preview.preview_data import preview_of
from .render_button import draw_ignored

# The share of the row of F12 that the engine's long name takes.
NAME_SHARE = 0.62


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
    row = column.split(factor=NAME_SHARE, align=True)
    shown = rendered_camera(scene)
    by_engine = scene.render.engine == ENGINE and shown == camera.name
    row.operator("scfpf.engine_use", text="Flexible Projection", depress=by_engine)
    row.operator("scfpf.cycles_use", text="Cycles", depress=renders_by_cycles(scene, camera))
    row = column.row(align=True)
    is_eevee = joined_engine(scene) == versions.EEVEE
    text = label_text("Render with {0}", "EEVEE" if is_eevee else engine_name(scene))
    for found in (
        row.operator("scfpf.joined_render", text=text),
        row.operator("scfpf.joined_plan", text="", icon="PRESET"),
    ):
        found.camera, found.engine = camera.name, "EEVEE" if is_eevee else "SCENE"
    if scene.render.use_multiview and scene.render.views_format == "STEREO_3D":
        eyes = column.operator("scfpf.eyes_joined", icon="CAMERA_STEREO")
        eyes.camera, eyes.engine = camera.name, "EEVEE" if is_eevee else "SCENE"
    row = column.row(align=True)
    row.operator("scfpf.quilt", text="Quilt")
    row.operator("scfpf.time_render", text="Over Time")
    row.operator("scfpf.time_assemble", text="", icon="RENDERLAYERS")
