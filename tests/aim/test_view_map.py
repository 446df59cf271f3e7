# SPDX-License-Identifier: GPL-3.0-or-later
"""Views against a pinhole camera, whose image is known in closed form."""

import numpy as np
import pytest

from scfpf_addon.aim.view_map import ViewMap, local_eye, orbit
from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

ASPECT = 16 / 9


def at_depth(depth):
    matrix = np.eye(4)
    matrix[2, 3] = -depth
    return matrix


def rigid(seed):
    random = np.random.default_rng(seed)
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    matrix = np.eye(4)
    matrix[:3, :3] = turn * np.sign(np.linalg.det(turn))
    matrix[:3, 3] = random.normal(size=3) * 5
    return matrix


def pinhole(place):
    """A camera at ``place`` that sees a width of 1 at distance 1."""
    planes = [Plane(matrix=place @ at_depth(d), width=d, height=d / ASPECT) for d in (0.5, 40.0)]
    return Projection(ViewingVolume(tuple(planes)), aspect=ASPECT)


def image_of(place, points):
    """The image positions of points through that camera, by similar triangles."""
    own = (np.linalg.inv(place) @ np.concatenate([points, np.ones((1, points.shape[1]))]))[:3]
    return np.stack([own[0] / -own[2] + 0.5, own[1] / -own[2] * ASPECT + 0.5])


def point_at(place, x, y, depth):
    own = np.array([(x - 0.5) * depth, (y - 0.5) / ASPECT * depth, -depth, 1.0])
    return (place @ own)[:3]


@pytest.mark.parametrize("seed", range(4))
def test_the_local_eye_of_a_pinhole_camera_is_that_camera(seed):
    place = rigid(seed)
    x, y, t = 0.3, 0.8, 0.2
    eye = local_eye(pinhole(place), x, y, t)
    assert not eye.is_parallel
    assert np.abs(eye.matrix - place).max() < 1e-6
    assert eye.image_width == pytest.approx(0.5 + t * 39.5)


def test_a_view_from_the_local_eye_is_the_image_as_it_is():
    place = rigid(9)
    centre = point_at(place, 0.7, 0.4, 8.0)
    points = centre[:, None] + np.random.default_rng(1).normal(size=(3, 50)) * 0.5
    eye = local_eye(pinhole(place), 0.7, 0.4, 7.5 / 39.5)
    view = ViewMap(
        np.linalg.inv(eye.matrix), False, centre, 1.5, (0.7, 0.4), 3.0 / eye.image_width, 0.0, ASPECT
    )
    assert np.abs(view.positions(points) - image_of(place, points)).max() < 1e-9


def test_parallel_projectors_have_a_parallel_eye():
    place = rigid(3)
    planes = [Plane(matrix=place @ at_depth(d), width=4.0, height=4.0 / ASPECT) for d in (0.5, 40.0)]
    eye = local_eye(Projection(ViewingVolume(tuple(planes)), aspect=ASPECT), 0.5, 0.5, 0.5)
    assert eye.is_parallel and eye.image_width == pytest.approx(4.0)
    assert np.abs(eye.matrix[:3, :3] - place[:3, :3]).max() < 1e-9


@pytest.mark.parametrize("is_parallel", [False, True])
def test_directions_and_steps_are_derivatives_of_positions(is_parallel):
    place = rigid(5)
    view = ViewMap(
        np.linalg.inv(place), is_parallel, point_at(place, 0.6, 0.3, 6.0), 1.0, (0.2, 0.9), 0.4, 0.7, ASPECT
    )
    points = point_at(place, 0.6, 0.3, 6.0)[:, None] + np.random.default_rng(2).normal(size=(3, 20))
    sight, steps = view.directions(points), view.steps(points)
    small = 1e-6
    along = (view.positions(points + small * sight) - view.positions(points)) / small
    assert np.abs(along).max() < 1e-7
    for axis, step in enumerate(steps):
        moved = (view.positions(points + small * step) - view.positions(points)) / small
        assert np.abs(moved - np.eye(2)[:, [axis]]).max() < 1e-4
        assert np.abs(np.einsum("cn,cn->n", step, sight)).max() < 1e-9


def test_points_behind_the_eye_have_no_position():
    view = ViewMap(np.eye(4), False, np.array([0.0, 0.0, -5.0]), 1.0, (0.5, 0.5), 0.2, 0.0, 1.0)
    assert np.isnan(view.positions(np.array([[0.0], [0.0], [2.0]]))).all()
    assert view.is_visible


@pytest.mark.parametrize("seed", range(3))
def test_an_orbit_goes_left_and_up_as_the_eye_sees_it(seed):
    place = rigid(seed)
    centre = point_at(place, 0.5, 0.5, 4.0)
    for left, up, axis in ((1e-4, 0.0, 0), (0.0, 1e-4, 1)):
        moved = orbit(place, centre, left, up) @ place
        step = (np.linalg.inv(place) @ moved[:, 3])[:3] / 1e-4
        assert np.linalg.norm(moved[:3, 3] - centre) == pytest.approx(4.0)
        assert step[axis] * (-1.0, 1.0)[axis] > 0.0
    # Up is along the eye's own up axis by the angle itself.
    assert step == pytest.approx([0.0, 4.0, 0.0], abs=1e-3)
    # Left goes round the vertical.
    assert (orbit(place, centre, 0.7, 0.0) @ place)[2, 3] == pytest.approx(place[2, 3])
