# SPDX-License-Identifier: GPL-3.0-or-later
"""Random numbers of points, for places on lamps and facets, spread over pixels and their neighbours.

Sobol's first two dimensions, in an order that is shuffled for each purpose (Burley 2020), along a curve
through the image: pixels near each other continue one sequence, so that their errors cancel (Ahmed and Wonka
2020). They depend on the pixel's place in the whole image only, so neither on tiles nor on threads.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...projection.typing import IndexArray
from ..typing import Single
from .sample_positions import Bits, scramble

# Multipliers of a hash whose bits depend on lower ones only (Laine and Karras 2011; Burley 2020).
LAINE_KARRAS = (0x6C50B47C, 0xB82F1E52, 0xC7AFE638, 0x8D22F6E6)
# Shifts and masks that turn Sobol's first dimension into the second (Ahmed 2024).
SECOND = ((16, 0x0000FFFF), (8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555))
# The same that put a 0 before each of 16 bits.
SPREAD = ((8, 0x00FF00FF), (4, 0x0F0F0F0F), (2, 0x33333333), (1, 0x55555555))
# A float32 holds this many bits exactly.
FLOAT_BITS = 24
# The dimension of the scramble whose numbers shift a sequence.
SHIFT = 5
# The seed of the first step of a path.
FIRST: Bits = np.zeros(1, np.uint32)


class Shares(NamedTuple):
    """Pairs of random numbers of n points. bits: two rows (n,), fractions of 2³²."""

    bits: tuple[Bits, Bits]

    def of(self, seed: int | np.uint32) -> Single:
        """The numbers (2, n) in [0, 1), shifted for one lamp or one lobe."""
        shifts = scramble(np.array([seed, seed], np.uint32) ^ np.arange(2, dtype=np.uint32), SHIFT)
        made: Single = np.empty((2, len(self.bits[0])), np.float32)
        for row, bits, shift in zip(made, self.bits, shifts, strict=True):
            # Signed integers become floats faster.
            row[:] = ((bits ^ shift) >> np.uint32(32 - FLOAT_BITS)).view(np.int32)
        made *= np.float32(2.0**-FLOAT_BITS)
        return made


class PointSamples(NamedTuple):
    """The pixel samples that n points belong to.

    place: (n,) of the pixels, see ``pixel_places``. number: of the sample in its pixel, (n,) or of all
    points. most: of a pixel's samples. seed: (n,) or (1,), of the step of a path.
    """

    place: Bits
    number: int | IndexArray
    most: int
    seed: Bits = FIRST

    @classmethod
    def alone(cls, count: int) -> PointSamples:
        """The one sample of each of ``count`` points, which sees the middle of lamps."""
        return cls(np.zeros(count, np.uint32), 0, 1)

    def take(self, which: IndexArray) -> PointSamples:
        """The samples of points ``which``."""
        number = self.number if isinstance(self.number, int) else self.number.take(which)
        seed = self.seed if len(self.seed) == 1 else self.seed.take(which)
        return PointSamples(self.place.take(which), number, self.most, seed)

    def pixel(self) -> Bits:
        """The numbers (n,) of the pixels along the curve, small ones in small images: to be scrambled."""
        return reversed_bits(self.place)

    def shares(self, purpose: int) -> Shares:
        """Random numbers of the points, others for each purpose, a dimension of the scramble."""
        bits = max(self.most - 1, 0).bit_length()
        numbers = reversed_bits(np.arange(1 << bits, dtype=np.uint32))
        first: Bits = (self.place >> np.uint32(bits)) | numbers[self.number]
        first += scramble(self.seed, purpose)
        for factor in LAINE_KARRAS:
            first ^= first * np.uint32(factor)
        second = first.copy()
        for shift, mask in SECOND:
            second ^= (second & np.uint32(mask)) << np.uint32(shift)
        return Shares((first, second))


def pixel_places(pixel: IndexArray, width: int) -> Bits:
    """Places (n,) of pixels along Morton's curve through an image, their bits in reverse.

    pixel: (n,) counted row by row in an image of this width.
    """
    row, column = np.divmod(pixel, width)
    place: Bits = _spread(column.astype(np.uint32)) | _spread(row.astype(np.uint32)) << np.uint32(1)
    return reversed_bits(place)


def _spread(number: Bits) -> Bits:
    """Numbers below 2¹⁶ with a 0 before each bit."""
    for shift, mask in SPREAD:
        number = (number | number << np.uint32(shift)) & np.uint32(mask)
    return number


def reversed_bits(number: Bits) -> Bits:
    """The 32 bits of numbers in reverse."""
    number = number << np.uint32(16) | number >> np.uint32(16)
    for shift, mask in SECOND[1:]:
        low, by = np.uint32(mask), np.uint32(shift)
        number = (number & low) << by | (number >> by) & low
    return number
