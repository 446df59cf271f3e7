# SPDX-License-Identifier: GPL-3.0-or-later
"""The first seven presets against definitions of their projections that know nothing of viewing volumes."""

from pathlib import Path

import numpy as np
import pytest

from scfpf_addon.projection.presets.preset import load_preset, preset_to_json, read_preset
from scfpf_addon.projection.volume.viewing_volume import determinant, image_derivatives

FOLDER = Path(__file__).resolve().parents[3] / "presets"
NAMES = (
    "angular_fisheye",
    "around_the_car",
    "cylindrical_panorama",
    "inverted_perspective",
    "nonlinear_twist",
    "orthographic",
    "perspective",
)
ASPECTS = (16 / 9, 1.0, 0.5, 3.0)


def preset(name):
    return read_preset(FOLDER / f"{name}.json")


def image_positions(count=400):
    x, y = np.random.default_rng(7).random((2, count))
    return x, y


def points_in_the_image(name, aspect, depths=(0.0, 0.1, 0.5, 0.9, 1.0)):
    """Random image positions and points (3, N) that they show, at several t."""
    projection = preset(name).projection(aspect)
    x, y = image_positions()
    image = projection.parameters(x, y)
    x, y, u, v = (values[image.mask] for values in (x, y, image.u, image.v))
    t = np.resize(depths, len(x))
    return x, y, t, projection.volume.evaluate(u, v, t).position


@pytest.mark.parametrize("name", NAMES)
def test_text_gives_the_preset_back(name):
    before = preset(name)
    after = load_preset(preset_to_json(before))
    for old, new in zip(before.surfaces, after.surfaces, strict=True):
        assert np.allclose(new.matrix, old.matrix, rtol=0, atol=1e-14)
        assert new.parameters == old.parameters
        assert new.points is None or np.array_equal(new.points, old.points)


@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("aspect", ASPECTS)
def test_no_preset_folds_or_mirrors(name, aspect):
    """det[Qx Qy Qt] < 0, formed over the image: a polar map turns the sense of (u, v)."""
    projection = preset(name).projection(aspect)
    grid = (np.arange(60) + 0.5) / 60
    x, y, t = (values.ravel() for values in np.meshgrid(grid, grid, np.linspace(0, 1, 41)))
    image = projection.parameters(x, y)
    sample = projection.volume.evaluate(image.u, image.v, t)
    qx, qy = image_derivatives(sample.du, sample.dv, image.jacobian)
    assert (determinant(sample._replace(du=qx, dv=qy))[image.mask] < 0).all()


@pytest.mark.parametrize("name", sorted(set(NAMES) - {"angular_fisheye"}))
def test_u_goes_right_and_v_up_at_the_image_s_centre(name):
    volume = preset(name).projection(1.0).volume
    sample = volume.evaluate(np.array([0.5]), np.array([0.5]), np.array([0.0]))
    assert sample.du[0, 0] > 0 and abs(sample.du[1, 0]) < 1e-12
    assert sample.dv[1, 0] > 0 and abs(sample.dv[0, 0]) < 1e-12
    assert sample.dt[2, 0] < 0


@pytest.mark.parametrize("aspect", ASPECTS)
def test_perspective_is_the_pinhole_of_a_50_mm_lens(aspect):
    x, y, t, (px, py, pz) = points_in_the_image("perspective", aspect)
    # The file is made for 16:9 and WIDTH, so the vertical field is that of a 36 mm × 20.25 mm sensor.
    half = 20.25 / 2 / 50
    assert np.allclose(x, 0.5 + px / -pz / (2 * half * aspect), rtol=0, atol=1e-12)
    assert np.allclose(y, 0.5 + py / -pz / (2 * half), rtol=0, atol=1e-12)
    assert np.allclose(-pz, 0.1 + t * 99.9, rtol=1e-12)


@pytest.mark.parametrize("aspect", ASPECTS)
def test_orthographic_drops_the_depth(aspect):
    x, y, _, (px, py, _) = points_in_the_image("orthographic", aspect)
    assert np.allclose(px, (x - 0.5) * 9 * aspect, rtol=0, atol=1e-12)
    assert np.allclose(py, (y - 0.5) * 9, rtol=0, atol=1e-12)


@pytest.mark.parametrize("aspect", ASPECTS)
def test_inverted_perspective_is_a_pinhole_behind_the_scene(aspect):
    """Projectors meet at z = -41; seen from there the image is upside down, so x and y keep their sign."""
    x, y, _, (px, py, pz) = points_in_the_image("inverted_perspective", aspect)
    distance = pz + 41
    assert (distance >= 10 - 1e-9).all()
    assert np.allclose((x - 0.5) * 11.25 * aspect / 40, px / distance, rtol=0, atol=1e-12)
    assert np.allclose((y - 0.5) * 11.25 / 40, py / distance, rtol=0, atol=1e-12)


@pytest.mark.parametrize("aspect", ASPECTS)
def test_panorama_is_the_central_cylindrical_projection(aspect):
    """x is the azimuth from -Z to the right, y the tangent of the elevation, equally scaled."""
    x, y, _, (px, py, pz) = points_in_the_image("cylindrical_panorama", aspect)
    azimuth = np.arctan2(px, -pz)
    assert np.allclose(azimuth, (x - 0.5) * 2 * np.pi, rtol=0, atol=1e-12)
    assert np.allclose(py / np.hypot(px, pz), (y - 0.5) * 2 * np.pi / aspect, rtol=0, atol=1e-12)


@pytest.mark.parametrize("aspect", ASPECTS)
def test_fisheye_is_equidistant(aspect):
    """At the angle theta from -Z a direction appears at theta / 90° of the disc, in its own sense."""
    x, y, t, position = points_in_the_image("angular_fisheye", aspect)
    px, py, pz = position
    across, up = (x - 0.5) * 2 * max(aspect, 1), (y - 0.5) * 2 * max(1 / aspect, 1)
    theta = np.arctan2(np.hypot(px, py), -pz)
    assert np.allclose(np.hypot(across, up), theta / (np.pi / 2), rtol=0, atol=1e-12)
    heading, turn = np.exp(1j * np.arctan2(py, px)), np.exp(1j * np.arctan2(up, across))
    assert np.allclose(heading, turn, rtol=0, atol=1e-9)
    assert np.allclose(np.linalg.norm(position, axis=0), 0.1 + t * 99.9, rtol=1e-12)


def test_polar_fisheye_starts_at_the_camera_s_right_and_turns_counter_clockwise():
    volume = preset("angular_fisheye").volume()
    u, v = np.array([0.0, 0.25, 0.5, 0.75, 0.3]), np.array([1.0, 1.0, 1.0, 1.0, 0.0])
    direction = volume.surfaces[1].evaluate(u, v).position / 100
    expected = np.array([[1, 0, 0], [0, 1, 0], [-1, 0, 0], [0, -1, 0], [0, 0, -1]]).T
    assert np.allclose(direction, expected, rtol=0, atol=1e-15)


@pytest.mark.parametrize("aspect", ASPECTS)
def test_twist_turns_the_middle_and_leaves_the_ends(aspect):
    x, y, t, position = points_in_the_image("nonlinear_twist", aspect)
    # A point of the image as a complex number, the middle square turned by 90 degrees.
    start = (x - 0.5) * 4 * aspect + 1j * (y - 0.5) * 4
    turned = start * ((1 - t) ** 2 + t**2 + 2 * t * (1 - t) * 1j)
    assert np.allclose(position[0] + 1j * position[1], turned, rtol=0, atol=1e-12)
    assert np.allclose(position[2], -2 - 20 * t, rtol=1e-12)
    half = (1 + 1j) / 2
    assert np.allclose(turned[t == 0.5], start[t == 0.5] * half) and np.angle(half, deg=True) == 45
    ends = (t == 0) | (t == 1)
    assert ends.any() and np.array_equal(turned[ends], start[ends])


def around_the_car(u, v):
    """The first two control points of the projector at u, v in [-1, 1], car-centred, (2, 3, N)."""
    near = (6 * u, 1.7 + 1.4 * v, np.full_like(u, 10))
    middle = (6 * np.sin(np.pi / 2 * u), 1.6 + 1.2 * v, 9 * np.cos(np.pi * u))
    return np.array([near, middle])


CAR_TO_CAMERA = np.array([0.0, 1.0, 10.0])[:, None]


def test_around_the_car_follows_its_formula():
    volume = preset("around_the_car").projection(3.0).volume
    # At the columns of the middle surface's points the file's rounding is all that differs.
    x, y = (values.ravel() for values in np.meshgrid(np.linspace(0, 1, 97), np.linspace(0, 1, 5)))
    wanted = around_the_car(2 * x - 1, 2 * y - 1) - CAR_TO_CAMERA
    assert np.allclose(volume.controls(x, y).points[:2], wanted, rtol=0, atol=1e-6)
    # Between them the middle surface is straight: at most max|Q1''| h²/8 off.
    x, y = image_positions()
    error = volume.controls(x, y).points[:2] - (around_the_car(2 * x - 1, 2 * y - 1) - CAR_TO_CAMERA)
    bend = 4 * np.hypot(6 * (np.pi / 2) ** 2, 9 * np.pi**2)
    assert np.linalg.norm(error, axis=1)[1].max() < bend / 96**2 / 8
    assert np.abs(error[0]).max() < 1e-12


def test_around_the_car_ends_on_level_ellipses_inside_the_car():
    """Row by row x = 0.3 sin 180°u, y constant, z = m + r cos 180°u; in the car's box or below its floor."""
    points = preset("around_the_car").surfaces[2].points + CAR_TO_CAMERA[:, 0]
    turn = np.linspace(-np.pi, np.pi, points.shape[1])
    middle = (points[:, :1, 2] + points[:, len(turn) // 2, None, 2]) / 2
    reach = points[:, len(turn) // 2, None, 2] - middle
    assert np.allclose(points[..., 0], 0.3 * np.sin(turn), rtol=0, atol=1e-6)
    assert np.ptp(points[..., 1], axis=1).max() == 0 and (np.diff(points[:, 0, 1]) > 0).all()
    assert np.allclose(points[..., 2], middle + reach * np.cos(turn), rtol=0, atol=1e-6)
    assert (np.abs(points) <= [0.9, 1.7, 2.2]).all() and reach.min() > 0


def test_around_the_car_folds_nowhere():
    volume = preset("around_the_car").projection(3.0).volume
    x, y, t = (a.ravel() for a in np.meshgrid(*[(np.arange(n) + 0.37) / n for n in (120, 40, 40)]))
    assert (determinant(volume.evaluate(x, y, t)) < 0).all()


def test_around_the_car_shows_front_sides_and_back():
    """First hits on the car's box: the front to |u| = 0.30, the sides to 0.80, then the back."""
    shown = preset("around_the_car")
    centre, size = np.array(shown.subject.centre), np.array(shown.subject.size)
    x = (np.arange(400) + 0.5) / 400
    t = np.linspace(0, 1, 2001)
    controls = shown.projection(3.0).volume.controls(x, np.full(400, 0.5)).points
    weights = np.array([(1 - t) ** 2, 2 * t * (1 - t), t**2])
    path = np.einsum("kt,kcn->ctn", weights, controls) - centre[:, None, None]
    inside = (np.abs(path) <= size[:, None, None] / 2).all(axis=0)
    assert inside.any(axis=0).all()
    hit = np.take_along_axis(path, inside.argmax(axis=0)[None, None], axis=1)[:, 0]
    depth = hit[2] / (size[2] / 2)
    front, back = depth > 0.99, depth < -0.99
    u = np.abs(2 * x - 1)
    front_end, back_start = u[front].max(), u[back].min()
    assert np.array_equal(front, u <= front_end) and front_end == pytest.approx(0.3, abs=0.02)
    assert np.array_equal(back, u >= back_start) and back_start == pytest.approx(0.8, abs=0.03)
    sides = ~front & ~back
    assert np.allclose(hit[0][sides], np.where(x < 0.5, -0.9, 0.9)[sides], rtol=0, atol=0.02)
