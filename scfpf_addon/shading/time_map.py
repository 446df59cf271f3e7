# SPDX-License-Identifier: GPL-3.0-or-later
"""The time at which each pixel of a picture is taken: slit scans, rolling shutters, painted times."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..projection.typing import Array
from .settings.frame_settings import Border

# The ways in which time goes through a picture.
ROLLING, SLIT, IMAGE = "ROLLING", "SLIT", "IMAGE"


def shares_of_time(way: str, size: tuple[int, int], painted: Array | None = None) -> Array:
    """The share of the time, [0, 1], at which each pixel is taken, (H, W), row 0 at the bottom.

    way: ROLLING from the top row to the lowest, SLIT from the left column to the right one, IMAGE as painted.
    size: width and height. painted: (h, w), whose nearest value counts; values beyond [0, 1] are clipped.
    """
    width, height = size
    if way == IMAGE:
        assert painted is not None
        rows = (np.arange(height) + 0.5) / height * painted.shape[0]
        columns = (np.arange(width) + 0.5) / width * painted.shape[1]
        found = painted[rows.astype(int)[:, None], columns.astype(int)]
        shares: Array = np.clip(np.nan_to_num(found.astype(np.float64)), 0.0, 1.0)
        return shares
    if way == SLIT:
        return np.broadcast_to((np.arange(width) + 0.5) / width, (height, width))
    return np.broadcast_to(1.0 - (np.arange(height)[:, None] + 0.5) / height, (height, width))


class TimeStep(NamedTuple):
    """The pixels that are taken at one time. share: of the whole time. border: around them.

    shown: which pixels of the border, (rows, columns) bool.
    """

    share: float
    border: Border
    shown: NDArray[np.bool_]


def time_steps(shares: Array, count: int) -> list[TimeStep]:
    """The steps of a picture's time, without those that no pixel needs. shares: (H, W), of all pixels.

    count: of steps of equal length; each pixel is taken in the middle of its step.
    """
    step = np.minimum((shares * count).astype(int), count - 1)
    found = []
    for number in np.unique(step):
        here = step == number
        rows, columns = np.flatnonzero(here.any(axis=1)), np.flatnonzero(here.any(axis=0))
        border = Border(int(columns[0]), int(rows[0]), int(columns[-1]) + 1, int(rows[-1]) + 1)
        shown = here[border.bottom : border.top, border.left : border.right]
        found.append(TimeStep((float(number) + 0.5) / count, border, shown))
    return found
