# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames and marks over the image, as gizmos in Image Editors and in Live View.

A gizmo highlights what is under the mouse, and a press on it calls the operator that drags.
"""

from __future__ import annotations

import math

import gpu
from gpu_extras.batch import batch_for_shader

from ...shading.picking.frame_handles import BODY, ORBIT
from ..overlays.image_marks import MARK, RIM, TEXT_GAP, draw_lines, write
from .shown_frame import ShownFrame, frame_at
from .shown_image import ShownImage, shown_image

POINT_SHADER = "POINT_UNIFORM_COLOR"
# Display colours of the frames that are not active, and of what the mouse is over.
QUIET, HOVERED = (0.75, 0.75, 0.75, 1.0), (1.0, 1.0, 1.0, 1.0)
# Pixels at a display scale of 1: handles, the fifth handle, their rims; the ring of a mark.
HANDLE, FIFTH, HANDLE_RIM, MARK_RING = 8.0, 10.0, 3.0, 8.0
MARK_SIDES = 16
# The ring that turns a view is less opaque than its frame.
RING_ALPHA = 0.5


def outline(shown: ShownFrame, scale: float) -> list[tuple[float, float]]:
    """End points of the lines of a frame with its stalk, or of the ring of a mark."""
    if shown.frame is None:
        x, y = shown.origin
        around = [
            (x + MARK_RING * scale * math.cos(a), y + MARK_RING * scale * math.sin(a))
            for a in (math.tau * n / MARK_SIDES for n in range(MARK_SIDES))
        ]
    else:
        around = [tuple(corner) for corner in shown.frame.corners.T]
    ends = [end for n in range(len(around)) for end in (around[n], around[(n + 1) % len(around)])]
    if shown.frame is not None and not shown.frame.has_grip:
        ends += [tuple(end) for end in shown.frame.stalk(scale).T]
    return ends


def ring_lines(shown: ShownFrame, scale: float) -> list[tuple[float, float]]:
    """End points of the lines of the ring around a frame; none for marks and frames with a grip."""
    if shown.frame is None or shown.frame.has_grip:
        return []
    around = [tuple(place) for place in shown.frame.ring(scale).T]
    return [end for n in range(len(around)) for end in (around[n - 1], around[n])]


def draw_frames(context, frames: list[ShownFrame], hovered: tuple[int, int] | None) -> None:
    """Draw frames and marks. hovered: index and part under the mouse, or None."""
    region, scale = context.region, context.preferences.system.ui_scale
    size = region.width, region.height
    for shown in frames:
        color = MARK if shown.is_active else QUIET
        part = hovered[1] if hovered is not None and hovered[0] == shown.index else None
        draw_lines(outline(shown, scale), size, scale, color if part in (None, ORBIT) else HOVERED)
        ring = ring_lines(shown, scale)
        if ring and (shown.is_active or part is not None):
            draw_lines(ring, size, scale, HOVERED if part == ORBIT else (*color[:3], RING_ALPHA))
        _draw_handles(shown, scale, color, part)
        if shown.is_active or part is not None:
            around = outline(shown, scale)
            left, top = min(x for x, _ in around), max(y for _, y in around)
            if shown.frame is not None:
                left, top = shown.frame.corners[0].min(), shown.frame.corners[1].max()
            write(shown.label, left, top + TEXT_GAP * scale, size, scale, color)


def _draw_handles(shown: ShownFrame, scale: float, color, part: int | None) -> None:
    """Draw the handles of a frame, or the point of a mark. part: under the mouse, or None."""
    if shown.frame is None:
        _draw_points([tuple(shown.origin)], HANDLE * scale, color)
        return
    handles = [tuple(place) for place in shown.frame.handles(scale).T]
    _draw_points(handles[:4], HANDLE * scale, color)
    _draw_points(handles[4:], FIFTH * scale, color)
    hovered = 4 if part == BODY and shown.frame.has_grip else part
    if hovered is not None and hovered < len(handles):
        _draw_points([handles[hovered]], FIFTH * scale, HOVERED)


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


class FrameGizmo:
    """The base of a gizmo that is all frames of one of the camera's lists in a region."""

    __slots__ = ()

    def frames(self, context, image: ShownImage) -> list[ShownFrame]:
        """The frames of the image's camera; the last one is in front."""
        raise NotImplementedError

    def draw_below(self, context, image: ShownImage) -> None:
        """Draw what is under the frames."""

    def setup(self):
        self._hovered = None

    def draw(self, context):
        image = shown_image(context)
        if image is not None:
            self.draw_below(context, image)
            draw_frames(context, self.frames(context, image), self._hovered if self.is_highlight else None)

    def test_select(self, context, location):
        image = shown_image(context)
        scale = context.preferences.system.ui_scale
        before = self._hovered
        self._hovered = None if image is None else frame_at(self.frames(context, image), *location, scale)
        if self._hovered != before:
            context.region.tag_redraw()
        return -1 if self._hovered is None else 0


class FrameGroup:
    """The base of a gizmo group of one kind of editor. gizmo, drag: identifiers of its gizmo and operator."""

    bl_region_type = "WINDOW"
    bl_options = {"PERSISTENT", "SHOW_MODAL_ALL"}
    gizmo = drag = ""

    @classmethod
    def has_frames(cls, settings) -> bool:
        """Return whether a camera may have frames. Quick."""
        raise NotImplementedError

    @classmethod
    def poll(cls, context):
        image = shown_image(context)
        return image is not None and cls.has_frames(image.camera.scfpf)

    def setup(self, _context):
        gizmo = self.gizmos.new(self.gizmo)
        gizmo.target_set_operator(self.drag)
        gizmo.use_draw_modal = True
