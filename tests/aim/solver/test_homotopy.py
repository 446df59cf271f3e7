# SPDX-License-Identifier: GPL-3.0-or-later
"""The way of pins: rotations against closed forms, and a thing that turns rigidly."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.aim.solver.control_net import ControlNet
from scfpf_addon.aim.solver.homotopy import Homotopy
from scfpf_addon.aim.solver.problem import AimPins
from scfpf_addon.aim.solver.start import start_volume
from scfpf_addon.aim.solver.vectors import rotation, rotation_between, turned_by
from scfpf_addon.aim.view_map import ViewMap
from scfpf_addon.projection.surfaces.nurbs import NurbsAxis, NurbsPatch
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

WIDTH, ASPECT, HALF = 1920, 2.0, np.tan(np.radians(20.0))
UP, SIDE = np.array([0.0, 1.0, 0.0]), np.array([1.0, 0.0, 0.0])
CENTRE = np.array([0.0, 0.0, -10.0])


@pytest.mark.parametrize("degrees", [1e-7, 1.0, 90.0, 179.0, 180.0])
def test_shares_of_a_rotation(degrees):
    axis = np.array([2.0, -1.0, 2.0]) / 3.0
    whole = rotation(axis, np.radians(degrees))
    third = turned_by(whole, 1 / 3)
    np.testing.assert_allclose(third @ third @ third, whole, atol=1e-7)
    np.testing.assert_allclose(third @ third.T, np.eye(3), atol=1e-12)
    assert np.isclose(np.trace(third), 1 + 2 * np.cos(np.radians(degrees / 3)), atol=1e-7)


def test_the_least_rotation_between_directions():
    a, b = np.array([0.6, 0.0, -0.8]), np.array([0.0, 0.28, -0.96])
    found = rotation_between(a, b)
    np.testing.assert_allclose(found @ a, b, atol=1e-12)
    # The least one leaves the vector that is perpendicular to both.
    np.testing.assert_allclose(found @ np.cross(a, b), np.cross(a, b), atol=1e-12)
    np.testing.assert_allclose(rotation_between(a, -a) @ a, -a, atol=1e-12)


@pytest.fixture
def pins():
    """A ball of radius 1 before a camera 10 away, as an eye sees it from 90° to the right and as far."""
    random = np.random.default_rng(8)
    ball = random.normal(size=(3, 20))
    ball /= np.linalg.norm(ball, axis=0)
    # The side that the eye sees.
    points = CENTRE[:, None] + np.where(SIDE @ ball > 0.0, 1.0, -1.0) * ball
    matrix = np.eye(4)
    matrix[:3, :3] = rotation(UP, np.radians(90.0)).T
    matrix[:3, 3] = -matrix[:3, :3] @ (CENTRE + 10.0 * SIDE)
    view = ViewMap(matrix, False, CENTRE, 1.0, (0.5, 0.5), 2.0 / (20.0 * HALF), 0.0, ASPECT)
    across, upward = view.steps(points)
    return AimPins(
        points,
        view.positions(points),
        view.directions(points),
        across=across,
        upward=upward,
        views=np.zeros(20, np.int64),
        pivots=np.repeat(CENTRE[:, None], 20, axis=1),
    )


def way_of(pins, last=None):
    straight = NurbsAxis(order=2)
    planes = tuple(
        NurbsPatch(
            np.array([[[x * HALF * d, y * HALF / ASPECT * d, -d] for x in (-1, 1)] for y in (-1, 1)]),
            straight,
            straight,
        )
        for d in (0.1, 40.0)
    )
    start = start_volume(Projection(ViewingVolume(planes), aspect=ASPECT), WIDTH, (12, 8), 3, 0.25)
    net = ControlNet(12, 8, 4)
    return Homotopy(net.at(*pins.positions), net.gather(start.patches), pins, WIDTH, last)


def test_a_thing_turns_rigidly(pins):
    way = way_of(pins)
    for share in (0.0, 0.3, 0.7, 1.0):
        # As the eye on its way round the thing sees it.
        turn = rotation(UP, np.radians(-90.0 * (1.0 - share)))
        expected = CENTRE[:, None] + turn @ (pins.points - CENTRE[:, None])
        found = way.targets(share)
        # At the old end the points are on projectors of the old camera, as near as a pose can bring them.
        assert np.abs(found.points - expected).max() < 0.1
        assert np.linalg.norm(found.directions - turn @ pins.directions, axis=0).max() < 0.02
        lengths = np.linalg.norm(found.across, axis=0) / np.linalg.norm(pins.across, axis=0)
        assert np.abs(lengths - 1.0).max() < 0.02
    last = way.targets(1.0)
    np.testing.assert_allclose(last.points, pins.points, atol=1e-9)
    np.testing.assert_allclose(last.upward, pins.upward, atol=1e-9)


def test_a_pin_by_itself_turns_on_a_great_circle():
    positions = np.array([[0.5, 0.4], [0.5, 0.5]])
    points = np.stack([(2 * positions[0] - 1) * HALF * 10, 0 * positions[0], np.full(2, -10.0)])
    directions = np.array([[np.sin(0.8), np.nan], [0.0, np.nan], [-np.cos(0.8), np.nan]])
    found = way_of(AimPins(points, positions, directions)).targets(0.5)
    np.testing.assert_allclose(found.directions[:, 0], [np.sin(0.4), 0.0, -np.cos(0.4)], atol=1e-9)
    # Without a direction it keeps that of its projector.
    np.testing.assert_allclose(found.directions[:, 1], points[:, 1] / np.linalg.norm(points[:, 1]), atol=1e-6)


def test_the_way_of_pins_that_moved_a_little_goes_on_from_the_last_one(pins):
    first = way_of(pins)
    moved = replace(pins, positions=pins.positions + np.array([[10.0 / WIDTH], [0.0]]))
    goes_on, anew = way_of(moved, last=first), way_of(moved)
    for share, tolerance in ((0.0, 0.1), (0.5, 0.1), (1.0, 1e-9)):
        found, expected = goes_on.targets(share), anew.targets(share)
        np.testing.assert_allclose(found.points, expected.points, atol=tolerance)
        np.testing.assert_allclose(found.directions, expected.directions, atol=tolerance)
    np.testing.assert_allclose(goes_on.footprint, anew.footprint, rtol=0.02)
    # A thing that is seen from elsewhere turns anew.
    turned = replace(moved, directions=rotation(UP, 0.2) @ pins.directions)
    assert not first.differs_in_positions_only(turned)
    np.testing.assert_array_equal(way_of(turned, last=first).t, way_of(turned).t)
