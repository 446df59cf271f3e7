# SPDX-License-Identifier: GPL-3.0-or-later
"""Lines of sight against the closed form of boxes: the slab test."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.aim.aim_scene import AimScene
from scfpf_addon.aim.sight import free_turn, sees
from scfpf_addon.aim.view_map import ViewMap, orbit
from scfpf_addon.casting.scene.cast_scene import CastScene

FACES = ((0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3))


def boxes(*limits):
    """A scene of boxes (low, high), each an object."""
    vertices, triangles, objects = [], [], []
    for number, (low, high) in enumerate(limits):
        corners = np.array([[(low, high)[i][k] for k, i in enumerate(c)] for c in np.ndindex(2, 2, 2)])
        for a, b, c, d in FACES:
            triangles += [[8 * number + i for i in t] for t in ((a, b, c), (a, c, d))]
            objects += [number, number]
        vertices.append(corners)
    return AimScene(
        CastScene(np.concatenate(vertices), np.array(triangles, np.int32)), np.array(objects, np.int32)
    )


def blocked(start, points, low, high):
    """Return whether segments from start to points (3, N) meet a box: the slab test."""
    way = points - start[:, None]
    with np.errstate(divide="ignore"):
        ends = np.stack([(np.array(corner)[:, None] - start[:, None]) / way for corner in (low, high)])
    return np.maximum(ends.min(axis=0).max(axis=0), 0.0) <= np.minimum(ends.max(axis=0).min(axis=0), 1.0)


def looking(place, is_parallel=False):
    """A view from a place along +Y at the origin."""
    eye = np.eye(4)
    eye[:3, :3] = np.stack([[1, 0, 0], [0, 0, 1], [0, -1, 0]], axis=1)
    eye[:3, 3] = place
    return ViewMap(np.linalg.inv(eye), is_parallel, np.zeros(3), 1.0, (0.5, 0.5), 0.3, 0.0, 1.0)


POST = ((-0.3, -4.0, -5.0), (0.3, -3.6, 5.0))
THING = ((-1.0, -1.0, -1.0), (1.0, 1.0, 1.0))


def test_sight_is_the_slab_test():
    scene = boxes(THING, POST)
    points = np.random.default_rng(4).uniform(-1.5, 1.5, (3, 400)) + np.array([[0], [3.0], [0]])
    view = looking((0.2, -9.0, 0.4))
    start = np.array((0.2, -9.0, 0.4))
    for objects, limits in (((1,), (POST,)), ((0, 1), (THING, POST))):
        hiding = scene.triangles_of(np.array(objects))
        wanted = ~np.any([blocked(start, points, *one) for one in limits], axis=0)
        assert (sees(scene, hiding, view, points) == wanted).all()
    assert 0.2 < sees(scene, scene.triangles_of(np.array([1])), view, points).mean() < 0.9


def test_parallel_sight_is_the_slab_test():
    scene = boxes(POST)
    points = np.random.default_rng(5).uniform(-1.0, 1.0, (3, 200))
    seen = sees(scene, np.ones(12, bool), looking((0.0, -9.0, 0.0), True), points)
    assert (seen == (np.abs(points[0]) > 0.3)).all()


@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_the_nearest_free_direction_is_free_and_nearest(side):
    """A post off the middle: the way round it is on the side where less of it is."""
    post = ((side * 0.4 - 1.2, -4.0, -5.0), (side * 0.4 + 1.2, -3.8, 5.0))
    scene, view = boxes(THING, post), looking((0.0, -9.0, 0.0))
    hiding = scene.triangles_of(np.array([1]))
    points = np.random.default_rng(6).uniform(-0.5, 0.5, (3, 30))
    left, up = free_turn(scene, hiding, view, points)
    # The post is to the right of the middle for side 1: the eye goes left.
    assert np.sign(left) == side and abs(up) < abs(left)
    eye = np.linalg.inv(view.to_eye)
    turned = replace(view, to_eye=np.linalg.inv(orbit(eye, np.zeros(3), left, up) @ eye))
    start = np.linalg.inv(turned.to_eye)[:3, 3]
    assert blocked(start, points, *post).mean() <= 0.05
    # A turn to the same side by one ring less is not free.
    less = orbit(eye, np.zeros(3), left * 0.6, up * 0.6) @ eye
    assert blocked(less[:3, 3], points, *post).mean() > 0.05


def test_what_is_seen_needs_no_turn_and_what_is_walled_in_has_none():
    view, points = looking((0.0, -9.0, 0.0)), np.zeros((3, 1))
    scene = boxes(THING, ((5.0, 5.0, 5.0), (6.0, 6.0, 6.0)))
    assert free_turn(scene, scene.triangles_of(np.array([1])), view, points) == (0.0, 0.0)
    assert free_turn(scene, np.ones(24, bool), view, points) is None
