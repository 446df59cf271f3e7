# SPDX-License-Identifier: GPL-3.0-or-later
"""Cryptomatte: the shares of each pixel that show objects and materials (Friedman and Jones 2015)."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence

import numpy as np

from ...casting.common.geometry import Geometry
from ...projection.typing import IndexArray
from ..typing import Single

MASK = 0xFFFFFFFF
# The most layers, each of two names and their shares, that Blender's compositor reads.
MOST_LAYERS = 8
# Names of a pixel that are counted besides those that are kept: the last of many may become the first.
SPARE = 2
CRYPTO_KINDS = ("OBJECT", "MATERIAL")
# The pass of a kind and a layer.
CRYPTO_PASS = "CRYPTO_{}_{:02d}"


def name_hash(name: str) -> int:
    """MurmurHash3 (x86, 32 bits, seed 0) of a name in UTF-8, as in Cryptomatte's specification."""
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
    """The float32 numbers that stand for names in an image, (N,)."""
    bits = np.array([float_bits(name_hash(name)) for name in names], np.uint32)
    return bits.view(np.float32)


def manifest(names: Sequence[str]) -> str:
    """The names of an image with their hashes in hexadecimal, as JSON for files."""
    return json.dumps(
        {name: f"{float_bits(name_hash(name)):08x}" for name in names},
        ensure_ascii=False,
        separators=(",", ":"),
    )


class CryptoFilm:
    """The counts of samples of ``count`` pixels that show each of the first names of a pixel.

    layers: of two names each.
    """

    def __init__(self, count: int, layers: int) -> None:
        self._kept = 2 * layers
        self._number = np.full((self._kept + SPARE, count), -1, np.int32)
        self._count = np.zeros((self._kept + SPARE, count), np.float32)

    def add(self, pixel: IndexArray, number: IndexArray) -> None:
        """Add one sample of the pixels (m,), none twice, that show objects or materials ``number`` (m,)."""
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
        """The identifiers and shares of pixels (m,), largest share first, (m, 4 · layers).

        samples: of each pixel. identifier: by number.
        """
        count, number = self._count[:, pixel], self._number[:, pixel]
        # Of equal shares the lower number comes first, in whatever order the samples came.
        order = np.lexsort((number, -count), axis=0)[: self._kept]
        count = np.take_along_axis(count, order, axis=0)
        number = np.take_along_axis(number, order, axis=0)
        made = np.zeros((len(pixel), 2 * self._kept), np.float32)
        made[:, ::2] = np.where(number >= 0, identifier[np.maximum(number, 0)], np.float32(0)).T
        made[:, 1::2] = (count / samples).T
        return made


class CryptoFilms:
    """The cryptomattes of a tile of ``count`` pixels. layers, identifiers: of each kind that is wanted."""

    def __init__(self, layers: Mapping[str, int], identifiers: Mapping[str, Single], count: int) -> None:
        self._identifiers = identifiers
        self._films = {kind: CryptoFilm(count, many) for kind, many in layers.items()}

    def add(self, pixel: IndexArray, geometry: Geometry, triangle: IndexArray) -> None:
        """Add samples of the tile's pixels (m,) that hit triangles (m,) of a geometry."""
        for kind, film in self._films.items():
            numbers = geometry.object_index if kind == "OBJECT" else geometry.material
            film.add(pixel, numbers[triangle])

    def develop(self, pixel: IndexArray, samples: Single | float, into: dict[str, Single]) -> None:
        """Write the layers of pixels (m,) into the passes, each (m, channels)."""
        for kind, film in self._films.items():
            made = film.develop(pixel, samples, self._identifiers[kind])
            for layer in range(made.shape[1] // 4):
                into[CRYPTO_PASS.format(kind, layer)][:] = made[:, 4 * layer : 4 * layer + 4]
