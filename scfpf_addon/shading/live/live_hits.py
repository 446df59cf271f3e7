# SPDX-License-Identifier: GPL-3.0-or-later
"""The hits of a live image: what each pixel's projector meets first, and from where it is seen."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import BoolArray
from ..typing import Single


class LiveHits(NamedTuple):
    """The first hits of an image's N = height · width projectors, row by row from the bottom.

    width, height: of the image, in pixels. mask: (N,) False where there is no projector.
    look: (N,) int32, row of the scene's table of looks (an object and one of its material slots), -1 on a
    miss. object: (N,) int32, number of the object or instance in the scene, -1 on a miss.
    t: (N,) float32 along the projector, inf on a miss. position: (3, N) float32, world space.
    forward, right, up: (3, N) float32 unit vectors in world space, the axes of the pixel's own view: along
    the projector, and across it where the image's x and y grow. Where the volume is folded, the image is
    mirrored and the axes are left-handed. is_mirrored: (N,) whether they are.
    normal: (3, N) float32, unit shading normal in world space, on the side of the viewer.
    uv: (2, N) float32, texture coordinates, or None if no look asks for them.
    color: (3, N) float32, the mesh's active colour attribute, linear, or None if no look asks for it.
    On a miss the floats are 0, but for t and the axes.
    """

    width: int
    height: int
    mask: BoolArray
    look: NDArray[np.int32]
    object: NDArray[np.int32]
    t: Single
    position: Single
    forward: Single
    right: Single
    up: Single
    is_mirrored: BoolArray
    normal: Single
    uv: Single | None = None
    color: Single | None = None
