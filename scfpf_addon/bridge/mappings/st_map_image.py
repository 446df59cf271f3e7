# SPDX-License-Identifier: GPL-3.0-or-later
"""A projection's image mapping as an ST map image."""

from __future__ import annotations

import bpy
import numpy as np

from ...projection.mappings.stack import Stack, mapped_places
from ...projection.volume.viewing_volume import Projection
from ..blender.packing import pack

IMAGE_NAME = "SCFPF ST Map"
CONTENTS = (
    ("MAPPINGS", "Mappings", "Position in the picture without mappings that each pixel shows"),
    ("PARAMETERS", "U and V", "Parameters u and v that each pixel shows, with the mapping and the ranges"),
)


def write_st_map(projection: Projection, size: tuple[int, int], content: str, inverse: bool):
    """A new float image of a picture's size: red to the right, green up, alpha 0 where nothing is seen.

    With what to tell the user where the file cannot keep it, else ''.

    content: MAPPINGS or PARAMETERS. inverse: at each place (or u and v, as shares of their ranges) where
    in the picture it is seen.
    """
    width, height = size
    grid = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    x, y = (axis.ravel() for axis in grid)
    image = projection.reparameterisation
    mappings = image.mappings if isinstance(image, Stack) else ()
    if content == "MAPPINGS" and inverse:
        u, v = x, y
        for mapping in reversed(mappings):
            u, v = mapping.image_positions(u, v, projection.aspect)
        mask = np.isfinite(u) & np.isfinite(v)
    elif content == "MAPPINGS":
        u, v, mask = mapped_places(mappings, x, y, projection.aspect)
    elif inverse:
        u, v = image.image_positions(x, y, projection.aspect)
        mask = np.isfinite(u) & np.isfinite(v)
    else:
        u, v, _, mask = projection.parameters(x, y)
    pixels = np.zeros((height * width, 4), np.float32)
    pixels[:, 0], pixels[:, 1] = np.where(mask, u, 0.0), np.where(mask, v, 0.0)
    pixels[:, 3] = mask
    result = bpy.data.images.new(IMAGE_NAME, width, height, alpha=True, float_buffer=True, is_data=True)
    # Pixels as they are: straight alpha would be multiplied when the file is opened again.
    result.alpha_mode = "PREMUL"
    result.pixels.foreach_set(pixels.ravel())
    result.update()
    return result, pack(result)
