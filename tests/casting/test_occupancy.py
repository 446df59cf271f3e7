# SPDX-License-Identifier: GPL-3.0-or-later
"""What is called empty holds nothing, and little is called full."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.scenes import SCENES, bent_projection
from scfpf_addon.casting.cast import CastCounts
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.occupancy import CELLS, Occupancy, stretches
from scfpf_addon.casting.scene import CastScene

WIDTH, HEIGHT = 75, 43


@given(st.integers(0, 10_000), st.floats(-3, 0.5), st.integers(1, 40))
def test_no_point_of_a_triangle_is_in_an_empty_box(seed, size, count):
    generator = np.random.default_rng(seed)
    middle = generator.uniform(-1, 1, (3, count))
    corners = middle + generator.normal(size=(3, 3, count)) * 10.0**size
    grid = Occupancy.of(corners)
    shares = generator.dirichlet(np.ones(3) * 0.3, (200, count))
    points = np.einsum("skc,cxk->xsk", shares, corners).reshape(3, -1)
    extent = np.abs(generator.normal(size=points.shape)) * 10.0 ** generator.uniform(-6, -1)
    assert grid.holds(points, points).all()
    assert grid.holds(points - extent, points + extent * generator.integers(0, 2)).all()


def test_a_slanted_sheet_fills_few_cells_and_boxes_outside_are_empty():
    corners = np.array([[-1.0, -1, -1], [1, 1, -1], [-1, 1, 1]])[:, :, None]
    grid = Occupancy.of(corners)
    assert grid.sums[-1, -1, -1] < 8 * CELLS**2
    low = np.array([[0.9, 1.1, -9], [-0.9, 1.1, -9], [0.9, 1.1, -9]])
    assert grid.holds(low, low + 0.05).tolist() == [False, False, False]
    huge = np.array([[-1e300], [-1e300], [-1e300]])
    assert grid.holds(huge, -huge).all() and not grid.holds(huge, huge).any()


@pytest.mark.parametrize("scene", SCENES)
@pytest.mark.parametrize(("degree", "angle"), [(2, 1.0), (3, 3.0), (5, 0.5)])
@pytest.mark.parametrize("columns", [WIDTH, None])
def test_every_hit_lies_in_a_stretch_that_is_not_empty(scene, degree, angle, columns):
    cast_scene = CastScene(*SCENES[scene](2000))
    projection = bent_projection(degree, angle).transformed(cast_scene.matrix)
    points, _ = projection.projectors(*pixel_centres(WIDTH, HEIGHT, (0, HEIGHT)))
    found = stretches(cast_scene.occupancy, projection.volume.spans, points, columns)
    generator = np.random.default_rng(3)
    # Points of projectors next to which the scene is: those that its triangles' corners are near to.
    t = generator.uniform(0, 1, (60, points.shape[2]))
    held = found.within(t.ravel(), t.ravel()).reshape(*t.shape, -1)
    held = np.take_along_axis(held, found.block[None, :, None], axis=2)[..., 0]
    weights = projection.volume.spans.weights(t.ravel())[0].reshape(-1, *t.shape)
    position = np.einsum("ksn,kcn->csn", weights, points)
    meets = cast_scene.occupancy.holds(position, position)
    assert 0.005 < meets.mean() < 0.9
    assert not (meets & ~held).any()
    low, high = found.reach
    assert t[meets].min() >= low and t[meets].max() <= high


def test_empty_space_is_not_cast_at(reference):
    vertices, triangles = SCENES["terrain"](2000)
    scene, counts = CastScene(vertices, triangles), CastCounts()
    projection = bent_projection(3, np.pi)
    hits = reference.cast_image(scene, projection, 96, 54, 0.01, grid=False, counts=counts)
    assert (hits.triangle >= 0).mean() > 0.3
    full, cells = CastCounts(), np.arange(CELLS + 1)
    scene.occupancy.sums[:] = cells[:, None, None] * cells[:, None] * cells
    again = reference.cast_image(scene, projection, 96, 54, 0.01, grid=False, counts=full)
    assert counts.chords < 0.8 * full.chords
    assert np.array_equal(hits.triangle, again.triangle)
