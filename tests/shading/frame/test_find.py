# SPDX-License-Identifier: GPL-3.0-or-later
"""From an object to its place in the image; those of a pinhole and of orthographic images are known."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.shading.picking.find import find, points_of

PIXEL = (1 / 200, 1 / 200)


@pytest.fixture
def scene(build):
    """A small square of half-size ½ about (1, 0) at z = 0, a lid of half-size 1 above it."""
    made = build.scene([build.square(0.5, 0.0, (1.0, 0.0)), build.square(1.0, 1.0, (1.0, 0.5))])
    number = np.repeat([0, 1], 2).astype(np.int32)
    return replace(made, geometry=replace(made.geometry, object_index=number, object_names=("Thing", "Lid")))


def alone(scene, kept):
    """The scene with the triangles ``kept`` only."""
    return replace(scene, geometry=scene.geometry.part(np.isin(scene.geometry.object_index, kept)))


def test_its_vertices_are_those_of_its_faces(scene):
    found = points_of(scene, {"Thing"})
    assert sorted(map(tuple, found.T)) == [(0.5, -0.5, 0), (0.5, 0.5, 0), (1.5, -0.5, 0), (1.5, 0.5, 0)]
    assert points_of(scene, {"Nothing"}).shape == (3, 0)


def test_in_an_orthographic_image_it_is_where_its_coordinates_say(build, scene):
    """An image of 4 × 4 about the origin."""
    camera = build.looking_down(5.0, -1.0, size=4.0)
    found = find(camera, alone(scene, [0]), points_of(scene, {"Thing"}), {"Thing"}, PIXEL)
    assert found.box == pytest.approx((0.625, 0.375, 0.875, 0.625), abs=1e-9)
    assert found.centre == pytest.approx((0.75, 0.5), abs=1e-9)
    assert (found.shown, found.hidden, found.hider) == (1.0, 0.0, "")


def test_what_stands_before_it_hides_it(build, scene):
    """The lid reaches down to y = -½: it covers all of the thing, and the thing covers nothing of the lid."""
    camera = build.looking_down(5.0, -1.0, size=4.0)
    found = find(camera, scene, points_of(scene, {"Thing"}) * [[1], [0.9], [1]], {"Thing"}, PIXEL)
    assert (found.hidden, found.hider) == (1.0, "Lid")
    lid = find(camera, scene, points_of(scene, {"Lid"}), {"Lid"}, PIXEL)
    assert (lid.hidden, lid.hider) == (0.0, "")
    # What is itself the thing hides nothing of it.
    both = find(camera, scene, points_of(scene, {"Thing", "Lid"}), {"Thing", "Lid"}, PIXEL)
    assert (both.hidden, both.hider) == (0.0, "")


def test_of_what_is_partly_outside_the_part_inside_counts(build, scene):
    """An image of 2 × 2 ends at x = 1, amid the object: two of its four corners are in it."""
    camera = build.looking_down(5.0, -1.0, size=2.0)
    found = find(camera, alone(scene, [0]), points_of(scene, {"Thing"}), {"Thing"}, PIXEL)
    assert found.box == pytest.approx((0.75, 0.25, 0.75, 0.75), abs=1e-9)
    assert found.shown == 0.5
    tiny = build.looking_down(5.0, -1.0, size=0.5)
    assert find(tiny, scene, points_of(scene, {"Thing"}), {"Thing"}, PIXEL) is None


def test_where_the_middle_is_outside_the_nearest_point_counts(build, scene):
    camera = build.looking_down(5.0, -1.0, size=1.9)
    found = find(camera, scene, points_of(scene, {"Thing"}), {"Thing"}, PIXEL)
    assert abs(found.centre[0] - (0.5 + 0.5 / 1.9)) < 1e-9 and found.centre[1] in found.box


def test_of_many_points_the_outermost_are_looked_up(build):
    """A ball of 20,000 points: its circle in an orthographic image."""
    ball = build.scene([build.sphere(100)])
    ball = replace(ball, geometry=replace(ball.geometry, object_names=("Ball",)))
    points = points_of(ball, {"Ball"})
    assert points.shape[1] > 19_000
    found = find(build.looking_down(5.0, -5.0, size=4.0), ball, points, {"Ball"}, PIXEL)
    assert found.box == pytest.approx((0.25, 0.25, 0.75, 0.75), abs=5e-3)


def test_a_scene_without_faces_hides_nothing(build, scene):
    empty = alone(scene, [])
    found = find(build.looking_down(5.0, -1.0, size=4.0), empty, np.zeros((3, 1)), {"Empty"}, PIXEL)
    assert found.box == pytest.approx((0.5, 0.5, 0.5, 0.5)) and (found.hidden, found.hider) == (0.0, "")
    unseen = replace(scene, geometry=replace(scene.geometry, visibility=np.zeros(4, np.uint8)))
    found = find(build.looking_down(5.0, -1.0, size=4.0), unseen, np.zeros((3, 1)), {"Empty"}, PIXEL)
    assert (found.hidden, found.hider) == (0.0, "")
