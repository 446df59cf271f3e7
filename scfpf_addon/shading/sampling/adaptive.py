# SPDX-License-Identifier: GPL-3.0-or-later
"""Adaptive sampling: pixels that are still uncertain get more samples.

All pixels of a tile take part, and a row more on either side, whatever part of it the border holds: the
samples of a pixel depend on the whole image only.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from ...projection.typing import BoolArray, IndexArray
from .films import AdaptiveFilm

# The most projectors that are cast at once.
BATCH = 1 << 16


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
        count = height * width if active is None else len(active)
        step = max(1, min(goal - done, BATCH // count))
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
