# SPDX-License-Identifier: GPL-3.0-or-later
"""UV meshes: the affine map of every triangle, found by brute force alike; islands, holes, overlaps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from scfpf_addon.projection.diagrams.diagram import DiagramOptions, diagram, volume_signature
from scfpf_addon.projection.surfaces import uv_bins, uv_chart
from scfpf_addon.projection.surfaces.surface import Grid
from scfpf_addon.projection.surfaces.uv_chart import EDGE_TOLERANCE, UVChart
from scfpf_addon.projection.surfaces.uv_mesh import UVMesh
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

ROUNDING = 1e-12


def sheet(rows, columns, seed=None):
    """UVs (V, 2) and triangles (T, 3) that cover the UV square; seed: inner vertices moved, rows shuffled."""
    x, y = np.meshgrid(np.linspace(0, 1, columns + 1), np.linspace(0, 1, rows + 1))
    if seed is not None:
        random = np.random.default_rng(seed)
        x[1:-1, 1:-1] += random.uniform(-0.3, 0.3, x[1:-1, 1:-1].shape) / columns
        y[1:-1, 1:-1] += random.uniform(-0.3, 0.3, y[1:-1, 1:-1].shape) / rows
    first = (np.arange(rows)[:, None] * (columns + 1) + np.arange(columns)).ravel()
    quads = np.stack([first, first + 1, first + columns + 2, first + columns + 1], 1)
    triangles = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    if seed is not None:
        random.shuffle(triangles)
    return np.stack([x.ravel(), y.ravel()], 1), triangles


def mesh(uv, triangles, points=None):
    """A UV mesh whose vertices have one UV each; points default to (u, v, 0)."""
    points = np.column_stack([uv, np.zeros(len(uv))]) if points is None else points
    return UVMesh(points, UVChart(uv[triangles], triangles))


def joined(*parts):
    """Several (uv, triangles) as one, vertices not shared."""
    start = np.cumsum([0] + [len(uv) for uv, _ in parts])
    return (
        np.concatenate([uv for uv, _ in parts]),
        np.concatenate([t + s for (_, t), s in zip(parts, start, strict=False)]),
    )


def brute_force(uv, triangles, u, v):
    """Margin of every point in every triangle, (T, N): the least barycentric weight, by 3 × 3 solves."""
    corners = np.concatenate([uv[triangles], np.ones((len(triangles), 3, 1))], axis=2).transpose(0, 2, 1)
    weights = np.linalg.solve(
        corners, np.broadcast_to(np.stack([u, v, 0 * u + 1]), (len(triangles), 3, len(u)))
    )
    return weights.min(axis=1)


units = st.floats(0, 1, allow_subnormal=False)
coordinates = st.floats(-10, 10, allow_subnormal=False)


@settings(deadline=None, max_examples=60)
@given(
    st.integers(1, 9),
    st.integers(1, 9),
    st.integers(0, 99),
    arrays(np.float64, (3, 3), elements=coordinates),
    arrays(np.float64, (2, 20), elements=units),
)
def test_an_affine_map_is_reproduced_with_its_derivatives(rows, columns, seed, affine, at):
    uv, triangles = sheet(rows, columns, seed)
    points = affine[0] + uv @ affine[1:]
    sample = mesh(uv, triangles, points).evaluate(*at)
    assert sample.valid.all() and not sample.tile.any()
    assert np.allclose(sample.position.T, affine[0] + at.T @ affine[1:], rtol=0, atol=1e-11)
    assert np.allclose(sample.du, affine[1][:, None], rtol=0, atol=1e-10)
    assert np.allclose(sample.dv, affine[2][:, None], rtol=0, atol=1e-10)


@pytest.mark.parametrize("seed", range(4))
def test_the_triangle_is_that_of_brute_force(seed):
    """Triangles thrown at random over and beyond the square: overlaps, slivers, holes."""
    random = np.random.default_rng(seed)
    count = (1, 7, 60, 400)[seed]
    uv = random.uniform(-0.2, 1.2, (count, 1, 2)) + random.normal(size=(count, 3, 2)) * 0.3 / np.sqrt(count)
    uv, triangles = uv.reshape(-1, 2), np.arange(3 * count).reshape(-1, 3)
    points = random.normal(size=(len(uv), 3))
    u, v = random.random((2, 3000))
    margin = brute_force(uv, triangles, u, v)
    clear = (np.abs(margin) > 1e-5).all(axis=0)
    assert clear.mean() > 0.9
    covered = (margin > 0).any(axis=0)
    surface = mesh(uv, triangles, points)
    found = surface.chart.find(u, v)
    expected = np.where(covered, (margin > 0).argmax(axis=0), -1)
    assert np.array_equal(found.triangle[clear], expected[clear])
    assert covered.any() and (seed > 2 or covered.mean() < 1)
    sample = surface.evaluate(u, v)
    assert np.array_equal(sample.valid[clear], covered[clear])
    step = 1e-7
    inner = np.flatnonzero(clear & covered & (np.abs(margin) > 1e-4).all(axis=0))
    for slope, (du, dv) in ((sample.du, (step, 0)), (sample.dv, (0, step))):
        ahead, behind = (surface.positions(u[inner] + s * du, v[inner] + s * dv).position for s in (1, -1))
        assert np.allclose((ahead - behind) / (2 * step), slope[:, inner], rtol=1e-5, atol=1e-4)
    where = found.triangle[inner]
    assert np.allclose(
        np.einsum(
            "kn,nkc->cn", corner_weights(uv[triangles[where]], u[inner], v[inner]), points[triangles[where]]
        ),
        sample.position[:, inner],
        atol=1e-9,
    )


def corner_weights(corners, u, v):
    """Barycentric weights (3, N) of points in their own triangles, corners (N, 3, 2)."""
    matrix = np.concatenate([corners, np.ones((len(u), 3, 1))], axis=2).transpose(0, 2, 1)
    return np.linalg.solve(matrix, np.stack([u, v, 0 * u + 1], 1)[..., None])[..., 0].T


@settings(deadline=None, max_examples=40)
@given(st.integers(1, 12), st.integers(1, 12), st.integers(0, 99), st.integers(0, 9999))
def test_a_full_cover_answers_everywhere_once(rows, columns, seed, at):
    """Vertices, edges and the border included: one triangle, the lowest of those that cover the point."""
    uv, triangles = sheet(rows, columns, seed)
    random = np.random.default_rng(at)
    edges = uv[triangles[:, [0, 1]]]
    share = random.random((len(edges), 1))
    line = random.random(50)
    points = np.concatenate(
        [
            uv,
            edges[:, 0] + share * (edges[:, 1] - edges[:, 0]),
            random.random((50, 2)),
            np.stack([0 * line, line], 1),
            np.stack([0 * line + 1, line], 1),
            np.stack([line, 0 * line], 1),
            np.stack([line, 0 * line + 1], 1),
            [[0, 0], [1, 0], [0, 1], [1, 1]],
        ]
    )
    found = mesh(uv, triangles).chart.find(*points.T)
    assert (found.triangle >= 0).all()
    margin = brute_force(uv, triangles, *points.T)
    own = margin[found.triangle, np.arange(len(points))]
    assert own.min() > -1e-9
    lower = np.arange(len(triangles))[:, None] < found.triangle
    assert not (lower & (margin > 1e-9)).any()


def test_a_grid_and_its_triangles_agree_at_vertices_and_along_edges():
    random = np.random.default_rng(5)
    rows, columns = 4, 6
    uv, triangles = sheet(rows, columns)
    points = random.normal(size=(rows + 1, columns + 1, 3))
    grid, flat = Grid(points), mesh(uv, triangles, points.reshape(-1, 3))
    assert np.allclose(flat.evaluate(*uv.T).position, points.reshape(-1, 3).T, rtol=0, atol=ROUNDING)
    line = random.random(200)
    row, column = random.integers(0, (rows + 1, columns + 1), (200, 2)).T
    for u, v in ((line, row / rows), (column / columns, line)):
        assert np.allclose(flat.evaluate(u, v).position, grid.evaluate(u, v).position, rtol=0, atol=1e-11)
    # On a cell's diagonal the bilinear cell and the triangles differ by the twist, ¼ at the middle.
    middle = flat.evaluate((np.arange(columns) + 0.5) / columns, np.full(columns, 0.5 / rows)).position.T
    assert np.allclose(middle, (points[0, :-1] + points[1, 1:]) / 2, rtol=0, atol=ROUNDING)


def two_islands(gap):
    left, triangles = sheet(2, 3)
    half = left * (0.5 - gap / 2, 1.0)
    return joined((half, triangles), (half + np.array([0.5 + gap / 2, 0.0]), triangles))


def test_islands_are_tiles_and_a_gap_is_a_hole():
    gap = 1e-5
    uv, triangles = two_islands(gap)
    points = np.column_stack([uv, np.where(uv[:, 0] > 0.5, 7.0, 0.0)])
    sample = mesh(uv, triangles, points).evaluate(
        [0.1, 0.5 - gap / 2, 0.5 - gap / 4, 0.5, 0.5 + gap / 4, 0.5 + gap / 2, 0.9], np.full(7, 0.4)
    )
    assert sample.valid.tolist() == [True, True, False, False, False, True, True]
    assert sample.tile[sample.valid].tolist() == [0, 0, 1, 1]
    assert sample.position[2, sample.valid].tolist() == [0, 0, 7, 7]
    assert np.isfinite(sample.position).all()
    assert not sample.du[:, ~sample.valid].any() and not sample.dv[:, ~sample.valid].any()


def test_islands_that_touch_keep_their_own_points():
    uv, triangles = two_islands(0.0)
    surface = mesh(
        uv, triangles, np.column_stack([uv, np.where(np.arange(len(uv)) < len(uv) // 2, 0.0, 7.0)])
    )
    beyond = np.nextafter(0.5, 1.0)
    sample = surface.evaluate([np.nextafter(0.5, 0.0), beyond, 0.5 + EDGE_TOLERANCE / 4], np.full(3, 0.4))
    assert sample.tile.tolist() == [0, 1, 1] and sample.position[2].tolist() == [0, 7, 7]
    assert surface.evaluate([0.5], [0.4]).tile.tolist() == [0], "the lowest triangle's on a common edge"


@pytest.mark.parametrize("count", [1, 3, 17])
def test_islands_are_counted_however_the_triangles_lie(count):
    """Long strips, the triangles shuffled: the labels must travel far."""
    parts = []
    for k in range(count):
        uv, triangles = sheet(1, 200)
        parts.append((uv * (1.0, 0.5 / count) + (0.0, k / count), triangles))
    uv, triangles = joined(*parts)
    order = np.random.default_rng(0).permutation(len(triangles))
    islands = UVChart(uv[triangles][order], triangles[order]).islands
    strip = np.rint(np.floor(uv[triangles][order][:, :, 1].mean(axis=1) * count)).astype(int)
    assert len(np.unique(islands)) == count
    assert all(len(np.unique(islands[strip == k])) == 1 for k in range(count))
    first = [np.flatnonzero(islands == k)[0] for k in range(count)]
    assert first == sorted(first)


def test_a_seam_parts_a_mesh_whose_vertices_are_shared():
    """A strip of two quadrilaterals, sharing two vertices, with UVs apart: a cylinder's seam."""
    vertices = np.array([[0, 1, 3], [1, 4, 3], [1, 2, 4], [2, 5, 4]])
    flat = np.array([[0, 0], [0.5, 0], [1, 0], [0, 1], [0.5, 1], [1, 1.0]])
    uv = flat[vertices]
    assert UVChart(uv, vertices).islands.tolist() == [0, 0, 0, 0]
    uv[:2] -= (0.1, 0)
    assert UVChart(uv, vertices).islands.tolist() == [0, 0, 1, 1]


def test_of_overlapping_triangles_the_lowest_counts():
    uv, triangles = joined(sheet(1, 1), sheet(3, 3))
    for order, z in ((slice(None), 0.0), (slice(None, None, -1), 1.0)):
        surface = mesh(
            uv, triangles[order], np.column_stack([uv, np.where(np.arange(len(uv)) < 4, 0.0, 1.0)])
        )
        assert (surface.evaluate(*np.random.default_rng(1).random((2, 99))).position[2] == z).all()


def test_triangles_without_area_are_ignored():
    uv, triangles = sheet(2, 2)
    line = np.array([[0.0, 0.3], [1.0, 0.3], [0.5, 0.3 + 1e-8], [0.2, 0.2], [0.2, 0.2], [0.2, 0.2]])
    uv, triangles = joined((line, np.array([[0, 1, 2], [3, 4, 5]])), (uv, triangles))
    sample = mesh(uv, triangles).evaluate(np.linspace(0, 1, 11), np.full(11, 0.3))
    assert sample.valid.all()
    assert np.allclose(sample.du, [[1], [0], [0]]) and np.allclose(sample.dv, [[0], [1], [0]])
    assert not mesh(line, np.array([[0, 1, 2]])).evaluate([0.5, 0.2], [0.3, 0.2]).valid.any()


def test_edges_are_found_within_the_tolerance_and_no_farther():
    """A square from a float32 rounding inside of 0 to one inside of 1, cut into thin triangles."""
    uv, triangles = sheet(1, 300)
    inset = np.finfo(np.float32).eps
    surface = mesh(uv * (1 - 2 * inset) + inset, triangles)
    line = np.linspace(0, 1, 1001)
    for u, v in ((0 * line, line), (0 * line + 1, line), (line, 0 * line), (line, 0 * line + 1)):
        sample = surface.evaluate(u, v)
        assert sample.valid.all()
        assert np.allclose(sample.position[:2], [u, v], rtol=0, atol=1e-11), "continued"
    inner = mesh(uv * 0.5 + 0.25, triangles)
    offsets = np.array([-3, -1.5, -0.5, 0, 0.5]) * EDGE_TOLERANCE
    assert inner.evaluate(0.25 + offsets, np.full(5, 0.4)).valid.tolist() == [False, False, True, True, True]
    assert inner.evaluate(np.full(5, 0.4), 0.25 + offsets).valid.tolist() == [False, False, True, True, True]


def test_a_sharp_corner_reaches_no_farther_than_the_tolerance():
    uv = np.array([[0.2, 0.5], [0.8, 0.5], [0.8, 0.5 + 1e-5]])
    surface = mesh(uv, np.array([[0, 1, 2]]))
    assert surface.evaluate(
        [0.2, 0.2 - 0.5 * EDGE_TOLERANCE, 0.2 - 2 * EDGE_TOLERANCE], np.full(3, 0.5)
    ).valid.tolist() == [
        True,
        True,
        False,
    ]


def test_outside_of_the_square_is_nothing():
    uv, triangles = sheet(4, 4)
    surface = mesh(uv * 3 - 1, triangles)
    sample = surface.evaluate([-0.1, 0.5, 1.1, 0.5, 0.0, 1.0], [0.5, -0.1, 0.5, 1.1, 1.0, 0.0])
    assert sample.valid.tolist() == [False, False, False, False, True, True]
    away = mesh(uv + 1.5, triangles)
    assert not away.chart.used.any() and not away.evaluate([0.5, 1.0], [0.5, 1.0]).valid.any()


def test_mirrored_triangles_count_as_the_others():
    uv, triangles = sheet(3, 3, seed=2)
    u, v = np.random.default_rng(2).random((2, 200))
    there, back = (mesh(uv, t).evaluate(u, v) for t in (triangles, triangles[:, ::-1]))
    assert np.allclose(there.position, back.position, atol=ROUNDING) and np.allclose(there.du, back.du)


def test_a_fan_of_needles_needs_no_more_memory_than_a_sheet():
    """Every needle passes through many bins: the lists stay within their limit, and the answers right."""
    count = 5000
    angle = np.linspace(0, 2 * np.pi, count, endpoint=False)
    uv = np.vstack([[0.5, 0.5], 0.5 + 0.5 * np.stack([np.cos(angle), np.sin(angle)], 1)])
    triangles = np.stack([np.zeros(count, int), np.arange(count) + 1, (np.arange(count) + 1) % count + 1], 1)
    surface = mesh(uv, triangles)
    assert len(surface.chart.bins.entries) <= uv_bins.ENTRIES_PER_TRIANGLE * count
    r, turn = np.random.default_rng(3).random((2, 2000))
    u, v = 0.5 + 0.499 * r * np.cos(2 * np.pi * turn), 0.5 + 0.499 * r * np.sin(2 * np.pi * turn)
    sample = surface.evaluate(u, v)
    assert sample.valid.all() and np.allclose(sample.position[:2], [u, v], atol=ROUNDING)


def test_points_are_tested_in_blocks(monkeypatch):
    """Many more points and candidates than fit into a block, overlapping ones too, give the same answers."""
    uv, triangles = joined(sheet(6, 6, seed=4), sheet(3, 5, seed=5), sheet(1, 1))
    u, v = np.random.default_rng(4).uniform(-0.1, 1.1, (2, 500))
    whole = mesh(uv * 0.8, triangles).chart.find(u, v)
    monkeypatch.setattr(uv_chart, "BLOCK", 16)
    monkeypatch.setattr(uv_bins, "BLOCK", 16)
    again = mesh(uv * 0.8, triangles).chart.find(u, v)
    assert np.array_equal(whole.triangle, again.triangle) and np.array_equal(whole.weights, again.weights)


def test_a_placed_mesh_is_moved_and_shares_its_look_up():
    uv, triangles = sheet(2, 2)
    surface = mesh(uv, triangles)
    matrix = np.array([[0, -2.0, 0, 5], [1, 0, 0, 6], [0, 0, 1, 7], [0, 0, 0, 1]])
    moved = surface.transformed(matrix)
    assert moved.chart is surface.chart
    sample = moved.evaluate([0.25], [0.75])
    assert np.allclose(sample.position.T, [[5 - 1.5, 6.25, 7]])
    assert np.allclose(sample.du.T, [[0, 1, 0]]) and np.allclose(sample.dv.T, [[-2, 0, 0]])
    assert np.array_equal(moved.positions(np.array([0.25]), np.array([0.75])).position, sample.position)


@pytest.mark.parametrize(
    "bad",
    [
        lambda good: UVChart(np.zeros((0, 3, 2)), np.zeros((0, 3), int)),
        lambda good: UVChart(good.uv[:, :2], good.vertices),
        lambda good: UVChart(good.uv, good.vertices[:-1]),
        lambda good: UVChart(good.uv * np.nan, good.vertices),
        lambda good: UVMesh(np.zeros((0, 3)), good),
        lambda good: UVMesh(np.zeros((4, 2)), good),
        lambda good: UVMesh(np.zeros((good.vertices.max(), 3)), good),
    ],
)
def test_bad_arrays_are_refused(bad):
    uv, triangles = sheet(2, 2)
    with pytest.raises(ValueError, match="UV"):
        bad(UVChart(uv[triangles], triangles))


def test_the_default_is_half_a_square():
    assert UVMesh().evaluate([0.25, 0.75], [0.25, 0.75]).valid.tolist() == [True, False]


def test_drawn_lines_leave_out_holes_and_lead_from_no_island_to_another():
    """Two islands 5 apart in depth: every drawn segment lies on one, none in the gap."""
    uv, triangles = two_islands(0.2)
    near = mesh(uv, triangles, np.column_stack([uv, np.where(uv[:, 0] > 0.5, 5.0, 0.0)]))
    back = np.eye(4)
    back[2, 3] = -3.0
    lines = diagram(
        Projection(ViewingVolume((near, near.transformed(back)))), DiagramOptions(11, 3, folds=False)
    )
    # 11 × 3 projectors, those at u = 0.5 in the gap, at 0.4 and 0.6 on its borders.
    assert len(lines["PROJECTOR"]) == 10 * 3
    for role in ("SURFACE", "FRAME"):
        assert len(lines[role]) and not np.ptp(lines[role][:, :, 2], axis=1).any()
        x = lines[role][:, :, 0]
        assert ((x < 0.4 + 1e-6) | (x > 0.6 - 1e-6)).all()
    touching = mesh(*two_islands(0.0), near.points)
    lines = diagram(Projection(ViewingVolume((touching, touching))), DiagramOptions(11, 3, folds=False))
    for role in ("SURFACE", "FRAME"):
        assert len(lines[role]) and not np.ptp(lines[role][:, :, 2], axis=1).any()


def test_the_drawing_notices_moved_points_and_moved_uvs():
    uv, triangles = sheet(2, 2)
    moved = uv.copy()
    moved[4] += 0.1
    points = np.column_stack([uv, np.zeros(len(uv))])
    volumes = [(mesh(uv, triangles), Grid()), (mesh(uv, triangles, points + 1), Grid())]
    volumes += [(mesh(moved, triangles, points), Grid()), (mesh(uv, triangles[::-1]), Grid())]
    signatures = [volume_signature(Projection(ViewingVolume(v))) for v in volumes]
    assert len(set(signatures)) == 4
    again = mesh(uv.copy(), triangles.copy())
    assert again.chart.find(*uv.T).triangle.min() >= 0, "what is kept for look-ups makes no difference"
    assert volume_signature(Projection(ViewingVolume((again, Grid())))) == signatures[0]
