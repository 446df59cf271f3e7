# SPDX-License-Identifier: GPL-3.0-or-later
"""Ray visibility of triangles: one bit of a byte for each kind of ray."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import BoolArray

# Projectors, shadow rays, rays of glossy lobes, rays of transmission lobes.
CAMERA, SHADOW, MIRROR, GLASS = 1, 2, 4, 8
EVERYWHERE = CAMERA | SHADOW | MIRROR | GLASS
# Not a ray: the triangle is a holdout, which hides others and leaves a hole in the image.
HOLDOUT = 16
# Nor this: the triangle is a shadow catcher, of which only the shadows on it are seen.
CATCHER = 32


def visible_to(visibility: NDArray[np.uint8] | None, ray: int) -> BoolArray | None:
    """Return which triangles a kind of ray meets, (T,), or None if it meets all.

    visibility: (T,), None if every ray meets every triangle.
    """
    if visibility is None:
        return None
    there: BoolArray = (visibility & ray) != 0
    return None if there.all() else there
