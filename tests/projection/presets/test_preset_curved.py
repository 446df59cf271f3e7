# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets with bent projectors against what defines them."""

from pathlib import Path

import numpy as np
import pytest

from scfpf_addon.projection.presets.preset import read_preset
from scfpf_addon.projection.volume.inverse import find_in_image

FOLDER = Path(__file__).resolve().parents[3] / "presets"
# Of the images that pixels are counted in.
WIDTH = 1000


def preset(name):
    return read_preset(FOLDER / f"{name}.json")


def seen(name, count=500):
    """Image positions from -1 to 1, t and the points (3, N) that they show."""
    shown = preset(name)
    x, y, t = np.random.default_rng(5).random((3, count))
    return 2 * x - 1, 2 * y - 1, t, shown.projection(shown.aspect).volume.evaluate(x, y, t).position


def bow(name, points):
    """The distance of the image of a straight line (3, N) from the line between its ends, in pixels."""
    shown = preset(name)
    place = find_in_image(shown.projection(shown.aspect), points)
    assert place.found.all()
    across, up = place.x * WIDTH, place.y * WIDTH / shown.aspect
    chord = np.array([across[-1] - across[0], up[-1] - up[0]])
    distance = (across - across[0]) * chord[1] - (up - up[0]) * chord[0]
    return np.abs(distance).max() / np.hypot(*chord)


def line(start, end):
    return np.linspace(start, end, 60).T


LINES = {
    "to the lower right": line((1.0, -0.7, -2), (1.0, -0.7, -36)),
    "to the upper left": line((-0.8, 0.6, -2), (-0.8, 0.6, -36)),
    "overhead": line((0.6, 1.6, -5), (0.6, 1.6, -36)),
}


@pytest.mark.parametrize("name", LINES)
def test_lines_into_depth_converge_in_curves(name):
    """Figure 9: more than 5 pixels off their chord; with rectangles of equal shapes they are straight."""
    assert bow("curved_convergence", LINES[name]) > 5
    assert bow("orthographic_to_perspective", LINES[name]) < 1e-3


def test_curved_convergence_follows_its_three_rectangles():
    x, y, t, (px, py, pz) = seen("curved_convergence")
    weights = np.array([(1 - t) ** 2, 2 * t * (1 - t), t**2])
    assert np.allclose(px, x * (np.array([1, 2, 10]) @ weights), rtol=0, atol=1e-12)
    assert np.allclose(py, y * (np.array([0.75, 7, 7.5]) @ weights), rtol=0, atol=1e-12)
    assert np.allclose(pz, -np.array([1, 20, 40]) @ weights, rtol=0, atol=1e-12)


def test_orthographic_becomes_perspective():
    """Figure 12: width w0 + (w2 - w0) t², t the depth over 40; parallel at the near rectangle."""
    x, y, t, (px, py, pz) = seen("orthographic_to_perspective")
    depth = -pz / 40
    assert np.allclose(depth, t, rtol=0, atol=1e-12)
    assert np.allclose(px, x * (10 + (60 - 10) * depth**2) / 2, rtol=0, atol=1e-12)
    assert np.allclose(py, y * (7.5 + (45 - 7.5) * depth**2) / 2, rtol=0, atol=1e-12)
    start = (
        preset("orthographic_to_perspective").volume().evaluate((x + 1) / 2, (y + 1) / 2, np.zeros_like(x))
    )
    assert np.abs(start.dt[:2]).max() < 1e-12 and (start.dt[2] == -40).all()


def test_house_of_stairs_follows_three_arcs_about_a_level_axis():
    x, y, t, position = seen("house_of_stairs")
    expected = np.zeros_like(position)
    weights = ((1 - t) ** 2, 2 * t * (1 - t), t**2)
    for weight, radius, half, reach in zip(weights, (1, 8, 30), (0.8, 5, 16), (50, 80, 88), strict=True):
        angle = np.radians(reach) * y
        expected += weight * np.array([half * x, radius * np.sin(angle), -radius * np.cos(angle)])
    # Cubic patches for arcs: 1e-5 of the largest radius.
    assert np.allclose(position, expected, rtol=0, atol=5e-4)


def test_verticals_converge_at_zenith_and_nadir_in_house_of_stairs():
    """Figure 13 as designed: at x = 2, depth 4, from u = 0.79 at the horizon to 0.23 at v = ±0.875."""
    height = 60 * np.linspace(-1, 1, 301) ** 3
    points = np.array([np.full_like(height, 2.0), height, np.full_like(height, -4.0)])
    shown = preset("house_of_stairs")
    place = find_in_image(shown.projection(shown.aspect), points)
    u, v = 2 * place.x[place.found] - 1, 2 * place.y[place.found] - 1
    assert np.interp(0, v, u) == pytest.approx(0.79, abs=0.01)
    for end in (-0.875, 0.875):
        assert np.interp(end, v, u) == pytest.approx(0.23, abs=0.01)
    upper = v > 0
    assert (np.diff(u[upper]) < 1e-9).all() and (np.diff(u[~upper]) > -1e-9).all()


def test_deep_curvy_volume_goes_through_its_three_patches():
    """Figure 3: 4 × 3 bulging by 1; the same moved by (5, 2) and turned by 30°; 12 × 9, a saddle of ±4."""
    x, y = np.random.default_rng(6).uniform(-1, 1, (2, 300))
    near, middle, far = preset("deep_curvy_volume").volume().controls((x + 1) / 2, (y + 1) / 2).points
    assert np.allclose(near[:2], [2 * x, 1.5 * y], rtol=0, atol=1e-5)
    # The middle four of 4 × 4 Bézier points raised: 16/9 of them is 1 at the centre, 0 along the borders.
    assert np.allclose(near[2], (1 - x**2) * (1 - y**2), rtol=0, atol=1e-5)
    turned = (2 * x + 1.5j * y) * np.exp(1j * np.pi / 6) + 5 + 2j
    assert np.allclose(middle[0] + 1j * middle[1], turned, rtol=0, atol=1e-5)
    assert np.allclose(middle[2], -10, rtol=0, atol=1e-12)
    assert np.allclose(far, [6 * x, 4.5 * y, -25 + 4 * x * y], rtol=0, atol=1e-5)


def occluded(radius, distance):
    """The place that the occlusion camera sees at a radius of its image, in units of the depth.

    Mei, Popescu and Sacks: radii shrink by 0.16 at depth 12 and by a share that is linear in 1/depth from
    nought at 8. Within 0.32 of the pole the shift is eased, or projectors would cross there.
    """
    shift = np.where(radius >= 0.32, 0.16, radius - radius**2 / 0.64)
    share = (1 / 8 - 1 / np.clip(distance, 8, 12)) / (1 / 8 - 1 / 12)
    return radius - shift * share


def test_occlusion_camera_follows_its_distortion_function():
    """At the vertices of its surfaces to the files' rounding, between them to the bend of a cell."""
    shown = preset("occlusion_camera")
    volume = shown.projection(shown.aspect).volume
    for rows, columns, tolerance in ((28, 37, 2e-5), (97, 131, 8e-4)):
        x, y = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, columns), np.linspace(0, 1, rows)))
        image = np.array([(x - 0.5) * 1.2, (y - 0.5) * 0.9])
        radius = np.hypot(*image)
        for t in (0.2, 1 / 3, 0.4, 0.5, 0.6, 2 / 3, 0.9, 1.0):
            px, py, pz = volume.evaluate(x, y, np.full_like(x, t)).position
            ratio = np.array([px, py]) / -pz
            expected = image * np.divide(
                occluded(radius, -pz), radius, out=np.ones_like(radius), where=radius > 0
            )
            away = radius > 0
            assert np.allclose(ratio[:, away], expected[:, away], rtol=0, atol=tolerance)


def test_occlusion_camera_sees_the_sides_that_a_pinhole_misses():
    """The subject's right side, from its front edge to its back: a pinhole sees none of it."""
    shown = preset("occlusion_camera")
    side = shown.subject.size[0] / 2
    depth = np.linspace(-8.3, -11.7, 30)
    points = np.array([np.full_like(depth, side), np.zeros_like(depth), depth])
    place = find_in_image(shown.projection(shown.aspect), points)
    assert place.found.all() and (np.diff(place.x) > 0).all(), "the back edge lies farther out than the front"
    pinhole = points[0] / -points[2]
    assert (np.diff(pinhole) < 0).all()
