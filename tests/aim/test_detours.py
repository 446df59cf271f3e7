# SPDX-License-Identifier: GPL-3.0-or-later
"""Pins that something hides come free where projectors can bend round it, against rays along chords."""

from dataclasses import replace

import numpy as np

from benchmarks.aim.cases import GRID, HALO, NET, Place, figure, room, setting
from benchmarks.hard_scenes import cube
from scfpf_addon.aim.detours import free_pins
from scfpf_addon.aim.rounds import FIRST, FREEING, Round, solve_in_rounds
from scfpf_addon.aim.solver.gauss_newton import solve
from scfpf_addon.aim.solver.problem import AimPins
from scfpf_addon.aim.views import sample_view
from scfpf_addon.projection.volume.inverse import find_in_image

OBSTACLE = 20
# A smaller control net and image than those of the bars, and fewer stays.
SMALL, COLUMNS, STAYS = (8, 6), 64, (32, 16)


def with_box(place: Place, low, high) -> Place:
    """The place and a box, the object OBSTACLE."""
    vertices, triangles = cube(1)
    box = np.array(low) + (vertices + 1) / 2 * np.subtract(high, low)
    return replace(
        place,
        vertices=np.vstack([place.vertices, box]),
        triangles=np.vstack([place.triangles, triangles + len(place.vertices)]),
        objects=np.concatenate([place.objects, np.full(len(triangles), OBSTACLE)]),
    )


def front(place: Place, net=SMALL, grid=STAYS):
    """The figure as the camera sees it."""
    pins = sample_view(place.scene, place.wanted, place.view(0.0, 0.0))
    return setting(place, pins, HALO * place.sphere[1], net=net, columns=COLUMNS, grid=grid)


def first_round(case):
    result = solve(case.problem)
    return Round(result, case.judged_result(result), 1, FIRST)


def met_boxes(case, result):
    """The number of projectors that meet the obstacle before their pins, by the slabs of its box."""
    place = case.place
    box = place.vertices[np.unique(place.triangles[place.objects == OBSTACLE])]
    low, high = box.min(axis=0)[:, None], box.max(axis=0)[:, None]
    volume, t = result.projection(2.0).volume, np.linspace(0.0, 1.0, 401)
    met = 0
    for (x, y), end in zip(case.problem.pins.positions.T, result.t, strict=True):
        points = volume.evaluate(np.full(401, x), np.full(401, y), t * end).position
        start, way = points[:, :-1], np.diff(points)
        with np.errstate(divide="ignore", invalid="ignore"):
            sides = np.sort([(low - start) / way, (high - start) / way], axis=0)
        met += bool((np.maximum(sides[0].max(axis=0), 0) < np.minimum(sides[1].min(axis=0), 1)).any())
    return met


def test_a_figure_behind_a_post_comes_free():
    case = front(with_box(figure(), (0.1, -1.1, 0.0), (0.3, -0.9, 3.0)), net=NET, grid=GRID)
    before = []

    def free(found):
        before.append(found)
        return case.freed(found)

    best = solve_in_rounds(case.problem, case.judged_result, case.old, free=free)
    hidden = int((before[0].judgement.hidden_by == OBSTACLE).sum())
    assert hidden >= 5 and met_boxes(case, before[0].result) == hidden
    # Posts to the left and right of this one leave none of four or seven, and five of nine.
    assert met_boxes(case, best.result) <= hidden // 2
    assert best.judgement.mirrored == 0.0 and best.judgement.pixels.max() < 1.5


def test_nothing_is_released_where_nothing_hides():
    case = front(room())
    first = first_round(case)
    assert first.judgement.hidden == 0.0 and case.freed(first) is None


def test_nothing_is_tried_where_no_way_leads_past():
    case = front(with_box(figure(), (-20.0, -1.1, 0.0), (20.0, -0.9, 20.0)))
    first = first_round(case)
    assert (first.judgement.hidden_by == OBSTACLE).mean() > 0.9
    assert case.freed(first) is None


def test_a_pin_by_itself_comes_free():
    place = with_box(figure(), (0.35, -1.1, 0.0), (0.45, -0.9, 3.0))
    # A column of the scene, behind the middle of the box.
    pin = AimPins(np.array([[0.5], [11.8], [1.0]]), np.zeros((2, 1)))
    pin = replace(pin, positions=place_in_image(place, pin.points))
    case = setting(place, pin, 1.0, net=SMALL, columns=COLUMNS, grid=STAYS)
    first = first_round(case)
    assert first.judgement.hidden_by[0] == OBSTACLE
    problem, released = free_pins(place.scene, case.problem, case.shown, *first[:2])
    assert released.objects.tolist() == [OBSTACLE]
    kept, before = problem.stays[0].weights, case.problem.stays[0].weights
    assert 0 < (before > kept).sum() < 0.1 * before.size
    assert met_boxes(case, first.result) == 1 and met_boxes(case, solve(problem, schedule=FREEING[0])) == 0


def place_in_image(place, points):
    found = find_in_image(place.base, points)
    return np.stack([found.x, found.y])
