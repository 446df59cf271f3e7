# SPDX-License-Identifier: GPL-3.0-or-later
"""Aim in scenes: views, stays, and a judge that is compared with brute force and closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.aim.cases import WIDTH, figure, random_setting, room, view_setting
from scfpf_addon.aim.aim_scene import HitFinder
from scfpf_addon.aim.solver.gauss_newton import solve
from scfpf_addon.aim.solver.problem import AimPins, SolvePlan
from scfpf_addon.aim.views import sample_view
from scfpf_addon.projection.volume.viewing_volume import ViewingVolume


@pytest.fixture(scope="module")
def place():
    return room()


@pytest.fixture(scope="module")
def solved(place):
    case = view_setting(place, 45.0, 10.0)
    result = solve(case.problem)
    return case, result, case.judged_result(result)


def chords_meet(points, corners):
    """Return whether a triangle (T, 3, 3) is inside a chord between points (N, 3), by Cramer's rule."""
    start, way = points[:-1, None], np.diff(points, axis=0)[:, None]
    a, b, c = corners.swapaxes(0, 1)
    sides = np.broadcast_arrays(way, a - b, a - c)
    determinant = np.linalg.det(np.stack(sides, axis=-1))
    with np.errstate(divide="ignore", invalid="ignore"):
        share, s, t = (
            np.linalg.det(np.stack([*sides[:k], a - start, *sides[k + 1 :]], axis=-1)) / determinant
            for k in range(3)
        )
    met = (share > 1e-6) & (share < 1 - 1e-4) & (s >= 0) & (t >= 0) & (s + t <= 1)
    return bool((met & (np.abs(determinant) >= 1e-12)).any())


def test_a_view_shows_what_its_eye_sees(place):
    view = place.view(45.0, 10.0)
    pins = sample_view(place.scene, place.wanted, view)
    np.testing.assert_allclose(view.positions(pins.points), pins.positions, atol=1e-12)
    own = place.vertices[place.triangles[place.wanted]]
    for point, direction in zip(pins.points.T, pins.directions.T, strict=True):
        eye = point - 20.0 * direction
        assert not chords_meet(np.stack([eye, point]), own)
    # Frames are the derivatives of the view's positions.
    moved = view.positions(pins.points + 1e-4 * pins.across) - pins.positions
    np.testing.assert_allclose(moved, np.array([[1e-4], [0.0]]) + 0 * moved, atol=1e-9)


def test_a_turned_chair_meets_the_bars(solved):
    _, _, found = solved
    assert (found.pixels <= 0.5).mean() >= 0.95 and found.pixels.max() <= 1.5
    assert found.mirrored == 0.0 and found.folded == 0.0 and found.seen.all()
    assert found.background_median <= 2.0 and found.background_most <= 25.0


def test_a_fold_is_mended(solved):
    case, result, _ = solved
    # A control point of an inner surface, drawn over its neighbour before a wall.
    inner = result.patches[2].points.copy()
    inner[5, 2, :3] += 6.0 * (inner[5, 3] - inner[5, 2])[:3]
    patches = (*result.patches[:2], replace(result.patches[2], points=inner), *result.patches[3:])
    folded = replace(result, patches=patches)
    case = replace(case, columns=96)
    assert case.judged_result(folded).folded > 0.01
    mended = case.judged_result(solve(replace(case.problem, solved=folded), schedule=SolvePlan().mending()))
    assert mended.is_clean and mended.pixels.max() <= 1.5


def test_the_judge_agrees_with_chords_of_the_projectors(place, solved):
    case, result, found = solved
    volume = ViewingVolume(result.patches)
    pins = case.problem.pins
    corners = place.vertices[place.triangles]
    t = np.linspace(0.0, 1.0, 60)
    for pin in range(0, pins.count, 4):
        x, y = pins.positions[:, pin]
        curve = volume.evaluate(np.full(60, x), np.full(60, y), t * (result.t[pin] - 2e-3)).position.T
        assert chords_meet(curve, corners) != found.seen[pin]


def test_the_judge_names_what_hides_a_pin(place):
    # A point on the wall behind the picture, which is object 7.
    point = np.array([[0.0], [5.0], [1.75]])
    case = view_setting(place, 0.0, 0.0)
    pins = AimPins(point, np.array([[0.5], [0.6]]))
    problem = replace(case.problem, pins=pins)
    judged = replace(case, problem=problem, halos=np.zeros(1)).judged(case.before)
    assert not judged.seen[0] and judged.hidden_by[0] == 7


def test_the_old_image_is_judged_as_unmoved(solved):
    case, _, found = solved
    old = case.judged(case.before)
    assert old.background_most < 1e-3 and old.mirrored == 0.0 and old.folded == 0.0
    assert found.worse_than(old) == ""
    assert replace(found, pixels=old.pixels + 50.0).worse_than(old) == "PINS"
    assert replace(found, mirrored=0.1).worse_than(old) == "MIRRORED"
    assert replace(found, folded=0.1).worse_than(old) == "FOLDED"


def test_what_a_halo_hides_where_its_view_has_it_does_not_count(place):
    # Everything moves to the right by a tenth of the width; a view has a place of the floor in the middle.
    planes = []
    for patch in place.base.volume.surfaces:
        corners = patch.points - 0.1 * (patch.points[:, 1:] - patch.points[:, :1])
        planes.append(replace(patch, points=corners))
    floor, halo, reach = np.array([[0.0], [0.0], [0.0]]), 1.2, 0.2
    pins = AimPins(floor, np.array([[0.5], [0.4]]), across=np.array([[halo / reach], [0.0], [0.0]]))
    case = replace(view_setting(place, 0.0, 0.0), before=place.base, halos=np.full(1, halo), columns=96)
    found, free = (
        replace(case, problem=replace(case.problem, pins=some)).judged(
            replace(place.base, volume=ViewingVolume(tuple(planes)))
        )
        for some in (pins, replace(pins, across=np.full((3, 1), np.nan)))
    )
    np.testing.assert_allclose(found.moved, 0.1 * WIDTH, atol=1e-6)

    x, y = (part.ravel()[::4] for part in np.meshgrid((np.arange(96) + 0.5) / 96, (np.arange(48) + 0.5) / 48))
    old, new = (place.scene.world(place.scene.hits(place.base, at, y, WIDTH).position) for at in (x, x - 0.1))
    near = np.linalg.norm(new - floor, axis=0) < halo
    near &= np.hypot(x - 0.5, (y - 0.4) / 2.0) < reach
    near &= np.linalg.norm(old - floor, axis=0) >= halo
    assert len(free.moved) - len(found.moved) == near.sum() >= 10


def test_a_mirrored_volume_is_reported(solved):
    case, _, _ = solved
    flipped = tuple(replace(p, points=p.points[:, ::-1]) for p in case.problem.patches)
    after = replace(case.before, volume=ViewingVolume(flipped))
    assert case.judged(after).mirrored == 1.0


def test_first_hits_for_the_solver_are_the_casters(place):
    x, y = np.random.default_rng(5).random((2, 300))
    hits = place.scene.hits(place.base, x, y, WIDTH)
    seen = HitFinder(place.scene, place.wanted)(place.base.projectors(x, y).points)
    np.testing.assert_allclose(seen.t, hits.t, atol=1e-6)
    np.testing.assert_array_equal(seen.wanted, place.wanted[hits.triangle] & (hits.triangle >= 0))


def test_projectors_that_meet_the_thing_pass_it_closely(place):
    random = np.random.default_rng(6)
    controls = place.base.projectors(*random.random((2, 3000))).points
    middle = controls.mean(axis=0) + random.normal(size=controls.shape[1:])
    for each in (controls, np.stack([controls[0], middle, controls[1]])):
        finder = HitFinder(place.scene, place.wanted)
        near, seen = finder.may_meet_wanted(each), finder(each)
        assert near[seen.wanted].all() and seen.wanted.sum() > 50
        assert near.mean() < 0.4
    assert not HitFinder(place.scene, np.zeros_like(place.wanted)).may_meet_wanted(controls).any()


def test_stays_are_weaker_near_the_thing(solved):
    case, _, _ = solved
    (stays,) = case.problem.stays
    listed = stays.weights > 0.0
    points, weights = stays.points[:, listed], stays.weights[listed]
    nearest = np.linalg.norm(points[:, :, None] - case.problem.pins.points[:, None], axis=0).min(axis=1)
    assert (weights[nearest >= case.halos[0]] == 1.0).all()
    assert (weights[nearest < 0.5 * case.halos[0]] < 0.6).all()
    x, y = (a[listed] for a in np.meshgrid(stays.x, stays.y, indexing="ij"))
    hits = case.place.scene.hits(case.before, x, y, WIDTH)
    np.testing.assert_allclose(case.place.scene.world(hits.position), points, atol=1e-9)


def test_random_pins_are_solved_and_never_worse():
    place = figure()
    for seed in range(3):
        # A smaller control net and image than those of the bars, and fewer stays.
        case = random_setting(place, seed, 20.0, 0.03, net=(6, 5), columns=64, grid=(32, 16))
        found = case.judged_result(solve(case.problem))
        assert found.pixels.max() <= 0.5
        assert found.worse_than(case.old) == ""
