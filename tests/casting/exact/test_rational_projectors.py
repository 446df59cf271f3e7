# SPDX-License-Identifier: GPL-3.0-or-later
"""NURBS projectors: circles in closed form, brute force, the chords' error, stationary ends."""

import math
from functools import cache

import numpy as np
import pytest

from benchmarks.scenes import SCENES, bent_projection
from scfpf_addon.casting.cast import cast
from scfpf_addon.casting.common.hits import CastCounts
from scfpf_addon.casting.curves.projector_batch import ProjectorBatch
from scfpf_addon.casting.curves.sampled_curves import sample_curves
from scfpf_addon.casting.curves.schedule import plan, scene_reach
from scfpf_addon.casting.exact.chord_bounds import certain_chords
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.volume.basis import span_basis
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

WIDTH, HEIGHT = 72, 40
# Weights of up to eight surfaces, from mild to as far apart as a camera takes them.
WEIGHTS = {
    "mild": (1.0, 2.0, 0.7, 1.5, 1.0, 0.6, 2.0, 1.0),
    "strong": (1.0, 10.0, 0.1, 3.0, 10.0, 0.2, 1.0, 5.0),
    "steep": (1000.0, 1.0, 0.05, 1.0, 30.0, 1.0, 20.0, 1.0),
    "corner": (0.001, 1000.0, 0.001, 1.0, 1000.0, 0.001, 1.0, 1000.0),
}
CASES = [
    ("boxes", "strong", 2),
    ("columns", "steep", 3),
    ("boxes", "mild", 4),
    ("columns", "strong", 4),
    ("boxes", "steep", 4),
    ("columns", "corner", 5),
    ("boxes", "strong", 7),
    ("columns", "steep", 7),
]


def weighted(name, count, degrees=120):
    curved = bent_projection(count - 1, math.radians(degrees))
    volume = ViewingVolume(curved.volume.surfaces, "NURBS", WEIGHTS[name][:count])
    return Projection(volume, aspect=16 / 9)


@cache
def mesh(scene):
    return SCENES[scene](1000)


@cache
def cast_scene(scene):
    return CastScene(*mesh(scene))


@pytest.fixture(scope="module")
def answers(reference):
    """Brute force of a scene and a volume, made once."""

    @cache
    def answer(scene, name, count):
        x, y = pixel_centres(WIDTH, HEIGHT, (0, HEIGHT))
        return reference.brute_force(*mesh(scene), weighted(name, count), x, y)

    return answer


def wrong(hits, t):
    """Pixels whose t is off by more than 1e-9, or hit where there is a miss."""
    ours, true = (np.where(np.isfinite(a), a, 2.0) for a in (hits.t, t))
    return np.abs(ours - true) > 1e-9


@pytest.mark.parametrize("grid", [True, False])
@pytest.mark.parametrize(("scene", "name", "count"), CASES)
def test_hits_away_from_silhouettes_are_exact(answers, reference, scene, name, count, grid):
    t, triangle = answers(scene, name, count)
    hits = reference.cast_image(cast_scene(scene), weighted(name, count), WIDTH, HEIGHT, 0.1, grid)
    inner = reference.interior(triangle, WIDTH)
    assert min(inner.mean(), np.isfinite(t).mean()) > 0.1
    assert not (wrong(hits, t) & inner).any()
    assert (hits.triangle[inner] == triangle[inner]).all()
    # At silhouettes a tenth of a pixel may decide otherwise, along edges float32 may.
    assert wrong(hits, t).mean() < 0.01


@pytest.mark.parametrize(("scene", "name", "count"), CASES)
def test_pixel_error_0_is_exact(answers, reference, scene, name, count):
    t, _ = answers(scene, name, count)
    counts = CastCounts()
    hits = reference.cast_image(cast_scene(scene), weighted(name, count), WIDTH, HEIGHT, 0.0, counts=counts)
    assert not wrong(hits, t).any() and np.isfinite(t).mean() > 0.3
    assert counts.tested and counts.unresolved == 0


@pytest.mark.parametrize("count", [2, 3, 5, 8])
@pytest.mark.parametrize("name", WEIGHTS)
def test_chords_of_exact_casting_stay_as_near_as_is_certain(name, count):
    points, _ = weighted(name, count).projectors(*np.random.default_rng(1).random((2, 300)))
    spans, epsilon = weighted(name, count).volume.spans, 0.02
    chords, certain = certain_chords(spans, points, np.full(3, -1e3), np.full(3, 1e3), epsilon)
    assert chords.breaks[0] == 0.0 and chords.breaks[-1] == 1.0 and (np.diff(chords.breaks) > 0.0).all()
    farthest = 0.0
    for share in np.linspace(0.0, 1.0, 9):
        t = chords.breaks[:-1] * (1.0 - share) + chords.breaks[1:] * share
        on_chord = chords.ends[:-1] * (1.0 - share) + chords.ends[1:] * share
        apart = np.einsum("gk,kcn->cgn", spans.weights(t)[0].T - on_chord, points)
        farthest = max(farthest, float(np.sqrt((apart**2).sum(axis=0)).max()))
    assert farthest <= certain * (1.0 + 1e-9) <= epsilon * (1.0 + 1e-9)


@pytest.mark.parametrize("name", ["strong", "steep"])
def test_errors_shrink_with_the_pixel_error(answers, reference, name):
    t, triangle = answers("columns", name, 4)
    edges = int((~reference.interior(triangle, WIDTH)).sum())
    wrongs = []
    # Not above: the denominators ask for chords that keep a pixel or two whatever is allowed.
    for error in (1.0, 0.5, 0.25, 0.125, 0.0625, 0.03125):
        hits = reference.cast_image(cast_scene("columns"), weighted(name, 4), WIDTH, HEIGHT, error, False)
        wrongs.append(int(wrong(hits, t).sum()))
        # Of the pixels at edges those within the error of one; a step in the number of chords
        # halves or doubles what is left of the error.
        assert wrongs[-1] <= 0.06 * error * edges + 1
    assert wrongs[0] > 10
    assert sum(wrongs[3:]) < sum(wrongs[:3]) / 5


def hinged(half, distance, size):
    """Planes through one axis, x, at angles 0, half and 2·half: projectors are arcs about it."""
    surfaces = []
    for angle, scale in ((0.0, 1.0), (half, 1 / math.cos(half)), (2 * half, 1.0)):
        out = np.array([0.0, math.sin(angle), -math.cos(angle)]) * scale
        matrix = np.eye(4)
        matrix[:3, 1], matrix[:3, 2], matrix[:3, 3] = out, np.cross([1, 0, 0], out), out * distance
        surfaces.append(Plane(size, size, matrix=matrix))
    return Projection(ViewingVolume(tuple(surfaces), "NURBS", (1.0, math.cos(half), 1.0)))


@pytest.mark.parametrize("degrees", [40, 100, 160])
@pytest.mark.parametrize("columns", [None, 40])
def test_arcs_of_circles_meet_a_plane_where_they_should(degrees, columns):
    half, height = math.radians(degrees) / 2, 0.5
    projection = hinged(half, 2.0, 1.5)
    far = 50.0
    corners = np.array([[-far, height, -far], [far, height, -far], [far, height, far], [-far, height, far]])
    scene = CastScene(corners, np.array([[0, 1, 2], [0, 2, 3]], np.int32))
    x, y = pixel_centres(40, 40, (0, 40))
    moved = projection.transformed(scene.matrix)
    hits = cast(scene, moved, x, y, (1 / 40, 1 / 40), 0.1, columns=columns)
    radius = 2.0 + (y - 0.5) * 1.5
    angle = np.arcsin(height / radius)
    hit = angle < 2 * half
    assert hit.any() and ((hits.triangle >= 0) == hit).all()
    # Farin, §12.7, as in the test of the basis.
    t = 0.5 + 0.5 * np.tan((angle - half) / 2) / math.tan(half / 2)
    np.testing.assert_allclose(hits.t[hit], t[hit], atol=1e-12)
    place = np.stack([(x - 0.5) * 1.5, np.full(len(x), height), -radius * np.cos(angle)])
    cast_place = scene.matrix[:3, :3] @ place + scene.matrix[:3, 3:]
    np.testing.assert_allclose(hits.position[:, hit], cast_place[:, hit], atol=1e-13)
    ahead = np.stack([np.zeros(len(x)), np.cos(angle), np.sin(angle)])
    way = hits.tangent / np.linalg.norm(hits.tangent, axis=0)
    np.testing.assert_allclose(way[:, hit], ahead[:, hit], atol=1e-12)


def chords_of(projection, pixel_error):
    x, y = pixel_centres(WIDTH, HEIGHT, (0, HEIGHT))
    curves = sample_curves(projection, x, y, projection.projectors(x, y).valid, (1 / WIDTH, 1 / HEIGHT))
    return plan(projection.volume.spans, curves, (0.0, 1.0), pixel_error)


def displacements(projection, starts, ends, low, high, count=30):
    """The distances of chords from their curves, in pixels, each against the nearest of many points.

    starts, ends: (n, K) weights of the chords' ends; low, high: (n,) in t.
    """
    generator = np.random.default_rng(1)
    pixels = generator.uniform(size=(2, count)) * [[WIDTH], [HEIGHT]]
    x, y = (np.floor(pixels) + 0.5) / [[WIDTH], [HEIGHT]]
    image = projection.parameters(x, y)
    controls = projection.volume.controls(image.u, image.v)
    jacobian = image.jacobian
    worst = 0.0
    for start, end, first, last in zip(starts, ends, low, high, strict=True):
        t = np.clip(np.linspace(1.5 * first - 0.5 * last, 1.5 * last - 0.5 * first, 1501), 0, 1)
        curve = np.einsum("kt,kcn->ctn", projection.volume.spans.weights(t)[0], controls.points)
        for share in (0.3, 0.5, 0.7):
            point = np.einsum("k,kcn->cn", start * (1 - share) + end * share, controls.points)
            nearest = ((curve - point[:, None]) ** 2).sum(axis=0).argmin(axis=0)
            sample = projection.volume.evaluate_controls(controls, t[nearest])
            (ux, uy), (vx, vy) = jacobian
            dx, dy = sample.du * ux + sample.dv * vx, sample.du * uy + sample.dv * vy
            columns = np.stack([dx / WIDTH, dy / HEIGHT, sample.dt], axis=1).transpose(2, 0, 1)
            moved = np.linalg.solve(columns, (point - sample.position).T[..., None])[:, :2, 0]
            worst = max(worst, float(np.linalg.norm(moved, axis=1).max()))
    return worst


@pytest.mark.parametrize(
    ("name", "count"), [("mild", 4), ("strong", 3), ("steep", 4), ("steep", 7), ("corner", 5)]
)
@pytest.mark.parametrize("pixel_error", [1.5, 0.1])
def test_chords_keep_their_error(name, count, pixel_error):
    projection = weighted(name, count)
    chords = chords_of(projection, pixel_error)
    assert chords.error <= pixel_error * 1.0001
    ends, low, high = chords.ends, chords.breaks[:-1], chords.breaks[1:]
    assert displacements(projection, ends[:-1], ends[1:], low, high) <= pixel_error * 1.1
    weights = projection.volume.spans.weights(chords.breaks)[0].T
    # Unshifted chords stray twice as far.
    assert displacements(projection, weights[:-1], weights[1:], low, high, 8) <= 1.1 * 2 * pixel_error


@pytest.mark.parametrize("name", ["mild", "strong"])
def test_weights_do_not_multiply_the_chords(name):
    plain = Projection(ViewingVolume(weighted(name, 4).volume.surfaces, "NURBS"), aspect=16 / 9)
    assert chords_of(weighted(name, 4), 0.1).count <= 1.3 * chords_of(plain, 0.1).count


@pytest.mark.parametrize("seed", range(12))
def test_nothing_of_a_projector_inside_the_scene_is_out_of_reach(seed):
    generator = np.random.default_rng(seed)
    scene = cast_scene("boxes")
    count = int(generator.integers(2, 8))
    spans = span_basis("NURBS", count, np.exp(generator.uniform(-6, 6, count)))
    points = generator.normal(size=(count, 3, 50)) * 0.3 + generator.normal(size=(count, 3, 1)) * 2
    reach = scene_reach(spans, points, scene)
    t = np.linspace(0, 1, 2000)
    places = np.einsum("kt,kcn->tcn", spans.weights(t)[0], points)
    inside = ((places >= scene.lower[:, None]) & (places <= scene.upper[:, None])).all(axis=1).any(axis=1)
    if reach is None:
        assert not inside.any()
    else:
        assert not inside[(t < reach[0]) | (t > reach[1])].any()


def stationary(kind, points, weights=None):
    """A batch of one projector with these control points (K, 3)."""
    points = np.asarray(points, np.float64)
    return ProjectorBatch(span_basis(kind, len(points), weights), points[:, :, None])


STEPS = np.array(
    [[0, 0, 0], [0, 0, -1], [0.3, 0, -2], [0.2, 0.4, -3], [1, 1, -4], [2, 1, -5.3], [2, 3, -6.1]]
)


@pytest.mark.parametrize(
    ("kind", "weights"),
    [
        ("BEZIER", None),
        ("POLYLINE", None),
        ("B_SPLINE", None),
        ("NURBS", (1.0, 3.0, 0.3, 1.0, 7.0, 0.2, 2.0)),
    ],
)
@pytest.mark.parametrize(("count", "together"), [(4, 2), (4, 3), (6, 2), (6, 4), (6, 5), (7, 3), (7, 5)])
@pytest.mark.parametrize("end", [0.0, 1.0])
def test_coincident_ends_have_the_direction_of_the_way_to_them(kind, weights, together, count, end):
    points = STEPS[:count].copy()
    if end == 1.0:
        points[-together:] = points[-1]
    else:
        points[:together] = points[0]
    batch = stationary(kind, points, weights and weights[:count])
    t = np.array([end])
    tangent = batch.at(t)[1]
    assert not tangent.any()
    batch.steer(t, tangent)
    # The limit of the chord to the end, seen from the last places that differ from it in float64.
    points_there = points - points[-1 if end else 0]
    neighbour = points_there[-together - 1] if end else points_there[together]
    expected = -neighbour if end else neighbour
    cosine = tangent[:, 0] @ expected / np.linalg.norm(tangent) / np.linalg.norm(expected)
    assert cosine == pytest.approx(1.0, abs=1e-9)


def test_rational_counts_are_reported(reference):
    counts = CastCounts()
    hits = reference.cast_image(cast_scene("columns"), weighted("mild", 4), WIDTH, HEIGHT, 0.1, True, counts)
    assert 0.0 < counts.error_bound <= 0.1
    assert counts.projectors == WIDTH * HEIGHT == len(hits.t)
