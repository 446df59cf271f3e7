# SPDX-License-Identifier: GPL-3.0-or-later
"""Presets under the names that people use for them, against the definitions of these views."""

from pathlib import Path

import numpy as np
import pytest

from scfpf_addon.projection.presets.preset import read_preset
from scfpf_addon.projection.volume.inverse import find_in_image

FOLDER = Path(__file__).resolve().parents[3] / "presets"


def seen(name, count=500, aspect=None):
    """Image positions from -1 to 1, the aspect, and points (3, N) of the near and of the far surface."""
    shown = read_preset(FOLDER / f"{name}.json")
    shown = shown.fitted(aspect or shown.aspect)
    x, y = np.random.default_rng(11).random((2, count))
    projection = shown.projection(shown.aspect)
    image = projection.parameters(x, y)
    ends = [projection.volume.evaluate(image.u, image.v, np.full(count, t)).position for t in (0.0, 1.0)]
    inside = image.mask
    return 2 * x[inside] - 1, 2 * y[inside] - 1, shown.aspect, *(end[:, inside] for end in ends)


def horizontal_angle(direction):
    return np.arctan2(direction[0], -direction[2])


def panini(angle, slope, distance):
    """Image position by Sharpless, Postle and German: angle from straight ahead, slope of the elevation."""
    share = (distance + 1) / (distance + np.cos(angle))
    return share * np.sin(angle), share * slope


@pytest.mark.parametrize("aspect", [None, 1.0])
@pytest.mark.parametrize(
    ("name", "distance", "half", "error"), [("panini", 1.0, 75, 1e-6), ("panini_compressed", 0.5, 65, 1e-4)]
)
def test_panini_is_a_cylinder_seen_from_behind(name, distance, half, error, aspect):
    """error: of the position, in half widths; the compressed one is a spline."""
    x, y, aspect, _, far = seen(name, aspect=aspect)
    slope = far[1] / np.hypot(far[0], far[2])
    across, up = panini(horizontal_angle(far), slope, distance)
    (border, _) = panini(np.radians(half), 0.0, distance)
    assert np.allclose(across / border, x, rtol=0, atol=error)
    assert np.allclose(up / border, y / aspect, rtol=0, atol=error)


@pytest.mark.parametrize("shape", [None, 1.5])
def test_vertical_panini_is_panini_turned(shape):
    x, y, aspect, _, far = seen("panini_vertical", aspect=shape)
    turned = np.array([far[1], far[0], far[2]])
    up, across = panini(horizontal_angle(turned), turned[1] / np.hypot(turned[0], turned[2]), 1.0)
    (border, _) = panini(np.radians(75), 0.0, 1.0)
    assert np.allclose(up / border, y, rtol=0, atol=1e-6)
    assert np.allclose(across / border, x * aspect, rtol=0, atol=1e-6)


@pytest.mark.parametrize(("shape", "height"), [(None, 4.4), (1.0, 4.4), (32 / 9, 2.2)])
def test_tiny_planet_is_stereographic_from_straight_below(shape, height):
    """r = 2 tan(angle / 2), and what is ahead is above the middle; the horizon lies at r = 2."""
    x, y, aspect, _, far = seen("tiny_planet", aspect=shape)
    across, up = height * aspect * x, height * y
    angle = np.arctan2(np.hypot(far[0], far[2]), -far[1])
    assert np.allclose(2 * np.tan(angle / 2), np.hypot(across, up), rtol=1e-6)
    assert np.allclose(np.arctan2(far[0], -far[2]), np.arctan2(across, up), rtol=0, atol=1e-6)


def refracted(ray, normal, ratio):
    """A ray (3, N) that passes a face against its normal; Snell's law, ratio: of the indices."""
    cosine = -(ray * normal).sum(axis=0)
    return ratio * ray + (ratio * cosine - np.sqrt(1 - ratio**2 * (1 - cosine**2))) * normal


def test_crystal_ball_refracts_parallel_rays():
    """Rays along -Z are traced through a unit ball of glass, n = 1.5."""
    x, y, _, _, far = seen("crystal_ball")
    entry = np.array([x, y, np.sqrt(1 - x * x - y * y)])
    inside = refracted(np.array([0.0, 0.0, -1.0])[:, None] + 0 * entry, entry, 1 / 1.5)
    leaving = entry - 2 * (entry * inside).sum(axis=0) * inside
    out = refracted(inside, -leaving, 1.5)
    off = np.linalg.norm(far / np.linalg.norm(far, axis=0) - out, axis=0)
    # At the rim the curve is as steep as no curve through points can be.
    assert off[np.hypot(x, y) < 0.99].max() < 1e-3 and off.max() < 5e-2


def test_fulldome_master_is_equidistant_about_the_zenith():
    """Right stays right, and what is ahead is at the bottom."""
    x, y, _, _, far = seen("fulldome_master")
    angle = np.arctan2(np.hypot(far[0], far[2]), far[1])
    assert np.allclose(angle, np.pi / 2 * np.hypot(x, y), rtol=0, atol=1e-11)
    assert np.allclose(np.exp(1j * np.arctan2(far[0], far[2])), np.exp(1j * np.arctan2(x, y)), atol=1e-9)


def oblique_image(name, point, aspect=16 / 9):
    """Image positions of a point (3,), in the units of space."""
    projection = read_preset(FOLDER / f"{name}.json").projection(aspect)
    found = find_in_image(projection, np.reshape(point, (3, 1)))
    corners = projection.volume.evaluate(projection.u_range, projection.v_range, np.zeros(2)).position
    width, height = np.hypot(*np.diff(corners)[[0, 2], 0]), np.diff(corners)[1, 0]
    assert found.found.all() and width / height == pytest.approx(aspect)
    return np.array([found.x[0] * width, found.y[0] * height])


@pytest.mark.parametrize("aspect", [16 / 9, 1.0, 2.4])
@pytest.mark.parametrize(
    ("name", "right", "up", "away"),
    [
        ("oblique", (1, 0), (0, 1), (np.sqrt(0.125), np.sqrt(0.125))),
        ("cavalier", (1, 0), (0, 1), (np.sqrt(0.5), np.sqrt(0.5))),
        ("three_quarter", (1, 0), (0, 1), (0, 1)),
        ("military", (np.sqrt(0.5), np.sqrt(0.5)), (0, 1), (-np.sqrt(0.5), np.sqrt(0.5))),
    ],
)
def test_oblique_views_draw_the_three_axes_at_their_length(name, right, up, away, aspect):
    """Images of a step to the right, upwards and away."""
    start = np.array([0.3, -0.2, -15.0])
    origin = oblique_image(name, start, aspect)
    steps = {"right": (1, 0, 0), "up": (0, 1, 0), "away": (0, 0, -1)}
    found = {axis: oblique_image(name, start + step, aspect) - origin for axis, step in steps.items()}
    assert np.allclose(found["right"], right, atol=1e-6)
    assert np.allclose(found["up"], up, atol=1e-6)
    assert np.allclose(found["away"], away, atol=1e-6)


@pytest.mark.parametrize("aspect", [16 / 9, 1.0])
def test_curved_world_falls_with_the_squared_distance(aspect):
    """The shader of rolling worlds: a point at the distance d goes down by d² / 120, seen at 60 degrees."""
    projection = read_preset(FOLDER / "curved_world.json").projection(aspect)
    random = np.random.default_rng(5)
    distance = random.uniform(1.1, 59, 300)
    right, up = random.uniform(-0.45, 0.45, (2, 300)) * distance * np.array([[0.5 * aspect], [0.5]])
    lowered = np.array([right, up, -distance])
    points = lowered + np.array([0 * right, distance**2 / 120, 0 * right])
    found = find_in_image(projection, points)
    height = 2 * np.tan(np.radians(30)) * 9 / 16
    assert found.found.all()
    assert np.allclose(found.x, 0.5 + right / distance / (height * aspect), atol=1e-5)
    assert np.allclose(found.y, 0.5 + up / distance / height, atol=1e-5)


def test_inward_sphere_looks_from_each_point_of_a_sphere_to_its_middle():
    """Longitude and latitude of a globe, north at the top and east to the right, seen from without."""
    x, y, aspect, near, far = seen("inward_sphere")
    centre = np.array([0.0, 0.0, -5.0])[:, None]
    longitude, latitude = np.pi * x, np.pi / 2 * y
    expected = np.array(
        [
            np.sin(longitude) * np.cos(latitude),
            np.sin(latitude),
            np.cos(longitude) * np.cos(latitude),
        ]
    )
    assert aspect == 2.0
    assert np.allclose(near - centre, 3 * expected, atol=1e-9) and np.allclose(far, centre, atol=1e-12)


@pytest.mark.parametrize("aspect", [16 / 9, 1.0, 2.4])
def test_dimetric_draws_both_ways_of_the_ground_at_two_to_one(aspect):
    """Uprights stay upright, tiles are twice as wide as high, and nothing shrinks with distance."""
    projection = read_preset(FOLDER / "dimetric.json").projection(aspect)
    steps = {"up": (0, 1, 0), "right": (1, 0, 0), "away": (0, 0, -1)}
    points = np.array([0.3, -0.2, -15.0]) + np.array([(0, 0, 0), *steps.values()])
    places = find_in_image(projection, points.T)
    (left, right), (low, high) = projection.u_range, projection.v_range
    corners = (
        projection.volume.surfaces[0]
        .evaluate(np.array([left, right, left]), np.array([low, low, high]))
        .position
    )
    size = np.linalg.norm(corners[:, 1:] - corners[:, :1], axis=0)
    assert places.found.all() and size[0] / size[1] == pytest.approx(aspect)
    moved = (np.array([places.x, places.y]) * size[:, None]).T
    found = {axis: place - moved[0] for axis, place in zip(steps, moved[1:], strict=True)}
    half = np.sqrt(0.5)
    assert np.allclose(found["right"], (half, -half / 2), atol=1e-5)
    assert np.allclose(found["away"], (half, half / 2), atol=1e-5)
    assert np.allclose(found["up"], (0, np.sqrt(0.75)), atol=1e-5)


def test_military_turns_the_ground_by_45_degrees():
    """Two directions of the ground stay at right angles and of equal length: a plan."""
    start = np.array([0.0, 0.0, -15.0])
    origin = oblique_image("military", start)
    one, other = (oblique_image("military", start + step) - origin for step in ((2, 0, 0), (0, 0, -2)))
    assert one @ other == pytest.approx(0, abs=1e-6)
    assert np.degrees(np.arctan2(one[1], one[0])) == pytest.approx(45, abs=1e-4)


def test_anamorphic_billboard_shows_the_wall_s_points_from_the_camera():
    """Near points lie on the wall at 55 degrees, and each projector continues the line from the eye."""
    x, y, _, near, far = seen("anamorphic_billboard")
    normal = np.array([np.sin(np.radians(55)), 0.0, np.cos(np.radians(55))])
    assert np.allclose(normal @ near, normal @ np.array([0.0, 0.0, -8.0]), rtol=0, atol=1e-12)
    along = np.array([np.cos(np.radians(55)), 0.0, -np.sin(np.radians(55))])
    assert np.allclose(along @ (near.T - np.array([0.0, 0.0, -8.0])).T, 4 * x, rtol=0, atol=1e-12)
    assert np.allclose(near[1], 2.25 * y, rtol=0, atol=1e-12)
    assert np.allclose(far, near * 12.5, rtol=1e-12)


def test_long_pan_is_a_pinhole_for_every_column_that_slides_and_turns():
    shown = read_preset(FOLDER / "long_pan.json")
    volume = shown.projection(shown.aspect).volume
    u = np.linspace(0, 1, 41)
    bottom, top = (
        [volume.evaluate(u, np.full_like(u, v), np.full_like(u, t)).position for t in (0.0, 1.0)]
        for v in (0.0, 1.0)
    )
    # The lines of the lowest and of the highest projector meet in the eye.
    sizes = [top[t][1] - bottom[t][1] for t in (0, 1)]
    eyes = [end[0] - (end[1] - end[0]) * sizes[0] / (sizes[1] - sizes[0]) for end in (bottom, top)]
    assert np.allclose(eyes[0], eyes[1], rtol=0, atol=1e-9)
    assert (np.diff(eyes[0][0]) > 0).all() and eyes[0][0][[0, -1]] == pytest.approx([-5.54, 5.54], abs=1e-3)
    heading = np.degrees(horizontal_angle(top[1] - top[0]))
    assert (np.diff(heading) > 0).all() and heading[[0, 20, -1]] == pytest.approx([-50, 0, 50], abs=1e-4)


# The panorama map: a camera 12 above the land, whose front edge is 15 ahead. Heights count twice. The width
# of the image is 90 at the front edge and 180 at the back, 100 farther.
FRONT, BACK, GROUND, RELIEF, WIDE = 15, 100, 12, 2, 90


def land(points):
    """Positions (3, N) on the land: across, behind the front edge, and twice the height."""
    return np.array([points[0], -points[2] - FRONT, RELIEF * (points[1] + GROUND)])


def pitch(y):
    """The angle of a row below the horizontal: evenly from 60 degrees to 8 upwards. y: from 0 to 1."""
    return np.radians(60 - 68 * y)


@pytest.mark.parametrize("shape", [None, 1.0])
def test_panorama_map_sees_at_one_pitch_per_row_and_in_upright_planes_per_column(shape):
    x, y, aspect, near, far = seen("panorama_map", aspect=shape)
    ends = [land(near), land(far)]
    for end in ends:
        assert np.allclose(end[0], x * WIDE / 2 * aspect / (16 / 9) * (1 + end[1] / BACK), rtol=0, atol=1e-4)
    step = ends[1] - ends[0]
    assert np.allclose(np.arctan2(-step[2], step[1]), pitch((y + 1) / 2), rtol=0, atol=5e-5)


def test_panorama_map_keeps_small_shapes_on_the_land_and_on_the_backdrop():
    """Steps across the rows are as long as in a parallel view at their pitch, of a map and of a backdrop.

    Land: ds sin(pitch) = w(s) dy / aspect, whose integral is a power of tan(pitch / 2). Backdrop, upright at
    the back edge: dh cos(pitch) = w dy / aspect.
    """
    shown = read_preset(FOLDER / "panorama_map.json")
    across = WIDE / (16 / 9) / np.radians(68)
    edge = 2 * np.arctan(np.tan(np.radians(30)) * 0.5 ** (BACK / across))
    y = np.linspace(0, 1, 300)
    angle = pitch(y)
    on_land = angle > edge
    behind = BACK * ((np.tan(np.radians(30)) / np.tan(np.abs(angle) / 2)) ** (across / BACK) - 1)
    height = 2 * across * (np.arcsinh(np.tan(edge)) - np.arcsinh(np.tan(angle)))
    place = np.array([0 * y, np.where(on_land, behind, BACK), np.where(on_land, 0, height)])
    assert 0.6 < on_land.mean() < 0.8 and height[-1] > 20
    points = np.array([place[0], place[2] / RELIEF - GROUND, -place[1] - FRONT])
    found = find_in_image(shown.projection(shown.aspect), points[:, 1:-1])
    assert found.found.all()
    assert np.allclose(found.y, y[1:-1], rtol=0, atol=4e-4) and np.allclose(found.x, 0.5, atol=1e-9)
