# SPDX-License-Identifier: GPL-3.0-or-later
"""The targets of Aim in a region that shows the camera's image: where they are, and what is under the mouse.

A region shows the image in the frame of Live View or of Rendered shading, or in an Image Editor.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from bpy.types import Object

from ...projection.typing import Array
from ...shading.picking.frame_handles import BODY, REACH, HandledFrame
from ..blender.user_errors import USER_ERRORS
from ..live.seen_object import shown_camera
from ..overlays.image_marks import marked_camera
from ..render.image_size import image_aspect
from ..render.render_viewport import camera_rectangle, viewport_eye
from ..render.result_image import result_image
from ..render.view_painter import Rectangle
from ..settings.aim_properties import LINE, PIN, VIEW
from .target_views import target_objects, thing_box, view_map


class ShownImage(NamedTuple):
    """A flexible camera whose image a region shows, and where, in pixels of the region."""

    camera: Object
    rectangle: Rectangle

    def pixels(self, positions: Array) -> Array:
        """The pixels of image positions, (2, N) each."""
        left, bottom, width, height = self.rectangle
        placed: Array = positions * np.array([[width], [height]]) + np.array([[left], [bottom]])
        return placed


class ShownTarget(NamedTuple):
    """A target in a region. frame: of a view, None for a pin. origin: (2,), the pixel of its position."""

    index: int
    origin: Array
    frame: HandledFrame | None


def shown_image(context) -> ShownImage | None:
    """The flexible camera that the context's region shows, and where; None without one."""
    space, region = context.space_data, context.region
    if space is None or region is None or region.type != "WINDOW":
        return None
    if space.type == "IMAGE_EDITOR":
        image, camera = space.image, marked_camera(context)
        if image is None or image != result_image() or camera is None:
            return None
        to_region = region.view2d.view_to_region
        left, bottom = to_region(0.0, 0.0, clip=False)
        right, top = to_region(1.0, 1.0, clip=False)
        return ShownImage(camera, Rectangle(left, bottom, right - left, top - bottom))
    camera = shown_camera(context)
    if camera is None:
        return None
    depsgraph = context.evaluated_depsgraph_get()
    eye = viewport_eye(space, depsgraph)
    frame = camera_rectangle(camera, depsgraph, region, context.region_data, eye)
    return None if frame is None else ShownImage(camera, frame)


def shown_targets(context, image: ShownImage) -> list[ShownTarget]:
    """The views and pins of the image's camera that are switched on, the active one last.

    A view that shows nothing has no frame, but the mark of a pin; its message says why.
    """
    settings = image.camera.scfpf
    depsgraph = context.evaluated_depsgraph_get()
    found = []
    for index, target in enumerate(settings.aim_targets):
        if not target.is_on or target.kind not in (VIEW, PIN):
            continue
        origin = image.pixels(np.array(target.position, np.float64)[:, None])[:, 0]
        frame = _frame(target, image, origin, depsgraph) if target.kind == VIEW else None
        found.append(ShownTarget(index, origin, frame))
    found.sort(key=lambda shown: shown.index == settings.active_aim)
    return found


def _frame(target, image: ShownImage, origin: Array, depsgraph) -> HandledFrame | None:
    """The frame around a view's thing in a region; None if the view shows nothing."""
    try:
        corners = box_corners(*thing_box(target_objects(target), depsgraph))
        aspect = image_aspect(depsgraph.scene)
        positions = view_map(target, depsgraph, aspect).positions(corners)
    except USER_ERRORS:
        return None
    seen = image.pixels(positions[:, np.isfinite(positions).all(axis=0)])
    return HandledFrame.around(seen, origin, target.turn) if seen.size else None


def box_corners(low: Array, high: Array) -> Array:
    """The corners of a box, (3, 8)."""
    return np.array(np.meshgrid(*np.stack([low, high], axis=1), indexing="ij")).reshape(3, 8)


def target_at(targets: list[ShownTarget], x: float, y: float, scale: float) -> tuple[int, int] | None:
    """The index of the target at a pixel and the part of it; handles come before bodies.

    targets: the last one is in front. scale: of the display.
    """
    bodies = []
    for shown in reversed(targets):
        if shown.frame is None:
            is_near = np.hypot(x - shown.origin[0], y - shown.origin[1]) <= REACH * scale
            part = BODY if is_near else None
        else:
            part = shown.frame.part_at(x, y, scale)
        if part == BODY and shown.frame is not None:
            bodies.append((shown.index, BODY))
        elif part is not None:
            return shown.index, part
    return bodies[0] if bodies else None


def straight_lines(settings, image: ShownImage) -> list[tuple[Array, Array]]:
    """The pixels of both ends of each line that has to stay straight."""
    pins = {t.handle: t.position for t in settings.aim_targets if t.kind == PIN and t.handle is not None}
    lines = []
    for target in settings.aim_targets:
        if target.kind == LINE and target.is_on and target.first in pins and target.second in pins:
            ends = np.array([pins[target.first], pins[target.second]], np.float64).T
            lines.append(tuple(image.pixels(ends).T))
    return lines
