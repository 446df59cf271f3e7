# SPDX-License-Identifier: GPL-3.0-or-later
"""Outlines and the stripes over folds, against plain loops over pixels."""

import numpy as np
import pytest

from scfpf_addon.shading.live.live_hits import LiveHits
from scfpf_addon.shading.live.live_overlays import ACTIVE, SELECTED, Overlays, draw_overlays, stripes

SELECTED_COLOR, ACTIVE_COLOR, FOLD_COLOR = (0.9, 0.3, 0.0), (1.0, 0.6, 0.2), (1.0, 0.2, 0.2)


def hits_of(objects, mirrored=None):
    height, width = objects.shape
    count = objects.size
    zero = np.zeros((3, count), np.float32)
    number = objects.ravel().astype(np.int32)
    mirrored = np.zeros(count, bool) if mirrored is None else mirrored.ravel()
    return LiveHits(
        width, height, np.ones(count, bool), number, number, zero[0], zero, zero, zero, zero, mirrored, zero
    )


def scattered(seed=1):
    """Three objects in rectangles that cover one another, and nothing beside them."""
    random = np.random.default_rng(seed)
    objects = np.full((30, 40), -1)
    for number in (0, 1, 2, 1, 0):
        top, left = random.integers(0, 22), random.integers(0, 30)
        objects[top : top + random.integers(3, 12), left : left + random.integers(3, 14)] = number
    return objects


def drawn(objects, states, pixel_size):
    image = np.zeros((*objects.shape, 4), np.float32)
    overlays = Overlays(np.array(states), SELECTED_COLOR, ACTIVE_COLOR)
    draw_overlays(image, hits_of(objects), overlays, pixel_size)
    return image


@pytest.mark.parametrize("seed", range(4))
def test_outlines_follow_the_borders_of_selected_objects(seed):
    objects, states = scattered(seed), [SELECTED, 0, ACTIVE]
    fine, coarse = drawn(objects, states, 1.0), drawn(objects, states, 6.0)
    height, width = objects.shape
    colors = {SELECTED: SELECTED_COLOR, ACTIVE: ACTIVE_COLOR}
    for row in range(height):
        for column in range(width):
            own = states[objects[row, column]] if objects[row, column] >= 0 else 0
            around = [
                objects[r, c]
                for r, c in ((row + 1, column), (row - 1, column), (row, column + 1), (row, column - 1))
                if 0 <= r < height and 0 <= c < width
            ]
            near = max((states[number] for number in around if number >= 0), default=0)
            border = any(number != objects[row, column] for number in around)
            if own:
                expected = colors[own] if border else (0, 0, 0)
                assert np.allclose(fine[row, column, :3], expected)
                # Two pixels of the screen, of the six across a pixel.
                assert np.allclose(coarse[row, column, :3], np.array(expected) / 3, atol=1e-6)
            else:
                assert np.allclose(coarse[row, column, :3], 0)
                assert (fine[row, column, 0] > 0.5) == (near > 0)


def test_nothing_is_drawn_if_nothing_is_selected():
    assert (drawn(scattered(), [0, 0, 0], 1.0) == 0).all()


@pytest.mark.parametrize("pixel_size", [1.0, 2.0, 6.0])
def test_stripes_lie_over_mirrored_hits_only(pixel_size):
    objects = np.zeros((60, 80), int)
    objects[:, 60:] = -1
    mirrored = np.zeros(objects.shape, bool)
    mirrored[20:, 30:] = True
    image = np.ones((*objects.shape, 4), np.float32)
    draw_overlays(image, hits_of(objects, mirrored), Overlays(fold=FOLD_COLOR), pixel_size)
    inside = mirrored & (objects == 0)
    assert (image[~inside] == 1).all()
    strong = image[..., 1] < 0.6
    assert 0.05 < strong[inside].mean() < 0.5
    assert (image[inside][:, 1] < 1).all()


@pytest.mark.parametrize("pixel_size", [0.5, 1.0, 3.0])
def test_stripes_are_diagonal_and_equally_far_apart_on_the_screen(pixel_size):
    column, row = np.meshgrid(np.arange(400), np.arange(5))
    found = stripes(column, row, pixel_size)
    assert (found[1:, :-1] == found[:-1, 1:]).all()
    starts = np.flatnonzero(np.diff(found[0].astype(int)) == 1)
    apart = np.diff(starts) * pixel_size / np.sqrt(2)
    assert np.abs(apart - max(12.0, 4 * pixel_size)).max() <= pixel_size
