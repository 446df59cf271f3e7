# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes of light: that they add up to the image, and closed forms of each."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.casting.common.ray_visibility import CATCHER, EVERYWHERE
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.passes import light_passes
from scfpf_addon.shading.passes.data_passes import DataPasses
from scfpf_addon.shading.sampling.adaptive import Adaptive
from scfpf_addon.shading.scene.motion import Moment
from scfpf_addon.shading.scene.shading_scene import Light
from scfpf_addon.shading.settings.frame_settings import FrameSettings

NAMES = tuple(light_passes.LIGHT_PASSES)
COLORS = NAMES[:4]
# Roundings of float32 in a sum of a dozen samples and four parts.
ROUNDING = 1e-6


def lit_ball(build):
    """A glossy, glowing ball over a ground in its shadow, under a lamp and the world."""
    lamp = Light("POINT", np.full(3, 900.0), build.placed((2, 1, 4)), radius=0.5)
    parts = [build.square(0.8, -0.8), build.sphere(12, radius=0.5)]
    return build.scene(parts, [lamp], (0.1, 0.2, 0.3), f0=0.05, emission=(0.3, 0.1, 0), base=(0.8, 0.6, 0.4))


def settings(**more):
    return FrameSettings(24, 24, samples=5, pixel_error=1.0, passes=DataPasses(NAMES), **more)


@pytest.mark.parametrize("adaptive", [None, Adaptive(0.02, 2)])
def test_parts_add_up_to_the_image(build, adaptive):
    view = build.looking_down(2, 0.2, -1, size=1.9, shifts=(0, 0.4, 0))
    frame = render_frame(view, lit_ball(build), settings(adaptive=adaptive))
    total = sum(frame.passes[name] for name in COLORS)
    assert np.abs(total - frame.pixels[..., :3]).max() < ROUNDING * frame.pixels.max()
    # There are no catchers.
    assert (frame.passes["SHADOW_CATCHER"] == 1.0).all()
    for name in set(NAMES) - {"SHADOW_CATCHER"}:
        assert np.ptp(frame.passes[name]) > 0.05, name
        assert frame.passes[name].min() >= 0.0
    assert frame.passes["SHADOW"].max() <= 1.0
    bare = replace(settings(adaptive=adaptive), passes=DataPasses())
    assert np.array_equal(render_frame(view, lit_ball(build), bare).pixels, frame.pixels)


def test_passes_of_light_cast_nothing_more(build):
    """They are made of the image's own samples, and without them nothing is gathered."""
    assert not settings().passes.central
    assert DataPasses(("DIFFUSE", "DEPTH")).central
    assert light_passes.LightFilm.of(("DEPTH",), 4, np.zeros(3)) is None


def test_a_sheet_under_the_sun(build):
    """Lambert's law, the world's light on top of it, a glow, and a sky beside the sheet."""
    sun = Light("SUN", np.full(3, 2.0), build.placed())
    scene = build.scene(
        [build.square(0.5, centre=(-0.5, 0))], [sun], (0.1, 0.2, 0.4), base=(0.5, 0.25, 1), emission=(0, 3, 0)
    )
    made = render_frame(build.looking_down(1, -1), scene, settings()).passes
    there, sky = made["DIFFUSE"][12, 4], made["ENVIRONMENT"][12, 20]
    assert np.allclose(there, np.array([0.5, 0.25, 1]) * (2 / np.pi + np.array([0.1, 0.2, 0.4])), atol=1e-6)
    assert np.allclose(made["EMISSION"][12, 4], (0, 3, 0)) and np.allclose(sky, (0.1, 0.2, 0.4))
    assert not made["SPECULAR"].any() and not made["ENVIRONMENT"][12, 4].any()
    assert not made["DIFFUSE"][12, 20].any() and (made["SHADOW"] == 1.0).all()


def test_shadow_is_the_share_of_light_that_arrives(build):
    """Of two lamps one is cut off from a half of the ground; the other is three times as bright."""
    lights = [
        Light("SUN", np.full(3, power), build.placed(shines=(x, 0, -1)))
        for power, x in ((1.0, 1.0), (3.0, -1.0))
    ]
    # A wall on edge, beside which the ground on the right lies in the first one's shadow.
    wall = np.array([[0, -9, -1], [0, 9, -1], [0, 9, 9], [0, -9, 9]], float), [[0, 1, 2], [0, 2, 3]], None
    scene = build.scene([build.square(2, -0.99), wall], lights)
    made = render_frame(build.looking_down(2, -1.5, size=1.8), scene, settings())
    assert np.allclose(made.passes["SHADOW"][4:-4, 14:-2], 0.75)
    assert np.allclose(made.passes["SHADOW"][4:-4, 2:10], 0.25)


def test_the_environment_stays_behind_a_transparent_film(build):
    scene = build.scene([build.square(0.5)], world=(0.5, 0.5, 0.5))
    made = render_frame(build.looking_down(1, -1), scene, settings(transparent=True))
    assert not made.pixels[0].any() and np.allclose(made.passes["ENVIRONMENT"][0], 0.5)


def test_caught_shadows_are_only_in_their_pass_while_the_shutter_is_open(build):
    """The same image as of a closed shutter: nothing moves, though each moment is read by itself."""
    lights = [Light("SUN", np.full(3, np.pi), build.placed(shines=(0.5, 0.2, -1)))]
    scene = build.scene([build.square(0.7), build.square(0.3, 0.6)], lights, world=(0.4, 0.5, 0.6))
    visibility = np.array([EVERYWHERE | CATCHER] * 2 + [EVERYWHERE] * 2, np.uint8)
    scene = replace(scene, geometry=replace(scene.geometry, visibility=visibility))
    view = build.looking_down(1, -1)
    moments = tuple(Moment(view, replace(scene), None) for _ in range(2))
    still, moving = (render_frame(view, scene, settings(), moments=moments) for moments in ((), moments))
    assert still.passes["SHADOW_CATCHER"].min() < 0.9
    assert np.array_equal(still.pixels, moving.pixels)
