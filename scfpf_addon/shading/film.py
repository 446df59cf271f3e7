# SPDX-License-Identifier: GPL-3.0-or-later
"""The film: what gathers the samples of a tile's pixels."""

from __future__ import annotations

import numpy as np

from ..projection.typing import Array, BoolArray, IndexArray
from .typing import Single

# Pixels that are written at once, channel by channel: they fit a core's cache.
AT_ONCE = 1 << 12


class Film:
    """The mean of samples over the pixels of a tile: a box filter of one pixel.

    count: pixels in the tile. transparent: whether what hits nothing is see-through
    instead of background (3,), a radiance.
    """

    def __init__(self, count: int, background: Array, transparent: bool) -> None:
        self._sum: Single = np.empty((4, count), np.float32)
        self._samples = 0
        self._empty = np.zeros(4, np.float32)
        if not transparent:
            self._empty[:] = (*background, 1)

    def add(self, shown: BoolArray, hit: IndexArray, color: Single) -> None:
        """One sample of every pixel.

        shown: (count,), False where the image shows nothing: transparent black.
        hit: (n,) the pixels that see the scene, color: (3, n) what they see, or (4, n)
        with its alpha.
        """
        if len(hit) == len(shown):
            sample = np.empty_like(self._sum)
            sample[:3], sample[3] = color[:3], color[3] if len(color) > 3 else 1
        else:
            sample = self._empty[:, None] * shown
            alpha = color[3] if len(color) > 3 else np.float32(1)
            for channel, values in zip(sample, (*color[:3], alpha), strict=True):
                channel[hit] = values
        self.add_whole(sample)

    def add_whole(self, sample: Single) -> None:
        """One sample of every pixel, (4, count) with alpha, whatever it sees; the film keeps the array."""
        if self._samples:
            self._sum += sample
        else:
            self._sum = sample
        self._samples += 1

    @property
    def exposed(self) -> bool:
        """Whether any sample has been added."""
        return self._samples > 0

    def develop(self, pixels: Single) -> None:
        """Write the mean into pixels (count, 4): premultiplied by alpha."""
        for start in range(0, len(pixels), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            for channel, total in zip(pixels[part].T, self._sum[:, part], strict=True):
                np.multiply(total, np.float32(1 / self._samples), out=channel)
