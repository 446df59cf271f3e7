# SPDX-License-Identifier: GPL-3.0-or-later
"""Matcaps: images of a lit ball, in which a surface finds its light by its normal.

The lookup is Workbench's (Blender's source, ``workbench_matcap.bsl.hh``): the normal is seen in axes that
turn with the view vector, so that perspective does not distort the ball.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...projection.typing import IndexArray
from ..typing import Single
from .studio_light import LitPixels

# The ball's radius as a share of the image's width, a little inside its border.
RADIUS = np.float32(0.496)


@dataclass(frozen=True)
class Matcap:
    """A matcap's images, (S, S, 3) float32, linear, row 0 at the bottom.

    diffuse: multiplied by the surface's colour. specular: added, None if it has none. is_flipped: whether
    left and right are exchanged.
    """

    diffuse: Single
    specular: Single | None = None
    is_flipped: bool = False


def matcap_color(matcap: Matcap, seen: LitPixels, base: Single, highlights: bool) -> Single:
    """The linear colour (3, n) of surfaces by a matcap. base: (3, n). highlights: whether to add them."""
    u, v = matcap_position(seen, matcap.is_flipped)
    color = _interpolated(matcap.diffuse, u, v)
    color *= base
    if highlights and matcap.specular is not None:
        color += _interpolated(matcap.specular, u, v)
    return color


def matcap_position(seen: LitPixels, is_flipped: bool) -> tuple[Single, Single]:
    """The positions (n,) in a matcap, each in [0, 1], at which normals find their light."""
    (x, y, z), (right, up, toward) = seen.normal, seen.incident
    share = 1 / (1 + np.maximum(toward, np.float32(-0.999)))
    cross = -right * up * share
    u = (1 - right * right * share) * x + cross * y - right * z
    v = cross * x + (1 - up * up * share) * y - up * z
    half = np.float32(0.5)
    return (half - RADIUS * u if is_flipped else half + RADIUS * u), half + RADIUS * v


def _interpolated(image: Single, u: Single, v: Single) -> Single:
    """The image (H, W, 3) at (u, v), as (3, n): bilinear between texels, clamped at the border."""
    height, width = image.shape[:2]
    flat = image.reshape(-1, 3)
    x, y = u * width - np.float32(0.5), v * height - np.float32(0.5)
    np.clip(x, 0, width - 1, out=x)
    np.clip(y, 0, height - 1, out=y)
    column, row = x.astype(np.int32), y.astype(np.int32)
    x -= column
    y -= row
    right: IndexArray = np.minimum(column + 1, width - 1)
    below, above = row * width, np.minimum(row + 1, height - 1) * width
    x, y = x[:, None], y[:, None]
    low = flat.take(below + column, axis=0)
    low += (flat.take(below + right, axis=0) - low) * x
    high = flat.take(above + column, axis=0)
    high += (flat.take(above + right, axis=0) - high) * x
    low += (high - low) * y
    color: Single = low.T
    return color
