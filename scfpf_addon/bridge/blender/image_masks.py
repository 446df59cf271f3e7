# SPDX-License-Identifier: GPL-3.0-or-later
"""Images of Blender as masks and maps over a picture.

Their first channel counts, whatever their color space: they are painted in black and white.
"""

from __future__ import annotations

import numpy as np

from ...projection.typing import Array


def mask_pixels(image, reads: bool = True) -> Array | None:
    """The first channel of a Blender image, (H, W) in [0, 1] from the bottom up; None if it has no pixels.

    reads: False for a single 0 instead, where it matters only whether there are any.
    """
    across, up = image.size
    if not (across and up and image.has_data):
        return None
    if not reads:
        return np.zeros((1, 1))
    pixels = np.empty(across * up * image.channels, np.float32)
    image.pixels.foreach_get(pixels)
    values = pixels.reshape(up, across, -1)[..., 0].astype(np.float64)
    return np.clip(np.nan_to_num(values), 0.0, 1.0)


def values_at(pixels: Array, positions: Array) -> Array:
    """The nearest pixels (H, W) at image positions (2, N) in [0, 1], (N,).

    pixels: see ``mask_pixels``, row 0 at the lower border.
    """
    up, across = pixels.shape
    x, y = (np.minimum((p * n).astype(np.int64), n - 1) for p, n in zip(positions, (across, up), strict=True))
    values: Array = pixels[y, x]
    return values
