# SPDX-License-Identifier: GPL-3.0-or-later
"""The cone of a pixel: of ordinary cameras in closed form; the screen of a rig lies on float32's steps."""

from pathlib import Path

import numpy as np
import pytest

from scfpf_addon.cycles.chords.chord_plan import plan_chords
from scfpf_addon.cycles.portals.screen import BEYOND, FEWEST_STEPS, is_about, screen_for
from scfpf_addon.projection.presets.preset import read_preset
from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

PRESETS = Path(__file__).parents[3] / "presets"
# Presets whose pixels differ little in size at each distance, and others.
EVEN = (
    "perspective", "telephoto", "angular_fisheye", "barrel_lens", "nonlinear_twist", "tiny_planet",
    "street_panorama", "orthographic_to_perspective",
)  # fmt: skip
UNEVEN = ("cylindrical_panorama", "equirectangular", "mirror_ball")


def plane(width, height, depth, x=0.0):
    matrix = np.array([[1, 0, 0, x], [0, 1, 0, 0], [0, 0, 1, -depth], [0, 0, 0, 1.0]])
    return Plane(width, height, matrix=matrix)


def cone_of(surfaces, size=(320, 200)):
    aspect = surfaces[0].width / surfaces[0].height
    return plan_chords([Projection(ViewingVolume(surfaces), aspect=aspect)], size, 0.2).cone


@pytest.mark.parametrize("scale", [1e-4, 1.0, 1e4])
@pytest.mark.parametrize("across", [0.08, 0.7, 3.0])
def test_a_camera_sees_by_its_own_cone(scale, across):
    """From its pinhole, as wide there as it sees: w = W / n · (distance from the pinhole)."""
    near, far = scale, 300.0 * scale
    cone = cone_of([plane(across * depth, 0.625 * across * depth, depth) for depth in (near, far)])
    assert not cone.is_parallel and cone.spread < 1.02
    assert cone.width / cone.distance == pytest.approx(across, rel=0.03)
    assert cone.distance == pytest.approx(near, rel=0.1)
    assert np.abs(cone.apex).max() < 0.1 * near


def test_a_parallel_camera_has_one_size_of_pixels():
    """Oblique as well: pixels count across the ray."""
    cone = cone_of([plane(4.0, 2.5, 1.0), plane(4.0, 2.5, 90.0)])
    assert cone.is_parallel and cone.width == pytest.approx(4.0) and cone.spread == pytest.approx(1.0)
    tilted = cone_of([plane(4.0, 2.5, 1.0), plane(4.0, 2.5, 11.0, x=10.0)])
    assert tilted.is_parallel and tilted.width == pytest.approx(4.0 * (0.5 + 0.5 * np.sqrt(0.5)), rel=1e-6)


@pytest.mark.parametrize("name", EVEN + UNEVEN)
def test_most_pixels_of_presets_are_within_a_factor_of_two(name):
    preset = read_preset(PRESETS / f"{name}.json")
    aspect = preset.aspect
    cone = plan_chords([preset.projection(aspect)], (480, round(480 / aspect)), 0.5).cone
    assert (cone.spread < 2.0) == (name in EVEN)


@pytest.mark.parametrize("scale", [1e-5, 1e-2, 1.0, 30.0, 1e4])
@pytest.mark.parametrize("length", [1.0, 1e6])
def test_a_ray_begins_exactly_one_step_before_the_screen(scale, length):
    """In float32, wherever the screen is; it is below all that is in the volume."""
    cone = cone_of([plane(depth, 0.625 * depth, depth) for depth in (scale, 20.0 * length * scale)])
    screen = screen_for(cone)
    assert screen.away >= BEYOND * cone.reach and screen.distance >= FEWEST_STEPS * screen.step
    camera, at = np.float32(-screen.away), np.float32(-screen.away - screen.distance)
    begin = np.float32(camera - np.float32(screen.distance - screen.step))
    assert float(camera) == -screen.away and float(at) == -screen.away - screen.distance
    assert float(begin) == float(at) + screen.step and np.nextafter(begin, at) == at
    assert is_about(screen, screen, 0.0) and not is_about(
        screen, screen._replace(width=1.2 * screen.width), 0.1
    )
