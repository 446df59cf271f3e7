# SPDX-License-Identifier: GPL-3.0-or-later
"""The images of a live image's surfaces: all in one array, with smaller copies, looked up at once."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import count
from typing import Literal, NamedTuple

import numpy as np

from ...projection.typing import BoolArray, IndexArray
from ..typing import Single

Extension = Literal["REPEAT", "EXTEND", "CLIP", "MIRROR"]
EXTENSIONS: tuple[Extension, ...] = ("REPEAT", "EXTEND", "CLIP", "MIRROR")
# Copies of each image, each half as wide as the one before.
LEVELS = 8
# Texture coordinates beyond this, which float32 cannot resolve to texels, count as 0.
FARTHEST = np.float32(1e5)


class LiveTexture(NamedTuple):
    """An image: pixels (H, W, 4) float32, linear, straight alpha, row 0 at the bottom; and its settings."""

    pixels: Single
    extension: Extension = "REPEAT"
    is_smooth: bool = True


@dataclass(frozen=True)
class LiveTextures:
    """Images as one array of texels. Row i of ``first``, ``width`` and ``height`` is image i.

    texels: (T, 4) float32, linear colour and straight alpha. first, width, height: (I, LEVELS) of each
    copy. extension: (I,) number in EXTENSIONS. is_smooth: (I,) whether texels are interpolated. serial: a
    number of its own.
    """

    texels: Single
    first: IndexArray
    width: IndexArray
    height: IndexArray
    extension: IndexArray
    is_smooth: BoolArray
    serial: int = field(default_factory=count().__next__)

    @classmethod
    def of(cls, images: Sequence[LiveTexture]) -> LiveTextures:
        """Pack images and their smaller copies."""
        copies = [copy for image in images for copy in smaller_copies(image.pixels)]
        sizes = np.array([copy.shape[:2] for copy in copies], np.int64).reshape(-1, LEVELS, 2)
        ends = np.cumsum(sizes.prod(axis=2).ravel())
        return cls(
            texels=np.concatenate([copy.reshape(-1, 4) for copy in copies] or [np.zeros((0, 4), np.float32)]),
            first=np.concatenate([[0], ends])[:-1].reshape(-1, LEVELS),
            width=sizes[:, :, 1],
            height=sizes[:, :, 0],
            extension=np.array([EXTENSIONS.index(image.extension) for image in images], np.int64),
            is_smooth=np.array([image.is_smooth for image in images], bool),
        )

    def sample(self, image: IndexArray, uv: Single, footprint: Single) -> Single:
        """The colour and alpha (4, n) of images at texture coordinates.

        image: (n,) rows. uv: (2, n). footprint: (n,) the width of a pixel in texture coordinates, which
        chooses the copy.
        """
        with np.errstate(divide="ignore"):
            level = np.log2(footprint * np.maximum(self.width[image, 0], self.height[image, 0]))
        level = np.clip(np.nan_to_num(level), 0, LEVELS - 1).astype(np.int64)
        width, height = self.width[image, level], self.height[image, level]
        near = np.abs(uv).max(axis=0) < FARTHEST
        u, v = np.where(near, uv, np.float32(0))
        smooth = self.is_smooth[image]
        x = u * width - np.where(smooth, np.float32(0.5), 0)
        y = v * height - np.where(smooth, np.float32(0.5), 0)
        left, low = np.floor(x), np.floor(y)
        across, upward = np.where(smooth, x - left, 0), np.where(smooth, y - low, 0)
        extension, is_clip = self.extension[image], EXTENSIONS.index("CLIP")
        columns = [_inside(left.astype(np.int64) + step, width, extension) for step in (0, 1)]
        rows = [_inside(low.astype(np.int64) + step, height, extension) for step in (0, 1)]
        first, mixed = self.first[image, level], []
        for row, outside_row in rows:
            start, pair = first + row * width, []
            for column, outside in columns:
                texels: Single = self.texels.take(start + column, axis=0)
                cut = (outside | outside_row) & (extension == is_clip)
                if cut.any():
                    texels[cut] = 0
                pair.append(texels)
            mixed.append(_mixed(pair[0], pair[1], across))
        return _mixed(mixed[0], mixed[1], upward).T.astype(np.float32, copy=False)


def _inside(index: IndexArray, size: IndexArray, extension: IndexArray) -> tuple[IndexArray, BoolArray]:
    """Indices of texels inside an image for any indices, and whether they were outside."""
    outside = (index < 0) | (index >= size)
    if not outside.any():
        return index, outside
    mirrored = index % (2 * size)
    mirrored = np.minimum(mirrored, 2 * size - 1 - mirrored)
    kinds = (index % size, np.clip(index, 0, size - 1), np.clip(index, 0, size - 1), mirrored)
    return np.choose(extension, kinds), outside


def _mixed(first: Single, second: Single, share: Single) -> Single:
    """Values between two (n, 4), by shares (n,) of the second."""
    second -= first
    second *= share[:, None].astype(np.float32, copy=False)
    second += first
    return second


def smaller_copies(pixels: Single) -> list[Single]:
    """An image and LEVELS - 1 copies, each the mean of squares of the one before, at least one texel."""
    copies = [np.ascontiguousarray(pixels, np.float32)]
    for _ in range(LEVELS - 1):
        copies.append(halved(copies[-1]))
    return copies


def halved(pixels: Single) -> Single:
    """An image (H, W, C) of half the width and height, rounded down, at least 1."""
    for axis in (0, 1):
        size = pixels.shape[axis]
        if size > 1:
            even = pixels.take(np.arange(0, size - 1, 2), axis), pixels.take(np.arange(1, size, 2), axis)
            pixels = (even[0] + even[1]) * np.float32(0.5)
    return pixels


def footprints(uv: Single, look: IndexArray, width: int) -> Single:
    """The width of each pixel in texture coordinates, (n,), by its neighbours on the same surface.

    uv: (2, n) of whole rows. look: (n,) what is hit. At a border the smaller difference counts.
    """
    shape = (-1, width)
    surface, coordinates = look.reshape(shape), uv.reshape(2, *shape)
    found = np.full(surface.shape, np.inf, np.float32)
    for axis in (1, 0):
        step = np.abs(np.diff(coordinates, axis=axis + 1)).max(axis=0)
        step[np.diff(surface, axis=axis) != 0] = np.inf
        one, other = (slice(None),) * axis + (slice(1, None),), (slice(None),) * axis + (slice(None, -1),)
        here = np.full(surface.shape, np.inf, np.float32)
        np.minimum(here[one], step, out=here[one])
        np.minimum(here[other], step, out=here[other])
        here[np.isinf(here)] = 0
        found = here if axis == 1 else np.maximum(found, here)
    return found.ravel()
