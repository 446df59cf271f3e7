# SPDX-License-Identifier: GPL-3.0-or-later
"""Sample positions: Sobol's net, scrambled by pixel, warped by the filter."""

import numpy as np
import pytest

from scfpf_addon.shading.sampling.pixel_filter import PixelFilter
from scfpf_addon.shading.sampling.sample_positions import PIXEL, SamplePositions, row_pixels, sobol


@pytest.mark.parametrize("power", range(9))
def test_points_are_a_net(power):
    """Of 2ⁿ points each box of the 2ᵃ × 2ⁿ⁻ᵃ holds one, for all a: the definition of a (0, n, 2)-net."""
    x, y = (sobol(1 << power)[d].astype(np.int64) for d in PIXEL)
    for a in range(power + 1):
        boxes = (x >> (32 - a)) << (power - a) | y >> (32 - power + a)
        assert sorted(boxes.tolist()) == list(range(1 << power))


def test_first_points_are_sobols():
    """The first eight points of all four dimensions, as fractions, from Joe and Kuo's page."""
    expected = [
        (0, 0, 0, 0),
        (0.5, 0.5, 0.5, 0.5),
        (0.75, 0.25, 0.25, 0.25),
        (0.25, 0.75, 0.75, 0.75),
        (0.375, 0.375, 0.625, 0.875),
        (0.875, 0.875, 0.125, 0.375),
        (0.625, 0.125, 0.875, 0.625),
        (0.125, 0.625, 0.375, 0.125),
    ]
    assert {*map(tuple, sobol(8).T * 2.0**-32)} == {*expected}


@pytest.mark.parametrize("kind", ["BOX", "GAUSSIAN", "BLACKMAN_HARRIS"])
def test_samples_have_the_filters_moments(kind):
    """Mean zero; the variance is that of the filter's formula, by a plain sum."""
    width = 1.5
    offset = PixelFilter(kind, width).offset((np.arange(20000) + 0.5) / 20000)
    if kind == "BOX":
        variance = 1 / 12
    else:
        reach = width * {"GAUSSIAN": 3, "BLACKMAN_HARRIS": 2}[kind]
        x = np.linspace(-reach / 2, reach / 2, 20001)
        angle = 2 * np.pi * (x / reach + 0.5)
        weight = (
            np.exp(-2 * (6 * x / reach) ** 2)
            if kind == "GAUSSIAN"
            else 0.35875 - 0.48829 * np.cos(angle) + 0.14128 * np.cos(2 * angle) - 0.01168 * np.cos(3 * angle)
        )
        variance = (weight * x * x).sum() / weight.sum()
    assert abs(offset.mean()) < 1e-9
    assert offset.var() == pytest.approx(variance, rel=1e-4)
    assert (np.diff(offset) > 0).all()


@pytest.mark.parametrize("scrambled", [False, True])
@pytest.mark.parametrize("width", [1.5, 9.0])
def test_pixels_have_their_samples_whatever_rows_they_are_in(scrambled, width):
    places = SamplePositions(17, 11, 6, PixelFilter("GAUSSIAN", width), scrambled)
    some = np.array([3, 40, 95, 96, 186])
    for sample in range(6):
        x, y = places.of_rows(slice(0, 11), sample)
        assert x.min() >= 0 and x.max() <= 1 and y.min() >= 0 and y.max() <= 1
        assert np.array_equal(np.stack(places.of_rows(slice(4, 7), sample)), np.stack([x, y])[:, 68:119])
        assert np.array_equal(np.stack(places.of_pixels(some, sample)), np.stack([x, y])[:, some])


def test_scrambled_pixels_are_filled_evenly_and_are_not_alike():
    places = SamplePositions(8, 8, 16, PixelFilter(), True)
    pixel = row_pixels(slice(0, 8), 8)
    within = np.array([np.stack(places.of_pixels(pixel, s)) * 8 % 1 for s in range(16)])
    for axis in range(2):
        cells = np.sort((within[:, axis] * 16).astype(int), axis=0)
        assert (cells == np.arange(16)[:, None]).all(), "each pixel has one sample in each sixteenth"
    assert len(np.unique(within[0].round(9), axis=1).T) > 60
    assert within.mean() == pytest.approx(0.5, abs=0.01)


def test_lens_places_are_spread():
    places = SamplePositions(8, 8, 16, PixelFilter(), True)
    pixel = row_pixels(slice(0, 8), 8)
    lens = np.array([places.on_lens(pixel, s) for s in range(16)])
    assert lens.min() >= 0 and lens.max() < 1
    assert all(len(set((lens[:, d, 5] * 16).astype(int))) == 16 for d in range(2))
