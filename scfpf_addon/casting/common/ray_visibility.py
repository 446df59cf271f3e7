# SPDX-License-Identifier: GPL-3.0-or-later
"""To which rays triangles are visible: bits of a byte each."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import BoolArray

# Projectors; rays that look for shadows; what mirrors and what glass send on.
CAMERA, SHADOW, MIRROR, GLASS = 1, 2, 4, 8
EVERYWHERE = CAMERA | SHADOW | MIRROR | GLASS
# Not a ray: what hides things and leaves a hole in the picture.
HOLDOUT = 16
# Nor this: what is seen of things is but the shadows on them.
CATCHER = 32


def visible_to(visibility: NDArray[np.uint8] | None, ray: int) -> BoolArray | None:
    """Which triangles rays of a kind meet, (T,); None for all. visibility: (T,), None where all see all."""
    if visibility is None:
        return None
    there: BoolArray = (visibility & ray) != 0
    return None if there.all() else there
