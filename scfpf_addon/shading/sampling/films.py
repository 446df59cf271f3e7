# SPDX-License-Identifier: GPL-3.0-or-later
"""Films: the means of the samples of pixels, as they are added."""

from __future__ import annotations

import numpy as np

from ...projection.arrays import put_columns
from ...projection.typing import Array, BoolArray, IndexArray
from ..typing import Single

# Pixels that are written at once, channel by channel, so that they fit a core's cache.
AT_ONCE = 1 << 12
# Darker pixels tolerate the same error as pixels of this brightness.
DARK = 1e-3
# Where an edge crosses the pixel, the error of the mean of n Sobol points is n to minus this times that of
# one point (Mitchell 1996).
CONVERGENCE = 0.75


class Film:
    """A film of ``count`` pixels, all with the same number of samples.

    transparent: whether pixels that hit nothing are transparent instead of showing the background (3,), a
    radiance.
    """

    def __init__(self, count: int, background: Array, transparent: bool) -> None:
        self._sum: Single = np.zeros((4, count), np.float32)
        self._empty = np.zeros(4, np.float32)
        if not transparent:
            self._empty[:] = (*background, 1)
        self._taken = 0

    def add(self, pixel: IndexArray, shown: BoolArray, hit: IndexArray, color: Single) -> None:
        """Add one sample of the pixels (m,), which are all of them, in order.

        shown: (m,), False where the image shows nothing: transparent black. hit: (n,) indices into ``pixel``
        of those that see the scene, in order. color: (3, n) of these, or (4, n) with alpha.
        """
        sample = self._sample(shown, hit, color)
        if self._taken:
            self._sum += sample
        else:
            self._sum = sample
        self._taken += 1

    def samples(self, pixel: IndexArray) -> Single | float:
        """The number of samples of pixels (m,)."""
        return float(self._taken)

    def develop(self, pixel: IndexArray, into: Single) -> None:
        """Write the means of the pixels (m,) of ``add`` into ``into`` (m, 4), premultiplied by alpha."""
        for start in range(0, len(into), AT_ONCE):
            part = slice(start, start + AT_ONCE)
            for channel, total in zip(into[part].T, self._sum[:, part], strict=True):
                np.multiply(total, np.float32(1 / self._taken), out=channel)

    def _sample(self, shown: BoolArray, hit: IndexArray, color: Single) -> Single:
        """Colour and alpha (4, m) of a sample, see ``add``."""
        if len(hit) == len(shown):
            sample: Single = np.empty((4, len(shown)), np.float32)
            sample[:3], sample[3] = color[:3], color[3] if len(color) > 3 else 1
            return sample
        sample = self._empty[:, None] * shown
        alpha = color[3] if len(color) > 3 else np.float32(1)
        for channel, values in zip(sample, (*color[:3], alpha), strict=True):
            channel[hit] = values
        return sample


class AdaptiveFilm(Film):
    """A film whose pixels have different numbers of samples.

    It sums the differences of samples to the pixel's first one, and their squares.
    """

    def __init__(self, count: int, background: Array, transparent: bool) -> None:
        super().__init__(count, background, transparent)
        self._first: Single = np.zeros((4, count), np.float32)
        self._squares: Single = np.zeros((4, count), np.float32)
        self._samples: Single = np.zeros(count, np.float32)

    def add(self, pixel: IndexArray, shown: BoolArray, hit: IndexArray, color: Single) -> None:
        """Add one sample of any pixels (m,): the first of all of them, or of none; see ``Film.add``."""
        value = self._sample(shown, hit, color)
        if self._samples[pixel[0]] == 0.0:
            put_columns(self._first, pixel, value)
        else:
            value -= self._first.take(pixel, 1)
            for total, square, own in zip(self._sum, self._squares, value, strict=True):
                total[pixel] += own
                own *= own
                square[pixel] += own
        self._samples[pixel] += 1

    def uncertain(self, pixel: IndexArray, threshold: float) -> BoolArray:
        """Return whether the expected errors of the means of pixels (m,) exceed the threshold."""
        count = self._samples[pixel]
        mean = self._sum.take(pixel, 1) / count
        squared = np.maximum(self._squares.take(pixel, 1) / count - mean * mean, 0)
        error = np.sqrt(squared) * count**-CONVERGENCE
        light = np.abs(mean + self._first.take(pixel, 1))
        # Not a mean along an axis, whose order may depend on the length.
        color, bright = ((c[0] + c[1] + c[2]) / 3 for c in (error, light))
        allowed = threshold * np.sqrt(np.maximum(bright, DARK))
        uncertain: BoolArray = (color > allowed) | (error[3] > threshold)
        return uncertain

    def samples(self, pixel: IndexArray) -> Single | float:
        """The numbers of samples of pixels (m,)."""
        return self._samples[pixel]

    def develop(self, pixel: IndexArray, into: Single) -> None:
        """Write the means of any pixels (m,) into ``into`` (m, 4), premultiplied by alpha."""
        into[:] = (self._first.take(pixel, 1) + self._sum.take(pixel, 1) / self._samples[pixel]).T
