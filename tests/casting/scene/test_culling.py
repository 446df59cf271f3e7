# SPDX-License-Identifier: GPL-3.0-or-later
"""Triangles that a volume cannot meet are not built; none that it can meet is left out."""

import math

import numpy as np
import pytest

from benchmarks.extremes import random_projection
from benchmarks.scenes import bent_projection, boxes, joined
from scfpf_addon.casting.frame import cast_frame
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.casting.scene.culling import within_volume
from scfpf_addon.projection.surfaces.nurbs import NurbsPatch
from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.surfaces.uv_mesh import UVMesh
from scfpf_addon.projection.volume.lattice import Lattice
from scfpf_addon.projection.volume.viewing_volume import ViewingVolume


def points_in(volume, count, seed):
    """Points Q(u, v, t) all over a volume, its borders among them, (count, 3)."""
    generator = np.random.default_rng(seed)
    u, v, t = np.clip(generator.uniform(-0.2, 1.2, (3, count)), 0.0, 1.0)
    return volume.evaluate(u, v, t).position.T


def dust_at(points):
    """A speck of a triangle at each point."""
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]]) * 1e-9
    vertices = (points[:, None] + corners).reshape(-1, 3)
    return vertices, np.arange(len(vertices), dtype=np.int32).reshape(-1, 3)


@pytest.mark.parametrize("seed", range(60))
def test_nothing_in_a_volume_is_left_out(seed):
    volume = random_projection(np.random.default_rng(seed)).volume
    assert within_volume(*dust_at(points_in(volume, 400, seed)), volume).all()


@pytest.mark.parametrize("kind", ["LINEAR", "CARDINAL", "CATMULL_ROM", "BSPLINE"])
def test_nothing_in_other_kinds_is_left_out(kind):
    generator = np.random.default_rng(5)
    moved = generator.normal(size=(3, 4, 5, 3))
    lattice = Lattice(np.full(3, -0.5), np.full(3, 0.5), moved, (kind, kind, kind))
    patch = NurbsPatch(np.abs(generator.normal(size=(5, 6, 4))) + 0.1)
    far = np.eye(4)
    far[:3, 3] = 3.0, 1.0, -9.0
    for volume in (
        lattice.volume(far),
        ViewingVolume((patch, patch.transformed(far))),
        ViewingVolume((Plane(), patch, UVMesh(matrix=far)), "NURBS", (1.0, 5.0, 0.1)),
    ):
        points = points_in(volume, 2000, 1)
        assert within_volume(*dust_at(points[np.isfinite(points).all(axis=1)]), volume).all()


def test_a_scene_of_which_a_tenth_is_within_builds_a_tenth():
    projection = bent_projection(2, math.radians(60))
    near, triangles = boxes(2000)
    inside = within_volume(near, triangles, projection.volume)
    far = [(near + np.array([0.0, 300.0 * k, 0.0]), triangles) for k in range(1, 10)]
    vertices, all_triangles = joined([(near, triangles), *far])
    kept = within_volume(vertices, all_triangles, projection.volume)
    assert (kept[: len(triangles)] == inside).all() and not kept[len(triangles) :].any()
    assert 0.02 < kept.mean() < 0.1


@pytest.mark.parametrize(("degree", "angle"), [(1, 0), (2, 60), (3, 180)])
def test_what_is_seen_is_the_same(degree, angle):
    projection = bent_projection(degree, math.radians(angle))
    vertices, triangles = boxes(4000)
    kept = np.flatnonzero(within_volume(vertices, triangles, projection.volume))
    assert len(kept) < 0.9 * len(triangles)
    whole = cast_frame(CastScene(vertices, triangles), projection, 96, 54, 0.0)
    part = cast_frame(CastScene(vertices, triangles[kept]), projection, 96, 54, 0.0)
    hit = whole.triangle >= 0
    assert (hit == (part.triangle >= 0)).all() and hit.mean() > 0.3
    np.testing.assert_allclose(part.t[hit], whole.t[hit], atol=1e-11)


@pytest.mark.parametrize("count", [60, 30000])
def test_a_volume_or_vertices_that_are_not_finite_leave_nothing_out(count):
    vertices, triangles = boxes(count)
    matrix = np.eye(4)
    matrix[0, 3] = np.inf
    assert within_volume(vertices, triangles, ViewingVolume((Plane(), Plane(matrix=matrix)))).all()
    vertices[0] = np.nan
    aside = np.eye(4)
    aside[:3, 3] = 1e4
    volume = ViewingVolume((Plane(matrix=aside), Plane(matrix=aside)))
    assert (within_volume(vertices, triangles, volume) == (triangles == 0).any(axis=1)).all()


def test_of_many_triangles_none_in_a_straight_volume_is_left_out():
    """There are so many triangles that a sample chooses the planes."""
    volume = bent_projection(1, 0.0).volume
    inside = points_in(volume, 20000, 3)
    generator = np.random.default_rng(4)
    low, high = inside.min(axis=0), inside.max(axis=0)
    about = generator.uniform(low - (high - low), high + (high - low), (60000, 3))
    order = generator.permutation(80000)
    kept = within_volume(*dust_at(np.concatenate([inside, about])[order]), volume)
    is_inside = order < 20000
    assert kept[is_inside].all()
    # The volume fills less than one part in 27 of the space about it.
    assert kept[~is_inside].mean() < 0.05
