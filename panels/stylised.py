# SPDX-License-Identifier: GPL-3.0-or-later
"""Drawn Style: its settings in Render properties, in the camera's Data tab and in the sidebar."""

import bpy

from ..scfpf_addon.bridge.settings.stylised_properties import LINE_KINDS
from .base import Subsection, section_panels
from .engine_panels import EnginePanel


def draw_style(layout, scene) -> None:
    """Draw all settings of a scene's Drawn Style."""
    options = scene.scfpf_drawn
    layout.use_property_split = True
    layout.operator_menu_enum("scfpf.drawn_style", "style", text="Style", icon="PRESET")
    body = layout.column()
    body.active = options.use_drawn
    draw_fill(body, options)
    header, lines = body.panel("scfpf_drawn_lines", default_closed=False)
    header.use_property_split = False
    header.prop(options, "use_lines")
    if lines:
        draw_lines(lines, options)
    header, strokes = body.panel("scfpf_drawn_hatching", default_closed=True)
    header.label(text="Hatching")
    if strokes:
        draw_hatching(strokes, options)
    body.prop(options, "detail")
    if scene.render.film_transparent and options.use_paper:
        body.label(text="A transparent film has no paper", icon="INFO")


def draw_fill(layout, options) -> None:
    """Draw the settings of the fill between lines, and of the paper."""
    layout.prop(options, "fill")
    column = layout.column()
    if options.fill == "TOON":
        column.prop(options, "steps")
        column.prop(options, "softness")
        column.prop(options, "darkest")
    if options.fill == "TOON" or options.hatching == "TONE":
        column.prop(options, "exposure")
    if options.fill != "PAPER":
        column.prop(options, "fade", text="Fade")
    row = layout.row(heading="Paper")
    row.prop(options, "use_paper", text="")
    row = row.row()
    row.active = options.use_paper or options.fade > 0 or options.fill == "PAPER"
    row.prop(options, "paper_color", text="")


def draw_lines(layout, options) -> None:
    """Draw the settings of lines: which, how wide, of which color."""
    layout.active = options.use_lines
    column = layout.column(heading="Draw", align=True)
    for name in LINE_KINDS:
        column.prop(options, name)
    column = layout.column(align=True)
    column.prop(options, "line_width", text="Outlines")
    column.prop(options, "inner_width", text="Inner")
    layout.prop(options, "line_color", text="Color")
    row = layout.row()
    row.active = options.use_crease
    row.prop(options, "crease_angle")
    row = layout.row()
    row.active = options.use_silhouette
    row.prop(options, "depth_jump")


def draw_hatching(layout, options) -> None:
    """Draw the settings of hatching by t or by tone."""
    layout.prop(options, "hatching", text="Strokes")
    if options.hatching == "NONE":
        return
    layout.prop(options, "hatch_width", text="Width")
    layout.prop(options, "hatch_color", text="Color")
    if options.hatching == "DEPTH":
        layout.prop(options, "hatch_count")
        return
    layout.prop(options, "hatch_spacing")
    layout.prop(options, "hatch_angle")
    layout.prop(options, "use_cross")


class _DrawnSection:
    bl_label = "Drawn Style"
    bl_options = {"DEFAULT_CLOSED"}

    def draw_header(self, context):
        self.layout.prop(context.scene.scfpf_drawn, "use_drawn", text="")


class SCFPF_PT_engine_drawn(_DrawnSection, EnginePanel, bpy.types.Panel):
    """Lines, flat shades and paper; the Render button follows it too"""

    bl_context = "render"

    def draw(self, context):
        draw_style(self.layout, context.scene)


class _CameraSection(_DrawnSection, Subsection):
    bl_order = 9

    def draw_settings(self, context, _camera, _settings):
        draw_style(self.layout, context.scene)


register, unregister = bpy.utils.register_classes_factory(
    (SCFPF_PT_engine_drawn, *section_panels(_CameraSection, "drawn"))
)
