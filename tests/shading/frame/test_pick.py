# SPDX-License-Identifier: GPL-3.0-or-later
"""From a pixel to its projector and what that meets, against closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.projection.surfaces.surface import Disc, Plane
from scfpf_addon.projection.volume.reparameterisation import Polar
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume
from scfpf_addon.shading.picking.pick import pick

PIXEL = (1 / 100, 1 / 100)


def named(scene, numbers, names):
    return replace(
        scene,
        geometry=replace(scene.geometry, object_index=np.array(numbers, np.int32), object_names=names),
    )


@pytest.fixture
def scene(build):
    """A square of half-size 1 at z = 0 named "Left" and "Right", its two triangles."""
    return named(build.scene([build.square(1.0)]), [0, 1], ("Left", "Right"))


def projection(build, *places):
    """2 × 2 planes at places (x, z)."""
    planes = tuple(Plane(2.0, 2.0, matrix=build.placed((x, 0, z))) for x, z in places)
    return Projection(ViewingVolume(planes))


@pytest.mark.parametrize("x, y", [(0.5, 0.4), (0.1, 0.8), (0.85, 0.15)])
def test_a_straight_projector_and_its_hit(build, scene, x, y):
    found = pick(projection(build, (0, 3), (0, -1)), scene, x, y, PIXEL)
    assert found.t == pytest.approx(0.75, abs=1e-12) and found.distance == pytest.approx(3, abs=1e-9)
    assert np.allclose(found.position, (2 * x - 1, 2 * y - 1, 0), atol=1e-9)
    assert np.allclose(found.curve[[0, -1]], [(2 * x - 1, 2 * y - 1, 3), (2 * x - 1, 2 * y - 1, -1)])


def test_the_hit_object_is_named(build, scene):
    straight = projection(build, (0, 3), (0, -1))
    names = {pick(straight, scene, x, y, PIXEL).object_name for x, y in ((0.9, 0.1), (0.1, 0.9))}
    assert names == {"Left", "Right"}


def test_a_curved_projector_and_its_length(build, scene):
    """x = 8t(1-t)·¼, z = 3 - 4t: at z = 0, t = ¾; the length is an integral of √(16 + (2-4t)²)."""
    found = pick(projection(build, (0, 3), (1, 1), (0, -1)), scene, 0.4, 0.5, PIXEL)
    assert found.t == pytest.approx(0.75, abs=1e-9)
    assert found.position[0] == pytest.approx(-0.2 + 2 * 0.75 * 0.25, abs=1e-8)
    t = (np.arange(200000) + 0.5) / 200000 * 0.75
    assert found.distance == pytest.approx(0.75 * np.hypot(4, 2 - 4 * t).mean(), rel=1e-6)


def test_a_miss_has_its_curve_only(build, scene):
    past = pick(projection(build, (5, 3), (5, -1)), scene, 0.5, 0.5, PIXEL)
    assert past.t is None and past.object_name == "" and past.distance == 0 and len(past.curve) > 2
    empty = replace(scene, geometry=replace(scene.geometry, triangles=np.zeros((0, 3), np.int32)))
    assert pick(projection(build, (0, 3), (0, -1)), empty, 0.5, 0.5, PIXEL).t is None


def test_where_the_image_shows_nothing_there_is_no_projector(build, scene):
    discs = tuple(Disc(0.5, matrix=build.placed((0, 0, z))) for z in (1, -1))
    fisheye = Projection(ViewingVolume(discs), Polar())
    assert pick(fisheye, scene, 0.02, 0.02, PIXEL) is None
    assert pick(fisheye, scene, 0.5, 0.6, PIXEL).t == pytest.approx(0.5)


def test_far_from_the_origin(build, scene):
    away = np.array([1e6, -2e6, 3e6])
    geometry = replace(scene.geometry, vertices=scene.geometry.vertices + away)
    matrix = np.eye(4)
    matrix[:3, 3] = away
    moved = projection(build, (0, 3), (1, 1), (0, -1)).transformed(matrix)
    found = pick(moved, replace(scene, geometry=geometry), 0.4, 0.5, PIXEL)
    assert found.t == pytest.approx(0.75, abs=1e-8)
