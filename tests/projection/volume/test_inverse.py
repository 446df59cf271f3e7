# SPDX-License-Identifier: GPL-3.0-or-later
"""The inverse of a volume against its forward evaluation: all kinds and presets, folds, what is outside."""

import pathlib
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from scfpf_addon.projection.presets.preset import read_preset
from scfpf_addon.projection.surfaces.nurbs import NurbsPatch
from scfpf_addon.projection.surfaces.surface import (
    BilinearPatch,
    Cone,
    Cylinder,
    Disc,
    Grid,
    Plane,
    Point,
    SphereSector,
)
from scfpf_addon.projection.surfaces.uv_chart import UVChart
from scfpf_addon.projection.surfaces.uv_mesh import UVMesh
from scfpf_addon.projection.volume.inverse import find_in_image, invert
from scfpf_addon.projection.volume.reparameterisation import Polar, Unrolled
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

FOLDER = pathlib.Path(__file__).resolve().parents[3] / "presets"
# The epipolar plane image has a plane for a volume: neither orientation nor inverse.
PRESETS = sorted(set(FOLDER.glob("*.json")) - {FOLDER / "epi.json"})


def placed(z):
    matrix = np.eye(4)
    matrix[2, 3] = z
    return matrix


def frustum(near=1.0, far=9.0, depth=-8.0):
    return ViewingVolume((Plane(near, near), Plane(far, far, matrix=placed(depth))))


def bumpy_grid(z, size):
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, 6), np.linspace(-0.5, 0.5, 5))
    points = np.stack([size * u, size * v, 0.1 * size * np.sin(7 * u) * np.cos(5 * v)], axis=-1)
    return Grid(points, matrix=placed(z))


def split_mesh(z, size):
    """Two halves of a sheet, moved apart: a UV mesh of two tiles with a hole between them."""
    corners = np.array([[-1.0, -1, 0], [-0.2, -1, 0], [-0.2, 1, 0], [-1, 1, 0]]) * size / 2
    points = np.concatenate([corners, corners + np.array([0.6 * size, 0, 0])])
    uv = np.array([[0.0, 0], [0.4, 0], [0.4, 1], [0, 1]])
    uv = np.concatenate([uv, uv + np.array([0.6, 0])])
    triangles = np.array([[0, 1, 2], [0, 2, 3], [4, 5, 6], [4, 6, 7]])
    return UVMesh(points, UVChart(uv[triangles], triangles), matrix=placed(z))


def nurbs(z, size):
    u, v = np.meshgrid(np.linspace(-0.5, 0.5, 5), np.linspace(-0.5, 0.5, 4))
    points = np.stack([size * u, size * v, 0.2 * size * u * v, 1 + 0.5 * np.cos(3 * u + 2 * v)], axis=-1)
    return NurbsPatch(points, matrix=placed(z))


KINDS = {
    "point": (Point(), Plane(4, 3, matrix=placed(-5))),
    "planes": frustum().surfaces,
    "patch": (BilinearPatch(), BilinearPatch(5 * BilinearPatch().corners + [0.3, 0.4, 0], matrix=placed(-6))),
    "disc": (Disc(0.2, 5.0), Disc(3.0, 5.0, matrix=placed(-4))),
    "cylinder": (Cylinder(0.5, 6.2, 0.4), Cylinder(6.0, 6.2, 7.0)),
    "cone": (Cone(0.5, 0.3, 4.0, 0.4), Cone(6.0, 5.0, 4.0, 7.0)),
    "sphere": (SphereSector(0.3, 6.0, -1.4, 1.4), SphereSector(9.0, 6.0, -1.4, 1.4)),
    "grid": (bumpy_grid(0, 1.0), bumpy_grid(-5, 4.0)),
    "mixed": (Point(), Plane(2, 2, matrix=placed(-2)), bumpy_grid(-6, 5.0)),
    "nurbs": (nurbs(0, 1.0), nurbs(-5, 4.0)),
    "uv mesh": (split_mesh(0, 1.0), split_mesh(-5, 3.0)),
}


def forward(volume, count=400, seed=5):
    """Random parameters where the volume has no hole, and the points there."""
    u, v, t = np.random.default_rng(seed).uniform(size=(3, count))
    kept = volume.controls(u, v).valid
    u, v, t = u[kept], v[kept], t[kept]
    return (u, v, t), volume.evaluate(u, v, t).position


def assert_passes_through(volume, place, points):
    size = np.abs(points).max()
    again = volume.evaluate(*(values[place.found] for values in place[:3])).position
    assert np.abs(again - points[:, place.found]).max(initial=0) <= 1e-9 * size


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("basis", ["BEZIER", "POLYLINE"])
def test_every_kind_gives_back_the_parameters(kind, basis):
    volume = ViewingVolume(KINDS[kind], basis)
    parameters, points = forward(volume)
    place = invert(volume, points)
    assert place.found.all()
    assert_passes_through(volume, place, points)
    assert np.allclose(place[:3], parameters, atol=1e-7)


def test_rational_projectors_give_back_the_parameters():
    surfaces = tuple(Plane(1 + i, 1 + i, matrix=placed(-2 * i)) for i in range(3))
    volume = ViewingVolume(surfaces, "NURBS", (1.0, 5.0, 0.5))
    parameters, points = forward(volume)
    place = invert(volume, points)
    assert place.found.all() and np.allclose(place[:3], parameters, atol=1e-7)


@pytest.mark.parametrize("path", PRESETS, ids=lambda path: path.stem)
@pytest.mark.parametrize("move", [0.0, 1e5], ids=["here", "far off"])
def test_every_preset_gives_back_the_place_in_the_image(path, move):
    projection = read_preset(path).projection(1.5)
    matrix = np.eye(4)
    matrix[:3, 3] = move
    projection = projection.transformed(matrix)
    x, y, t = np.random.default_rng(2).uniform(size=(3, 300))
    image = projection.parameters(x, y)
    shown = image.mask
    points = projection.volume.evaluate(image.u, image.v, t).position[:, shown]
    place = find_in_image(projection, points)
    assert place.found.all() and (place.t <= t[shown] + 1e-6).all()
    again = projection.parameters(place.x, place.y)
    missed = projection.volume.evaluate(again.u, again.v, place.t).position - points
    assert np.abs(missed).max() <= 1e-8 * np.abs(points).max()
    assert np.allclose([place.x, place.y], [x[shown], y[shown]], atol=1e-5)


@settings(max_examples=40, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    count=st.integers(2, 5),
    scale=st.floats(-6, 6),
    basis=st.sampled_from(["BEZIER", "POLYLINE", "B_SPLINE"]),
)
@example(seed=261, count=3, scale=0.0, basis="BEZIER")
def test_random_volumes_are_passed_through_no_later_than_known(seed, count, scale, basis):
    """Twisted, bent and sometimes folded patches: what is found is right, and never behind what is known.

    But for layers that meet at a fold within the distance of two samples.
    """
    random = np.random.default_rng(seed)
    corners = np.array([[-1.0, -1, 0], [1, -1, 0], [-1, 1, 0], [1, 1, 0]])
    surfaces = tuple(
        BilinearPatch(
            corners * (1 + index) + random.normal(scale=0.3, size=(4, 3)), matrix=placed(-2 * index)
        )
        for index in range(count)
    )
    matrix = np.diag([10.0**scale] * 3 + [1.0])
    volume = ViewingVolume(surfaces, basis).transformed(matrix)
    (u, v, t), points = forward(volume, 60, seed)
    place = invert(volume, points)
    assert place.found.all()
    assert_passes_through(volume, place, points)
    behind = place.t > t + 1e-7
    apart = np.abs([place.u - u, place.v - v, place.t - t])[:, behind]
    assert (apart <= np.array([1 / 8, 1 / 8, 1 / 6])[:, None]).all()


def test_a_folded_volume_gives_the_nearest_layer():
    """Two layers: planes whose order along the line of sight is 0, -4, -1: z runs out and back."""
    volume = ViewingVolume(tuple(Plane(2, 2, matrix=placed(z)) for z in (0.0, -4.0, -1.0)))
    t = np.linspace(0.0, 1.0, 2001)
    z = -8 * t * (1 - t) - t**2
    wanted = np.linspace(-1.05, z.min() * 0.999, 50)
    points = np.stack([np.full(50, 0.3), np.full(50, -0.2), wanted])
    first = np.array([t[np.argmax(z <= depth)] for depth in wanted])
    place = invert(volume, points)
    assert place.found.all() and np.allclose(place.t, first, atol=1e-3)
    polyline = invert(replace(volume, basis="POLYLINE"), points)
    assert polyline.found.all() and np.allclose(polyline.t, -wanted / 8)


def test_what_is_outside_is_not_found():
    points = np.array([[0.0, 0, -4], [0, 0, 1], [0, 0, -8.01], [3, 0, -4], [0, -2.6, -4], [np.nan, 0, -4]]).T
    place = invert(frustum(), points)
    assert place.found.tolist() == [True, False, False, False, False, False]
    assert np.isnan(place.u[1:]).all() and np.isnan(place.t[1:]).all()
    assert (place.u[0], place.v[0], place.t[0]) == pytest.approx((0.5, 0.5, 0.5))
    assert invert(frustum(), np.zeros((3, 0))).found.shape == (0,)


def test_holes_and_flat_volumes_find_nothing():
    holed = ViewingVolume(KINDS["uv mesh"])
    assert not invert(holed, np.array([[0.0], [0], [-2.5]])).found.any()
    flat = ViewingVolume((Plane(), Plane()))
    assert not invert(flat, np.zeros((3, 2))).found.any()
    assert not invert(ViewingVolume((Point(), Point())), np.zeros((3, 1))).found.any()


def test_points_on_the_borders_count_as_inside():
    u, v, t = (axis.ravel() for axis in np.meshgrid(*[np.array([0.0, 0.5, 1.0])] * 3))
    points = frustum().evaluate(u, v, t).position.astype(np.float32).astype(np.float64)
    place = invert(frustum(), points)
    assert place.found.all() and np.allclose(place[:3], (u, v, t), atol=1e-6)
    for values in place[:3]:
        assert values.min() >= 0 and values.max() <= 1


def test_a_volume_a_million_times_longer_than_wide():
    volume = frustum(1e-3, 1e3, -1e3)
    parameters, points = forward(volume, 300)
    place = invert(volume, points)
    assert place.found.all() and np.allclose(place[:3], parameters, atol=1e-6)


def test_only_the_part_that_is_shown_is_looked_in():
    volume = frustum()
    points = volume.evaluate(np.array([0.2, 0.7]), np.array([0.5, 0.5]), np.array([0.5, 0.5])).position
    for u_range in ((0.5, 1.0), (1.0, 0.5)):
        assert invert(volume, points, u_range).found.tolist() == [False, True]
        place = find_in_image(Projection(volume, Unrolled(), u_range), points)
        assert place.found.tolist() == [False, True]
        assert place.x[1] == pytest.approx((0.7 - u_range[0]) / (u_range[1] - u_range[0]))


@pytest.mark.parametrize("aspect", [0.4, 1.0, 1.7778])
def test_image_positions_are_the_inverse_of_the_image_map(aspect):
    x, y = np.random.default_rng(3).uniform(size=(2, 500))
    for kind in (Unrolled(), Polar()):
        image = kind.map(x, y, aspect)
        again = kind.image_positions(image.u, image.v, aspect)
        assert np.allclose(again, (x, y), atol=1e-14)
