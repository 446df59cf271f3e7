# SPDX-License-Identifier: GPL-3.0-or-later
"""Adaptive sampling: pixels that are still uncertain get more samples.

All pixels of a tile take part, and a row more on either side, whatever part of it the border holds: the
samples of a pixel depend on the whole image only.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...projection.typing import Array, BoolArray, IndexArray
from ..typing import Single

# The most projectors that are cast at once.
BATCH = 1 << 16
# Darker pixels tolerate the same error as pixels of this brightness.
DARK = 1e-3
# Where an edge crosses the pixel, the error of the mean of n Sobol points is n to minus this times that of
# one point (Mitchell 1996).
CONVERGENCE = 0.75


@dataclass(frozen=True)
class Adaptive:
    """The settings of adaptive sampling.

    threshold: tolerated error of a pixel, a share of the square root of its brightness, > 0. least: samples
    of every pixel, >= 2. Raises ValueError.
    """

    threshold: float = 0.01
    least: int = 4

    def __post_init__(self) -> None:
        if self.threshold <= 0.0 or self.least < 2:
            raise ValueError("adaptive sampling needs a threshold above 0 and at least two samples")


class AdaptiveFilm:
    """A film whose pixels have different numbers of samples.

    It sums the differences of samples to the pixel's first one, and their squares. The parameters are those
    of ``Film``.
    """

    def __init__(self, count: int, background: Array, transparent: bool) -> None:
        self._first: Single = np.zeros((4, count), np.float32)
        self._sum: Single = np.zeros((4, count), np.float32)
        self._squares: Single = np.zeros((4, count), np.float32)
        self._samples: Single = np.zeros(count, np.float32)
        self._empty = np.zeros(4, np.float32)
        if not transparent:
            self._empty[:] = (*background, 1)

    def add(self, pixel: IndexArray, shown: BoolArray, hit: IndexArray, color: Single) -> None:
        """Add one sample of the pixels (m,): the first of all of them, or of none.

        shown: (m,), hit: (k,) and color: (3, k) or (4, k) as in ``Film.add``; ``hit`` are indices into
        ``pixel``.
        """
        value = self._empty[:, None] * shown
        value[3, hit] = 1
        value[: len(color), hit] = color
        if self._samples[pixel[0]] == 0.0:
            self._first[:, pixel] = value
        else:
            value -= self._first[:, pixel]
            self._sum[:, pixel] += value
            value *= value
            self._squares[:, pixel] += value
        self._samples[pixel] += 1

    def uncertain(self, pixel: IndexArray, threshold: float) -> BoolArray:
        """Whether the expected errors of the means of pixels (m,) exceed the threshold."""
        count = self._samples[pixel]
        mean = self._sum[:, pixel] / count
        squared = np.maximum(self._squares[:, pixel] / count - mean * mean, 0)
        error = np.sqrt(squared) * count**-CONVERGENCE
        light = np.abs(mean + self._first[:, pixel])
        # Not a mean along an axis, whose order may depend on the length.
        color, bright = ((c[0] + c[1] + c[2]) / 3 for c in (error, light))
        allowed = threshold * np.sqrt(np.maximum(bright, DARK))
        uncertain: BoolArray = (color > allowed) | (error[3] > threshold)
        return uncertain

    def samples(self, pixel: IndexArray) -> Single:
        """The numbers of samples of pixels (m,)."""
        return self._samples[pixel]

    def develop(self, pixel: IndexArray, into: Single) -> None:
        """Write the means of pixels (m,) into ``into`` (m, 4), premultiplied by alpha."""
        into[:] = (self._first[:, pixel] + self._sum[:, pixel] / self._samples[pixel]).T


def margin(rows: slice, height: int) -> slice:
    """The rows with one more on either side, within the image."""
    return slice(max(rows.start - 1, 0), min(rows.stop + 1, height))


def with_neighbours(chosen: BoolArray) -> BoolArray:
    """Pixels (H, W) that are chosen or touch a chosen one."""
    wide = chosen.copy()
    wide[1:] |= chosen[:-1]
    wide[:-1] |= chosen[1:]
    result = wide.copy()
    result[:, 1:] |= wide[:, :-1]
    result[:, :-1] |= wide[:, 1:]
    return result


def adaptive_batches(
    film: AdaptiveFilm, adaptive: Adaptive, shape: tuple[int, int], own: slice, most: int
) -> Iterator[tuple[IndexArray | None, range]]:
    """Yield pixels of a block, None for all, and the samples to take of them next.

    The caller adds these samples to the film before it goes on. Pixels come until they are certain or have
    ``most`` samples. shape: rows and columns of the block. own: its rows that are wanted; the others only
    say which of these have uncertain neighbours.
    """
    done, goal = 0, min(adaptive.least, most)
    height, width = shape
    active: IndexArray | None = None
    while True:
        step = 1 if active is None else max(1, min(goal - done, BATCH // len(active)))
        for first in range(done, goal, step):
            yield active, range(first, min(first + step, goal))
        if goal >= most:
            return
        everything = np.arange(height * width) if active is None else active
        uncertain = film.uncertain(everything, adaptive.threshold)
        if active is None:
            # The first samples of a pixel may miss a thing that those of its neighbours hit.
            wanted = with_neighbours(uncertain.reshape(shape))
            wanted[: own.start], wanted[own.stop :] = False, False
            active = np.flatnonzero(wanted)
        else:
            active = active[uncertain]
        if not len(active):
            return
        done, goal = goal, min(2 * goal, most)
