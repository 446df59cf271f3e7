# SPDX-License-Identifier: GPL-3.0-or-later
"""The Noise Texture: fractal sums of Perlin's gradient noise, with Blender's hash of lattice points.

Perlin, Improving Noise (SIGGRAPH 2002); the hash is the last step of Bob Jenkins' lookup3 (public domain).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array
from .context import ShadingContext
from .graph import Inputs, Settings

Words = NDArray[np.uint32]

# Factors that scale the noise to [-1, 1], by dimensions.
RANGE = {2: 0.6616, 3: 0.9820}
# The period of the noise, as in Blender, where float32 has digits left.
PERIOD = 100000.0
MOST_DETAIL = 15.0


def _rotated(words: Words, bits: int) -> Words:
    return (words << np.uint32(bits)) | (words >> np.uint32(32 - bits))


def hashed(*keys: Words) -> Words:
    """The hash (n,) of two or three integers, each (n,) uint32."""
    start = np.uint32((0xDEADBEEF + 4 * len(keys) + 13) & 0xFFFFFFFF)
    a, b = start + keys[0], start + keys[1]
    c = start + keys[2] if len(keys) > 2 else np.full_like(keys[0], start)
    for bits in (14, 11, 25, 16, 4, 14, 24):
        # Each step mixes one word with the word before.
        c = (c ^ b) - _rotated(b, bits)
        a, b, c = b, c, a
    # After seven steps of three words the last mixed is the second.
    return b


def _gradient(words: Words, parts: Sequence[Array]) -> Array:
    """Scalar product with a direction to the middle of a cube's edge, or a square's, chosen by the hash."""
    if len(parts) == 2:
        x, y = parts
        low = (words & np.uint32(7)) < 4
        u, v = np.where(low, x, y), 2.0 * np.where(low, y, x)
    else:
        x, y, z = parts
        h = words & np.uint32(15)
        u = np.where(h < 8, x, y)
        # 12 and 14.
        v = np.where(h < 4, y, np.where((h | np.uint32(2)) == 14, x, z))
    for each, bit in ((u, 0), (v, 1)):
        # The lowest bits of the hash become signs of floats.
        signs = each.view(np.uint64)
        signs ^= (words >> np.uint32(bit)).astype(np.uint64) << np.uint64(63)
    u += v
    return u


def perlin(place: Array) -> Array:
    """Gradient noise in [-1, 1] at (2, n) or (3, n), (n,)."""
    place = np.nan_to_num(place)
    if np.abs(place).max(initial=0.0) >= PERIOD:
        place = np.fmod(place, PERIOD)
    cell = np.floor(place)
    inside = place - cell
    fade = inside * (inside * 6.0 - 15.0)
    fade += 10.0
    # Powers take longer than products.
    for _ in range(3):
        fade *= inside
    count = len(place)
    keys = [(each, each + np.uint32(1)) for each in cell.astype(np.int64).astype(np.uint32)]
    parts = [(each, each - 1.0) for each in inside]
    values = []
    for number in range(1 << count):
        step = [number >> axis & 1 for axis in range(count)]
        words = hashed(*(key[way] for key, way in zip(keys, step, strict=True)))
        values.append(_gradient(words, [part[way] for part, way in zip(parts, step, strict=True)]))
    for share in fade:
        values = [low + (high - low) * share for low, high in zip(values[::2], values[1::2], strict=True)]
    total: Array = values[0] * RANGE[count]
    return total


def fractal(place: Array, detail: Array, roughness: Array, lacunarity: Array, normalise: bool) -> Array:
    """The sum of octaves of noise, (n,), in [0, 1] if normalised; fractional detail blends the last."""
    total, most, size, scale = (np.full(place.shape[1], each) for each in (0.0, 0.0, 1.0, 1.0))
    whole = np.floor(detail)
    part = detail - whole
    for octave in range(int(whole.max(initial=0.0)) + 2):
        full = octave <= whole
        some = (octave == whole + 1) & (part > 0.0)
        if not (full | some).any():
            break
        share = np.where(full, 1.0, np.where(some, part, 0.0))
        value = perlin(place * scale) * size
        if normalise:
            before, after = total / np.where(most > 0.0, most, 1.0), (total + value) / (most + size)
            mixed = np.where(full, after, before + part * (after - before))
            total = np.where(share > 0.0, mixed * (most + size), total)
            most = np.where(share > 0.0, most + size, most)
        else:
            total = total + value * share
        size, scale = size * roughness, scale * lacunarity
    if normalise:
        return 0.5 * total / np.where(most > 0.0, most, 1.0) + 0.5
    return total


def _offset(seed: float, axis: int) -> float:
    """The offset of another channel's noise along an axis, 100 to 200."""
    keys = (np.array([value], np.float32).view(np.uint32) for value in (seed, axis))
    return 100.0 + 100.0 * float(hashed(*keys)[0]) / 0xFFFFFFFF


def noise(inputs: Inputs, settings: Settings, context: ShadingContext) -> tuple[Array, ...]:
    """The Noise Texture: vector, scale, detail, roughness, lacunarity, distortion → factor, colour."""
    count = settings["dimensions"]
    n = max(each.shape[1] for each in inputs)
    vector, *rest = (np.broadcast_to(each, (len(each), n)) for each in inputs)
    scale, detail, roughness, lacunarity, distortion = (each[0] for each in rest)
    at = vector[:count] * scale
    detail, roughness = np.clip(detail, 0.0, MOST_DETAIL), np.maximum(roughness, 0.0)

    def moved(seed: int) -> Array:
        """The offset of another noise, (count, 1)."""
        return np.array([[_offset(seed, axis)] for axis in range(count)])

    if distortion.any():
        at = at + np.stack([perlin(at + moved(axis)) for axis in range(count)]) * distortion

    def value(where: Array) -> Array:
        """The factor (n,) at places (count, n)."""
        return fractal(where, detail, roughness, lacunarity, settings["normalise"])

    first = value(at)
    if not settings["colored"]:
        return first[None], np.repeat(first[None], 3, axis=0)
    return first[None], np.stack([first, value(at + moved(count)), value(at + moved(count + 1))])


OPERATIONS: dict[str, Callable[..., tuple[Array, ...]]] = {"NOISE": noise}
