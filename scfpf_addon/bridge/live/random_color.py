# SPDX-License-Identifier: GPL-3.0-or-later
"""The random colours of objects in Blender's Solid shading, which depend on their names.

Workbench (Blender's source, ``workbench_materials.cc``) hashes the name of the datablock, with its type, by
MurmurHash2 (Austin Appleby) and Bob Jenkins' final mix of lookup3, and takes the result for a hue.
"""

from __future__ import annotations

import colorsys
from functools import lru_cache

SATURATION, VALUE = 0.5, 0.8
WORD = 0xFFFFFFFF
MURMUR = 0x5BD1E995
# The start of lookup3 for two words: 0xdeadbeef + (2 << 2) + 13.
JENKINS = (0xDEADBEEF + (2 << 2) + 13) & WORD


@lru_cache(maxsize=1 << 14)
def random_color(name: str, library: str = "") -> tuple[float, float, float]:
    """The linear colour of an object by its name and the path of its library as the file has it."""
    number = _murmur(b"OB" + name.encode() + b"\0")
    if library:
        number = ((number * 13) & WORD) ^ _murmur(library.encode() + b"\0")
    return colorsys.hsv_to_rgb(_jenkins(number) / WORD, SATURATION, VALUE)


def _murmur(text: bytes) -> int:
    """MurmurHash2 of bytes, with seed 0."""
    found = len(text)
    whole = len(text) & ~3
    for start in range(0, whole, 4):
        part = int.from_bytes(text[start : start + 4], "little") * MURMUR & WORD
        part = (part ^ part >> 24) * MURMUR & WORD
        found = (found * MURMUR & WORD) ^ part
    if whole < len(text):
        found = (found ^ int.from_bytes(text[whole:], "little")) * MURMUR & WORD
    found = (found ^ found >> 13) * MURMUR & WORD
    return found ^ found >> 15


def _jenkins(number: int) -> int:
    """Bob Jenkins' final mix of a number and 0."""
    a, b, c = (JENKINS + number) & WORD, JENKINS, JENKINS
    c = ((c ^ b) - _turned(b, 14)) & WORD
    a = ((a ^ c) - _turned(c, 11)) & WORD
    b = ((b ^ a) - _turned(a, 25)) & WORD
    c = ((c ^ b) - _turned(b, 16)) & WORD
    a = ((a ^ c) - _turned(c, 4)) & WORD
    b = ((b ^ a) - _turned(a, 14)) & WORD
    return ((c ^ b) - _turned(b, 24)) & WORD


def _turned(number: int, bits: int) -> int:
    return (number << bits | number >> (32 - bits)) & WORD
