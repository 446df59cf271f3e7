# SPDX-License-Identifier: GPL-3.0-or-later
"""The first object on one projector, against points of the projector placed one by one."""

import numpy as np
import pytest

from scfpf_addon.projection.surfaces.surface import Plane, Point
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume
from scfpf_addon.shading.picking.seen import first_seen, may_be_met

PIXEL = (1e-3, 1e-3)


def at(x, y, z):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return matrix


def plane(matrix, width, height):
    return Plane(matrix=matrix, width=width, height=height)


def volume(kind, basis):
    """A volume along -Z: straight, or with two surfaces that pull its projectors aside."""
    near, far = plane(at(0, 0, 0), 2.0, 2.0), plane(at(0, 0, -10), 4.0, 3.0)
    middle = () if kind == "straight" else (plane(at(6, 1, -4), 1.0, 2.0), plane(at(-5, -1, -6), 3.0, 1.0))
    return Projection(ViewingVolume((near, *middle, far), basis))


def de_casteljau(points, t):
    """The points of a Bézier curve (M, 3) at t (S,)."""
    rows = np.repeat(np.asarray(points, float)[:, None], len(t), axis=1)
    while len(rows) > 1:
        rows = (1 - t)[:, None] * rows[:-1] + t[:, None] * rows[1:]
    return rows[0]


def walked(projection, x, y, count=8_001):
    """The projector at (x, y) as many points, from the corners of its planes and Bernstein's definition."""
    controls = [
        s.matrix[:3, 3] + ((x - 0.5) * s.width * s.matrix[:3, 0] + (y - 0.5) * s.height * s.matrix[:3, 1])
        for s in projection.volume.surfaces
    ]
    t = np.linspace(0.0, 1.0, count)
    if projection.volume.basis == "POLYLINE":
        places = t * (len(controls) - 1)
        return np.stack([np.interp(places, range(len(controls)), axis) for axis in np.transpose(controls)], 1)
    return de_casteljau(controls, t)


def facing(z, low, high):
    """A rectangle at a depth, from (x, y) to (x, y), as vertices and triangles."""
    (left, lower), (right, upper) = low, high
    corners = [(left, lower, z), (right, lower, z), (right, upper, z), (left, upper, z)]
    return np.array(corners, float), np.array([(0, 1, 2), (0, 2, 3)], np.int32)


@pytest.mark.parametrize("kind", ["straight", "bent"])
@pytest.mark.parametrize("basis", ["BEZIER", "POLYLINE"])
def test_no_box_on_the_projector_is_missed_and_few_others_are_kept(kind, basis):
    random = np.random.default_rng(7)
    projection = volume(kind, basis)
    points = walked(projection, 0.3, 0.8)
    size = random.uniform(0.0, 0.8, (500, 3))
    # Some hold a point of the projector, the others lie anywhere.
    near = random.choice(points, 50) - size[:50] * random.random((50, 3))
    low = np.concatenate([near, random.uniform(-12, 6, (450, 3))])
    high = low + size
    held = np.array(
        [((points >= a) & (points <= b)).all(axis=1).any() for a, b in zip(low, high, strict=True)]
    )
    kept = may_be_met(projection, 0.3, 0.8, low, high)
    assert held.any() and kept[held].all()
    assert kept.sum() <= 2 * held.sum() + 20


@pytest.mark.parametrize("kind", ["straight", "bent"])
@pytest.mark.parametrize("basis", ["BEZIER", "POLYLINE"])
def test_first_mesh_is_that_whose_plane_the_projector_passes_first(kind, basis):
    random = np.random.default_rng(11)
    projection = volume(kind, basis)
    seen = set()
    for _ in range(12):
        x, y = random.uniform(0.1, 0.9, 2)
        points = walked(projection, x, y)
        corners = [(random.uniform(-4, 3, 2), random.uniform(0.5, 4, 2)) for _ in range(6)]
        depths = random.uniform(-9.9, -0.1, 6)
        meshes = [facing(z, a, a + b) for z, (a, b) in zip(depths, corners, strict=True)]
        passed = []
        for number, (z, (low, size)) in enumerate(zip(depths, corners, strict=True)):
            side = points[:, 2] > z
            for step in np.flatnonzero(side[1:] != side[:-1]):
                if ((points[step, :2] >= low) & (points[step, :2] <= low + size)).all():
                    passed.append((step, number))
        expected = min(passed, default=(0, -1))[1]
        assert first_seen(projection, meshes, x, y, PIXEL) == expected
        seen.add(expected)
    assert len(seen) > 2


def test_nothing_is_seen_where_there_is_nothing():
    projection = volume("straight", "BEZIER")
    assert first_seen(projection, [], 0.5, 0.5, PIXEL) == -1
    empty = np.empty((0, 3)), np.empty((0, 3), np.int32)
    assert first_seen(projection, [empty], 0.5, 0.5, PIXEL) == -1
    behind = facing(-11.0, (-9, -9), (9, 9))
    assert first_seen(projection, [behind], 0.5, 0.5, PIXEL) == -1
    assert first_seen(projection, [empty, behind, facing(-2.0, (-9, -9), (9, 9))], 0.5, 0.5, PIXEL) == 2


def test_there_is_no_projector_where_the_volume_is_not_finite():
    surfaces = Point(matrix=np.full((4, 4), np.nan)), plane(at(0, 0, -5), 1.0, 1.0)
    projection = Projection(ViewingVolume(surfaces))
    assert not may_be_met(projection, 0.5, 0.5, np.full((1, 3), -1e9), np.full((1, 3), 1e9)).any()
