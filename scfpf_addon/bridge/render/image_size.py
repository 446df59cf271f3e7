# SPDX-License-Identifier: GPL-3.0-or-later
"""The size of a scene's image, its shape as it is shown, and its render region."""

from __future__ import annotations

import numpy as np

from ...casting.common.memory import shortage
from ...projection.user_error import UserError
from ...shading.settings.frame_settings import Border

# 16384 × 16384. A pixel is in the film and in Blender's buffer, then there and in the packed file,
# which takes 38 bytes.
MAXIMUM_PIXELS = 2**28
BYTES_PER_PIXEL = 48


def image_size(scene) -> tuple[int, int]:
    """Width and height in pixels from the scene's resolution and percentage, at least 1 × 1.

    Raises UserError if memory cannot hold the image.
    """
    render = scene.render
    width = max(render.resolution_x * render.resolution_percentage // 100, 1)
    height = max(render.resolution_y * render.resolution_percentage // 100, 1)
    require_size(width, height)
    return width, height


def require_size(width: int, height: int) -> None:
    """Raise UserError for an image that exceeds MAXIMUM_PIXELS or the free memory."""
    needed = width * height * BYTES_PER_PIXEL
    short = shortage(needed)
    if short is None and width * height <= MAXIMUM_PIXELS:
        return
    there_is = f" and {short[1]} are free" if short else ""
    raise UserError(
        "A picture of {0} × {1} pixels would need about {2:.1f} GB of memory{3}; lower "
        "the resolution or its percentage in Output Properties",
        width,
        height,
        needed / 1e9,
        there_is,
    )


def image_aspect(scene) -> float:
    """Width / height of the scene's image as it is shown, pixel aspect included. Raises UserError."""
    return shown_aspect(scene.render, *image_size(scene))


def shown_aspect(render, width: int, height: int) -> float:
    """Width / height of an image of width × height pixels as it is shown."""
    return width * render.pixel_aspect_x / (height * render.pixel_aspect_y)


def render_region(render, width: int, height: int) -> Border | None:
    """The pixels of a scene's render region, just as Blender counts them; None without a region.

    render: bpy.types.RenderSettings. width, height: of the whole image in pixels.
    """
    if not render.use_border:
        return None
    # Blender multiplies in float32 and cuts off.
    size = {"x": np.float32(width), "y": np.float32(height)}
    left, bottom, right, top = (
        int(np.float32(getattr(render, f"border_{end}_{axis}")) * size[axis])
        for end in ("min", "max")
        for axis in ("x", "y")
    )
    return Border(left, bottom, right, top)
