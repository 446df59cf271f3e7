# SPDX-License-Identifier: GPL-3.0-or-later
"""Control surfaces: derivatives, closed forms, orientation, affine invariance."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scfpf_addon.projection.surfaces.surface import (
    BilinearPatch,
    Cone,
    Cylinder,
    Disc,
    Grid,
    Paraboloid,
    Plane,
    Point,
    SphereSector,
)

size = st.floats(0.05, 20.0)
angle = st.floats(0.1, 2 * np.pi)
# Strictly between the lines of the grid below, where all kinds are smooth.
inner = st.floats(0.01, 0.24) | st.floats(0.26, 0.49) | st.floats(0.51, 0.74) | st.floats(0.76, 0.99)
seeds = st.integers(0, 2**32 - 1)


def affine(seed):
    generator = np.random.default_rng(seed)
    matrix = np.eye(4)
    matrix[:3] = generator.normal(size=(3, 4))
    return matrix


def random_grid(seed):
    return Grid(np.random.default_rng(seed).normal(size=(3, 5, 3)))


surfaces = st.one_of(
    st.just(Point()),
    st.builds(Plane, width=size, height=size),
    st.builds(lambda s: BilinearPatch(np.random.default_rng(s).normal(size=(4, 3))), seeds),
    st.builds(Disc, radius=size, arc=angle),
    st.builds(Cone, radius_start=size, radius_end=size, arc=angle, height=size),
    st.builds(Cylinder, radius=size, arc=angle, height=size),
    st.builds(SphereSector, radius=size, arc=angle, latitude_start=st.just(-1.2), latitude_end=st.just(1.4)),
    st.builds(Paraboloid, radius=size, arc=angle, depth=size),
    st.builds(random_grid, seeds),
)


@settings(max_examples=200)
@given(surfaces, seeds, inner, inner)
def test_derivatives_are_those_of_the_position(surface, seed, u, v):
    surface = surface.transformed(affine(seed))
    u, v, step = np.array([u]), np.array([v]), 1e-5
    sample = surface.evaluate(u, v)
    scale = 1.0 + np.abs(sample.position).max() + np.abs(sample.du).max() + np.abs(sample.dv).max()

    def difference(a, b):
        one = surface.evaluate(u + a, v + b).position - surface.evaluate(u - a, v - b).position
        half = (
            surface.evaluate(u + a / 2, v + b / 2).position - surface.evaluate(u - a / 2, v - b / 2).position
        )
        return (4 * half / step - one / (2 * step)) / 3  # Richardson: the error is of fourth order

    np.testing.assert_allclose(sample.du, difference(step, 0), atol=1e-8 * scale)
    np.testing.assert_allclose(sample.dv, difference(0, step), atol=1e-8 * scale)


@given(surfaces, seeds, seeds)
def test_a_transformed_surface_is_the_transformed_points(surface, first, second):
    one, two = affine(first), affine(second)
    u, v = np.random.default_rng(first).uniform(size=(2, 7))
    base = surface.transformed(one).evaluate(u, v)
    moved = surface.transformed(one).transformed(two).evaluate(u, v)
    scale = 1.0 + np.abs(moved.position).max() + np.abs(base.position).max()
    np.testing.assert_allclose(moved.position, two[:3, :3] @ base.position + two[:3, 3:], atol=1e-12 * scale)
    np.testing.assert_allclose(moved.du, two[:3, :3] @ base.du, atol=1e-11 * scale)
    np.testing.assert_allclose(moved.dv, two[:3, :3] @ base.dv, atol=1e-11 * scale)


@given(surfaces, seeds)
def test_positions_are_those_of_evaluate(surface, seed):
    surface = surface.transformed(affine(seed))
    u, v = np.random.default_rng(seed).uniform(size=(2, 9))
    sample, placement = surface.evaluate(u, v), surface.positions(u, v)
    scale = 1.0 + np.abs(sample.position).max()
    np.testing.assert_allclose(placement.position, sample.position, atol=1e-13 * scale)
    assert (placement.valid == sample.valid).all()


def at(surface, u, v):
    return surface.evaluate(np.array([float(u)]), np.array([float(v)])).position[:, 0]


def test_closed_forms():
    np.testing.assert_allclose(at(Plane(width=4, height=2), 0, 1), [-2, 1, 0])
    np.testing.assert_allclose(at(Disc(radius=3), 0.25, 0.5), [0, 1.5, 0], atol=1e-15)
    np.testing.assert_allclose(at(Cylinder(radius=2, arc=np.pi, height=3), 0.5, 0), [0, -1.5, -2])
    np.testing.assert_allclose(at(Cylinder(radius=2, arc=np.pi, height=3), 1, 1), [2, 1.5, 0], atol=1e-15)
    np.testing.assert_allclose(at(Cone(2, 1, np.pi, 3), 0.5, 1), [0, 1.5, -1])
    np.testing.assert_allclose(at(SphereSector(radius=2), 0.75, 0.5), [2, 0, 0], atol=1e-15)
    np.testing.assert_allclose(at(SphereSector(radius=2), 0.3, 1), [0, 2, 0], atol=1e-15)
    corners = np.arange(12.0).reshape(4, 3)
    for number, (u, v) in enumerate([(0, 0), (1, 0), (0, 1), (1, 1)]):
        np.testing.assert_allclose(at(BilinearPatch(corners), u, v), corners[number])
    points = np.random.default_rng(1).normal(size=(3, 4, 3))
    for row in range(3):
        for column in range(4):
            np.testing.assert_allclose(at(Grid(points), column / 3, row / 2), points[row, column], atol=1e-15)


@given(size, angle, size, st.floats(0, 1), st.floats(0, 1))
def test_a_paraboloid_is_as_far_from_its_focus_as_from_its_directrix(radius, arc, depth, u, v):
    focal_length = radius**2 / (4 * depth)
    x, y, z = at(Paraboloid(radius, arc, depth), u, v)
    assert np.hypot(np.hypot(x, y), z - focal_length) == pytest.approx(z + focal_length, rel=1e-12)
    assert np.hypot(x, y) == pytest.approx(radius * v, rel=1e-12)


@pytest.mark.parametrize(
    "surface", [Plane(2, 2), BilinearPatch(), Cylinder(2, np.pi, 2), Cone(2, 3, np.pi, 2), SphereSector(2)]
)
def test_u_goes_right_and_v_up_for_a_viewer_inside(surface):
    sample = surface.evaluate(np.array([0.5]), np.array([0.5]))
    assert sample.du[0, 0] > 0 and abs(sample.du[1, 0]) < 1e-12
    assert sample.dv[1, 0] > 0 and abs(sample.dv[0, 0]) < 1e-12


def test_derivatives_vanish_where_a_surface_is_a_point():
    u = np.array([0.1, 0.7])
    assert not Point().evaluate(u, u).du.any() and not Point().evaluate(u, u).dv.any()
    np.testing.assert_allclose(SphereSector(2).evaluate(u, np.ones(2)).du, 0, atol=1e-15)
    assert not Disc(2).evaluate(u, np.zeros(2)).du.any()
    assert not Paraboloid(2).evaluate(u, np.zeros(2)).du.any()


def test_a_grid_line_takes_the_cell_to_its_right_and_above():
    points = np.zeros((2, 3, 3))
    points[:, :, 0] = [0.0, 1.0, 4.0]
    points[1, :, 1] = 1.0
    u = np.array([0.25, 0.5, 0.75, 1.0])
    sample = Grid(points).evaluate(u, np.zeros(4))
    np.testing.assert_allclose(sample.du[0], [2, 6, 6, 6])


@pytest.mark.parametrize("shape", [(1, 3, 3), (3, 1, 3), (3, 3), (2, 2, 2)])
def test_small_grids_are_refused(shape):
    with pytest.raises(ValueError, match="2 × 2"):
        Grid(np.zeros(shape))
