# SPDX-License-Identifier: GPL-3.0-or-later
"""Image textures: interpolation, extension beyond the border, and colour space.

As in Blender's documentation of the Image Texture node. A texel's centre is at
((i + ½) / width, (j + ½) / height). There is no filter by the pixel footprint: samples are averaged.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
from numpy.typing import NDArray

from ...projection.colors import linear_from_srgb
from ...projection.typing import Array, IndexArray

Extension = Literal["REPEAT", "EXTEND", "CLIP", "MIRROR"]
Interpolation = Literal["Closest", "Linear", "Cubic"]

# Blender's colour of a missing image.
MISSING = np.array([1.0, 0.0, 1.0, 1.0])

# Coordinates beyond this, which float64 cannot resolve to texels, count as 0.
FARTHEST = 1e9


@dataclass(frozen=True)
class ImageData:
    """An image.

    pixels: (H, W, 4) uint8 or float32, row 0 at the bottom. encoded: whether colours are sRGB's, otherwise
    scene-linear or plain data. premultiplied: whether colours are multiplied by alpha.
    """

    pixels: NDArray[Any]
    encoded: bool
    premultiplied: bool = False


def sample(
    image: ImageData | None,
    u: Array,
    v: Array,
    interpolation: Interpolation,
    extension: Extension,
    straight: bool,
) -> Array:
    """The image at (u, v), each (n,), as (4, n): scene-linear colour and alpha.

    straight: whether premultiplied colours are divided by alpha. image: None for a missing one.
    """
    if image is None or image.pixels.size == 0:
        return np.repeat(MISSING[:, None], len(u), axis=1)
    height, width = image.pixels.shape[:2]
    with np.errstate(invalid="ignore"):
        near = (np.abs(u) < FARTHEST) & (np.abs(v) < FARTHEST)
    u, v = np.where(near, u, 0.0), np.where(near, v, 0.0)
    if interpolation == "Closest":
        column, row = np.floor(u * width).astype(np.intp), np.floor(v * height).astype(np.intp)
        values = _texels(image, column, row, extension)
    else:
        values = _interpolated(image, u * width - 0.5, v * height - 0.5, interpolation, extension)
    if image.pixels.dtype == np.uint8:
        values /= 255.0
    if straight and image.premultiplied:
        alpha = values[3]
        values[:3] /= np.where((alpha != 0.0) & (alpha != 1.0), alpha, 1.0)
    if image.encoded:
        # Last of all, as Cycles does.
        values[:3] = linear_from_srgb(values[:3])
    return values


def _interpolated(image: ImageData, x: Array, y: Array, interpolation: str, extension: Extension) -> Array:
    """The interpolated texels (4, n) at (x, y), counted in texels from the centre of the first."""
    column, row = np.floor(x).astype(np.intp), np.floor(y).astype(np.intp)
    weigh = _cubic if interpolation == "Cubic" else _linear
    columns, rows = weigh(x - column), weigh(y - row)
    values = np.zeros((4, len(x)))
    for dy, share in rows:
        line = np.zeros((4, len(x)))
        for dx, part in columns:
            line += _texels(image, column + dx, row + dy, extension) * part
        values += line * share
    return values


def _linear(f: Array) -> list[tuple[int, Array]]:
    return [(0, 1.0 - f), (1, f)]


def _cubic(f: Array) -> list[tuple[int, Array]]:
    """The uniform cubic B-spline, which does not pass through the texels' values."""
    g = 1.0 - f
    return [
        (-1, g**3 / 6.0),
        (0, (4.0 - 6.0 * f**2 + 3.0 * f**3) / 6.0),
        (1, (4.0 - 6.0 * g**2 + 3.0 * g**3) / 6.0),
        (2, f**3 / 6.0),
    ]


def _texels(image: ImageData, column: IndexArray, row: IndexArray, extension: Extension) -> Array:
    """Stored texels (4, n), float64; beyond the border by ``extension``."""
    height, width = image.pixels.shape[:2]
    across, up = _wrap(column, width, extension), _wrap(row, height, extension)
    flat = image.pixels.reshape(-1, 4)
    values: Array = flat.take(up * width + across, axis=0).T.astype(np.float64)
    if extension == "CLIP":
        outside = (column < 0) | (column >= width) | (row < 0) | (row >= height)
        values[:, outside] = 0.0
    return values


def _wrap(index: IndexArray, size: int, extension: Extension) -> IndexArray:
    wrapped: IndexArray
    if extension == "REPEAT":
        wrapped = index % size
    elif extension == "MIRROR":
        turned = index % (2 * size)
        wrapped = np.minimum(turned, 2 * size - 1 - turned)
    else:
        wrapped = np.clip(index, 0, size - 1)
    return wrapped
