# SPDX-License-Identifier: GPL-3.0-or-later
"""Shells around the small things of a scene, for exact casting.

Prisms are as thick as the scene's size and its triangles require. In the prisms of a sky of 1 km spheres of
1 m overlap altogether. So triangles as far away as the sky are cast apart, in a cast space of their own; the
nearer hit counts, whose t is exact in both.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, IndexArray
from .cast_space import small_things

# A shell reaches so many times as far as the one before, the first as the nearest small things or as they are
# large; it is worth its time if the scene reaches WORTH times as far as that.
RATIO, WORTH = 16.0, 8.0


def shells_of(vertices: Array, triangles: NDArray[np.int32], usable: BoolArray) -> list[IndexArray]:
    """The usable triangles in shells, nearest first, [] if all are one.

    vertices: (3, V). triangles: (T, 3). usable: (T,).
    """
    corners = vertices.take(triangles.T, 1).swapaxes(0, 1)
    sizes = np.sqrt(((corners - corners[[1, 2, 0]]) ** 2).sum(axis=1).max(axis=0))
    centre, near, size = small_things(vertices.T, triangles, usable, sizes)
    first = RATIO * max(near, size)
    reach = np.abs(corners - centre[:, None]).max(axis=(0, 1))
    if not reach[usable].max() > WORTH * first:
        return []
    number = np.maximum(np.ceil(np.log(reach / first) / np.log(RATIO)), 0.0)
    parts = [np.flatnonzero(usable & (number == shell)) for shell in np.unique(number[usable])]
    return parts if len(parts) > 1 else []
