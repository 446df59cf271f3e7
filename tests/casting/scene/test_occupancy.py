# SPDX-License-Identifier: GPL-3.0-or-later
"""Empty boxes of the grid contain nothing, and few boxes count as full."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from benchmarks.scenes import SCENES, bent_projection
from scfpf_addon.casting.cast import CastCounts
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.scene import occupancy
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.casting.scene.occupancy import CELLS, FINER, Occupancy
from scfpf_addon.casting.scene.stretches import Stretches, stretches

WIDTH, HEIGHT = 75, 43


@given(
    st.integers(0, 10_000),
    st.floats(-3, 0.5),
    st.integers(1, 40),
    st.sampled_from([1 << 12, 1 << 16, CELLS]),
)
def test_no_point_of_a_triangle_is_in_an_empty_box(seed, size, count, cells):
    generator = np.random.default_rng(seed)
    middle = generator.uniform(-1, 1, (3, count))
    corners = middle + generator.normal(size=(3, 3, count)) * 10.0**size
    grid = Occupancy.of(corners, cells=cells)
    shares = generator.dirichlet(np.ones(3) * 0.3, (200, count))
    points = np.einsum("skc,cxk->xsk", shares, corners).reshape(3, -1)
    extent = np.abs(generator.normal(size=points.shape)) * 10.0 ** generator.uniform(-6, -1)
    for holds in (grid.holds, grid.holds_finely):
        assert holds(points, points).all()
        assert holds(points - extent, points + extent * generator.integers(0, 2)).all()


def test_a_slanted_sheet_fills_few_cells_and_boxes_outside_are_empty():
    corners = np.array([[-1.0, -1, -1], [1, 1, -1], [-1, 1, 1]])[:, :, None]
    grid = Occupancy.of(corners)
    assert grid.sums[-1, -1, -1] < 8 * CELLS ** (2 / 3)
    low = np.array([[0.9, 1.1, -9], [-0.9, 1.1, -9], [0.9, 1.1, -9]])
    huge = np.array([[-1e300], [-1e300], [-1e300]])
    for holds in (grid.holds, grid.holds_finely):
        assert holds(low, low + 0.01).tolist() == [False, False, False]
        assert holds(huge, -huge).all() and not holds(huge, huge).any()


@pytest.mark.parametrize("apart", [0.0, 0.003, 0.1])
def test_what_is_near_is_held_too(apart):
    generator = np.random.default_rng(7)
    corners = generator.uniform(-1, 1, (3, 1, 20)) + generator.normal(size=(3, 3, 20)) * 0.2
    grid = Occupancy.of(corners, apart)
    shares = generator.dirichlet(np.ones(3), (500, 20))
    points = np.einsum("skc,cxk->xsk", shares, corners)
    points += apart * generator.uniform(-1, 1, points.shape)
    assert grid.holds(points, points).all() and grid.holds_finely(points, points).all()


def test_cells_are_counted_modulo_a_byte_without_harm():
    """Boxes over exactly as many full cells as leave no remainder."""
    generator = np.random.default_rng(5)
    corners = generator.uniform(-1, 1, (3, 3, 1500))
    grid = Occupancy.of(corners)
    cell = 1.0 / (FINER * grid.scale[:, None])
    for cells in ((15, 17, 1), (4, 7, 9), (255, 1, 1), (3, 5, 17)):
        size = np.array(cells)[:, None]
        place = generator.integers(0, np.array(grid.finer.shape)[:, None] - size, (3, 8_000))
        low, high = (grid.lower[:, None] + cell * (place + shift) for shift in (0.5, size - 0.5))
        middle = [low + cell * generator.integers(0, size, low.shape) for _ in range(8)]
        sampled = np.any([grid.holds_finely(m, m) for m in middle], axis=0)
        held = grid.holds_finely(low, high)
        assert sampled.mean() > 0.3 and not (sampled & ~held).any()
        assert not (held & ~grid.holds(low, high)).any()


def test_boxes_over_as_many_full_cells_as_a_byte_forgets_are_held():
    cells = np.ones((32, 32, 4), bool)
    whole = occupancy.integral_image(cells[::FINER, ::FINER, ::FINER])
    grid = Occupancy(whole, occupancy.integral_image(cells, np.uint8), np.zeros(3), np.ones(3))
    for size in ((16, 16, 1), (32, 8, 1), (32, 32, 4)):
        low, high = np.full((3, 1), 0.1), (np.array(size)[:, None] - 0.5) / FINER
        assert grid.holds_finely(low, high).all()


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
    meets = cast_scene.occupancy.holds_finely(position, position)
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
    full = CastCounts()
    for sums in (scene.occupancy.sums, scene.occupancy.finer):
        x, y, z = np.indices(sums.shape)
        sums[:] = x * y * z
    again = reference.cast_image(scene, projection, 96, 54, 0.01, grid=False, counts=full)
    assert counts.chords < 0.8 * full.chords
    assert np.array_equal(hits.triangle, again.triangle)


@pytest.mark.parametrize("columns", [75, 64, 5])
def test_blocks_of_a_grid_are_those_of_their_pixels(columns):
    """The cached table of tiles and the sorting for other projectors give the same blocks."""
    scene = CastScene(*SCENES["boxes"](1_000))
    projection = bent_projection(2, 0.5).transformed(scene.matrix)
    x, y = pixel_centres(columns, 43, (0, 43))
    points, _ = projection.projectors(x, y)
    where = stretches(scene.occupancy, projection.volume.spans, points.astype(np.float32), columns)
    known, sorted_ones = where.members(), where._replace(grid=None).members()
    assert np.array_equal(np.sort(known[known >= 0]), np.arange(len(x)))
    for one, other in zip(known, sorted_ones, strict=True):
        assert np.array_equal(np.sort(one[one >= 0]), np.sort(other[other >= 0]))


@pytest.mark.parametrize("count", [20, 40])
def test_parts_of_t_are_held_where_any_stretch_in_them_is(count):
    """Few and many intervals, against a search of every part."""
    generator = np.random.default_rng(3)
    edges = np.linspace(0.0, 1.0, 33)
    held = generator.random((32, 7)) < 0.2
    low = np.sort(generator.uniform(-0.1, 1.0, count))
    high = low + generator.uniform(1e-3, 0.3, count)
    found = Stretches(edges, held, np.arange(7)).within(low, high)
    touching = (edges[1:] > low[:, None]) & (edges[:-1] < high[:, None])
    assert np.array_equal(found, (touching[:, :, None] & held).any(axis=1))


def test_more_triangles_have_more_cells(monkeypatch):
    """Eight a triangle, from the fewest to the most."""
    for count, cells in ((10, 1 << 10), (300, 2400), (2000, 1 << 13)):
        monkeypatch.setattr(occupancy, "CELLS", 1 << 10)
        monkeypatch.setattr(occupancy, "MOST_CELLS", 1 << 13)
        corners = np.random.default_rng(count).uniform(0.0, 1.0, (3, 3, count))
        made = np.prod(np.array(Occupancy.of(corners).sums.shape) - 1)
        assert 0.7 * cells < made <= cells
