# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets that are general linear cameras: three rays, their affine combinations, the type that these make.

A ray is (s, t, σ, τ): it meets the plane at depth λ in (s + λσ, t + λτ). Three rays meet that plane in a
triangle whose doubled area is Aλ² + Bλ + C. Its roots, and whether the triangle is a point or a line there,
tell the camera's type (Yu and McMillan, General Linear Cameras, ECCV 2004, section 3 and table 2).
"""

from pathlib import Path

import numpy as np
import pytest

from scfpf_addon.projection.presets.preset import read_preset

FOLDER = Path(__file__).resolve().parents[3] / "presets"
TYPES = {
    "perspective": "pinhole",
    "telephoto": "pinhole",
    "off_centre": "pinhole",
    "inverted_perspective": "pinhole",
    "orthographic": "orthographic",
    "oblique": "orthographic",
    "pushbroom": "pushbroom",
    "cross_slit": "cross-slit",
    "irregular_perspective": "cross-slit",
    "twisted_orthographic": "twisted orthographic",
    "pencil": "pencil",
    "bilinear": "bilinear",
    "linear_twist": "bilinear",
    "epi": "epi",
}
# Of the largest value that a coefficient could have: the files' six decimals.
ROUNDING = 1e-5


def preset(name):
    return read_preset(FOLDER / f"{name}.json")


def rays(volume, u, v):
    """(4, N): place on the plane through the camera and slope against depth, from two points of each."""
    near, far = (volume.evaluate(u, v, np.full(len(u), t)).position for t in (0.25, 0.75))
    slope = (far[:2] - near[:2]) / (near[2] - far[2])
    return np.concatenate([near[:2] + slope * near[2], slope])


def corner_rays(name):
    return rays(preset(name).volume(), np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]))


def doubled_area(a, b):
    return np.linalg.det(np.stack([a, b, np.ones(3)]))


def spread(a, b):
    return max(np.ptp(a), np.ptp(b))


def camera_type(three):
    """The type by the characteristic equation of three rays (4, 3), lengths in units of their own spread."""
    s, t, across, up = three
    if spread(s, t) < ROUNDING:
        # The plane lies where all rays meet: the type is the same from another one.
        s, t = s + across, t + up
    unit, slope = spread(s, t), spread(across, up)
    depth = unit / slope if slope > ROUNDING else 1.0
    s, t, across, up = s / unit, t / unit, across * depth / unit, up * depth / unit
    a, c = doubled_area(across, up), doubled_area(s, t)
    b = doubled_area(s, up) + doubled_area(across, t)
    size = max(abs(a), abs(b), abs(c))
    if size < ROUNDING:
        return "epi"
    if abs(a) < ROUNDING * size:
        if abs(b) > ROUNDING * size:
            return "pushbroom"
        return "orthographic" if spread(across, up) < ROUNDING else "twisted orthographic"
    discriminant = b * b - 4 * a * c
    if abs(discriminant) < ROUNDING * size**2:
        root = -b / (2 * a)
        left = spread(s + root * across, t + root * up)
        return "pinhole" if left < np.sqrt(ROUNDING) else "pencil"
    return "cross-slit" if discriminant > 0 else "bilinear"


@pytest.mark.parametrize(
    ("three", "expected"),
    [
        ([[0, 0, 0], [0, 0, 0], [0, 1, 0], [0, 0, 1]], "pinhole"),
        ([[0, 1, 0], [0, 0, 1], [0.2, 0.2, 0.2], [0, 0, 0]], "orthographic"),
        ([[0, 1, 0], [0, 0, 0], [0, 0, 0], [0, 0, 1]], "pushbroom"),
        ([[0, 0, 0], [0, 0, 1], [0, 1, 0], [0, 0, 1]], "cross-slit"),
        ([[0, 1, 0], [0, 0, 1], [0, 0, 1], [0, 0, 0]], "twisted orthographic"),
        ([[0, 0, 1], [0, 0, 0], [0, 1, 0], [0, 0, 1]], "pencil"),
        ([[0, 0, 1], [0, -1, 0], [0, 1, 0], [0, 0, 1]], "bilinear"),
        ([[0, 1, 0], [0, 0, 0], [0, 0, 1], [0, 0, 0]], "epi"),
    ],
)
def test_the_type_test_tells_textbook_cameras(three, expected):
    assert camera_type(np.array(three, float)) == expected


@pytest.mark.parametrize(("name", "expected"), TYPES.items())
def test_three_rays_make_a_camera_of_its_type(name, expected):
    assert camera_type(corner_rays(name)) == expected


def test_all_eight_types_are_there():
    assert len(set(TYPES.values())) == 8


@pytest.mark.parametrize("name", TYPES)
def test_every_projector_is_an_affine_combination_of_three(name):
    u, v = np.random.default_rng(3).random((2, 300))
    shown = preset(name)
    for aspect in (shown.aspect, 0.8):
        volume = shown.projection(aspect).volume
        three = rays(volume, np.array([0.0, 1.0, 0.0]), np.array([0.0, 0.0, 1.0]))
        combined = three @ np.array([1 - u - v, u, v])
        size = np.abs(three).max()
        assert np.allclose(rays(volume, u, v), combined, rtol=0, atol=1e-12 * max(size, 1.0))


def seen(name, count=400):
    """Image positions and the points that they show at random depths."""
    shown = preset(name)
    x, y, t = np.random.default_rng(11).random((3, count))
    return 2 * x - 1, 2 * y - 1, shown.projection(shown.aspect).volume.evaluate(x, y, t).position


def test_pushbroom_is_parallel_along_and_central_across_its_way():
    """Gupta and Hartley: x = X / speed, y = f Y / Z."""
    x, y, (px, py, pz) = seen("pushbroom")
    assert np.allclose(x, px / 8, rtol=0, atol=1e-12)
    assert np.allclose(y, py / -pz / 0.225, rtol=0, atol=1e-12)


def test_crossed_slits_are_two_depths_for_two_axes():
    """Zomet and others: x = fx X / (Z + 12), y = fy Y / Z; every projector meets both slits."""
    x, y, (px, py, pz) = seen("cross_slit")
    assert np.allclose(x, px / (12 - pz) / (16 / 9 * 5 / 32), rtol=0, atol=1e-6)
    assert np.allclose(y, py / -pz / 0.25, rtol=0, atol=1e-12)
    s, t, across, _ = rays(preset("cross_slit").volume(), (x + 1) / 2, (y + 1) / 2)
    assert np.abs(t).max() < 1e-12, "the level slit lies at the camera"
    assert np.abs(s - 12 * across).max() < 1e-5, "the upright slit lies 12 behind it"


def test_twisted_orthographic_shears_with_depth():
    x, y, (px, py, pz) = seen("twisted_orthographic")
    assert np.allclose(py, 4.5 * y, rtol=0, atol=1e-12)
    assert np.allclose(px, 8 * x + y * 3 * (-pz - 20) / 20, rtol=0, atol=1e-12)


def test_pencil_is_a_perspective_whose_centre_is_a_level_line():
    x, y, (px, py, pz) = seen("pencil")
    assert np.allclose(py, 0.25 * y * -pz, rtol=0, atol=1e-12)
    assert np.allclose(px, 4 / 9 * x * -pz + 0.2 * y * (-pz - 12), rtol=0, atol=1e-5)
    s, t, _, _ = rays(preset("pencil").volume(), (x + 1) / 2, (y + 1) / 2)
    assert np.abs(t).max() < 1e-12 and np.ptp(s) > 1


def test_bilinear_turns_as_it_grows():
    """As complex numbers: depth + ½ i (depth - 12), times the place in the image."""
    x, y, (px, py, pz) = seen("bilinear")
    expected = (4 / 9 * x + 0.25j * y) * (-pz + 0.5j * (-pz - 12))
    assert np.allclose(px + 1j * py, expected, rtol=0, atol=1e-5)


def test_epi_is_direction_across_and_place_upwards():
    x, y, (px, py, pz) = seen("epi")
    assert not py.any()
    assert np.allclose(px, 6 * y + 0.5 * x * -pz, rtol=0, atol=1e-12)


def test_oblique_is_a_cabinet_drawing():
    """A line into depth appears at 45 degrees and half its length; the sheet lies at half the depth."""
    x, y, (px, py, pz) = seen("oblique")
    half_depth = (-pz - 15) / 2 * np.exp(0.25j * np.pi)
    assert np.allclose(8 * x + 4.5j * y, px + 1j * py + half_depth, rtol=0, atol=1e-5)


@pytest.mark.parametrize(
    ("name", "half_width", "half_height", "rise"),
    [("telephoto", 18 / 300, 10.125 / 300, 0), ("off_centre", 0.72, 0.405, 0.3)],
)
def test_shifted_and_narrow_pinholes(name, half_width, half_height, rise):
    x, y, (px, py, pz) = seen(name)
    assert np.allclose(x, px / -pz / half_width, rtol=0, atol=1e-12)
    assert np.allclose(y, (py / -pz - rise) / half_height, rtol=0, atol=1e-11)


def test_irregular_perspective_spreads_less_across_than_upwards():
    """Figure 5: edges at 32 degrees instead of the 63 of a pinhole with the same height."""
    x, y, (px, py, pz) = seen("irregular_perspective")
    assert np.allclose(y, py / -pz, rtol=0, atol=1e-12)
    assert np.allclose(x, px / (12 + (-pz - 1) * 12 / 19), rtol=0, atol=1e-12)
    assert np.degrees(np.arctan(12 / 19)) == pytest.approx(32, abs=0.5)
    assert np.degrees(np.arctan(2)) == pytest.approx(63, abs=0.5)


def test_round_columns_stay_slim_in_irregular_perspective():
    """At the border 1.18 times as wide as in the middle, in a pinhole 2.24 times."""
    aside = 12 / 19
    assert np.hypot(1, aside) == pytest.approx(1.18, abs=0.01) and np.hypot(1, 2) == pytest.approx(
        2.24, abs=0.01
    )
    volume = preset("irregular_perspective").volume()
    x = np.linspace(0, 1, 200_001)
    origin, ahead = (volume.controls(x, np.full_like(x, 0.5)).points[i][[0, 2]] for i in (0, 1))
    along = ahead - origin
    widths = []
    for centre in (0.0, 12 + 9 * aside - 1.5):
        to_centre = np.array([centre, -10.0])[:, None] - origin
        distance = np.abs(along[0] * to_centre[1] - along[1] * to_centre[0]) / np.hypot(*along)
        widths.append((distance < 1).mean())
    assert 1.1 < widths[1] / widths[0] < 1.2


def test_linear_twist_turns_by_90_degrees_on_straight_projectors():
    """Figure 7, left: depth alone turns the image, from 0 to 90 degrees, and half-way by 45."""
    x, y, (px, py, pz) = seen("linear_twist")
    t = (-pz - 2) / 20
    assert np.allclose(px + 1j * py, 2 * (x + 1j * y) * (1 - t + 1j * t), rtol=0, atol=1e-12)
