# SPDX-License-Identifier: GPL-3.0-or-later
"""The film of a tile whose pixels all have the same number of samples."""

from __future__ import annotations

import numpy as np

from ..projection.typing import Array, BoolArray, IndexArray
from .typing import Single

# Pixels that are written at once, channel by channel, so that they fit a core's cache.
AT_ONCE = 1 << 12


class Film:
    """The mean of samples over the pixels of a tile: a box filter of one pixel.

    count: of pixels. transparent: whether pixels that hit nothing are transparent instead of showing the
    background (3,), a radiance.
    """

    def __init__(self, count: int, background: Array, transparent: bool) -> None:
        self._sum: Single = np.empty((4, count), np.float32)
        self._samples = 0
        self._empty = np.zeros(4, np.float32)
        if not transparent:
            self._empty[:] = (*background, 1)

    def add(self, _pixel: IndexArray, shown: BoolArray, hit: IndexArray, color: Single) -> None:
        """Add one sample of every pixel.

        shown: (count,), False where the image shows nothing: transparent black. hit: (n,) the pixels that
        see the scene. color: (3, n) of these, or (4, n) with alpha. The first parameter, for pixels (count,)
        in order, is that of ``AdaptiveFilm``.
        """
        if len(hit) == len(shown):
            sample = np.empty_like(self._sum)
            sample[:3], sample[3] = color[:3], color[3] if len(color) > 3 else 1
        else:
            sample = self._empty[:, None] * shown
            alpha = color[3] if len(color) > 3 else np.float32(1)
            for channel, values in zip(sample, (*color[:3], alpha), strict=True):
                channel[hit] = values
        if self._samples:
            self._sum += sample
        else:
            self._sum = sample
        self._samples += 1

    def samples(self, _pixel: IndexArray) -> float:
        """The number of samples of every pixel."""
        return float(self._samples)

    def develop(self, _pixel: IndexArray, pixels: Single) -> None:
        """Write the mean into pixels (count, 4): premultiplied by alpha."""
        for start in range(0, len(pixels), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            for channel, total in zip(pixels[part].T, self._sum[:, part], strict=True):
                np.multiply(total, np.float32(1 / self._samples), out=channel)
