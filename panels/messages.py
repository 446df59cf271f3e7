# SPDX-License-Identifier: GPL-3.0-or-later
"""The messages of a flexible camera, in a place of the panel that has always the same height.

So nothing below it moves when a message comes or goes. The most urgent one is shown, a popover has all.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import bpy

from ..operators.camera.preview import FLAT
from ..operators.camera.ways import is_any, is_live, joined_engine, rendered_camera
from ..operators.common.target import flexible_camera_of
from ..operators.common.words import label_text, translated_label
from ..scfpf_addon.anchors.kept_plan import KeptPlan
from ..scfpf_addon.anchors.plan import PlanLimits
from ..scfpf_addon.bridge.blends.camera_blend import is_blend
from ..scfpf_addon.bridge.camera.read_projection import is_lattice_volume
from ..scfpf_addon.bridge.camera.volume_fit import needs_fit
from ..scfpf_addon.bridge.layers.read_image_layers import NOT_BY_F12, lacking, not_here, shown_layers
from ..scfpf_addon.bridge.render.image_size import image_aspect, image_size
from ..scfpf_addon.bridge.sync.camera_sync import sharers
from ..scfpf_addon.casting.scene.embreex import caster_fault
from ..scfpf_addon.cycles.engine_choice import renders_by_cycles
from ..scfpf_addon.engines.render_times import estimated_seconds
from ..scfpf_addon.projection.user_error import Message, UserError
from ..scfpf_addon.scanline.preview.preview_data import is_flat, left_out, preview_of
from ..scfpf_addon.scanline.preview.preview_viewports import viewports_of
from .base import draw_fixed, draw_text
from .surface_list import absence_of

# Lines of text that a message has in the panel; the popover shows it whole.
LINES = 2
# For a volume that is as the camera's own view.
NEXT = Message("Straight so far: choose a preset, or add a surface with + and move it (G)")
# While the control surfaces can be selected.
EDITING = Message("Select a surface (its arrow or a click), then press G, R or S")
# If there is no message: without Live View, and with it.
READY = Message("Ready: press Render, or Live View to see it while you work")
READY_LIVE = Message("Ready: press Render")
# The problem of a control surface that the scene lacks, by ``absence_of``.
ABSENT = {
    "deleted": "A control surface was deleted",
    "in another scene": "A control surface is in another scene",
    "in no scene": "A control surface is in no scene",
}
LEFT_OUT = (
    ("unreachable", "{:,} faces are cut or left out: the volume does not reach them"),
    ("folded", "{:,} samples of the volume are folded: pull the control surfaces apart there"),
)


class Told(NamedTuple):
    """A message, and the operator that mends what it says, "" without one."""

    text: str | Message
    icon: str = "INFO"
    operator: str = ""


def messages(context, camera) -> Iterator[Told]:
    """The messages about a flexible camera, the most urgent first."""
    scene = context.scene
    for text in problems(scene, camera):
        yield Told(text, "ERROR")
    if fault := caster_fault():
        yield Told(Message("Rendering is off: {0}", fault), "ERROR")
        yield Told(Message("Editing, Nodes and Cycles work without it."))
    source = preview_of(camera, scene)
    if source is not None:
        yield from _of_preview(context, camera, source)
    others = sharers(camera)
    if others:
        whose = f"'{others[0]}'" if len(others) == 1 else label_text("{0} cameras", len(others))
        yield Told(Message("Surfaces shared with {0}", whose), operator="scfpf.volume_single_user")
    if _needs_fit(scene, camera):
        yield Told(
            Message("The resolution has another shape than the volume"), operator="scfpf.volume_fit_picture"
        )
    if renders_by_cycles(scene, camera) and shown_layers(camera):
        yield Told(NOT_BY_F12)
    for layer in camera.scfpf.layers:
        if layer.is_on and (text := lacking(layer) or layer.message):
            yield Told(Message("Layer '{0}': {1}", layer.name, text), "ERROR")
    shown = rendered_camera(scene)
    if not shown:
        yield Told(
            Message("The scene has no camera for F12: press Flexible Projection or Cycles below With F12")
        )
    elif shown != camera.name:
        yield Told(Message("F12 shows {0}: press Flexible Projection or Cycles below With F12", shown))
    if scene.render.use_multiview:
        yield Told(Message("One view: F12 renders all"))
    if camera.scfpf.report:
        yield Told(camera.scfpf.report, "CHECKMARK")
    if text := plan_text(scene, camera):
        yield Told(text)
    yield from _of_aim(camera.scfpf)
    if camera.scfpf.edit_volume:
        yield Told(EDITING)
    elif is_plain(camera):
        yield Told(NEXT)


def problems(scene, camera) -> list[str]:
    """The reasons why a flexible camera cannot render, each in a few words."""
    slots = camera.scfpf.surfaces
    found = []
    if len(slots) < 2 and not is_lattice_volume(slots):
        found.append("A volume needs two control surfaces")
    absent = {absence_of(scene, slot) for slot in slots}
    return found + [text for where, text in ABSENT.items() if where in absent]


def plan_text(scene, camera) -> str:
    """The text of the plan that a camera keeps for renders by another engine; empty without one."""
    plan = KeptPlan.read(camera.scfpf.anchor_plan)
    if plan is None:
        return ""
    if plan.size != image_size(scene):
        return label_text("Plan of {0} × {1} pixels: plan again", *plan.size)
    if plan.texels != PlanLimits.of_samples(camera.scfpf.samples).texels:
        return label_text("Plan for other samples: plan again")
    count, pixels = len(plan.anchors), plan.pixels
    renderer = joined_engine(scene)
    every = pixels * plan.size[0] * plan.size[1]
    seconds = estimated_seconds(renderer, count, every, camera.scfpf.anchor_times)
    text = label_text("Plan: {0} renders, {1:.2%}, {2:.1f} × the pixels", count, plan.shown, pixels)
    return text if seconds is None else label_text("{0}, about {1:.0f} s", text, seconds)


def _of_aim(settings) -> Iterator[Told]:
    """The outcome of the last solve, which the panel Aim shows in part."""
    for target in settings.aim_targets:
        # The line of the whole solve has that of its only view.
        if target.is_on and target.message and target.message not in settings.aim.message:
            text = Message("{0}: {1}", target.name, target.message)
            yield Told(text, "ERROR" if target.hidden > 0.0 else "INFO")
    if settings.aim_targets and settings.aim.message:
        yield Told(settings.aim.message, "ERROR" if settings.aim.flaws else "INFO")


def is_plain(camera) -> bool:
    """Return whether a picture is a new camera's: two planes, and neither mappings nor views nor layers."""
    settings = camera.scfpf
    kinds = [slot.object and slot.object.scfpf_surface.kind for slot in settings.surfaces]
    more = settings.mappings, settings.layers, settings.aim_targets
    return kinds == ["PLANE", "PLANE"] and not any(map(len, more)) and not is_blend(camera)


def _needs_fit(scene, camera) -> bool:
    try:
        return needs_fit(camera, image_aspect(scene))
    except UserError:
        return False  # Rendering reports that the image is too large.


def _of_preview(context, camera, source) -> Iterator[Told]:
    """What is wrong with a nodes preview, and what it leaves out."""
    if source.scfpf_preview.problem:
        yield Told(source.scfpf_preview.problem, "ERROR")
    depsgraph = context.evaluated_depsgraph_get()
    if is_flat(source, depsgraph):
        yield Told(FLAT, "ERROR")
    if not viewports_of(source):
        yield Told(Message("No viewport shows the nodes preview"), operator="scfpf.preview_show")
    for text in reported(left_out(source, depsgraph)):
        yield Told(text)
    if text := not_here(camera):
        yield Told(text)


def reported(counts) -> list[str]:
    """A sentence for each count of a preview that is not 0."""
    return [text.format(counts[key]) for key, text in LEFT_OUT if counts[key]]


def told(context, camera) -> list[Told]:
    """All messages, at least that everything is ready."""
    ready = READY_LIVE if is_any(context, camera, is_live) else READY
    return list(messages(context, camera)) or [Told(ready, "CHECKMARK")]


def draw_messages(layout, context, camera) -> None:
    """Draw the most urgent message, with its button and that of the popover, in ``LINES`` + 1 lines."""
    found = told(context, camera)
    first = found[0]
    column = layout.box().column(align=True)
    text = translated_label(first.text).replace(" · ", ", ")
    fits = draw_fixed(column, [text], first.icon, LINES)
    row = column.row(align=True)
    if first.operator:
        row.operator(first.operator)
    if len(found) > 1 or not fits:
        row.popover("SCFPF_PT_messages", text=label_text("All Messages: {0}", len(found)))
    elif not first.operator:
        row.label()


class SCFPF_PT_messages(bpy.types.Panel):
    """All messages about the flexible camera"""

    bl_label = "Messages"
    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"
    bl_ui_units_x = 16

    def draw(self, context):
        camera = flexible_camera_of(context)
        for one in told(context, camera) if camera is not None else ():
            column = self.layout.column(align=True)
            draw_text(column, one.text, one.icon)
            if one.operator:
                column.operator(one.operator)


register, unregister = bpy.utils.register_classes_factory((SCFPF_PT_messages,))
