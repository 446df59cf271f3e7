# SPDX-License-Identifier: GPL-3.0-or-later
"""The keys that decide which layer of an image hides which: the smallest is in front.

The caster's hits and the joined renders of Cycles are compared by them alike.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...projection.typing import Array, BoolArray
from ...projection.volume.viewing_volume import ImageLayer


def layer_keys(
    layers: Sequence[ImageLayer], number: int, position: Array, is_hit: BoolArray, middle: Array | None
) -> Array:
    """The keys (N,) of points that one layer shows, infinite where it shows none.

    layers: of the image, at least one. number: of the layer, 0 for the rest of the image. position: (3, N),
    in the space of the layers. is_hit: (N,). middle: (3,) of the layer's things, None without any.
    """
    front, eye = "DEPTH", layers[0].eye
    if number and middle is not None:
        front, eye = layers[number - 1].front, layers[number - 1].eye
        if front == "ANCHOR":
            position = middle[:, None]
    if front == "ORDER":
        # Distances are not negative.
        key = np.array(float(number - len(layers) - 1))
    else:
        key = np.sqrt(((position - eye[:, None]) ** 2).sum(axis=0))
    keys: Array = np.where(is_hit, key, np.inf)
    return keys
