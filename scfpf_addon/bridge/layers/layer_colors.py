# SPDX-License-Identifier: GPL-3.0-or-later
"""The colours of layers, and the image that shows which layer each pixel belongs to."""

from __future__ import annotations

import bpy
import numpy as np

from ...projection.diagrams.line_colors import LAYERS
from ...shading.typing import Single

IMAGE_NAME = "Layers of {}"


def color_layers(layers) -> None:
    """Give each layer that has none, black, the first of the colors that the fewest others have."""
    for layer in layers:
        if not any(layer.color):
            taken = [tuple(round(part, 2) for part in other.color) for other in layers]
            layer.color = min(LAYERS, key=taken.count)


def write_picture(camera, pixels: Single):
    """Keep an image of a camera's layers in its property ``layer_image``; return the image.

    pixels: (H, W, 4) display colours, row 0 at the bottom. The image is new, so that undo brings back the one
    before, and editors go on with it.
    """
    height, width = pixels.shape[:2]
    made = bpy.data.images.new(IMAGE_NAME.format(camera.name), width, height)
    made.pixels.foreach_set(np.ascontiguousarray(pixels, np.float32).reshape(-1))
    made.update()
    made.pack()
    before = camera.scfpf.layer_image
    camera.scfpf.layer_image = made
    if before is not None and before.is_editable:
        name = before.name
        before.user_remap(made)
        bpy.data.images.remove(before)
        made.name = name
    return made
