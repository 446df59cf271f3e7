# SPDX-License-Identifier: GPL-3.0-or-later
"""Solutions against closed forms, SciPy, and the inverse of the volume."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.aim.solver.banded import GridTerms, Normal, Rows, pairs
from scfpf_addon.aim.solver.control_net import ControlNet
from scfpf_addon.aim.solver.fold_barrier import FoldBarrier
from scfpf_addon.aim.solver.gauss_newton import Aim, solve
from scfpf_addon.aim.solver.problem import AimLines, AimPins, AimProblem, AimStays, AimWeights, FirstHits
from scfpf_addon.aim.solver.start import projection_of, start_volume
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


def problem(pins, degree=3, stays=(), **weights):
    start = start_volume(PERSPECTIVE, WIDTH, (12, 8), degree, subject=10 / 60)
    return AimProblem(start.patches, WIDTH, ASPECT, pins, stays, weights=AimWeights(**weights))


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


def plain(net):
    """Normal equations with H = 1 and random right sides."""
    band = np.zeros((4, net.columns, net.block, net.block))
    band[0] = np.eye(net.block)
    return Normal(net, band, np.random.default_rng(2).normal(size=net.unknowns))


def full(normal):
    """H of normal equations as a whole."""
    columns, block = normal.right.shape
    matrix = np.zeros((columns, block, columns, block))
    for apart in range(4):
        for k in range(columns - apart):
            matrix[k + apart, :, k] = normal.band[apart, k]
            matrix[k, :, k + apart] = normal.band[apart, k].T
    return matrix.reshape(columns * block, columns * block)


def of_places(net):
    """Normal equations of random residuals at 60 places."""
    random = np.random.default_rng(3)
    normal = plain(net)
    places = net.at(random.random(60), random.random(60))
    normal.add(Rows.of(places, random.normal(size=(16 * 6, 2, 60)), random.normal(size=(2, 60))))
    return normal


def test_equations_are_solved_as_by_linalg():
    normal = of_places(ControlNet(7, 5, 3))
    matrix = full(normal)
    expected = np.linalg.solve(matrix + 0.25 * np.diag(matrix.diagonal()), normal.right.reshape(-1))
    np.testing.assert_allclose(normal.solve(0.25), expected, rtol=1e-9, atol=1e-12)


def test_moves_that_cost_are_a_damping_of_their_own():
    net = ControlNet(7, 5, 3)
    normal = of_places(net)
    matrix = full(normal)
    normal.resist(np.array([0.5, 3.0]))
    # Unknowns are ordered by point, surface and component.
    costs = np.tile([0.25] * 3 + [9.0] * 3, net.points)
    expected = np.linalg.solve(matrix + np.diag(costs), normal.right.reshape(-1))
    np.testing.assert_allclose(normal.solve(0.0), expected, rtol=1e-9, atol=1e-12)


def test_residuals_on_a_grid_are_summed_as_rows_are():
    net = ControlNet(7, 5, 3)
    random = np.random.default_rng(4)
    grid = net.grid(np.sort(random.random(9)), np.sort(random.random(6)))
    # Two residuals at each place, along vectors e, with weights w of the surfaces: the near one is fixed.
    w, e, r = random.normal(size=(2, 3, 54)), random.normal(size=(2, 3, 54)), random.normal(size=(2, 54))
    one, other = plain(net), plain(net)
    for weights, vectors, residuals in zip(w, e, r, strict=True):
        rows = grid.places.rows_of(0, weights, vectors)
        one.add(Rows(grid.places.column, grid.places.row, rows, residuals))
    (a, b), (i, j) = pairs(2), pairs(3)
    products = sum((x[1:][a] * x[1:][b])[:, None] * (y[i] * y[j]) for x, y in zip(w, e, strict=True))
    right = sum(x[1:, None] * (y * z) for x, y, z in zip(w, e, r, strict=True))
    other.add_grid(GridTerms(grid, products.reshape(18, 9, 6), right.reshape(6, 9, 6)))
    np.testing.assert_allclose(full(other), full(one), atol=1e-12)
    np.testing.assert_allclose(other.right, one.right, atol=1e-12)


def test_a_grid_has_the_projectors_of_its_places():
    start = start_volume(PERSPECTIVE, WIDTH, (12, 8), 3, subject=0.2)
    net = ControlNet(12, 8, 4)
    points = net.gather(start.patches)
    points = points + np.random.default_rng(6).normal(size=points.shape)
    grid = net.grid(np.linspace(0.0, 1.0, 11), np.linspace(0.0, 1.0, 5))
    np.testing.assert_allclose(grid.controls(points), grid.places.controls(points), atol=1e-9)


def test_the_start_shows_the_same():
    start = start_volume(PERSPECTIVE, WIDTH, (12, 8), 4, subject=0.2)
    assert start.error < 1e-4
    random = np.random.default_rng(1)
    positions = random.random((2, 50))
    x, y = positions
    curve = projection_of(start.patches, ASPECT).volume.evaluate(x, y, np.full(50, 0.6))
    expected = at(positions, -curve.position[2])
    np.testing.assert_allclose(curve.position, expected, atol=1e-6)


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
        # Behind the pins folds are nobody's business, at every event.
        assert aim.pin_folds.t.max() < 0.5
        assert in_image(result, points, moved).max() < 1.0


def test_the_barrier_of_two_parts_is_that_of_each():
    net, random = ControlNet(12, 8, 4), np.random.default_rng(4)
    points = net.gather(problem(AimPins(np.zeros((3, 0)), np.zeros((2, 0)))).patches)
    points = points + random.normal(scale=0.3, size=points.shape)
    grid = FoldBarrier(net.grid(np.linspace(0.0, 1.0, 6), np.linspace(0.0, 1.0, 5)), -1.0)
    some = FoldBarrier(net.at(*random.random((2, 7))), -1.0)
    some.look(random.random(7))
    both = grid.joined(some)
    worst = np.concatenate([grid.worst(points), some.worst(points)])
    assert (worst < 0.0).any() and (worst > 0.0).any()
    np.testing.assert_allclose(both.worst(points), worst, rtol=1e-9, atol=1e-12)
    assert np.isclose(both.value(points, 2.0), grid.value(points, 2.0) + some.value(points, 2.0))


@pytest.mark.parametrize("degree", [2, 3, 4])
@pytest.mark.parametrize("subject", [0.0, 1e-6, 0.03, 0.5, 0.8, 0.97, 1.0])
@pytest.mark.parametrize("far", [0.2, 1.0])
def test_surfaces_of_the_start_are_apart_wherever_the_subject_is(degree, subject, far):
    start = start_volume(PERSPECTIVE, WIDTH, (6, 5), degree, subject=subject * far, far=far)
    assert start.error < 1e-3
    depths = np.array([-patch.points[..., 2].mean() for patch in start.patches])
    assert depths[0] == pytest.approx(0.1) and depths[-1] == pytest.approx(0.1 + 59.9 * far)
    assert (np.diff(depths) > 1e-4 * far).all()
    # Beyond 0.97 of the way the last step of the projector is as long as a tenth of it.
    assert depths[-1] - depths[-2] >= 0.1 * 59.9 * far * (1 - 1e-6)


@pytest.mark.parametrize("subject", [0.75, 0.99])
def test_a_pin_near_the_end_of_the_projectors_is_met(subject):
    positions = np.array([[0.4], [0.55]])
    points = at(np.array([[0.45], [0.5]]), 0.1 + 59.9 * 0.2 * subject)
    start = start_volume(PERSPECTIVE, WIDTH, (12, 8), 3, subject=0.2 * subject, far=0.2)
    result = solve(AimProblem(start.patches, WIDTH, ASPECT, AimPins(points, positions)))
    assert in_image(result, points, positions).max() < 0.05


def test_the_barrier_is_silent_where_the_volume_is_a_point():
    """A perspective whose near surface is its eye: Qu and Qv vanish there."""
    start = start_volume(
        Projection(ViewingVolume((plane(0.0), plane(60.0))), aspect=ASPECT), WIDTH, (6, 5), 3, subject=0.2
    )
    net = ControlNet(6, 5, 4)
    points = net.gather(start.patches)
    grid = net.grid(np.linspace(0.0, 1.0, 5), np.linspace(0.0, 1.0, 4))
    barrier = FoldBarrier(grid, -1.0, np.where(np.arange(20) < 7, 0.0, 0.5))
    assert (barrier.worst(points) > 0.0).all() and barrier.value(points, 1.0) == 0.0
    # Elsewhere a mirrored volume is told.
    other = FoldBarrier(grid, 1.0, np.where(np.arange(20) < 7, 0.0, 0.5))
    rows = other.linearise(points, 1.0)
    assert np.isfinite(rows.coefficients).all() and np.isfinite(rows.residuals).all()
    np.testing.assert_array_equal(other.worst(points) < 0.0, np.arange(20) >= 7)


def test_stays_that_hardly_count_are_none():
    positions = np.array([[0.4], [0.55]])
    points = at(np.array([[0.45], [0.5]]), 10.0)
    x, y = np.linspace(0.1, 0.9, 5), np.linspace(0.1, 0.9, 4)
    grid = at(np.stack([a.ravel() for a in np.meshgrid(x, y, indexing="ij")]), 20.0)
    stays = AimStays(x, y, grid.reshape(3, 5, 4), np.full((5, 4), 0.3), np.full((5, 4), 1e-5))

    class Nothing:
        """A scene in which no projector meets anything."""

        def __call__(self, controls):
            return FirstHits(np.full(controls.shape[2], np.inf), np.zeros(controls.shape[2], bool))

        def may_meet_wanted(self, controls):
            return np.zeros(controls.shape[2], bool)

    result = solve(replace(problem(AimPins(points, positions), stays=(stays,)), first_hits=Nothing()))
    assert in_image(result, points, positions).max() < 0.05


@pytest.mark.parametrize("fault", ["singular", "nowhere better"])
def test_a_way_ends_where_no_step_is_better(monkeypatch, fault):
    """Damping that rises at each attempt leaves steps that move nothing: more of them would be in vain."""
    attempts = []

    def failing(self, damping):
        attempts.append(damping)
        if fault == "singular":
            raise np.linalg.LinAlgError
        return np.full(self.right.size, np.nan)

    monkeypatch.setattr(Normal, "solve", failing)
    # A fold would let the solver go on to its last step.
    monkeypatch.setattr(Aim, "is_folded", True)
    positions = np.array([[0.4], [0.55]])
    result = solve(problem(AimPins(at(np.array([[0.45], [0.5]]), 10.0), positions)))
    assert np.isfinite(result.patches[1].points).all()
    # The ten steps on the way, and the first one at its end, of five attempts each.
    assert result.steps == 11 and len(attempts) == 55
