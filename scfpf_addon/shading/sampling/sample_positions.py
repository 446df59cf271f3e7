# SPDX-License-Identifier: GPL-3.0-or-later
"""The positions of each pixel's samples, in the image and on a lens.

They are the same set in each pixel, without noise, or the points of Sobol's sequence. These are scrambled by
the pixel's number in the whole image, so that a pixel does not depend on tiles, borders or threads.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, IndexArray
from .pixel_filter import PixelFilter
from .sample_sets import pixel_positions

Bits = NDArray[np.uint32]

# Degree, coefficients and first direction numbers of Joe and Kuo 2008, from the second dimension on.
DIRECTIONS = ((1, 0, (1,)), (2, 1, (1, 3)), (3, 1, (1, 3, 1)))
# Dimensions of the position in the pixel and of that on the lens.
PIXEL, LENS = (0, 1), (2, 3)
BITS = 32
# Scrambled positions are rounded to steps of the filter, of which there are 2 to this.
STEP_BITS = 12


def sobol(count: int) -> Bits:
    """The first ``count`` points of Sobol's sequence, (4, count), as fractions of 2³²."""
    index = np.arange(count, dtype=np.uint32)
    points = np.zeros((1 + len(DIRECTIONS), count), np.uint32)
    for dimension, row in enumerate(points):
        for bit, direction in enumerate(_directions(dimension)):
            row ^= np.where(index >> np.uint32(bit) & np.uint32(1), np.uint32(direction), np.uint32(0))
    return points


def _directions(dimension: int) -> list[int]:
    """The numbers that the bits of an index add to a coordinate, by exclusive or."""
    if dimension == 0:
        return [1 << (BITS - 1 - bit) for bit in range(BITS)]
    degree, coefficients, first = DIRECTIONS[dimension - 1]
    numbers = list(first)
    for k in range(degree, BITS):
        number = numbers[k - degree] ^ (numbers[k - degree] << degree)
        for j in range(1, degree):
            if coefficients >> (degree - 1 - j) & 1:
                number ^= numbers[k - j] << j
        numbers.append(number)
    return [number << (BITS - 1 - bit) for bit, number in enumerate(numbers)]


def scramble(pixel: Bits, dimension: int) -> Bits:
    """Hash each pixel number (N,) with a dimension: Wellons' lowbias32, unbiased in every bit."""
    mixed = pixel * np.uint32(8) + np.uint32(dimension)
    for shift, factor in ((16, 0x7FEB352D), (15, 0x846CA68B)):
        mixed ^= mixed >> np.uint32(shift)
        mixed *= np.uint32(factor)
    mixed ^= mixed >> np.uint32(16)
    return mixed


@dataclass(frozen=True)
class SamplePositions:
    """The samples of an image of width × height pixels, ``count`` a pixel.

    scrambled: each pixel has its own, of which any first ones are well spread; otherwise all pixels have the
    same. Samples of a wide filter beyond the image's edges are reflected at them: the volume may end there.
    """

    width: int
    height: int
    count: int
    pixel_filter: PixelFilter
    scrambled: bool = False

    @cached_property
    def _same(self) -> Array:
        """Offsets from the pixel's centre, the same in all pixels, (2, count)."""
        return self.pixel_filter.offset(pixel_positions(self.count))

    @cached_property
    def _points(self) -> Bits:
        return sobol(self.count)

    @cached_property
    def _steps(self) -> Array:
        """The filter's offset at each of 2^STEP_BITS equal shares."""
        steps = 1 << STEP_BITS
        return self.pixel_filter.offset((np.arange(steps) + 0.5) / steps)

    def of_rows(self, rows: slice, sample: int) -> tuple[Array, Array]:
        """Image positions (x, y) of a sample in each pixel of whole rows, each (n,)."""
        if self.scrambled:
            return self.of_pixels(row_pixels(rows, self.width), sample)
        column, row = np.arange(self.width), np.arange(rows.start, rows.stop)
        x, y = self._in_image(column, row, *self._same[:, sample])
        return np.tile(x, len(y)), np.repeat(y, len(x))

    def of_pixels(self, pixel: IndexArray, sample: int) -> tuple[Array, Array]:
        """Image positions (x, y) of a sample in pixels (n,), counted row by row from the bottom left."""
        row, column = np.divmod(pixel, self.width)
        if not self.scrambled:
            return self._in_image(column, row, *self._same[:, sample])
        offsets = [self._steps.take(self._own(pixel, d, sample) >> (BITS - STEP_BITS)) for d in PIXEL]
        return self._in_image(column, row, *offsets)

    def on_lens(self, pixel: IndexArray, sample: int) -> Array:
        """Shares (2, n) in [0, 1) of a lens, scrambled for each pixel."""
        share = np.stack([self._own(pixel, dimension, sample) for dimension in LENS])
        return share.astype(np.float64) * 2.0**-BITS

    def _own(self, pixel: IndexArray, dimension: int, sample: int) -> Bits:
        own: Bits = scramble(pixel.astype(np.uint32), dimension)
        own ^= self._points[dimension, sample]
        return own

    def _in_image(
        self, column: IndexArray, row: IndexArray, x: Array | float, y: Array | float
    ) -> tuple[Array, Array]:
        return _reflected((column + (0.5 + x)) / self.width), _reflected((row + (0.5 + y)) / self.height)


def row_pixels(rows: slice, width: int) -> IndexArray:
    """The numbers of the pixels of whole rows, row by row from the image's bottom left."""
    return np.arange(rows.start * width, rows.stop * width)


def _reflected(place: Array) -> Array:
    """Reflect places at both ends of [0, 1]."""
    if place.min(initial=0.0) < 0.0 or place.max(initial=1.0) > 1.0:
        # Only these: the rounding of the others must not depend on them.
        beyond = np.flatnonzero((place < 0.0) | (place > 1.0))
        place[beyond] = 1.0 - np.abs(1.0 - np.mod(place[beyond], 2.0))
    return place
