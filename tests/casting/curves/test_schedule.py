# SPDX-License-Identifier: GPL-3.0-or-later
"""The chords of a tile: their error in pixels, their number, the part of t that they cover."""

import math

import numpy as np
import pytest

from benchmarks.scenes import bent_projection, boxes, frame_at
from scfpf_addon.casting.cast import cast
from scfpf_addon.casting.common.hits import CastCounts
from scfpf_addon.casting.curves.sampled_curves import sample_curves
from scfpf_addon.casting.curves.schedule import MOST_CHORDS, plan, scene_reach, split
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.surfaces.surface import Disc, Grid, Plane, Point, SphereSector
from scfpf_addon.projection.volume.bezier import chord_count
from scfpf_addon.projection.volume.reparameterisation import Polar
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume, image_derivatives

WIDTH, HEIGHT = 64, 36
SIZE = (1 / WIDTH, 1 / HEIGHT)


def placed(surface, *position):
    matrix = np.eye(4)
    matrix[:3, 3] = position
    return surface.transformed(matrix)


def turned(surface, angle):
    cos, sin = math.cos(angle), math.sin(angle)
    return surface.transformed(np.array([[1, 0, 0, 0], [0, cos, -sin, 0], [0, sin, cos, 0], [0, 0, 0, 1.0]]))


def telescope(near):
    """A volume whose width grows from ``near`` to 1, bent by 40°."""
    turn = math.radians(40)
    middle = np.array([0.0, 0.0, -0.5])
    far = middle + 0.5 * np.array([math.sin(turn), 0, -math.cos(turn)])
    first = Point() if near == 0 else Plane(near, near)
    return Projection(
        ViewingVolume(
            (first, placed(Plane((1 + near) / 2, (1 + near) / 2), *middle), frame_at(far, turn, 1, 1))
        )
    )


VOLUMES = {
    "quadratic": bent_projection(2, math.radians(60)),
    "cubic": bent_projection(3, math.radians(180)),
    "quintic": bent_projection(5, math.radians(180)),
    "telescope": telescope(0.001),
    "point": telescope(0.0),
    "sphere": Projection(
        ViewingVolume((SphereSector(0.1), turned(SphereSector(1.0), 0.3), turned(SphereSector(3.0), 0.9)))
    ),
    "polar": Projection(
        ViewingVolume((Disc(0.1), placed(turned(Disc(1.0), 0.2), 0, 0.5, -3), placed(Disc(4.0), 0, 0, -6))),
        Polar(),
    ),
}


def schedule(projection, pixel_error):
    x, y = pixel_centres(WIDTH, HEIGHT, (0, HEIGHT))
    mask = projection.projectors(x, y).valid
    curves = sample_curves(projection, x, y, mask, SIZE)
    return plan(projection.volume.spans, curves, (0.0, 1.0), pixel_error)


def displacement(projection, chords, count=80):
    """The largest displacement of the chords' points in the image, in pixels, by inverting Q."""
    generator = np.random.default_rng(1)
    worst = 0.0
    pixels = generator.uniform(size=(2, count)) * [[WIDTH], [HEIGHT]]
    x, y = (np.floor(pixels) + 0.5) / [[WIDTH], [HEIGHT]]
    image = projection.parameters(x, y)
    controls = projection.volume.controls(image.u, image.v)
    keep = image.mask & controls.valid
    points = controls.points
    for chord in range(chords.count):
        for share in (0.1, 0.3, 0.5, 0.7, 0.9):
            weights = chords.ends[chord] * (1 - share) + chords.ends[chord + 1] * share
            on_chord = np.einsum("k,kcn->cn", weights, points)
            # The curve's point nearest to it, from the same t on.
            t = np.full(count, chords.breaks[chord] * (1 - share) + chords.breaks[chord + 1] * share)
            for _ in range(3):
                sample = projection.volume.evaluate_controls(controls, t)
                along = ((on_chord - sample.position) * sample.dt).sum(axis=0) / (sample.dt**2).sum(axis=0)
                t = np.clip(t + along, 0, 1)
            sample = projection.volume.evaluate_controls(controls, t)
            dx, dy = image_derivatives(sample.du, sample.dv, image.jacobian)
            jacobian = np.stack([dx * SIZE[0], dy * SIZE[1], sample.dt], axis=1).transpose(2, 0, 1)[keep]
            offset = (on_chord - sample.position).T[keep]
            moved = np.linalg.solve(jacobian, offset[..., None])[:, :2, 0]
            worst = max(worst, float(np.linalg.norm(moved, axis=1).max()))
    return worst


@pytest.mark.parametrize("pixel_error", [1.0, 0.1])
@pytest.mark.parametrize("name", VOLUMES)
def test_chords_displace_the_image_by_no_more_than_the_pixel_error(name, pixel_error):
    chords = schedule(VOLUMES[name], pixel_error)
    assert 0.2 * pixel_error < chords.error <= pixel_error * 1.0001
    # The margins are for projectors between the sampled ones.
    assert displacement(VOLUMES[name], chords) <= pixel_error * 1.1


@pytest.mark.parametrize("name", VOLUMES)
def test_breaks_rise_from_near_to_far_and_ends_start_and_stop_on_the_surfaces(name):
    chords = schedule(VOLUMES[name], 0.1)
    assert (np.diff(chords.breaks) > 0).all()
    assert (chords.breaks[0], chords.breaks[-1]) == (0.0, pytest.approx(1.0))
    count = len(VOLUMES[name].volume.surfaces)
    np.testing.assert_allclose(chords.ends[[0, -1]], np.eye(count)[[0, -1]], atol=1e-12)
    np.testing.assert_allclose(chords.ends.sum(axis=1), 1.0, atol=1e-12)


@pytest.mark.parametrize("name", VOLUMES)
def test_chords_cut_in_six_stray_a_sixteenth(name):
    chords = schedule(VOLUMES[name], 1.0)
    fine = split(VOLUMES[name].volume.spans, chords, 6)
    np.testing.assert_allclose(fine.breaks[::6], chords.breaks, rtol=0, atol=1e-15)
    assert fine.count == 6 * chords.count and fine.error == chords.error / 18
    assert displacement(VOLUMES[name], fine) <= 1.2 / 16


def test_the_number_of_chords_grows_as_the_root_of_the_accuracy():
    counts = [schedule(VOLUMES["cubic"], e).count for e in (1.0, 0.1, 0.01)]
    assert counts[1] / counts[0] == pytest.approx(math.sqrt(10), rel=0.1)
    assert counts[2] / counts[1] == pytest.approx(math.sqrt(10), rel=0.1)


def test_chords_are_graded_where_a_volume_telescopes():
    projection = telescope(0.001)
    graded = schedule(projection, 0.1).count
    points = projection.projectors(*pixel_centres(WIDTH, HEIGHT, (0, HEIGHT))).points
    uniform = chord_count(points, 0.1 * 0.001 / WIDTH).max()
    assert uniform > 200
    assert graded < uniform / 10
    # A point instead of the small near surface would need infinitely many even chords.
    assert schedule(telescope(0.0), 0.1).count < 1.5 * graded


def test_straight_projectors_need_one_chord_however_their_speed_changes():
    for depths in ((0, -1, -10), (0, -9, -10), (0, -1, -2, -20), (0, -5, -10)):
        surfaces = tuple(placed(Plane(1 - 0.1 * z, 1 - 0.1 * z), 0.2 * z, 0, z) for z in depths)
        chords = schedule(Projection(ViewingVolume(surfaces)), 0.1)
        assert chords.count == 1 and chords.error < 1e-9


def test_an_error_of_nothing_ends_at_what_float32_can_tell():
    chords = schedule(bent_projection(2, math.radians(60)), 0.0)
    assert 100 < chords.count <= MOST_CHORDS


def test_sampling_finds_the_corners_and_leaves_out_what_is_masked():
    x, y = pixel_centres(100, 80, (0, 80))
    projection = Projection(ViewingVolume((Plane(), placed(Plane(), 0, 0, -1))))
    curves = sample_curves(projection, x, y, np.ones(len(x), bool), (0.01, 0.0125))
    near = curves.points[0, :2]
    assert near[0].min() == pytest.approx(-0.495) and near[0].max() == pytest.approx(0.495)
    assert near[1].min() == pytest.approx(-0.49375) and near[1].max() == pytest.approx(0.49375)
    assert len(np.unique(near[0].round(9))) > 30 and len(np.unique(near[1].round(9))) > 30
    np.testing.assert_allclose(curves.dx[0, 0], 0.01)
    grid = sample_curves(projection, x, y, np.ones(len(x), bool), (0.01, 0.0125), int(np.sum(y == y[0])))
    for known, searched in zip(grid, curves, strict=True):
        assert {tuple(c) for c in known.reshape(-1, known.shape[2]).T} == {
            tuple(c) for c in searched.reshape(-1, searched.shape[2]).T
        }
    left = sample_curves(projection, x, y, x < 0.3, (0.01, 0.0125))
    assert left.points[0, 0].max() < -0.2


@pytest.mark.parametrize("seed", range(8))
def test_nothing_of_a_projector_inside_the_scene_is_out_of_reach(seed):
    generator = np.random.default_rng(seed)
    scene = CastScene(*boxes(60))
    points = generator.normal(size=(4, 3, 50)) * 0.3 + generator.normal(size=(4, 3, 1)) * 2
    projection = bent_projection(3, 1.0)
    spans = projection.volume.spans
    reach = scene_reach(spans, points, scene)
    t = np.linspace(0, 1, 500)
    places = np.einsum("kt,kcn->tcn", spans.weights(t)[0], points)
    inside = ((places >= scene.lower[:, None]) & (places <= scene.upper[:, None])).all(axis=1).any(axis=1)
    if reach is None:
        assert not inside.any()
    else:
        assert not inside[(t < reach[0]) | (t > reach[1])].any()


def test_volumes_that_pass_the_scene_by_cost_nothing():
    scene = CastScene(*boxes(60))
    counts = CastCounts()
    matrix = np.eye(4)
    matrix[1, 3] = 1000.0
    projection = bent_projection(2, 1.0).transformed(matrix).transformed(scene.matrix)
    hits = cast(scene, projection, *pixel_centres(8, 8, (0, 8)), (1 / 8, 1 / 8), 0.1, counts)
    assert counts.rays == 0 and counts.projectors == 64
    assert (hits.triangle == -1).all() and hits.mask.all()


def half_bent(count=9, aside=4.0):
    """A volume whose left half is straight and whose right half bends, more and more, to the right."""
    u, v = np.meshgrid(np.linspace(-1, 1, 2 * count + 1), np.linspace(-1, 1, 5))
    grids = []
    for k, z in enumerate((0.0, -8.0, -16.0)):
        x = (8 + 2 * k) * u + (aside * np.maximum(u, 0.0) if k == 1 else 0.0)
        grids.append(Grid(np.stack([6 + x, (4 + 2 * k) * v, np.full_like(u, z - 2.0)], axis=-1)))
    return Projection(ViewingVolume(tuple(grids)))


def test_straight_projectors_beside_bent_ones_meet_the_same():
    scene = CastScene(*boxes(3000))
    projection = half_bent().transformed(scene.matrix)
    x, y = pixel_centres(96, 54, (0, 54))
    size = (1 / 96, 1 / 54)
    left = x < 0.5
    counts, whole, right = CastCounts(), CastCounts(), CastCounts()
    alone = cast(scene, projection, x[left], y[left], size, 0.1, counts, 48)
    assert counts.chords <= counts.projectors == left.sum()
    together = cast(scene, projection, x, y, size, 0.1, whole, 96)
    cast(scene, projection, x[~left], y[~left], size, 0.1, right, 48)
    assert right.chords > 2.5 * right.projectors
    # Among many boxes; where more is empty they are fewer.
    assert whole.chords < 1.8 * (counts.chords + right.chords)
    assert whole.error_bound <= 0.1
    assert (together.triangle[left] == alone.triangle).mean() > 0.998


def test_a_volume_that_telescopes_a_thousandfold_needs_a_fifteenth_of_even_chords():
    projection, width = telescope(0.001), 1920
    x, y = pixel_centres(WIDTH, HEIGHT, (0, HEIGHT))
    points, mask = projection.projectors(x, y)
    curves = sample_curves(projection, x, y, mask, (1 / width, 1 / 1080))
    even = int(chord_count(points, 0.1 * 0.001 / width).max())
    assert even == 1518
    assert plan(projection.volume.spans, curves, (0.0, 1.0), 0.1).count <= 105
