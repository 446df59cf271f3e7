# SPDX-License-Identifier: GPL-3.0-or-later
"""The image of a flexible camera in a region: Live View, Rendered shading, or a render in an Image Editor."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from bpy.types import Object

from ...projection.typing import Array
from ..live.seen_object import shown_camera
from ..overlays.image_marks import marked_camera
from ..render.render_viewport import camera_rectangle, viewport_eye
from ..render.result_image import result_image
from ..render.view_painter import Rectangle


class ShownImage(NamedTuple):
    """A flexible camera whose image a region shows, and where, in pixels of the region."""

    camera: Object
    rectangle: Rectangle

    def pixels(self, positions: Array) -> Array:
        """The pixels of image positions, (2, N) each."""
        left, bottom, width, height = self.rectangle
        placed: Array = positions * np.array([[width], [height]]) + np.array([[left], [bottom]])
        return placed


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
