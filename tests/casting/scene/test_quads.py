# SPDX-License-Identifier: GPL-3.0-or-later
"""Quads in Embree: rays meet the same triangles as in float64 against all of them."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks.scenes import boxes, columns, terrain
from scfpf_addon.casting.scene import embree_meshes
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.casting.scene.quads import Quads

RAYS = 300
# Rays that pass an edge nearer than this share of the triangle, or a second triangle nearer than this
# share of their length, say nothing: Embree works in float32.
NEAR = 1e-4


def mixed(generator, count):
    """Halves of quads that are not flat, with fans, mirrored pairs and single triangles among them."""
    vertices, faces = [], []
    for _ in range(count):
        first = len(vertices)
        middle = generator.uniform(-1.0, 1.0, 3)
        sides = 0.4 * np.linalg.qr(generator.normal(size=(3, 3)))[0]
        corners = generator.integers(3, 7)
        turn = 2.0 * np.pi * np.arange(corners) / corners
        ring = middle + np.outer(np.cos(turn), sides[0]) + np.outer(np.sin(turn), sides[1])
        vertices += list(ring + generator.normal(scale=0.05, size=(corners, 3)))
        fan = [[first, first + k, first + k + 1] for k in range(1, corners - 1)]
        if generator.random() < 0.4:
            fan = [[a, c, b] for a, b, c in fan]
        faces += fan
    return np.array(vertices), np.array(faces, np.int32)


def brute_force(corners, origins, ways):
    """Shares t of the way, and weights of the second and third corners, (T, N) each: Möller, Trumbore.

    corners: (T, 3, 3). origins, ways: (N, 3).
    """
    first, along, across = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    p = np.cross(ways[None], across[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = 1.0 / (along[:, None] * p).sum(axis=2)
        s = origins[None] - first[:, None]
        u = (s * p).sum(axis=2) * inverse
        q = np.cross(s, along[:, None])
        v = (ways[None] * q).sum(axis=2) * inverse
        t = (across[:, None] * q).sum(axis=2) * inverse
    return t, u, v


def compare(vertices, faces, generator, usable=None):
    """The scene's answers for random rays are those of float64, wherever these are beyond doubt."""
    scene = CastScene(vertices, faces)
    if usable is not None:
        scene = scene.only(usable)
    ends = scene.matrix[:3, :3] @ generator.uniform(-1.2, 1.2, (2, 3, RAYS)) + scene.matrix[:3, 3:]
    origins, ways = ends[0].astype(np.float32), (ends[1] - ends[0]).astype(np.float32)
    limits = np.ones(RAYS, np.float32)
    found = scene.mesh.trace(origins, ways, limits)
    assert (limits == 1).all()
    assert found.dtype == np.int32
    corners = scene.vertices.T[faces]
    t, u, v = brute_force(corners, origins.T.astype(float), ways.T.astype(float))
    inside = np.minimum(np.minimum(u, v), 1.0 - u - v)
    if usable is not None:
        inside[~usable] = -1.0
    with np.errstate(invalid="ignore"):
        hit = (inside > -NEAR) & (t > -NEAR) & (t < 1.0 + NEAR)
    t = np.where(hit, t, np.inf)
    order = np.argsort(t, axis=0)
    ray = np.arange(RAYS)
    first, second = t[order[0], ray], t[order[1], ray] if len(t) > 1 else np.inf
    with np.errstate(invalid="ignore"):
        sure = ~np.isfinite(first) | (
            (inside[order[0], ray] > NEAR) & (first > NEAR) & (first < 1.0 - NEAR) & ~(second - first < NEAR)
        )
    expected = np.where(np.isfinite(first), order[0], -1)
    np.testing.assert_array_equal(found[sure], expected[sure])
    seen = np.flatnonzero(sure & (expected >= 0))
    hidden = scene.occluded(origins, ways, np.full(1, 1.0))
    deep = sure & (~np.isfinite(first) | (first < 0.999))
    np.testing.assert_array_equal(hidden[deep], (expected >= 0)[deep])
    return scene, len(seen)


@pytest.mark.parametrize("copied", [False, True])
@given(st.integers(0, 2**32 - 1), st.integers(2, 40))
@settings(deadline=None)
def test_rays_meet_what_float64_finds(copied, seed, count):
    """copied: embreex, which has no quads, copies the triangles."""
    generator = np.random.default_rng(seed)
    with pytest.MonkeyPatch.context() as patch:
        if copied:
            patch.setattr(embree_meshes, "_library", lambda module: None)
        compare(*mixed(generator, count), generator)


@given(st.integers(0, 2**32 - 1))
@settings(deadline=None)
def test_parts_of_them_too(seed):
    generator = np.random.default_rng(seed)
    vertices, faces = mixed(generator, 30)
    usable = generator.random(len(faces)) < 0.8
    usable[0] = True
    compare(vertices, faces, generator, usable)


def test_the_comparison_sees_quads():
    """Enough rays meet something, most of it in pairs."""
    generator = np.random.default_rng(5)
    vertices, faces = mixed(generator, 40)
    scene, seen = compare(vertices, faces, generator)
    assert scene.mesh.quads is not None and seen > RAYS / 3
    assert len(scene.mesh.quads.faces) < 0.7 * len(faces)


@pytest.mark.parametrize("make", [terrain, columns])
@pytest.mark.parametrize("mirrored", [False, True])
def test_faces_of_four_corners_are_one_each(make, mirrored):
    _, triangles = make(2000)
    if mirrored:
        triangles = triangles[:, [0, 2, 1]]
    quads = Quads.of(triangles, np.ones(len(triangles), bool))
    assert quads is not None and 2 * len(quads.faces) == len(triangles)
    assert sorted(quads.numbers[:-2]) == list(range(len(triangles)))


def test_triangles_without_partners_stay_what_they_are():
    _, triangles = boxes(600)
    everything = np.ones(len(triangles), bool)
    assert Quads.of(triangles, everything) is None
    _, triangles = terrain(200)
    assert Quads.of(triangles, np.arange(len(triangles)) % 2 == 0) is None
    assert Quads.of(triangles[:1], everything[:1]) is None
