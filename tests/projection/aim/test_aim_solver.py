# SPDX-License-Identifier: GPL-3.0-or-later
"""Solutions against closed forms, SciPy, and the inverse of the volume."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.projection.aim.banded import Normal, Rows
from scfpf_addon.projection.aim.control_net import Net
from scfpf_addon.projection.aim.problem import AimLines, AimPins, AimProblem, AimStays, AimWeights
from scfpf_addon.projection.aim.solver import Aim, solve, turn_between
from scfpf_addon.projection.aim.start import projection_of, start_volume
from scfpf_addon.projection.surfaces.nurbs import NurbsAxis, NurbsPatch
from scfpf_addon.projection.volume.inverse import follow
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

WIDTH, ASPECT, HALF = 1920, 2.0, np.tan(np.radians(27.5))
LINEAR = NurbsAxis(order=2)


def plane(depth):
    """The plane of a perspective of 55° at a depth."""
    corners = [[[x * HALF * depth, y * HALF / ASPECT * depth, -depth] for x in (-1, 1)] for y in (-1, 1)]
    return NurbsPatch(np.array(corners), LINEAR, LINEAR)


PERSPECTIVE = Projection(ViewingVolume((plane(0.1), plane(60.0))), aspect=ASPECT)


def at(positions, depth):
    """World points at image positions (2, N) of PERSPECTIVE."""
    x, y = positions
    return np.stack([(2 * x - 1) * HALF * depth, (2 * y - 1) * HALF / ASPECT * depth, -depth + 0 * x])


def problem(pins, degree=3, stays=None, **weights):
    start = start_volume(PERSPECTIVE, WIDTH, (12, 8), degree, subject=10 / 60)
    return AimProblem(start.patches, WIDTH, ASPECT, pins, stays or AimStays(), weights=AimWeights(**weights))


def in_image(result, points, positions):
    """Distances in pixels at which the solved volume shows points."""
    place = follow(ViewingVolume(result.patches), points, np.stack([*positions, result.t]))
    assert place.found.all()
    return np.hypot(place.u - positions[0], (place.v - positions[1]) / ASPECT) * WIDTH


@pytest.mark.parametrize("degree", [2, 3, 4])
def test_a_pin_lands_where_it_is_wanted(degree):
    positions = np.array([[0.4], [0.55]])
    points = at(np.array([[0.45], [0.5]]), 10.0)
    result = solve(problem(AimPins(points, positions), degree))
    assert in_image(result, points, positions).max() < 0.05
    np.testing.assert_allclose(result.residuals, in_image(result, points, positions), atol=1e-3)


def test_a_pin_is_seen_from_its_direction():
    positions = np.array([[0.5], [0.5]])
    direction = np.array([[np.sin(0.6)], [0.0], [-np.cos(0.6)]])
    result = solve(problem(AimPins(at(positions, 10.0), positions, direction), direction=200.0))
    tangent = ViewingVolume(result.patches).evaluate(*positions, result.t).dt[:, 0]
    assert np.degrees(np.arccos(tangent @ direction[:, 0] / np.linalg.norm(tangent))) < 0.5
    assert in_image(result, at(positions, 10.0), positions).max() < 0.05


def test_without_a_wish_nothing_moves():
    positions = np.array([[0.3, 0.7], [0.4, 0.6]])
    asked = problem(AimPins(at(positions, np.array([9.0, 12.0])), positions))
    result = solve(asked)
    for old, new in zip(asked.patches, result.patches, strict=True):
        # t along a projector is looked up to some millimetres.
        assert np.abs(old.points - new.points).max() < 0.02


def test_equations_are_solved_as_by_linalg():
    net = Net(7, 5, 3)
    random = np.random.default_rng(3)
    normal = Normal(net, np.eye(net.unknowns), random.normal(size=net.unknowns))
    places = net.at(random.random(60), random.random(60))
    rows = random.normal(size=(60, 2, 16 * 6))
    residuals = random.normal(size=(60, 2))
    normal.add(Rows.of(places, rows, residuals))
    full = normal.matrix.reshape(net.unknowns, net.unknowns)
    expected = np.linalg.solve(full + 0.25 * np.diag(full.diagonal()), normal.right.reshape(-1))
    np.testing.assert_allclose(normal.solve(0.25), expected, rtol=1e-9, atol=1e-12)


def test_the_start_shows_the_same():
    start = start_volume(PERSPECTIVE, WIDTH, (12, 8), 4, subject=0.2)
    assert start.error < 1e-4
    random = np.random.default_rng(1)
    positions = random.random((2, 50))
    x, y = positions
    curve = projection_of(start.patches, ASPECT).volume.evaluate(x, y, np.full(50, 0.6))
    expected = at(positions, -curve.position[2])
    np.testing.assert_allclose(curve.position, expected, atol=1e-6)


def test_turning_follows_great_circles():
    start, end = np.array([[0.0, 0.0, -1.0]]), np.array([[1.0, 0.0, 0.0]])
    half = turn_between(start, end, 0.5)
    np.testing.assert_allclose(half, [[np.sqrt(0.5), 0.0, -np.sqrt(0.5)]], atol=1e-12)
    opposite = turn_between(start, -start, 0.5)
    assert abs(opposite @ start[0]) < 1e-12 and np.isclose(np.linalg.norm(opposite), 1.0)


def test_a_line_between_two_pins_is_straight():
    ends = np.array([[0.25, 0.7], [0.35, 0.6]])
    points = at(ends, np.array([9.0, 14.0]))
    # A pin beside the line pulls the image out of shape.
    third = at(np.array([[0.48], [0.42]]), 10.0)
    pins = AimPins(np.hstack([points, third]), np.hstack([ends, [[0.5], [0.36]]]))
    share = np.linspace(0.1, 0.9, 9)
    between = points[:, :1] * (1 - share) + points[:, 1:] * share
    bends = []
    for lines in (AimLines(), AimLines(np.array([[0], [1]]))):
        result = solve(replace(problem(pins), lines=lines))
        guess = np.stack([*(ends[:, :1] * (1 - share) + ends[:, 1:] * share), 0.4 + 0 * share])
        place = follow(ViewingVolume(result.patches), between, guess)
        across = np.array([-(ends[1, 1] - ends[1, 0]) / ASPECT, ends[0, 1] - ends[0, 0]])
        off = np.stack([place.u - ends[0, 0], (place.v - ends[1, 0]) / ASPECT])
        bends.append(np.abs(across @ off / np.linalg.norm(across)).max() * WIDTH)
    assert bends[0] > 5.0 and bends[1] < 0.5


def test_a_drag_follows_with_one_step_an_event():
    positions = np.array([[0.4, 0.6], [0.45, 0.5]])
    points = at(positions, np.array([10.0, 11.0]))
    aim = Aim(problem(AimPins(points, positions)))
    aim.solve()
    for event in range(1, 8):
        moved = positions + np.array([[10.0 * event / WIDTH, 0.0], [0.0, 0.0]])
        result = aim.drag(AimPins(points, moved))
        assert in_image(result, points, moved).max() < 1.0
