# SPDX-License-Identifier: GPL-3.0-or-later
"""The viewing volume: interpolation, invariance, derivatives, folds."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scfpf_addon.projection.surfaces.surface import BilinearPatch, Cylinder, Grid, Plane, Point, SphereSector
from scfpf_addon.projection.volume.reparameterisation import Polar
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume, determinant

seeds = st.integers(0, 2**32 - 1)


def random_volume(seed, basis="BEZIER"):
    """Two to five surfaces of any smooth kind, anywhere."""
    generator = np.random.default_rng(seed)
    kinds = [
        lambda: Point(),
        lambda: Plane(2.0, 1.5),
        lambda: BilinearPatch(generator.normal(size=(4, 3))),
        lambda: Cylinder(2.0, 2.0, 3.0),
        lambda: SphereSector(2.0, 2.0, -0.5, 0.7),
    ]
    surfaces = []
    for _ in range(generator.integers(2, 6)):
        matrix = np.eye(4)
        matrix[:3] = generator.normal(size=(3, 4))
        surfaces.append(kinds[generator.integers(len(kinds))]().transformed(matrix))
    return ViewingVolume(tuple(surfaces), basis)


@given(seeds, st.sampled_from(["BEZIER", "POLYLINE"]))
def test_projectors_join_the_outer_surfaces(seed, basis):
    volume = random_volume(seed, basis)
    u, v = np.random.default_rng(seed).uniform(size=(2, 5))
    near, far = volume.evaluate(u, v, 0.0), volume.evaluate(u, v, 1.0)
    np.testing.assert_allclose(near.position, volume.surfaces[0].evaluate(u, v).position, atol=1e-12)
    np.testing.assert_allclose(far.position, volume.surfaces[-1].evaluate(u, v).position, atol=1e-12)


@settings(deadline=None)
@given(seeds, st.sampled_from(["BEZIER", "POLYLINE"]))
def test_derivatives_are_those_of_the_position(seed, basis):
    volume = random_volume(seed, basis)
    generator = np.random.default_rng(seed)
    u, v = generator.uniform(0.05, 0.95, size=(2, 6))
    spans = len(volume.surfaces) - 1
    # Away from the corners of a polyline.
    t = (generator.integers(spans, size=6) + generator.uniform(0.1, 0.9, 6)) / spans
    sample, step = volume.evaluate(u, v, t), 1e-6

    def difference(du, dv, dt):
        more = volume.evaluate(u + du, v + dv, t + dt).position
        return (more - volume.evaluate(u - du, v - dv, t - dt).position) / (2 * step)

    scale = 1.0 + np.abs(sample.dt).max() + np.abs(sample.du).max() + np.abs(sample.dv).max()
    np.testing.assert_allclose(sample.du, difference(step, 0, 0), atol=1e-7 * scale)
    np.testing.assert_allclose(sample.dv, difference(0, step, 0), atol=1e-7 * scale)
    np.testing.assert_allclose(sample.dt, difference(0, 0, step), atol=1e-7 * scale)


@given(seeds, seeds, st.sampled_from(["BEZIER", "POLYLINE"]))
def test_a_transformed_volume_is_the_transformed_points(seed, other, basis):
    volume = random_volume(seed, basis)
    matrix = np.eye(4)
    matrix[:3] = np.random.default_rng(other).normal(size=(3, 4))
    u, v, t = np.random.default_rng(seed).uniform(size=(3, 6))
    base, moved = volume.evaluate(u, v, t), volume.transformed(matrix).evaluate(u, v, t)
    scale = 1.0 + np.abs(base.position).max() * np.abs(matrix).max()
    np.testing.assert_allclose(
        moved.position, matrix[:3, :3] @ base.position + matrix[:3, 3:], atol=1e-11 * scale
    )
    scale = 1.0 + np.abs(base.dt).max() * np.abs(matrix).max()
    np.testing.assert_allclose(moved.dt, matrix[:3, :3] @ base.dt, atol=1e-11 * scale)


@given(seeds)
def test_the_projectors_of_an_image_are_the_controls(seed):
    volume = random_volume(seed)
    projection = Projection(volume, Polar(), (0.1, 0.9), (0.2, 0.7), aspect=1.6)
    x, y = np.random.default_rng(seed).uniform(size=(2, 30))
    image = projection.parameters(x, y)
    projectors, controls = projection.projectors(x, y), volume.controls(image.u, image.v)
    np.testing.assert_allclose(projectors.points, controls.points, atol=1e-12)
    np.testing.assert_array_equal(projectors.valid, image.mask & controls.valid)


def shifted(surface, x, y, z):
    matrix = np.eye(4)
    matrix[:3, 3] = x, y, z
    return surface.transformed(matrix)


def test_a_polyline_bends_at_its_surfaces_only():
    surfaces = (Plane(), shifted(Plane(), 1, 0, -1), shifted(Plane(), 0, 0, -2))
    volume = ViewingVolume(surfaces, "POLYLINE")
    half = np.full(3, 0.5)
    sample = volume.evaluate(half, half, np.array([0.25, 0.5, 0.75]))
    np.testing.assert_allclose(sample.position.T, [[0.5, 0, -0.5], [1, 0, -1], [0.5, 0, -1.5]], atol=1e-15)
    np.testing.assert_allclose(sample.dt.T, [[2, 0, -2], [-2, 0, -2], [-2, 0, -2]], atol=1e-14)


def test_the_determinant_tells_a_good_volume_from_a_folded_and_a_mirrored_one():
    good = ViewingVolume((shifted(Plane(1, 1), 0, 0, -1), shifted(Plane(4, 4), 0, 0, -4)))
    mirrored = ViewingVolume((Plane(1, 1), shifted(Plane(-4, 4), 0, 0, -4)))
    half = np.full(1, 0.5)
    assert determinant(good.evaluate(half, half, 0.5))[0] < 0
    assert (
        determinant(mirrored.evaluate(half, half, 0.1))[0]
        < 0
        < determinant(mirrored.evaluate(half, half, 0.9))[0]
    )


def test_tiles_are_told_apart():
    grid = Grid(np.random.default_rng(0).normal(size=(3, 3, 3)))
    controls = ViewingVolume((grid, Plane())).controls(np.array([0.1, 0.9]), np.array([0.1, 0.9]))
    assert controls.tile.shape == (2,) and controls.valid.all()


def test_one_surface_is_no_volume():
    with pytest.raises(ValueError, match="at least two"):
        ViewingVolume((Plane(),))
