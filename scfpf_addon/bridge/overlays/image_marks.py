# SPDX-License-Identifier: GPL-3.0-or-later
"""Marks over the render in Image Editors: a box around the found object, a cross at the picked position."""

from __future__ import annotations

from collections.abc import Callable

import blf
import bpy
import gpu
from gpu_extras.batch import batch_for_shader

from ..blender.draw_handler import DrawHandler
from ..blender.rig_mark import camera_behind
from ..render.result_image import result_image

SHADER = "POLYLINE_UNIFORM_COLOR"
# Display colours. Lines and letters have a dark rim, so that they are visible over any image.
MARK = (1.0, 0.95, 0.15, 1.0)
RIM = (0.0, 0.0, 0.0, 0.65)
# Pixels at a display scale of 1: lines, their rims, the arms of the cross and the gap in its middle.
LINE, RIM_LINE, ARM, GAP = 1.5, 4.0, 11.0, 3.0
TEXT_SIZE = 12.0
# Pixels between the box and its name, and between the object and its box.
TEXT_GAP, MARGIN = 6.0, 3.0


def mark_lines(settings, to_region: Callable, scale: float) -> list[tuple[float, float]]:
    """End points, in pixels of the region, of the lines of a camera's marks.

    to_region: from shares of the image to pixels. scale: display scale.
    """
    lines = []
    if settings.show_found:
        left, low, right, high = _box(settings, to_region, scale)
        corners = [(left, low), (right, low), (right, high), (left, high)]
        lines += [end for i in range(4) for end in (corners[i], corners[(i + 1) % 4])]
    if settings.show_pick:
        lines += _cross(*to_region(*settings.pick), scale)
    return lines


def _cross(x: float, y: float, scale: float) -> list[tuple[float, float]]:
    """End points of the arms of a cross."""
    return [
        (x + dx * r * scale, y + dy * r * scale)
        for dx, dy in ((1, 0), (-1, 0), (0, 1), (0, -1))
        for r in (GAP, ARM)
    ]


def _box(settings, to_region, scale) -> tuple[float, float, float, float]:
    left, low = to_region(*settings.found_box[:2])
    right, high = to_region(*settings.found_box[2:])
    return left - MARGIN * scale, low - MARGIN * scale, right + MARGIN * scale, high + MARGIN * scale


def draw_marks(settings, to_region: Callable, size: tuple[int, int], scale: float) -> None:
    """Draw a camera's marks into the active framebuffer, with matrices in pixels.

    size: of the region, pixels.
    """
    lines = mark_lines(settings, to_region, scale)
    if not lines:
        return
    draw_lines(lines, size, scale)
    if settings.show_found:
        left, _, _, high = _box(settings, to_region, scale)
        write(settings.found_object.split(" · ")[0], left, high + TEXT_GAP * scale, size, scale)


def draw_cross(x: float, y: float, size: tuple[int, int], scale: float) -> None:
    """Draw the cross of a picked position at a pixel of a region. size, scale: as for ``draw_marks``."""
    draw_lines(_cross(x, y, scale), size, scale)


def draw_lines(lines, size: tuple[int, int], scale: float, color=MARK) -> None:
    """Draw lines with a dark rim, given by their end points in pixels. size, scale: as above."""
    shader = gpu.shader.from_builtin(SHADER)
    batch = batch_for_shader(shader, "LINES", {"pos": [(x, y, 0.0) for x, y in lines]})
    gpu.state.blend_set("ALPHA")
    shader.bind()
    shader.uniform_float("viewportSize", size)
    for tone, width in ((RIM, RIM_LINE), (color, LINE)):
        shader.uniform_float("lineWidth", width * scale)
        shader.uniform_float("color", tone)
        batch.draw(shader)
    gpu.state.blend_set("NONE")


def write(text: str, x: float, y: float, size: tuple[int, int], scale: float, color=MARK) -> None:
    """Draw a line of text inside the region."""
    font = 0
    blf.size(font, TEXT_SIZE * scale)
    width, height = blf.dimensions(font, text)
    blf.enable(font, blf.SHADOW)
    blf.shadow(font, 5, 0.0, 0.0, 0.0, 1.0)
    blf.color(font, *color)
    blf.position(font, max(0.0, min(x, size[0] - width)), max(0.0, min(y, size[1] - height)), 0.0)
    blf.draw(font, text)
    blf.disable(font, blf.SHADOW)


def marked_camera(context):
    """The camera whose marks are shown: the scene's camera if flexible, else the active object, or None."""
    for candidate in (context.scene.camera, getattr(context, "object", None)):
        camera = camera_behind(candidate)
        if camera is not None and camera.type == "CAMERA" and camera.scfpf.enabled:
            return camera
    return None


def draw_image_editor() -> None:
    """The draw handler of Image Editors: marks only over the extension's render."""
    context = bpy.context
    image, camera = context.space_data.image, marked_camera(context)
    if image is None or image != result_image() or camera is None:
        return
    region = context.region
    to_region = region.view2d.view_to_region

    def pixels(x, y):
        return to_region(x, y, clip=False)

    draw_marks(camera.scfpf, pixels, (region.width, region.height), context.preferences.system.ui_scale)


_draw_handler = DrawHandler(bpy.types.SpaceImageEditor, draw_image_editor, "POST_PIXEL")
register, unregister = _draw_handler.register, _draw_handler.unregister
