# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes whose triangles are cut at a box, against all triangles in float64."""

import numpy as np
import pytest

from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.casting.scene.clipped_triangles import clipped

LOWER, UPPER = np.array([-0.5, -0.3, -0.4]), np.array([0.4, 0.6, 0.5])


def area(corners):
    edges = corners[1:] - corners[0]
    return 0.5 * np.linalg.norm(np.cross(edges[0], edges[1], axis=0), axis=0)


def test_pieces_have_the_area_in_the_box():
    triangles = np.array(
        [
            [[-1, -1, 0.2], [3, -1, 0.2], [-1, 3, 0.2]],  # covers the box
            [[0, 0, 0], [0.3, 0, 0], [0, 0.3, 0]],  # is inside
            [[2, 2, 2], [3, 2, 2], [2, 3, 2]],  # is outside
            [[0, 0, 0], [1, 0, 0], [0, 0.4, 0]],  # its tip is outside: a trapezium of 0.4 and 0.24 is left
        ],
        float,
    )
    pieces, owner = clipped(triangles.transpose(1, 2, 0), LOWER, UPPER)
    areas = np.bincount(owner, area(pieces), 4)
    np.testing.assert_allclose(areas, [0.9 * 0.9, 0.045, 0.0, 0.4 * (0.4 + 0.24) / 2], atol=1e-12)
    assert (pieces >= LOWER[:, None]).all() and (pieces <= UPPER[:, None]).all()


def meetings(corners, start, way):
    """The shares (T, N) of segments (N, 3) at which they meet triangles (T, 3, 3); inf for misses."""
    first, along, across = corners[:, 0], corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    normal = np.cross(way[None], across[:, None])
    volume = np.einsum("tnc,tc->tn", normal, along)
    off = start[None] - first[:, None]
    u = np.einsum("tnc,tnc->tn", off, normal) / volume
    turned = np.cross(off, along[:, None])
    v = np.einsum("nc,tnc->tn", way, turned) / volume
    t = np.einsum("tc,tnc->tn", across, turned) / volume
    return np.where((u >= 0) & (v >= 0) & (u + v <= 1) & (t >= 0) & (t <= 1), t, np.inf)


@pytest.mark.parametrize("seed", range(3))
def test_first_hits_in_a_box(seed):
    generator = np.random.default_rng(seed)
    corners = (generator.uniform(-0.7, 0.7, (60, 1, 3)) + generator.normal(size=(60, 3, 3)) * 0.3).reshape(
        -1, 3
    )
    scene = CastScene(corners, np.arange(180, dtype=np.int32).reshape(-1, 3))
    kept = generator.random(60) < 0.8
    part = scene.enclosed(kept, LOWER, UPPER)
    start, end = generator.normal(size=(2, 2000, 3))
    found = part.mesh.trace(
        start.T.astype(np.float32), (end - start).T.astype(np.float32), np.ones(2000, np.float32)
    )
    t = meetings(scene.vertices.T[scene.triangles], start, end - start)
    with np.errstate(invalid="ignore"):
        place = start + t[..., None] * (end - start)
    off = np.maximum(LOWER - place, place - UPPER).max(axis=2)
    there = np.where(kept[:, None] & (off <= 0.0), t, np.inf)
    # Rays that meet something where the box ends are decided by roundings.
    clear = ~(np.isfinite(t) & (np.abs(off) < 1e-4)).any(axis=0)
    expected = np.where(np.isfinite(there).any(axis=0), there.argmin(axis=0), -1)
    assert clear.mean() > 0.9 and (expected >= 0).mean() > 0.1
    np.testing.assert_array_equal(found[clear], expected[clear])


def test_no_ray_passes_between_pieces_with_a_common_edge():
    generator = np.random.default_rng(0)
    side = 12
    across, up = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side))
    points = np.stack([across, up, 0.1 * generator.normal(size=across.shape)], axis=-1).reshape(-1, 3)
    number = np.arange(side * side).reshape(side, side)
    a, b, c, d = (
        each.ravel() for each in (number[:-1, :-1], number[:-1, 1:], number[1:, 1:], number[1:, :-1])
    )
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([a, c, d], axis=1)]).astype(np.int32)
    scene = CastScene(points, triangles)
    part = scene.enclosed(
        np.ones(len(triangles), bool), np.array([-0.61, -0.52, -1.0]), np.array([0.57, 0.66, 1.0])
    )
    # Rays through places on edges, from above.
    edge = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    share = generator.random((40, len(edge), 1))
    ends = scene.vertices.T[edge]
    place = (ends[:, 0] + share * (ends[:, 1] - ends[:, 0])).reshape(-1, 3).T
    inside = (np.abs(place[0] + 0.02) < 0.58) & (np.abs(place[1] - 0.07) < 0.58)
    place = place[:, inside].astype(np.float32)
    down = np.broadcast_to(np.array([[0.0], [0.0], [-4.0]], np.float32), place.shape)
    start = place + np.array([[0.0], [0.0], [2.0]], np.float32)
    assert place.shape[1] > 5000
    assert (part.mesh.trace(start, down, np.ones(place.shape[1], np.float32)) >= 0).all()
