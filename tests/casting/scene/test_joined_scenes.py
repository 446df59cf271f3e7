# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes joined from parts, of which some triangles are gone, against all triangles in float64."""

import numpy as np
import pytest

from benchmarks.scenes import bent_projection, boxes
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene

SIZE = (32, 20)
DEGREES = {"straight": (1, 0.0), "bent": (2, 1.0)}
# Silhouettes may move by the pixel error, and float32 decides straight ones.
EDGES = 0.03


@pytest.fixture(scope="module")
def parts():
    """A still and a moving scene, without a part of each, and their triangles in world space."""
    vertices, triangles = boxes(400)
    moved = vertices + np.array([0.613, 0.927, -0.471])
    whole = CastScene(vertices, triangles)
    moving = CastScene(moved, triangles, space=whole.space)
    # Two of three, so that neighbours are gone.
    kept, kept_too = np.arange(len(triangles)) % 3 > 0, np.arange(len(triangles)) % 3 < 2
    joined = CastScene.joined([whole.keeping(kept), moving.keeping(kept_too)])
    both = np.concatenate([triangles, triangles + np.int32(len(vertices))])
    return joined, np.concatenate([vertices, moved]), both, np.concatenate([kept, kept_too])


@pytest.mark.parametrize("kind", DEGREES)
@pytest.mark.parametrize("error", [0.1, 0.0])
@pytest.mark.parametrize("half", ["both", "the first", "the second", "some of each"])
def test_joined_scenes_are_hit_where_their_triangles_are(reference, parts, kind, error, half):
    scene, vertices, triangles, shown = parts
    first, each = np.arange(len(triangles)) < len(triangles) // 2, np.arange(len(triangles)) % 5 > 0
    chosen = {"both": shown, "the first": first, "the second": ~first, "some of each": each}[half]
    projection, kept = bent_projection(*DEGREES[kind]), np.flatnonzero(shown & chosen)
    x, y = pixel_centres(*SIZE, (0, SIZE[1]))
    t, triangle = reference.brute_force(vertices, triangles[kept], projection, x, y)
    expected = np.where(triangle < 0, -1, kept[triangle])
    found = reference.cast_image(scene.only(chosen), projection, *SIZE, error)
    other = found.triangle != expected
    assert len(set(expected)) > 20
    assert np.count_nonzero(other) <= (0 if error == 0.0 else EDGES * len(x))
    np.testing.assert_allclose(found.t[~other], t[~other], rtol=1e-6, atol=1e-6)


def test_shadow_rays_meet_all_parts(parts):
    scene, vertices, triangles, shown = parts
    generator = np.random.default_rng(4)
    places = vertices.T[:, generator.integers(0, len(vertices), 300)] + generator.normal(size=(3, 300))
    ways = generator.normal(size=(3, 300)) * 30.0
    # Möller and Trumbore (1997).
    corners = vertices[triangles[shown]]
    along, across = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    off = places.T[None] - corners[:, None, 0]
    normal = np.cross(ways.T[None], across[:, None])
    with np.errstate(divide="ignore", invalid="ignore"):
        volume = np.einsum("tnc,tc->tn", normal, along)
        u, turned = np.einsum("tnc,tnc->tn", off, normal) / volume, np.cross(off, along[:, None])
        v = np.einsum("nc,tnc->tn", ways.T, turned) / volume
        t = np.einsum("tc,tnc->tn", across, turned) / volume
    meets = (u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 0.999)
    origins = (places - scene.centre[:, None]) * scene.scale
    found = scene.occluded(origins, ways * scene.scale, np.ones(300))
    assert 0.1 < meets.any(axis=0).mean() < 0.9
    assert np.count_nonzero(found != meets.any(axis=0)) <= 2


def test_a_part_may_have_nothing_left(parts):
    scene = parts[0]
    count = len(scene.parts[0].usable)
    moving = scene.only(np.arange(2 * count) >= count)
    assert len(moving.usable) == 2 * count and not moving.usable[:count].any()
    assert scene.only(np.zeros(2 * count, bool)) is None
