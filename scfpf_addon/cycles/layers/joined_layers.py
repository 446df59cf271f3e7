# SPDX-License-Identifier: GPL-3.0-or-later
"""The join of an image's layers: pixels that each view shows, and the keys by which views are compared."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...casting.layers.join_images import joined, shares
from ...projection.typing import Array, BoolArray
from ...shading.settings.frame_settings import Border
from ...shading.typing import Single
from .layer_passes import OF_ONE_SAMPLE
from .pass_files import Pass

# Rows that are joined at once.
ROWS = 64
# A smaller share of a pixel makes no difference to it: less than a rounding of float32.
LEAST_SHARE = 2.0**-24


class ShownPixels(NamedTuple):
    """Colours (H, W, 4), premultiplied, of the pixels of a window, and keys (S, h, w) of those of another.

    The keys are those at S places of each pixel. Outside of the windows nothing is shown, or nothing is known
    to be near: the key is infinite. passes: see ``summed``. first: (H, W), keys of what those of one
    sample of each pixel show, empty without passes.
    """

    window: Border
    color: Single
    compared: Border
    keys: Array
    passes: dict[str, Pass]
    first: Array

    def part(self, window: Border, places: int) -> tuple[Single, Array]:
        """Colours (N, 4) and keys (places, N) of a window's pixels. places: S, or any number if S is 1."""
        color = widened(self.color, self.window, window, 0.0).reshape(-1, 4)
        return color, padded(self.keys, self.compared, window, places).reshape(places, -1)

    def pass_part(self, name: str, window: Border) -> Single:
        """The values (N, C) of a pass in a window's pixels."""
        values = self.passes[name].values
        return widened(values, self.window, window, 0.0).reshape(-1, values.shape[2])

    def in_image(self, size: tuple[int, int]) -> ShownPixels:
        """The same in all pixels of an image of a size, as F12 leaves them around a render region."""
        whole = Border(0, 0, *size)
        passes = {
            name: each._replace(values=widened(each.values, self.window, whole, 0.0))
            for name, each in self.passes.items()
        }
        color = widened(self.color, self.window, whole, 0.0)
        return self._replace(window=whole, color=color, passes=passes)


def widened(values: NDArray, own: Border, window: Border, empty: float) -> NDArray:
    """The values (H, W, ...) of a window's pixels: those of the window ``own``, elsewhere ``empty``."""
    shape = (window.top - window.bottom, window.right - window.left, *values.shape[2:])
    every = np.full(shape, empty, values.dtype)
    if (common := shared(own, window)) is not None:
        every[slices(common, window)] = values[slices(common, own)]
    return every


def padded(keys: Array, own: Border, window: Border, places: int) -> Array:
    """The keys (places, H, W) of a window's pixels: ``keys`` (S, H, W) of the window ``own``, inf elsewhere.

    places: S, or any number if S is 1.
    """
    every = np.full((places, window.top - window.bottom, window.right - window.left), np.inf)
    if (common := shared(own, window)) is not None:
        every[(slice(None), *slices(common, window))] = keys[(slice(None), *slices(common, own))]
    return every


def join_into(rest: ShownPixels, layers: Sequence[ShownPixels]) -> None:
    """Write the image of all layers into the colours and passes of the rest, those of the whole image."""
    whole = around([layer.window for layer in layers])
    sources = (rest, *layers)
    places = max(len(each.keys) for each in sources)
    for first in range(whole.bottom, whole.top, ROWS):
        window = whole._replace(bottom=first, top=min(first + ROWS, whole.top))
        own, (height, width) = slices(window, rest.window), (window.top - first, window.right - window.left)
        parts = [each.part(window, places) for each in sources]
        alphas = [color[:, 3] for color, _ in parts]
        share = shares(alphas, [keys for _, keys in parts])
        is_seen = (np.stack(alphas[1:]) > 0.0).any(axis=0)
        rest.color[own] = joined([color for color, _ in parts], share, is_seen).reshape(height, width, 4)
        if not rest.passes:
            continue
        nearest = np.argmin([widened(each.first, each.window, window, np.inf).ravel() for each in sources], 0)
        for name, (_letters, values) in rest.passes.items():
            found = [each.pass_part(name, window) for each in sources]
            if name in OF_ONE_SAMPLE:
                pixels = np.stack(found)[nearest, np.arange(len(nearest))]
            else:
                pixels = joined(found, share, is_seen)
            values[own] = pixels.reshape(height, width, -1)


def hidden_behind(layers: Sequence[ShownPixels], keys: Array, compared: Border, whole: Border) -> BoolArray:
    """The pixels (H, W) of a whole image in which layers hide all the rest, whatever that is.

    keys: (S, h, w) of the rest in the window ``compared``, as of ``ShownPixels``.
    """
    hidden = np.zeros((whole.top, whole.right), bool)
    if not layers:
        return hidden
    places = max(len(keys), *(len(layer.keys) for layer in layers))
    every = around([layer.window for layer in layers])
    for first in range(every.bottom, every.top, ROWS):
        window = every._replace(bottom=first, top=min(first + ROWS, every.top))
        parts = [layer.part(window, places) for layer in layers]
        behind = padded(keys, compared, window, places)
        alphas = [np.ones(behind[0].size, np.float32), *(color[:, 3] for color, _ in parts)]
        share = shares(alphas, [behind.reshape(places, -1), *(own for _, own in parts)])[0]
        hidden[slices(window, whole)] = (share <= LEAST_SHARE).reshape(behind.shape[1:])
    return hidden


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


def shared(one: Border, other: Border) -> Border | None:
    """The pixels that two windows have in common, None without any."""
    common = Border(
        max(one.left, other.left),
        max(one.bottom, other.bottom),
        min(one.right, other.right),
        min(one.top, other.top),
    )
    return common if common.left < common.right and common.bottom < common.top else None
