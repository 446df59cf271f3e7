# SPDX-License-Identifier: GPL-3.0-or-later
"""Distances over whole things and the whole background, against projections in closed form."""

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.aim.cases import ASPECT, HALO, WIDTH, room, setting
from scfpf_addon.aim.survey import background_spread, spread_of
from scfpf_addon.aim.views import sample_view, seen_of
from scfpf_addon.projection.volume.viewing_volume import ViewingVolume


@pytest.fixture(scope="module")
def place():
    return room()


@pytest.fixture(scope="module")
def case(place):
    pins = sample_view(place.scene, place.wanted, place.view(0.0, 0.0))
    return setting(place, pins, HALO * place.sphere[1], net=(6, 5), columns=96, grid=(16, 8))


def in_image(place, points):
    """Image positions (2, N) of world points in the place's own perspective."""
    right, up, ahead = place.frame @ (points - np.array(place.eye)[:, None])
    half = np.tan(np.radians(55.0) / 2)
    return np.stack([0.5 + 0.5 * right / ahead / half, 0.5 + 0.5 * ASPECT * up / ahead / half])


def test_distances_of_a_thing_are_those_of_its_visible_points(place, case):
    points = seen_of(place.scene, place.wanted, place.view(30.0, 10.0)).points
    now = in_image(place, points)
    # The picture is asked to have the thing twice as large, and elsewhere.
    wanted = 0.45 + 2.0 * (now - now.mean(axis=1, keepdims=True))
    found = spread_of(case.judge, place.base, points, wanted)
    # Hidden are those that the straight line from the eye meets after something else.
    ahead = place.scene.hits(place.base, *now, WIDTH).position
    seen = np.linalg.norm(place.scene.world(ahead) - points, axis=0) < 0.01
    assert 0.3 < seen.mean() < 0.9
    pixels = WIDTH * np.hypot(*((now - wanted) / np.array([[1.0], [ASPECT]])))[seen]
    assert found.worst == pytest.approx(pixels.max(), rel=1e-6)
    assert found.nearly_all == pytest.approx(np.percentile(pixels, 95), rel=0.01)
    np.testing.assert_allclose(found.place, now[:, seen][:, pixels.argmax()], atol=1e-9)


def test_what_is_lost_is_marked_where_it_shall_be(place, case):
    points = seen_of(place.scene, place.wanted, place.view(0.0, 0.0)).points[:, ::40].copy()
    wanted = in_image(place, points)
    points[:, 3] = np.array(place.eye) - (0.0, 3.0, 0.0)
    found = spread_of(case.judge, place.base, points, wanted)
    assert found.worst == np.inf and found.nearly_all < 1e-6
    np.testing.assert_array_equal(found.place, wanted[:, 3])
    assert spread_of(case.judge, place.base, points[:, 3:3], wanted[:, 3:3]) is None
    # What shall be outside the image is nobody's business.
    assert spread_of(case.judge, place.base, points, wanted + 1.0) is None


def test_the_background_moves_with_the_image(place, case):
    assert background_spread(case.judge, case.before).worst < 0.01
    planes = []
    for patch in place.base.volume.surfaces:
        corners = patch.points - 0.1 * (patch.points[:, 1:] - patch.points[:, :1])
        planes.append(replace(patch, points=corners))
    found = background_spread(case.judge, replace(place.base, volume=ViewingVolume(tuple(planes))))
    assert found.nearly_all == pytest.approx(0.1 * WIDTH) and found.worst == pytest.approx(0.1 * WIDTH)
