# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels of an image that a view shows: their colours, and the keys by which views are compared."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...casting.layers.join_images import joined
from ...projection.typing import Array, BoolArray
from ...shading.settings.frame_settings import Border
from ...shading.typing import Single

# Rows that are joined at once.
ROWS = 64


class ShownPixels(NamedTuple):
    """Colours (H, W, 4), premultiplied, of the pixels of a window, and keys (S, h, w) of those of another.

    The keys are those at S places of each pixel. Outside of the windows nothing is shown, or nothing is known
    to be near: the key is infinite.
    """

    window: Border
    color: Single
    compared: Border
    keys: Array

    def part(self, window: Border, places: int) -> tuple[Single, Array]:
        """Colours (N, 4) and keys (places, N) of a window's pixels. places: S, or any number if S is 1."""
        height, width = window.top - window.bottom, window.right - window.left
        color = np.zeros((height, width, 4), np.float32)
        if (shared := _shared(self.window, window)) is not None:
            color[slices(shared, window)] = self.color[slices(shared, self.window)]
        return color.reshape(-1, 4), padded(self.keys, self.compared, window, places).reshape(places, -1)


def padded(keys: Array, own: Border, window: Border, places: int) -> Array:
    """The keys (places, H, W) of a window's pixels: ``keys`` (S, H, W) of the window ``own``, inf elsewhere.

    places: S, or any number if S is 1.
    """
    every = np.full((places, window.top - window.bottom, window.right - window.left), np.inf)
    if (shared := _shared(own, window)) is not None:
        every[(slice(None), *slices(shared, window))] = keys[(slice(None), *slices(shared, own))]
    return every


def join_into(rest: ShownPixels, layers: Sequence[ShownPixels]) -> None:
    """Write the image of all layers into the colours of the rest, which are those of the whole image."""
    whole = around([layer.window for layer in layers])
    places = max(len(each.keys) for each in (rest, *layers))
    for first in range(whole.bottom, whole.top, ROWS):
        window = whole._replace(bottom=first, top=min(first + ROWS, whole.top))
        parts = [each.part(window, places) for each in (rest, *layers)]
        pixels = joined([color for color, _ in parts], [keys for _, keys in parts])
        rest.color[slices(window, rest.window)] = pixels.reshape(window.top - first, -1, 4)


def around(windows: Sequence[Border]) -> Border:
    """The least window that has all pixels of some."""
    left, bottom, right, top = zip(*windows, strict=True)
    return Border(min(left), min(bottom), max(right), max(top))


def within(is_wanted: BoolArray, window: Border) -> Border | None:
    """The least window with all wanted pixels (H, W) of another one, None without any."""
    rows, columns = np.flatnonzero(is_wanted.any(axis=1)), np.flatnonzero(is_wanted.any(axis=0))
    if not len(rows):
        return None
    return Border(
        window.left + int(columns[0]),
        window.bottom + int(rows[0]),
        window.left + int(columns[-1]) + 1,
        window.bottom + int(rows[-1]) + 1,
    )


def slices(window: Border, within: Border) -> tuple[slice, slice]:
    """The rows and columns of a window in the array of another one around it."""
    rows = slice(window.bottom - within.bottom, window.top - within.bottom)
    return rows, slice(window.left - within.left, window.right - within.left)


def _shared(one: Border, other: Border) -> Border | None:
    """The pixels that two windows have in common, None without any."""
    shared = Border(
        max(one.left, other.left),
        max(one.bottom, other.bottom),
        min(one.right, other.right),
        min(one.top, other.top),
    )
    return shared if shared.left < shared.right and shared.bottom < shared.top else None
