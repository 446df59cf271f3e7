# SPDX-License-Identifier: GPL-3.0-or-later
"""Nothing is met outside the part of a picture that is said to hold all; empty parts are found."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from scfpf_addon.casting.common.hits import CastCounts
from scfpf_addon.casting.image_bounds import STRIPS
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.casting.visible_triangles import FlatRays, see_rows
from scfpf_addon.projection.surfaces.surface import Plane, Point
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume


def placed(place, generator=None, turn=0.0):
    """A frame at a place, turned any way."""
    matrix = np.eye(4)
    if generator is not None:
        matrix[:3, :3] = np.linalg.qr(np.eye(3) + turn * generator.normal(size=(3, 3)))[0]
    matrix[:3, 3] = place
    return matrix


def seen_by(projection, points, faces, count=48):
    """Which of count × count rays meet something, and the window; None for volumes far larger than that."""
    scene = CastScene(points, faces)
    rays = FlatRays.of(projection.transformed(scene.matrix), scene)
    if rays is None:
        return None
    places = np.linspace(0, 1, count)
    triangle = see_rows(scene, rays, places, places, CastCounts(), False).triangle
    return triangle.reshape(count, count) >= 0, rays.window(scene), places


@settings(max_examples=150, deadline=None)
@given(
    st.booleans(), st.sampled_from([0.0, 0.2, 2.0]), st.sampled_from([0.3, 1.0, 3.0]), st.integers(0, 2**32)
)
def test_nothing_is_met_outside_the_window(pinhole, turn, spread, seed):
    """Turned against each other, or crossing, the two planes make any volume of straight rays."""
    generator = np.random.default_rng(seed)
    near = placed(generator.normal((0, 0, 2), 0.3), generator, turn)
    far = placed(generator.normal(0, 0.3, 3), generator, turn)
    sizes = generator.uniform(0.2, 4, 4)
    first = Point(matrix=near) if pinhole else Plane(*sizes[:2], matrix=near)
    projection = Projection(ViewingVolume((first, Plane(*sizes[2:], matrix=far))))
    points = generator.normal(0, 1, 3) + generator.normal(0, spread, (12, 3))
    found = seen_by(projection, points, np.arange(12, dtype=np.int32).reshape(4, 3))
    assume(found is not None)
    hit, window, places = found
    columns, lines = window.held(places, places)
    held = np.zeros_like(hit)
    held[lines, columns] = True
    assert not (hit & ~held).any()


@pytest.mark.parametrize("near", [Point(matrix=placed((0, 0, 1))), Plane(1, 1, matrix=placed((0, 0, 1)))])
def test_the_window_is_close_round_what_is_seen(near):
    """A triangle in the middle of a far plane, a quarter of it wide; and behind that, where it is not met."""
    projection = Projection(ViewingVolume((near, Plane(2, 2, matrix=placed((0, 0, 0))))))
    points = np.array([[-0.25, -0.25, 0.0], [0.25, -0.25, 0], [0, 0.25, 0]])
    faces = np.array([[0, 1, 2]], np.int32)
    _, window, _ = seen_by(projection, points, faces)
    assert np.abs(np.array(window) - [0.375, 0.625, 0.375, 0.625]).max() <= 1.5 / STRIPS
    _, window, places = seen_by(projection, points - np.array([0, 0, 0.5]), faces)
    assert window.left > window.right
    assert window.held(places, places)[0] == slice(0, 0)
