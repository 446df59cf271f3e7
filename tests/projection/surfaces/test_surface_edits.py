# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces with more points, evenly spaced, backwards, and as patches: what must stay the same does."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scfpf_addon.projection.editing.nurbs_edits import patch_near, refined, reversing
from scfpf_addon.projection.editing.respacing import EVEN, equalised, unevenness
from scfpf_addon.projection.surfaces.nurbs import NurbsAxis, NurbsPatch
from scfpf_addon.projection.surfaces.surface import BilinearPatch, Cylinder, Disc, Grid, Plane, SphereSector
from scfpf_addon.projection.surfaces.uv_chart import UVChart
from scfpf_addon.projection.surfaces.uv_mesh import UVMesh
from scfpf_addon.projection.user_error import UserError
from scfpf_addon.projection.volume.lattice import Lattice

U, V = np.random.default_rng(4).random((2, 400))
# Coordinates are near 1; least squares over some ten basis functions.
ROUNDING = 1e-11
axes = st.builds(NurbsAxis, st.integers(2, 5), *[st.booleans()] * 3)


def bumpy_patch(rows, columns, along_u, along_v, seed=0):
    rng = np.random.default_rng(seed)
    return NurbsPatch(
        np.concatenate([rng.normal(size=(rows, columns, 3)), rng.uniform(0.5, 2, (rows, columns, 1))], 2),
        along_u,
        along_v,
    )


@settings(max_examples=60)
@given(axes, st.integers(2, 8), st.integers(0, 99))
def test_a_refined_patch_is_the_same(axis, count, seed):
    if axis.problem(count):
        return
    patch = bumpy_patch(4, count, axis, NurbsAxis(3), seed)
    try:
        finer = refined(patch, True, True)
    except UserError:
        # Only the unusual knots, whose ends are no whole pieces, have no finer ones.
        assert axis.bezier
        return
    assert finer.points.shape[0] > 4 and finer.points.shape[1] > count
    assert np.abs(finer.evaluate(U, V).position - patch.evaluate(U, V).position).max() < ROUNDING


@pytest.mark.parametrize(("endpoint", "bezier", "cyclic"), [(1, 0, 0), (0, 0, 0), (0, 0, 1), (1, 1, 0)])
@pytest.mark.parametrize("order", [2, 3, 4, 5])
def test_common_axes_have_finer_ones_with_twice_the_pieces(order, endpoint, bezier, cyclic):
    axis = NurbsAxis(order, bool(endpoint), bool(bezier), bool(cyclic))
    count = 2 * (order - 1) + 1 if bezier else 6
    finer = refined(bumpy_patch(4, count, axis, NurbsAxis(4)), True, False)
    pieces = count if cyclic else (count - 1) // (order - 1) if bezier else count - order + 1
    now = finer.points.shape[1]
    pieces_now = now if cyclic else (now - 1) // (order - 1) if bezier else now - order + 1
    assert pieces_now == 2 * pieces
    assert finer.points.shape[0] == 4


def test_reversed_control_points_run_backwards():
    refused = 0
    for flags, order in itertools.product(itertools.product((False, True), repeat=3), (2, 3, 4, 5)):
        axis = NurbsAxis(order, *flags)
        for count in (order, 2 * order - 1, 2 * order + 2):
            if axis.problem(count):
                continue
            patch = bumpy_patch(4, count, axis, NurbsAxis(3))
            try:
                places = reversing(axis, count)
            except UserError:
                refused += 1
                assert axis.bezier or (axis.endpoint and axis.cyclic)
                continue
            back = NurbsPatch(patch.points[:, places], axis, NurbsAxis(3))
            gap = back.evaluate(U, V).position - patch.evaluate(1 - U, V).position
            assert np.abs(gap).max() < ROUNDING
    assert refused < 30


@pytest.mark.parametrize(
    ("surface", "error"),
    [
        (Plane(width=3.0, height=2.0), ROUNDING),
        (BilinearPatch(np.random.default_rng(1).normal(size=(4, 3))), ROUNDING),
        (Grid(np.random.default_rng(2).normal(size=(4, 5, 3))), ROUNDING),
        (Cylinder(arc=np.pi), 1e-4),
        (Disc(arc=np.pi), 1e-4),
        (SphereSector(arc=np.pi), 1e-4),
    ],
)
def test_a_patch_near_a_surface(surface, error):
    u, v = np.linspace(0, 1, 97), np.random.default_rng(3).random(97)
    patch = patch_near(surface, 12, 12)
    assert np.abs(patch.evaluate(u, v).position - surface.evaluate(u, v).position).max() < error


def test_a_finer_patch_is_nearer_by_the_fourth_power():
    surface = SphereSector(arc=np.pi)
    errors = [
        np.abs(patch_near(surface, n, n).evaluate(U, V).position - surface.evaluate(U, V).position).max()
        for n in (11, 19)
    ]
    assert errors[0] / errors[1] > 2**3.5


def parabola(columns=9, rows=5):
    """Flat, with u² and v³ along X and Y: as uneven as can be."""
    u, v = np.meshgrid(np.linspace(0, 1, columns) ** 2, np.linspace(0, 1, rows) ** 3)
    return np.stack([u, v, np.zeros_like(u)], 2)


@pytest.mark.parametrize("along", [(True, False), (False, True), (True, True)])
@pytest.mark.parametrize("kind", ["grid", "sphere", "nurbs", "patch"])
def test_steps_are_even_and_the_shape_is_kept(along, kind):
    surface = {
        "grid": Grid(parabola()),
        "sphere": SphereSector(2.0, np.pi, -1.0, 1.0),
        "nurbs": NurbsPatch(np.pad(parabola(6, 6), ((0, 0), (0, 0), (0, 1)), constant_values=1.0)),
        "patch": BilinearPatch(np.array([[0.0, 0, 0], [3, 0, 0], [0, 1, 0], [1, 2, 0]])),
    }[kind]
    points, left = equalised(surface, 33, 17, *along)
    for axis, asked in ((1, along[0]), (0, along[1])):
        if asked:
            assert unevenness(points, axis) <= left <= EVEN
    if kind == "sphere":
        assert np.allclose(np.linalg.norm(points, axis=2), 2.0)
    else:
        assert np.abs(points[..., 2]).max() == 0
    # The corners, and so the sheet, stay.
    u, v = np.array([0.0, 1, 0, 1]), np.array([0.0, 0, 1, 1])
    corners = points[[0, 0, -1, -1], [0, -1, 0, -1]]
    assert np.allclose(corners, surface.evaluate(u, v).position.T, atol=1e-12)


def test_one_direction_leaves_its_lines_in_place():
    points, _ = equalised(Grid(parabola()), 9, 5, True, False)
    assert np.allclose(points[..., 1], parabola()[..., 1], atol=1e-12)
    assert np.allclose(points[..., 0], np.linspace(0, 1, 9), atol=1e-4)


def test_a_pole_keeps_its_point():
    points, left = equalised(SphereSector(1.0, np.pi, 0.0, np.pi / 2), 17, 9, True, True)
    assert left <= EVEN
    assert np.allclose(points[-1], (0, 1, 0), atol=1e-9)


def test_holes_are_refused():
    corners = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0]])
    half = UVMesh(corners, UVChart(corners[None, :, :2], np.array([[0, 1, 2]])))
    with pytest.raises(UserError, match="holes"):
        equalised(half, 9, 9, True, True)
    with pytest.raises(UserError, match="holes"):
        patch_near(half, 4, 4)


@pytest.mark.parametrize("kind", ["LINEAR", "CARDINAL", "CATMULL_ROM", "BSPLINE"])
def test_a_lattice_through_points(kind):
    points = np.random.default_rng(6).normal(size=(3, 4, 5, 3))
    lattice = Lattice.through(points, (kind,) * 3)
    w, v, u = np.meshgrid(*(np.linspace(0, 1, n) for n in (3, 4, 5)), indexing="ij")
    volume = lattice.volume(np.eye(4))
    got = volume.evaluate(u.ravel(), v.ravel(), 1 - w.ravel()).position.T
    assert np.abs(got - points.reshape(-1, 3)).max() < ROUNDING
    if kind != "BSPLINE":
        assert np.allclose(lattice.points, points)
