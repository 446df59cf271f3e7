# SPDX-License-Identifier: GPL-3.0-or-later
"""The part of an image in which projectors can meet some points, against the formula of a pinhole camera."""

from dataclasses import replace

import numpy as np
import pytest

from scfpf_addon.casting.layers.image_bounds import ImageBounds
from scfpf_addon.projection.mappings.stack import Stack
from scfpf_addon.projection.surfaces.surface import Plane, Point
from scfpf_addon.projection.volume.reparameterisation import Framed, Polar, Unrolled
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

FRAME = Framed((0.4, 0.6), (1.3, 0.5))


def plane(depth, width, turn=0.0):
    """A plane across -Z, width × width / 2 large."""
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    matrix[2, 3] = -depth
    return Plane(matrix=matrix, width=width, height=width / 2)


def pinhole(near=None, image=None):
    """A camera at the origin, whose image is as wide as it is far away and shows u from 0.1 to 0.9."""
    surfaces = (near or plane(0.1, 0.1), plane(8.0, 8.0))
    return Projection(ViewingVolume(surfaces), image or Unrolled(), u_range=(0.1, 0.9), aspect=2.0)


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("is_framed", [False, True])
@pytest.mark.parametrize("near", [None, Point()])
def test_bounds_are_those_of_the_points_in_the_image(seed, is_framed, near):
    points = np.random.default_rng(seed).uniform([[-1], [-1], [-6]], [[1], [1], [-2]], (3, 7))
    bounds = ImageBounds.around(pinhole(near, Stack((FRAME,), Unrolled()) if is_framed else None), points)
    x = (points[0] / -points[2] + 0.5 - 0.1) / 0.8
    y = points[1] / -points[2] / 0.5 + 0.5
    if is_framed:
        x, y = FRAME.image_positions(x, y, 2.0)
    assert bounds.hold(x, y).all()
    for low, high, place in zip(bounds.low, bounds.high, (x, y), strict=False):
        np.testing.assert_allclose([low, high], [place.min(), place.max()], atol=2e-4)
    # Just beyond the points on each side of the octagon.
    for direction in bounds.directions:
        for side in (-1.0, 1.0):
            end = np.argmax(side * (direction @ np.stack([x, y])))
            step = 3e-4 * side * direction / np.linalg.norm(direction)
            assert not bounds.hold(x[[end]] + step[0], y[[end]] + step[1]).any()


def test_unknown_bounds():
    points = np.array([[0.0, 0.1], [0.0, 0.2], [-3.0, -4.0]])
    camera = pinhole()
    assert ImageBounds.around(camera, points) is not None
    assert ImageBounds.around(camera, points * [[1], [1], [-1]]) is None
    assert ImageBounds.around(replace(camera, reparameterisation=Polar()), points) is None
    near, far = camera.volume.surfaces
    for surfaces in ((near, plane(8.0, 8.0, 0.5)), (near, plane(4.0, 3.0), far), (Point(), Point())):
        assert ImageBounds.around(replace(camera, volume=ViewingVolume(surfaces)), points) is None
