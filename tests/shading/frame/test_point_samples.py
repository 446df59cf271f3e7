# SPDX-License-Identifier: GPL-3.0-or-later
"""Random numbers of points, spread over a pixel's samples and its neighbours, and their soft shadows."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.sampling.point_samples import PointSamples, pixel_places
from scfpf_addon.shading.sampling.sample_positions import sobol
from scfpf_addon.shading.scene.shading_scene import Light
from scfpf_addon.shading.settings.frame_settings import Border, FrameSettings
from scfpf_addon.shading.tracing.path_samples import PathSamples

WIDTH = 32


def shares(pixel, count, purpose=3, lamp=7):
    place = pixel_places(np.asarray(pixel), WIDTH)
    made = [PointSamples(place, number, count).shares(purpose).of(lamp) for number in range(count)]
    return np.stack(made, axis=1)


def is_net(points):
    """Of 2^n points (2, 2^n) each box of the 2^a x 2^(n-a) holds one, for all a."""
    power = points.shape[1].bit_length() - 1
    for a in range(power + 1):
        x, y = np.floor(points[0] * 2**a), np.floor(points[1] * 2 ** (power - a))
        if len(np.unique(x * 2**power + y)) < 1 << power:
            return False
    return True


@pytest.mark.parametrize("count", [4, 16])
def test_samples_of_a_pixel_and_of_squares_of_pixels_are_nets(count):
    found = shares(np.arange(WIDTH * WIDTH), count)
    assert found.min() >= 0.0 and found.max() < 1.0
    assert all(is_net(found[:, :, pixel]) for pixel in range(0, WIDTH * WIDTH, 37))
    square = [row * WIDTH + column for row in range(4) for column in range(8, 12)]
    assert is_net(found[:, :, square].reshape(2, -1))
    assert len(np.unique(found[0, 0])) == WIDTH * WIDTH, "no two pixels are alike"


def test_the_numbers_are_sobols():
    """Differences by exclusive or do not depend on the shift: those of two samples are Sobol's own."""
    place = np.zeros(1, np.uint32)
    first, second = PointSamples(place, np.arange(1), 64).shares(0).bits
    known = {int(x): int(y) for x, y in sobol(64)[:2].T}
    top = np.uint32(0xFC000000)
    for number in range(1, 64):
        x, y = PointSamples(place, number, 64).shares(0).bits
        assert known[int((x ^ first)[0] & top)] == int((y ^ second)[0] & top)


def test_purposes_and_lamps_do_not_keep_step():
    """Any half of one lamp is met with any half of another purpose, in nearly each pixel."""
    pixel = np.arange(256)
    one, other = (shares(pixel, 16, purpose)[0] > 0.5 for purpose in (3, 4))
    together = (one & other).sum(axis=0)
    assert 3.0 < together.mean() < 5.0 and together.std() < 2.0
    assert np.abs(shares(pixel, 16, lamp=8) - shares(pixel, 16, lamp=7)).min() > 0.0


@pytest.mark.parametrize("scrambled", [False, True])
def test_a_soft_shadow_has_no_steps(build, scrambled):
    """A square lamp of side 2 at height 4 over the edge of a wall at height 2, by a sum over places on it."""
    lamp = Light("AREA", np.full(3, 100.0), build.placed((0, 0, 4)), size=(2.0, 2.0))
    scene = build.scene([build.square(20.0), build.square(8.0, 2.0, (8.0, 0.0))], lights=[lamp])
    settings = FrameSettings(64, 64, samples=16, scrambled=scrambled)
    view = build.looking_down(1.0, -1.0, size=2.0)
    shown = render_frame(view, scene, settings).pixels[..., 0].astype(float)
    pixel, place = ((np.arange(count) + 0.5) / (count / 2) - 1.0 for count in (64, 40))
    x, along, up = np.meshgrid(pixel, place, place, indexing="ij")
    light = np.stack([4.0**2 / ((x - along) ** 2 + (y - up) ** 2 + 4.0**2) ** 2 for y in pixel])
    expected = 100.0 / np.pi**2 * (light * (x + along < 0.0)).mean(axis=(2, 3))
    wrong = (shown - expected) / expected.max()
    assert abs(wrong.mean()) < 1e-3 and np.sqrt((wrong**2).mean()) < 0.03
    # Pixels along the edge differ, and so the steps of their samples do not show.
    assert wrong[:, 8:56].std(axis=0).min() > 0.005 and np.abs(wrong.mean(axis=0)).max() < 0.02
    part = replace(settings, border=Border(20, 30, 40, 50), threads=1)
    assert np.array_equal(render_frame(view, scene, part).pixels[..., 0], shown[30:50, 20:40])


def test_each_pixel_begins_its_reflections_elsewhere():
    """The starts of all pixels differ, and are spread as random points are: |mean of e^(2πi x)| < 4/√n."""
    pixel = np.arange(WIDTH * WIDTH)
    samples = PathSamples(PointSamples(pixel_places(pixel, WIDTH), 0, 16))
    starts = samples.facets(pixel, np.zeros(len(pixel), np.int64))
    assert len(np.unique(starts, axis=1)[0]) == len(pixel)
    for across, up in ((1, 0), (0, 1), (1, 1), (1, -1), (2, 1), (1, 2)):
        wave = np.exp(2j * np.pi * (across * starts[0] + up * starts[1]))
        assert abs(wave.mean()) < 4.0 / np.sqrt(len(pixel))
