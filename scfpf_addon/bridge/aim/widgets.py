# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames and marks of Aim's targets over the image, as gizmos in Image Editors and in Live View.

A gizmo highlights what is under the mouse, and a press on it calls the operator that drags.
"""

from __future__ import annotations

import math

import bpy
import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader

from ...projection.user_error import Message
from ...shading.picking.frame_handles import ORBIT, TURN
from ..blender.user_errors import translated_report
from ..overlays.image_marks import ARM, MARK, RIM, TEXT_GAP, draw_cross, draw_lines, write
from ..settings.aim_properties import LARGEST
from .shown_targets import ShownImage, ShownTarget, shown_image, shown_targets, straight_lines, target_at

DRAG = "scfpf.aim_drag"
POINT_SHADER = "POINT_UNIFORM_COLOR"
# Display colours of the targets that are not active, and of what the mouse is over.
QUIET, HOVERED = (0.75, 0.75, 0.75, 1.0), (1.0, 1.0, 1.0, 1.0)
# Pixels at a display scale of 1: handles, the turning handle, their rims; the ring of a pin.
HANDLE, TURNER, HANDLE_RIM, RING = 8.0, 10.0, 3.0, 8.0
RING_SIDES = 16
# The ring that turns a view is less opaque than its frame.
RING_ALPHA = 0.5
# A residual above so many pixels is told in the label.
WELL_MET = 1.5
# Labels of the worst places.
OFF, LOST = Message("{0}: {1:.0f} px off"), Message("{0}: is lost here")


def label_of(target) -> str:
    """The name of a target, with what is wrong with it."""
    if target.hidden > 0.0 and target.hidden_by:
        return f"{target.name}: hidden by {target.hidden_by}"
    if target.residual_max > WELL_MET:
        return f"{target.name}: {target.residual_max:.1f} px off"
    return target.name


def outline(shown: ShownTarget, scale: float) -> list[tuple[float, float]]:
    """End points of the lines of a target: its frame with the stalk, or the ring of a pin."""
    if shown.frame is None:
        x, y = shown.origin
        around = [
            (x + RING * scale * math.cos(a), y + RING * scale * math.sin(a))
            for a in (math.tau * n / RING_SIDES for n in range(RING_SIDES))
        ]
    else:
        around = [tuple(corner) for corner in shown.frame.corners.T]
    ends = [end for n in range(len(around)) for end in (around[n], around[(n + 1) % len(around)])]
    if shown.frame is not None:
        ends += [tuple(end) for end in shown.frame.stalk(scale).T]
    return ends


def ring_lines(shown: ShownTarget, scale: float) -> list[tuple[float, float]]:
    """End points of the lines of the ring around a view's frame; none for a pin."""
    if shown.frame is None:
        return []
    around = [tuple(place) for place in shown.frame.ring(scale).T]
    return [end for n in range(len(around)) for end in (around[n - 1], around[n])]


def draw_targets(context, image: ShownImage, hovered: tuple[int, int] | None) -> None:
    """Draw all targets of a camera. hovered: index and part under the mouse, or None."""
    region, scale = context.region, context.preferences.system.ui_scale
    size, settings = (region.width, region.height), image.camera.scfpf
    for x, y, label in worst_places(settings, image):
        draw_cross(x, y, size, scale)
        write(label, x + ARM * scale, y + TEXT_GAP * scale, size, scale)
    for ends in straight_lines(settings, image):
        draw_lines([tuple(end) for end in ends], size, scale, QUIET)
    for shown in shown_targets(context, image):
        target = settings.aim_targets[shown.index]
        is_active = shown.index == settings.active_aim
        color = MARK if is_active else QUIET
        part = hovered[1] if hovered is not None and hovered[0] == shown.index else None
        draw_lines(outline(shown, scale), size, scale, color if part in (None, ORBIT) else HOVERED)
        if is_active or part is not None:
            quiet = (*color[:3], RING_ALPHA)
            draw_lines(ring_lines(shown, scale), size, scale, HOVERED if part == ORBIT else quiet)
        handles = [] if shown.frame is None else [tuple(corner) for corner in shown.frame.corners.T]
        _draw_points(handles or [tuple(shown.origin)], HANDLE * scale, color)
        if shown.frame is not None:
            handles.append(tuple(shown.frame.stalk(scale)[:, 1]))
            _draw_points(handles[TURN:], TURNER * scale, color)
        if part is not None and part < len(handles):
            _draw_points([handles[part]], TURNER * scale, HOVERED)
        if is_active or part is not None:
            around = outline(shown, scale)[:-2]
            left, top = min(x for x, _ in around), max(y for _, y in around)
            write(label_of(target), left, top + TEXT_GAP * scale, size, scale, color)


def worst_places(settings, image: ShownImage) -> list[tuple[float, float, str]]:
    """The pixels of the worst places of the active view's thing and of the background, and their labels.

    Those that a user would not notice are left out.
    """
    aim = settings.aim
    found = [(aim.background_max, aim.background_worst, Message("background"))]
    if settings.active_aim < len(settings.aim_targets):
        target = settings.aim_targets[settings.active_aim]
        if target.is_on:
            found.append((target.whole_max, target.whole_worst, target.name))
    marks = []
    for pixels, place, name in found if aim.is_solved else ():
        if pixels > WELL_MET:
            x, y = image.pixels(np.array(place, np.float64)[:, None])[:, 0]
            marks.append(
                (
                    float(x),
                    float(y),
                    translated_report(Message(LOST if pixels >= LARGEST else OFF, name, pixels)),
                )
            )
    return marks


def _draw_points(points, diameter: float, color) -> None:
    """Draw dots with a dark rim."""
    shader = gpu.shader.from_builtin(POINT_SHADER)
    batch = batch_for_shader(shader, "POINTS", {"pos": [(x, y, 0.0) for x, y in points]})
    gpu.state.blend_set("ALPHA")
    shader.bind()
    for tone, wide in ((RIM, diameter + HANDLE_RIM), (color, diameter)):
        gpu.state.point_size_set(wide)
        shader.uniform_float("color", tone)
        batch.draw(shader)
    gpu.state.blend_set("NONE")


class SCFPF_GT_aim(bpy.types.Gizmo):
    """The frames and marks of all targets in a region"""

    bl_idname = "SCFPF_GT_aim"
    __slots__ = ("_hovered",)

    def setup(self):
        self._hovered = None

    def draw(self, context):
        image = shown_image(context)
        if image is not None:
            draw_targets(context, image, self._hovered if self.is_highlight else None)

    def test_select(self, context, location):
        image = shown_image(context)
        scale = context.preferences.system.ui_scale
        before = self._hovered
        self._hovered = None if image is None else target_at(shown_targets(context, image), *location, scale)
        if self._hovered != before:
            context.region.tag_redraw()
        return -1 if self._hovered is None else 0


class _Group:
    """The gizmos of one editor."""

    bl_label = "Aim"
    bl_region_type = "WINDOW"
    bl_options = {"PERSISTENT", "SHOW_MODAL_ALL"}

    @classmethod
    def poll(cls, context):
        image = shown_image(context)
        return image is not None and len(image.camera.scfpf.aim_targets) > 0

    def setup(self, _context):
        gizmo = self.gizmos.new(SCFPF_GT_aim.bl_idname)
        gizmo.target_set_operator(DRAG)
        gizmo.use_draw_modal = True


class SCFPF_GGT_aim_viewport(_Group, bpy.types.GizmoGroup):
    bl_idname = "SCFPF_GGT_aim_viewport"
    bl_space_type = "VIEW_3D"


class SCFPF_GGT_aim_image(_Group, bpy.types.GizmoGroup):
    bl_idname = "SCFPF_GGT_aim_image"
    bl_space_type = "IMAGE_EDITOR"


register, unregister = bpy.utils.register_classes_factory(
    (SCFPF_GT_aim, SCFPF_GGT_aim_viewport, SCFPF_GGT_aim_image)
)
