# SPDX-License-Identifier: GPL-3.0-or-later
"""Casting against brute force in float64: straight, curved and polyline projectors."""

import math
from functools import cache

import numpy as np
import pytest

from benchmarks.scenes import SCENES, bent_projection
from scfpf_addon.casting.common.hits import CastCounts
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.volume.basis import SpanBasis
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

WIDTH, HEIGHT = 96, 54


class SplineVolume(ViewingVolume):
    """Four surfaces joined by a quadratic B-spline: two curved spans."""

    @property
    def spans(self):
        return SpanBasis(
            np.array([0.0, 0.5, 1.0]),
            np.array(
                [
                    [[0.5, 0.5, 0, 0], [0, 1, 0, 0], [0, 0.5, 0.5, 0]],
                    [[0, 0.5, 0.5, 0], [0, 0, 1, 0], [0, 0, 0.5, 0.5]],
                ]
            ),
        )


def volume(name):
    if name == "polyline":
        curved = bent_projection(3, math.radians(120))
        return Projection(ViewingVolume(curved.volume.surfaces, "POLYLINE"), aspect=16 / 9)
    if name == "spline":
        curved = bent_projection(3, math.radians(120))
        return Projection(SplineVolume(curved.volume.surfaces), aspect=16 / 9)
    degree, angle = {"straight": (1, 0), "quadratic": (2, 60), "cubic": (3, 180), "quintic": (5, 180)}[name]
    return bent_projection(degree, math.radians(angle))


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
    def answer(scene, name):
        x, y = pixel_centres(WIDTH, HEIGHT, (0, HEIGHT))
        return reference.brute_force(*mesh(scene), volume(name), x, y)

    return answer


def wrong(hits, t):
    """Pixels whose t is off by more than 1e-9, or hit where there is a miss."""
    ours, true = (np.where(np.isfinite(a), a, 2.0) for a in (hits.t, t))
    return np.abs(ours - true) > 1e-9


@pytest.mark.parametrize("grid", [True, False])
@pytest.mark.parametrize("name", ["straight", "quadratic", "cubic", "quintic", "polyline", "spline"])
@pytest.mark.parametrize("scene", SCENES)
def test_hits_away_from_silhouettes_are_exact(answers, reference, scene, name, grid):
    t, triangle = answers(scene, name)
    hits = reference.cast_image(cast_scene(scene), volume(name), WIDTH, HEIGHT, 0.1, grid)
    inner = reference.interior(triangle, WIDTH)
    assert min(inner.mean(), np.isfinite(t).mean()) > 0.1
    assert not (wrong(hits, t) & inner).any()
    assert (hits.triangle[inner] == triangle[inner]).all()
    # At silhouettes a tenth of a pixel may decide otherwise, along edges float32 may.
    assert wrong(hits, t).mean() < 0.01


@pytest.mark.parametrize("scene", ["columns", "boxes"])
def test_errors_shrink_with_the_pixel_error(answers, reference, scene):
    t, _ = answers(scene, "quadratic")
    shares = [
        wrong(reference.cast_image(cast_scene(scene), volume("quadratic"), WIDTH, HEIGHT, e, False), t).sum()
        for e in (8.0, 1.0, 0.125)
    ]
    assert shares[0] > 100
    assert shares[1] < shares[0] / 4 and shares[2] < shares[1] / 4 + 2


@pytest.mark.parametrize("scene", ["columns", "boxes"])
def test_rows_of_pixels_see_what_loose_ones_see(reference, scene):
    """Blocks of neighbours save rays through empty space and change nothing else."""
    plain, rows = CastCounts(), CastCounts()
    loose, grid = (
        reference.cast_image(cast_scene(scene), volume("quadratic"), WIDTH, HEIGHT, 0.1, kind, c)
        for kind, c in ((False, plain), (True, rows))
    )
    # Empty space decides where chords begin, and each kind keeps the pixel error in its own way.
    assert wrong(grid, loose.t).mean() < 0.005
    assert rows.chords <= plain.chords


@pytest.mark.parametrize("name", ["straight", "cubic", "polyline"])
def test_a_hit_is_where_it_says(reference, name):
    scene, projection = cast_scene("columns"), volume(name)
    hits = reference.cast_image(scene, projection, WIDTH, HEIGHT)
    hit = hits.triangle >= 0
    corners = scene.vertices[:, scene.triangles[hits.triangle[hit]].T]
    b, c = hits.barycentric[:, hit]
    on_triangle = corners[:, 0] * (1 - b - c) + corners[:, 1] * b + corners[:, 2] * c
    np.testing.assert_allclose(on_triangle, hits.position[:, hit], atol=1e-7)
    x, y = pixel_centres(WIDTH, HEIGHT, (0, HEIGHT))
    inside = projection.transformed(scene.matrix)
    image = inside.parameters(x, y)
    t = np.where(hit, hits.t, 1.0)
    sample = inside.volume.evaluate(image.u, image.v, t)
    np.testing.assert_allclose(hits.position, sample.position, atol=1e-12)
    np.testing.assert_allclose(hits.tangent, sample.dt, atol=1e-11)
    assert hits.mask.all() and (hits.barycentric[:, ~hit] == 0).all() and np.isinf(hits.t[~hit]).all()
    assert hits.t.dtype == hits.position.dtype == hits.barycentric.dtype == np.float64
    assert hits.triangle.dtype == np.int32


@pytest.mark.parametrize("name", ["quadratic", "cubic"])
@pytest.mark.parametrize("scene", SCENES)
def test_nothing_is_passed_when_the_pixel_error_is_small(reference, scene, name):
    """In a tiny image things are thinner than a pixel."""
    width, height = 36, 20
    x, y = pixel_centres(width, height, (0, height))
    t, _ = reference.brute_force(*mesh(scene), volume(name), x, y)
    hits = reference.cast_image(cast_scene(scene), volume(name), width, height, 0.001, True)
    # Of 720 pixels one may lie within a hundredth of a silhouette.
    assert wrong(hits, t).sum() <= 1
