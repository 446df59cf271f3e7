# SPDX-License-Identifier: GPL-3.0-or-later
"""Overlays in a live image: the outline of selected objects, and stripes where it is mirrored by a fold."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...projection.typing import Array, BoolArray, IndexArray
from ..typing import Single
from .live_hits import LiveHits

# States of objects.
NOT_SELECTED, SELECTED, ACTIVE = 0, 1, 2
# Distance of the stripes over folds and their width, pixels of the screen, across them.
STRIPE_PERIOD, STRIPE_WIDTH = 12.0, 2.5
# Opacity of the stripes, and of the tint between them.
STRIPE_OPACITY, TINT_OPACITY = 0.75, 0.12
# Width of an outline on each side of the border, pixels of the screen; an image's pixel at least.
OUTLINE = 1.0
# Opacity of the outer half of an outline, whose steps would be seen otherwise.
OUTER_OPACITY = 0.8

Color = tuple[float, float, float]


@dataclass(frozen=True)
class Overlays:
    """The overlays drawn over the surfaces; display colours (sRGB).

    states: (O,) state of each object, None for no outlines. selected, active: the outlines' colours. fold:
    the stripes' colour, None for no stripes.
    """

    states: IndexArray | None = None
    selected: Color = (0.93, 0.34, 0.0)
    active: Color = (1.0, 0.63, 0.16)
    fold: Color | None = None


def draw_overlays(image: Single, hits: LiveHits, overlays: Overlays, pixel_size: float) -> None:
    """Draw over an image (H, W, 4) of display colours, in place.

    pixel_size: pixels of the screen across a pixel of the image.
    """
    if overlays.fold is not None:
        _draw_folds(image, hits, overlays.fold, pixel_size)
    if overlays.states is not None and overlays.states.any():
        _draw_outlines(image, hits, overlays, overlays.states, pixel_size)


def _draw_folds(image: Single, hits: LiveHits, color: Color, pixel_size: float) -> None:
    """Stripe the pixels whose projector is mirrored where it hits."""
    folded = hits.is_mirrored & (hits.look >= 0)
    if not folded.any():
        return
    place = np.flatnonzero(folded)
    row, column = np.divmod(place, hits.width)
    opacity = np.where(stripes(column, row, pixel_size), np.float32(STRIPE_OPACITY), np.float32(TINT_OPACITY))
    flat = image.reshape(-1, 4)
    flat[place, :3] += (np.array(color, np.float32) - flat[place, :3]) * opacity[:, None]


def stripes(column: IndexArray, row: IndexArray, pixel_size: float) -> BoolArray:
    """Return whether pixels are on a diagonal stripe, which is at least a pixel wide."""
    period = max(STRIPE_PERIOD, 4 * pixel_size)
    width = max(STRIPE_WIDTH, pixel_size)
    across: Array = (column + row) * (pixel_size / np.sqrt(2.0))
    on_stripe: BoolArray = across % period < width
    return on_stripe


def _draw_outlines(
    image: Single, hits: LiveHits, overlays: Overlays, states: IndexArray, pixel_size: float
) -> None:
    """Draw the borders of selected objects: on both sides if the image is fine enough, else translucent."""
    shape = hits.height, hits.width
    objects = hits.object.reshape(shape)
    state = np.where(objects >= 0, states.take(objects, mode="clip"), NOT_SELECTED).astype(np.uint8)
    # Objects that are not selected have no border between them.
    marked = np.where(state > NOT_SELECTED, objects, -1)
    if not (marked >= 0).any():
        return
    colors = np.array([overlays.selected, overlays.selected, overlays.active], np.float32)
    inner = _borders(marked) & (state > NOT_SELECTED)
    if pixel_size < 2 * OUTLINE:
        beside = _strongest_neighbour(state)
        outer = _borders(marked) & (state == NOT_SELECTED) & (beside > NOT_SELECTED)
        part = image[outer, :3]
        image[outer, :3] = part + (colors[beside[outer]] - part) * np.float32(OUTER_OPACITY)
    opacity = np.float32(min(2 * OUTLINE / pixel_size, 1.0))
    image[inner, :3] += (colors[state[inner]] - image[inner, :3]) * opacity


def _borders(marked: IndexArray) -> BoolArray:
    """Pixels (H, W) with another number in the pixel beside, above or below."""
    found = np.zeros(marked.shape, bool)
    across, upward = marked[:, 1:] != marked[:, :-1], marked[1:] != marked[:-1]
    found[:, 1:] |= across
    found[:, :-1] |= across
    found[1:] |= upward
    found[:-1] |= upward
    return found


def _strongest_neighbour(state: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The highest state in the pixels beside, above and below each pixel."""
    found = np.zeros_like(state)
    for one, other in (
        ((slice(None), slice(1, None)), (slice(None), slice(None, -1))),
        ((slice(1, None),), (slice(None, -1),)),
    ):
        np.maximum(found[one], state[other], out=found[one])
        np.maximum(found[other], state[one], out=found[other])
    return found
