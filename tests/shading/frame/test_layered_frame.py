# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames with image layers: a ball above a floor, seen by the image's volume and by layers' own."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.projection.volume.viewing_volume import ImageLayer
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.passes.data_passes import DataPasses
from scfpf_addon.shading.scene.shading_scene import Light
from scfpf_addon.shading.settings.frame_settings import FrameSettings

SIDE = 48
EYE = np.array([0.0, 0.0, 9.0])
PASSES = ("DEPTH", "POSITION", "PARAMETERS", "OBJECT_INDEX")
# Straight projectors, and bent ones that are shifted halfway.
VOLUMES = [dict(heights=(4.0, -1.0)), dict(heights=(4.0, 1.5, -1.0), shifts=[0.0, 0.6, 0.0])]


@pytest.fixture
def scene(build):
    """A floor (object 0) and a ball above it (object 1), in the sun; the ball is in layer 1."""
    sun = Light("SUN", np.ones(3) * 3, build.placed((0, 0, 5), (0.5, 0, -1)))
    made = build.scene([build.square(3.0), build.sphere(12, (0.6, 0, 1.0), 0.4)], [sun], (0.1, 0.2, 0.3))
    numbers = (made.geometry.object_index == 1).astype(np.uint8)
    geometry = replace(made.geometry, image_layer=numbers, object_names=("Floor", "Ball"))
    return replace(made, geometry=geometry, object_index=(3, 5), material_index=(1, 2))


def view(build, heights=(4.0, -1.0), shifts=None, size=4.0):
    return build.looking_down(*heights, size=size, shifts=shifts)


def frame(projection, scene, **settings):
    given = {"samples": 4, "passes": DataPasses(PASSES), "pixel_error": 0.05} | settings
    return render_frame(projection, scene, FrameSettings(SIDE, SIDE, **given))


def layered(projection, *others, front="DEPTH", **more):
    return replace(projection, layers=tuple(ImageLayer(each, front, EYE, **more) for each in others))


@pytest.mark.parametrize("volume", VOLUMES)
def test_the_background_stays_bit_for_bit(build, scene, volume):
    plain = view(build, **volume)
    there = frame(plain, scene)
    moved = frame(layered(plain, view(build, shifts=[1.0, 1.0])), scene)
    thing = np.zeros((SIDE, SIDE), bool)
    for made in (there, moved):
        thing |= made.passes["OBJECT_INDEX"][..., 0] == 5
        # Samples and filter of the ball reach its neighbours.
    for _ in range(2):
        around = np.pad(thing, 1)
        thing |= around[:-2, 1:-1] | around[2:, 1:-1] | around[1:-1, :-2] | around[1:-1, 2:]
    assert thing.mean() < 0.4
    np.testing.assert_array_equal(moved.pixels[~thing], there.pixels[~thing])
    assert (moved.pixels != there.pixels).any()
    # The ball's shadow on the floor is where the ball is, not where the image shows it.
    assert np.ptp(moved.pixels[~thing][:, 0]) > 0.1


@pytest.mark.parametrize("volume", VOLUMES)
def test_a_layer_that_shows_nothing_leaves_the_image(build, scene, volume):
    plain = view(build, **volume)
    elsewhere = build.looking_down(4.0, -1.0, size=1.0, shifts=[50.0, 50.0])
    geometry = scene.geometry
    hidden = replace(geometry, image_layer=None, visibility=(15 - geometry.image_layer).astype(np.uint8))
    without = frame(plain, replace(scene, geometry=hidden))
    made = frame(layered(plain, elsewhere), scene)
    np.testing.assert_array_equal(made.pixels, without.pixels)
    empty = replace(scene, geometry=replace(geometry, image_layer=np.zeros_like(geometry.image_layer)))
    np.testing.assert_array_equal(frame(layered(plain, elsewhere), empty).pixels, frame(plain, scene).pixels)


@pytest.mark.parametrize("volume", VOLUMES)
def test_a_layer_through_the_same_volume_shows_the_same(build, scene, volume):
    plain = view(build, **volume)
    made, expected = frame(layered(plain, plain), scene), frame(plain, scene)
    np.testing.assert_allclose(made.pixels, expected.pixels, atol=2e-2)
    for name in PASSES:
        np.testing.assert_allclose(made.passes[name], expected.passes[name], atol=1e-4, err_msg=name)


def test_passes_of_a_layer_are_those_of_its_own_projectors(build, scene):
    other = view(build, heights=(5.0, -3.0), shifts=[1.0, 1.0])
    made = frame(layered(view(build), other, front="ORDER"), scene)
    ball = made.passes["OBJECT_INDEX"][..., 0] == 5
    assert ball.sum() > 20
    position = made.passes["POSITION"][ball]
    np.testing.assert_allclose(np.linalg.norm(position - [0.6, 0, 1.0], axis=1), 0.4, atol=0.02)
    np.testing.assert_allclose(made.passes["DEPTH"][ball][:, 0], 5.0 - position[:, 2], atol=1e-5)
    np.testing.assert_allclose(made.passes["PARAMETERS"][ball][:, 2], (5.0 - position[:, 2]) / 8, atol=1e-5)
    centre = ((np.arange(SIDE) + 0.5) / SIDE - 0.5) * 4
    x, _y = np.meshgrid(centre, centre)
    # The layer's view looks one unit to the right of the image's.
    np.testing.assert_allclose(position[:, 0], x[ball] + 1.0, atol=1e-5)


def test_eight_layers(build, scene):
    parts = [build.square(0.2, 1.0, (0.4 * k - 1.4, 0.0)) for k in range(8)]
    made = build.scene([build.square(3.0), *parts], (), (1, 1, 1))
    numbers = made.geometry.object_index.astype(np.uint8)
    geometry = replace(made.geometry, image_layer=numbers)
    made = replace(made, geometry=geometry, object_index=tuple(range(9)))
    others = [view(build, shifts=[0.0, 0.0], size=4.0 + k) for k in range(8)]
    found = frame(layered(view(build), *others, front="ORDER"), made).passes["OBJECT_INDEX"]
    assert set(np.unique(found)) == set(range(9))


def test_a_halo_takes_the_ground_along(build, scene):
    other = view(build, shifts=[1.0, 1.0])
    alone = frame(layered(view(build), other, front="ORDER"), scene).passes["POSITION"]
    halo = frame(layered(view(build), other, front="ORDER", halo=0.8), scene).passes
    moved = np.abs(halo["POSITION"] - alone).max(axis=2) > 0.5
    assert moved.any() and (halo["OBJECT_INDEX"][moved] == 3).all()
    # The box of the ball ends 0.6 above the floor: 0.8 reaches so far beyond it there.
    place = halo["POSITION"][moved][:, :2] - [0.6, 0.0]
    off = np.linalg.norm(np.maximum(np.abs(place) - 0.4, 0), axis=1)
    assert off.max() <= np.sqrt(0.8**2 - 0.6**2) + 1e-6
