# SPDX-License-Identifier: GPL-3.0-or-later
"""Cryptomatte: which share of each pixel shows what, by hashes of names (Friedman and Jones 2015)."""

from __future__ import annotations

import json
from collections.abc import Sequence

import numpy as np

from ...projection.typing import IndexArray
from ..typing import Single

MASK = 0xFFFFFFFF
# The most layers, each of two names and their shares, that Blender's compositor reads.
MOST_LAYERS = 8
# Names of a pixel that are counted besides those that are kept: the last of many may become the first.
SPARE = 2


def name_hash(name: str) -> int:
    """MurmurHash3 (x86, 32 bits, seed 0) of a name in UTF-8, as Cryptomatte's specification has it."""
    data = name.encode()
    value = 0
    whole = len(data) // 4 * 4
    for start in range(0, whole, 4):
        value ^= _scattered(int.from_bytes(data[start : start + 4], "little"))
        value = (_turned(value, 13) * 5 + 0xE6546B64) & MASK
    if whole < len(data):
        value ^= _scattered(int.from_bytes(data[whole:], "little"))
    value ^= len(data)
    for shift, factor in ((16, 0x85EBCA6B), (13, 0xC2B2AE35)):
        value ^= value >> shift
        value = value * factor & MASK
    return value ^ value >> 16


def _turned(value: int, bits: int) -> int:
    return (value << bits | value >> 32 - bits) & MASK


def _scattered(block: int) -> int:
    return _turned(block * 0xCC9E2D51 & MASK, 15) * 0x1B873593 & MASK


def float_bits(value: int) -> int:
    """A hash as the bits of a float32 that is neither 0, denormal, infinite nor NaN."""
    exponent = min(max(value >> 23 & 0xFF, 1), 254)
    return value & 0x807FFFFF | exponent << 23


def identifiers(names: Sequence[str]) -> Single:
    """What stands for names in a picture, (N,)."""
    bits = np.array([float_bits(name_hash(name)) for name in names], np.uint32)
    return bits.view(np.float32)


def manifest(names: Sequence[str]) -> str:
    """The names of a picture with what stands for them, as files have it."""
    return json.dumps(
        {name: f"{float_bits(name_hash(name)):08x}" for name in names},
        ensure_ascii=False,
        separators=(",", ":"),
    )


class CryptoFilm:
    """Counts of what samples of n pixels show, for the names that a pixel shows first.

    layers: of two names each.
    """

    def __init__(self, count: int, layers: int) -> None:
        self._kept = 2 * layers
        self._number = np.full((self._kept + SPARE, count), -1, np.int32)
        self._count = np.zeros((self._kept + SPARE, count), np.float32)

    def add(self, pixel: IndexArray, number: IndexArray) -> None:
        """One sample of the pixels (m,), none twice, that shows the things ``number`` (m,)."""
        pixel, number = pixel.astype(np.intp), number.astype(np.int32)
        for numbers, counts in zip(self._number, self._count, strict=True):
            if not len(pixel):
                return
            there = numbers[pixel]
            free = there < 0
            mine = free | (there == number)
            numbers[pixel[free]] = number[free]
            counts[pixel[mine]] += 1
            pixel, number = pixel[~mine], number[~mine]

    def develop(self, pixel: IndexArray, samples: Single | float, identifier: Single) -> Single:
        """(m, 4 · layers) of pixels (m,): what stands for a name and its share, the largest share first.

        samples: of each pixel. identifier: by number.
        """
        count, number = self._count[:, pixel], self._number[:, pixel]
        # Of equal shares the lower number comes first, whatever came first in the pixel.
        order = np.lexsort((number, -count), axis=0)[: self._kept]
        count = np.take_along_axis(count, order, axis=0)
        number = np.take_along_axis(number, order, axis=0)
        made = np.zeros((len(pixel), 2 * self._kept), np.float32)
        made[:, ::2] = np.where(number >= 0, identifier[np.maximum(number, 0)], np.float32(0)).T
        made[:, 1::2] = (count / samples).T
        return made
