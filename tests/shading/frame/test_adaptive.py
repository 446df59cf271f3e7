# SPDX-License-Identifier: GPL-3.0-or-later
"""Adaptive sampling: more samples where pixels differ, and the same image by any parts."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.sampling import adaptive
from scfpf_addon.shading.sampling.adaptive import Adaptive, with_neighbours
from scfpf_addon.shading.sampling.pixel_filter import PixelFilter
from scfpf_addon.shading.scene.motion import Moment
from scfpf_addon.shading.scene.shading_scene import Light
from scfpf_addon.shading.settings.frame_settings import Border, FrameSettings
from scfpf_addon.shading.tracing import scene_view

SETTINGS = FrameSettings(
    96, 64, samples=32, pixel_filter=PixelFilter("GAUSSIAN", 3.0), adaptive=Adaptive(0.02, 4), threads=2
)


@pytest.fixture(scope="module")
def view(build):
    """A curved volume that looks at a ball with a soft shadow."""
    parts = [build.square(3), build.sphere(12, (0.2, 0.1, 0.6), 0.5), build.square(0.3, 1.4, (-0.5, 0))]
    lights = [
        Light("SUN", np.full(3, np.pi), build.placed()),
        Light("AREA", np.array([30, 20, 10.0]), build.placed((1, 1, 3)), size=(1, 0.5)),
    ]
    scene = build.scene(parts, lights, base=(0.8, 0.6, 0.4), f0=0.04, world=(0.1, 0.1, 0.2))
    return build.looking_down(2, 1, -1, shifts=[0, 0.8, 0]), scene


SMALL = replace(SETTINGS, width=48, height=32)


@pytest.fixture(scope="module")
def whole(view):
    return render_frame(*view, SMALL)


@pytest.mark.parametrize("border", [Border(0, 0, 20, 15), Border(20, 15, 48, 32)])
def test_a_border_is_a_part_of_the_whole(view, whole, border):
    part = render_frame(*view, replace(SMALL, border=border, threads=1))
    left, bottom, right, top = border
    assert np.array_equal(part.pixels, whole.pixels[bottom:top, left:right])


def test_it_comes_near_the_image_of_all_samples_with_fewer(build, view):
    view = build.looking_down(2, -1), view[1]
    some = render_frame(*view, SMALL)
    everywhere = render_frame(*view, replace(SMALL, adaptive=None, scrambled=True))
    few = render_frame(*view, replace(SMALL, adaptive=None, scrambled=True, samples=4))
    many = render_frame(*view, replace(SMALL, adaptive=None, samples=64)).pixels

    def error(frame):
        return np.sqrt(((frame.pixels - many) ** 2).mean())

    assert some.report.projectors < 0.6 * everywhere.report.projectors
    assert error(some) < 0.6 * error(few)
    # Edges and shadows get all of them.
    worst = np.abs(few.pixels - many).max(axis=2) > 0.1
    assert worst.sum() > 10
    assert np.abs(some.pixels - many)[worst].mean() < 1.5 * np.abs(everywhere.pixels - many)[worst].mean()


def test_a_flat_image_gets_the_fewest(build):
    scene = build.scene([build.square(3)], [Light("SUN", np.full(3, np.pi), build.placed())])
    frame = render_frame(build.looking_down(1, -1), scene, replace(SETTINGS, samples=64))
    # Tiles look at a row more on either side.
    assert frame.report.projectors <= 4 * 96 * (64 + 2 * 16)
    assert np.ptp(frame.pixels) < 1e-6


def test_transparency_counts(build):
    scene = build.scene([build.square(0.505)], [], base=(0, 0, 0))
    settings = replace(SETTINGS, transparent=True, samples=256, pixel_filter=PixelFilter())
    pixels = render_frame(build.looking_down(1, -1), scene, settings).pixels
    edge = (pixels[..., 3] > 0) & (pixels[..., 3] < 1)
    assert edge.sum() > 100 and not pixels[..., :3].any()
    # The square covers 0.505 × 96 = 48.48 columns in the middle.
    assert pixels[32, 23, 3] == pytest.approx(0.24, abs=0.02)


def test_neighbours():
    chosen = np.zeros((5, 6), bool)
    chosen[0, 0] = chosen[3, 4] = True
    expected = np.zeros_like(chosen)
    expected[:2, :2] = expected[2:5, 3:6] = True
    assert np.array_equal(with_neighbours(chosen), expected)


@pytest.mark.parametrize("degree", [1, 2])
def test_samples_of_a_moment_are_cast_together_and_the_same(build, view, monkeypatch, degree):
    """A batch of one projector casts sample by sample. Bent projectors share chords with other ones then."""
    shifts = [0, 0.8, 0][: degree + 1]
    projection, scene = build.looking_down(2, *(1, -1)[2 - degree :], shifts=shifts), view[1]
    moved = replace(scene, geometry=replace(scene.geometry, vertices=scene.geometry.vertices + 0.1))
    moments = (Moment(projection, scene), Moment(projection, moved))
    settings = replace(SETTINGS, width=14, height=6, samples=16)
    calls = []
    whole = scene_view.cast
    monkeypatch.setattr(scene_view, "cast", lambda *given: calls.append(1) or whole(*given))
    together = render_frame(projection, scene, settings, moments=moments)
    count, calls[:] = len(calls), []
    monkeypatch.setattr(adaptive, "BATCH", 1)
    apart = render_frame(projection, scene, settings, moments=moments)
    assert count < 0.8 * len(calls)
    difference = np.abs(together.pixels - apart.pixels)
    assert difference.max() == 0.0 if degree == 1 else (difference > 1e-4).mean() < 0.01
    border = Border(3, 2, 12, 5)
    part = render_frame(projection, scene, replace(settings, border=border), moments=moments)
    assert np.array_equal(part.pixels, apart.pixels[2:5, 3:12])
