# SPDX-License-Identifier: GPL-3.0-or-later
"""The Render button with its progress, and what keeps it or F12 from rendering a flexible camera."""

from ..operators.common.words import label_text
from ..scfpf_addon.bridge.render import render_job
from ..scfpf_addon.bridge.render.result_image import result_image
from ..scfpf_addon.casting.scene.embreex import caster_fault
from ..scfpf_addon.cycles.engine_choice import engine_name
from .base import draw_lines, draw_text


def draw_render(layout, camera) -> None:
    """Draw the Render button or the progress."""
    job = render_job.current()
    row = layout.row(align=True)
    row.scale_y = 1.5
    if job is None:
        row.operator("scfpf.render", text="Render", icon="RENDER_STILL").camera = camera.name
        if result_image() is not None:
            row.operator("scfpf.result_show", text="", icon="IMAGE_DATA")
    else:
        text = "Canceling" if job.cancelled else label_text("Rendering {0:.0%}", job.progress)
        row.progress(factor=job.progress, text=text)
        row.operator("scfpf.render_cancel", text="", icon="X")


def draw_ignored(layout, scene) -> None:
    """Say that F12 ignores the flexible camera."""
    layout.label(text=label_text("F12 ({0}) ignores the volume", engine_name(scene)), icon="ERROR")


def draw_caster_fault(layout) -> None:
    """Say why the Render button cannot work, and what works without it."""
    fault = caster_fault()
    if fault:
        column = layout.column(align=True)
        column.alert = True
        draw_text(column, label_text("Rendering is off: {0}", fault), "ERROR")
        draw_text(column, "Editing, Nodes and Cycles work without it.", "BLANK1")


def draw_report(layout, text: str) -> None:
    """Draw the parts of a render's report, one a line."""
    if text:
        draw_lines(layout, text.split(" · "))
