# SPDX-License-Identifier: GPL-3.0-or-later
"""One image joined from an image of each layer, each pixel's in the order of their keys.

Samples of different layers mix in a pixel by alpha: whatever is in front covers its share of the pixel, and
what is behind shows in the rest.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray
from ...projection.volume.viewing_volume import ImageLayer

# Places across and up a pixel at which a frame and a mask are looked at.
COVER_SIDE = 4


def shares(alphas: Sequence[NDArray[np.float32]], keys: Sequence[Array]) -> Array:
    """The share (K, N) of each pixel in which nothing of the other K - 1 sources is before a source.

    alphas: (N,) of each source. keys: (S, N) of each, at S places of each pixel, see ``layer_keys``. Of equal
    keys the earlier source is in front. A source whose keys are all infinite is behind the others.
    """
    alpha, depth = np.clip(np.stack(alphas), 0.0, 1.0), np.stack([_filled(each) for each in keys])
    total, pixels = np.zeros(alpha.shape), np.arange(alpha.shape[1])
    places = depth.shape[1]
    for place in range(places):
        order = np.argsort(depth[:, place], axis=0, kind="stable")
        shows = np.ones(alpha.shape[1])
        for rank in order:
            total[rank, pixels] += shows
            shows = shows * (1.0 - alpha[rank, pixels])
    share: Array = total / places
    return share


def joined(sources: Sequence[NDArray[np.float32]], share: Array, is_seen: BoolArray) -> NDArray[np.float32]:
    """Values (N, C) of pixels that are sums over their samples, such as premultiplied colours.

    sources: (N, C) of each source; the first is the rest of the image. share: (K, N), see ``shares``.
    is_seen: (N,), whether any layer is; other pixels keep the values of the rest.
    """
    total = sum(each * own[:, None] for each, own in zip(sources, share, strict=True))
    pixels: NDArray[np.float32] = np.where(is_seen[:, None], total, sources[0]).astype(np.float32)
    return pixels


def _filled(keys: Array) -> Array:
    """Keys (S, N) with the nearest one of a pixel where it has others; its alpha tells how much it covers."""
    filled: Array = np.where(np.isfinite(keys), keys, keys.min(axis=0))
    return filled


def cover(layer: ImageLayer, size: tuple[int, int], window: tuple[int, int, int, int]) -> Array:
    """The share (H, W) of each pixel of a window in which the frame and the mask of a layer show it.

    size: of the whole image in pixels. window: left, bottom, right and top, in pixels.
    """
    left, bottom, right, top = window
    total = np.zeros((top - bottom, right - left))
    steps = (np.arange(COVER_SIDE) + 0.5) / COVER_SIDE
    for step_x in steps:
        for step_y in steps:
            x = (np.arange(left, right) + step_x) / size[0]
            y = (np.arange(bottom, top) + step_y) / size[1]
            x, y = (axis.ravel() for axis in np.meshgrid(x, y))
            shown = (
                layer.shown_at(x, y)
                & layer.projection.reparameterisation.points(x, y, layer.projection.aspect).mask
            )
            total += shown.reshape(total.shape)
    return total / COVER_SIDE**2


def halo_share(is_seen: BoolArray, nearness: Array) -> Array:
    """The share (H, W) of what is beside and before a layer's things in each pixel that its halo shows.

    is_seen: (S, H, W), whether the surroundings of the things are seen at S places of each pixel. nearness:
    (S, H, W), the halo's share of each of these, 0 where none is seen. A pixel in which no place sees them
    has its neighbours' share, as the filter of a render reaches into those.
    """
    seen, near = is_seen.sum(axis=0).astype(np.float64), nearness.sum(axis=0).astype(np.float64)
    is_alone = seen == 0.0
    seen, near = (np.where(is_alone, _of_neighbours(each), each) for each in (seen, near))
    share: Array = np.divide(near, seen, out=np.zeros_like(near), where=seen > 0.0)
    return share


def _of_neighbours(values: Array) -> Array:
    """The sums (H, W) of a pixel's values and those of the eight around it."""
    padded, (rows, columns) = np.pad(values, 1), values.shape
    total: Array = np.sum([padded[i : i + rows, j : j + columns] for i in range(3) for j in range(3)], axis=0)
    return total
