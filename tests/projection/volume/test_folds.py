# SPDX-License-Identifier: GPL-3.0-or-later
"""Folds: found where a closed form says, and nowhere else, whatever float32 does to the parameters."""

import pathlib
from dataclasses import fields, replace

import numpy as np
import pytest

from scfpf_addon.projection.diagrams.diagram import DiagramOptions, diagram
from scfpf_addon.projection.diagrams.projector_lines import (
    FOLD_PIECES,
    parted_projector_lines,
    projector_lines,
)
from scfpf_addon.projection.presets.preset import read_preset
from scfpf_addon.projection.surfaces.surface import Cylinder, Disc, Grid, Plane, Point, SphereSector
from scfpf_addon.projection.volume.bezier import bernstein
from scfpf_addon.projection.volume.folds import (
    FOLD_GRID,
    determinant_controls,
    find_folds,
    folded_pieces,
    orientations,
)
from scfpf_addon.projection.volume.reparameterisation import Polar
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume, determinant

FOLDER = pathlib.Path(__file__).resolve().parents[3] / "presets"
# The epipolar plane image has a plane for a volume: neither orientation nor inverse.
PRESETS = sorted(set(FOLDER.glob("*.json")) - {FOLDER / "epi.json"})


def placed(z):
    matrix = np.eye(4)
    matrix[2, 3] = z
    return matrix


def planes(*sizes, basis="BEZIER"):
    """Parallel planes of (width, height), one unit apart along -Z; negative sizes are mirrored."""
    surfaces = tuple(Plane(width, height, matrix=placed(-i)) for i, (width, height) in enumerate(sizes))
    return Projection(ViewingVolume(surfaces, basis))


def as_float32(value):
    return np.float32(value).astype(np.float64) if isinstance(value, float | np.ndarray) else value


def in_float32(projection):
    """Every parameter as Blender stores it."""
    surfaces = tuple(
        replace(s, **{f.name: as_float32(getattr(s, f.name)) for f in fields(s)})
        for s in projection.volume.surfaces
    )
    return replace(projection, volume=replace(projection.volume, surfaces=surfaces))


def moved(projection):
    """In another place, turned and mirrored: none of it is a fold."""
    turn = np.linalg.qr(np.random.default_rng(4).normal(size=(3, 3)))[0]
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = turn @ np.diag([1, -1, 1]), (100, -3000, 7)
    return projection.transformed(matrix)


@pytest.mark.parametrize("path", PRESETS, ids=lambda path: path.stem)
@pytest.mark.parametrize("aspect", [1.0, 1.7778, 0.4])
def test_no_preset_folds_in_float32(path, aspect):
    projection = in_float32(read_preset(path).projection(aspect))
    for same in (projection, moved(projection), moved(in_float32(projection))):
        assert not find_folds(same)
        assert not len(parted_projector_lines(same, 9, 9)[1])


@pytest.mark.parametrize(
    "sizes, share",
    [
        ([(1, 1), (2, 2)], 0),
        ([(-1, 1), (-2, 2)], 0),
        ([(1, 1), (-1, -1)], 0),
        ([(1, 1), (-1, 1)], 1 / 2),
        ([(1, 1), (3, 3), (1, -0.5)], 1 - (4 + 38**0.5) / 11),
        ([(1, 1), (1, -2), (1, -2), (1, 1)], 1 - 5**0.5 / 3),
    ],
    ids=["frustum", "mirrored", "through a point", "through a line", "turned over at the far end", "cubic"],
)
def test_share_of_parallel_planes(sizes, share):
    """Width and height are polynomials of t: the fold is where their product has the rarer sign."""
    folds = find_folds(planes(*sizes))
    assert bool(folds) == (share > 0)
    assert folds.share == pytest.approx(share, abs=1 / FOLD_GRID)
    t = np.linspace(0, 1, 20001)
    volume = planes(*sizes).volume
    weights, _ = volume.spans.weights(t)
    area = (np.array(sizes).T @ weights).prod(axis=0)
    negative = (area < 0).mean()
    assert min(negative, 1 - negative) == pytest.approx(share, abs=1e-3)
    # The samples named are where the sign is the rarer one.
    depth = np.interp(-folds.positions[2] / (len(sizes) - 1), t, area)
    rarer = -1 if negative < 0.5 else 1
    assert (np.sign(depth) == rarer).all() or share == 0.5


@pytest.mark.parametrize("shift", [-4e-8, 0.0, 4e-8])
def test_a_pole_beside_its_place_is_no_fold(shift):
    spheres = tuple(SphereSector(radius, 2 * np.pi, np.pi / 2 + shift, 0.0) for radius in (0.1, 100.0))
    assert not find_folds(Projection(ViewingVolume(spheres), Polar()))


def test_points_discs_and_thin_cylinders_are_no_folds():
    discs = (Disc(0.0, matrix=placed(0)), Disc(1.0, matrix=placed(-1)))
    assert not find_folds(Projection(ViewingVolume(discs), Polar()))
    assert not find_folds(Projection(ViewingVolume((Point(), Plane(matrix=placed(-1))))))
    assert not find_folds(Projection(ViewingVolume((Cylinder(1e-3), Cylinder(5.0, height=4.0)))))
    nothing = find_folds(Projection(ViewingVolume((Point(), Point()))))
    assert not nothing and nothing.orientation == 0 and nothing.positions.shape == (3, 0)


def test_a_polar_image_of_a_folded_volume_folds():
    """Radii 1, -2, 1 at t = 0, ½, 1: the radius is negative in between, the area's square is not."""
    discs = tuple(Disc(1.0, arc, matrix=placed(-i)) for i, arc in enumerate((2.0, -4.0, 2.0)))
    folds = find_folds(Projection(ViewingVolume(discs), Polar()))
    assert 0.3 < folds.share < 0.5


def test_a_fold_of_a_grid_is_where_its_columns_run_back():
    columns = np.array([0.0, 2.0, 1.0, 3.0])
    points = np.stack(np.broadcast_arrays(columns, np.arange(2.0)[:, None], -1.0), axis=-1)
    near = Grid(points, matrix=placed(0))
    folds = find_folds(Projection(ViewingVolume((near, replace(near, matrix=placed(-5))))))
    assert folds.share == pytest.approx(1 / 3, abs=1 / FOLD_GRID)
    assert folds.positions[0].min() >= 1 and folds.positions[0].max() <= 2


@pytest.mark.parametrize("basis", ["BEZIER", "POLYLINE"])
def test_drawn_pieces_of_projectors_part_where_the_height_changes_its_sign(basis):
    projection = planes((1, 1), (1, 1), (1, -0.5), basis=basis)
    good, folded, _ = parted_projector_lines(projection, 3, 2)
    t = np.linspace(0, 1, 20001)
    height = np.array([1, 1, -0.5]) @ projection.volume.spans.weights(t)[0]
    crossing = 2 * t[np.argmax(height < 0)]
    assert len(folded) and -folded[..., 2].max() >= crossing - 2 / FOLD_PIECES
    assert -good[..., 2].min() <= crossing + 2 / FOLD_PIECES

    def length(lines):
        return np.linalg.norm(np.diff(lines.astype(float), axis=1), axis=2).sum()

    assert length(good) + length(folded) == pytest.approx(
        length(projector_lines(projection, 3, 2, 200)), rel=1e-3
    )


def test_without_folds_the_lines_are_those_of_projector_lines():
    projection = planes((1, 1), (3, 2), (4, 4))
    good, folded, dashes = parted_projector_lines(projection, 4, 3)
    assert np.array_equal(good, projector_lines(projection, 4, 3)) and folded.shape == (0, 2, 3)
    assert dashes.shape == (0, 2, 3)


WEIGHTS = (1.0, 4.0, 0.5, 2.0, 1.0, 3.0)


def random_volume(seed, count, basis):
    """Planes, spheres, cones and grids in random places, so that about half of the volumes fold."""
    random = np.random.default_rng(seed)
    surfaces = []
    for index in range(count):
        matrix = placed(-2.0 * index)
        matrix[:3, :3] += random.normal(scale=0.4, size=(3, 3))
        shapes = (
            Plane(*random.uniform(0.5, 3, 2), matrix=matrix),
            SphereSector(random.uniform(0.5, 3), 2.0, -0.8, 0.8, matrix=matrix),
            Grid(random.normal(size=(3, 4, 3)), matrix=matrix),
        )
        surfaces.append(shapes[random.integers(3)])
    return ViewingVolume(tuple(surfaces), basis)


@pytest.mark.parametrize("basis", ["BEZIER", "POLYLINE", "B_SPLINE", "SMOOTH"])
@pytest.mark.parametrize("count", [2, 3, 4, 6])
@pytest.mark.parametrize("seed", range(6))
def test_the_quick_way_finds_the_same_folded_pieces(seed, count, basis):
    volume = random_volume(seed, count, basis)
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 12), np.linspace(0, 1, 11)))
    controls = volume.controls(u, v)
    t = (np.arange(FOLD_PIECES) + 0.5) / FOLD_PIECES
    signs = orientations(volume, controls, t)
    for orientation in (-1, 0, 1):
        found = folded_pieces(volume, controls, t, orientation)
        assert np.array_equal(found, (signs == -orientation) & (orientation != 0))


@pytest.mark.parametrize("count", [2, 3, 4, 6])
@pytest.mark.parametrize("seed", range(6))
def test_rational_projectors_have_the_same_folded_pieces(seed, count):
    volume = replace(random_volume(seed, count, "NURBS"), weights=WEIGHTS[:count])
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 12), np.linspace(0, 1, 11)))
    controls = volume.controls(u, v)
    t = (np.arange(FOLD_PIECES) + 0.5) / FOLD_PIECES
    signs = orientations(volume, controls, t)
    for orientation in (-1, 1):
        assert np.array_equal(folded_pieces(volume, controls, t, orientation), signs == -orientation)


@pytest.mark.parametrize("path", PRESETS, ids=lambda path: path.stem)
def test_the_quick_way_finds_the_same_in_presets(path):
    volume = in_float32(read_preset(path).projection(1.5)).volume
    u, v = (a.ravel() for a in np.meshgrid(np.linspace(0, 1, 32), np.linspace(0, 1, 32)))
    controls = volume.controls(u, v)
    t = (np.arange(FOLD_PIECES) + 0.5) / FOLD_PIECES
    signs = orientations(volume, controls, t)
    for orientation in (-1, 1):
        assert np.array_equal(folded_pieces(volume, controls, t, orientation), signs == -orientation)


@pytest.mark.parametrize("basis", ["BEZIER", "POLYLINE", "B_SPLINE", "NURBS", "SMOOTH"])
def test_the_determinant_in_bernstein_form_is_the_determinant(basis):
    volume = random_volume(3, 5, basis)
    if basis == "NURBS":
        volume = replace(volume, weights=WEIGHTS[:5])
    u, v, t = np.random.default_rng(1).uniform(size=(3, 50))
    coefficients = determinant_controls(volume, volume.controls(u, v))
    span, start, length = volume.spans.locate(t)
    weights = bernstein(coefficients.shape[1] - 1, (t - start) / length)
    found = np.einsum("kn,kn->n", weights, coefficients[span, :, np.arange(50)].T)
    expected = determinant(volume.evaluate(u, v, t))
    if basis == "NURBS":
        local = bernstein(volume.spans.degree, (t - start) / length)
        expected = expected * np.einsum("kn,nk->n", local, volume.spans.point_weights[span]) ** 4
    assert np.allclose(found, expected, rtol=1e-11, atol=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize("path", PRESETS, ids=lambda path: path.stem)
@pytest.mark.parametrize("flip", [(1, 1, 1), (-1, 1, 1), (1, -1, 1), (-1, -1, 1)])
def test_a_volume_in_a_mirror_has_a_mirrored_image(path, flip):
    """Polar images too, whose u and v have the other handedness."""
    found = find_folds(read_preset(path).projection(1.5).transformed(np.diag([*map(float, flip), 1.0])))
    assert found.share == 0
    assert found.mirrored == (np.prod(flip) < 0)


def wavy(columns, folds_at, width):
    """Two grids far apart whose columns run back in narrow strips about some places of u alone."""
    u = np.linspace(0.0, 1.0, columns + 1)
    x = u - sum(4 * (u - at) * np.exp(-(((u - at) / width) ** 2)) for at in folds_at)
    v = np.array([0.0, 0.5, 1.0])
    points = np.stack(np.broadcast_arrays(x - 0.5, v[:, None] - 0.5, -1.0), axis=-1)
    near = Grid(points, matrix=placed(0))
    return Projection(ViewingVolume((near, replace(near, matrix=placed(-5)))))


@pytest.mark.parametrize("columns", [32, 40, 64])
def test_folds_between_the_drawn_projectors_are_drawn(columns):
    """No drawn projector is folded; dashes are where the columns run back, as many as the report has."""
    projection = wavy(columns, (0.16,), 0.05)
    folds = find_folds(projection)
    lines = diagram(projection, DiagramOptions(5, 5))
    assert 0.01 < folds.share < 0.2 and not len(lines["FOLD"])
    dashes = lines["FOLDED"].astype(np.float64)
    assert len(dashes) == 2 * round(folds.share * FOLD_GRID**3)
    x = projection.volume.surfaces[0].points[0, :, 0]
    back = [(low, high) for low, high in zip(x[1:], x[:-1], strict=True) if low < high]
    inside = [any(low - 1e-6 <= one <= high + 1e-6 for low, high in back) for one in dashes[..., 0].ravel()]
    assert all(inside)


@pytest.mark.parametrize("columns", [16, 32])
def test_a_symmetric_fold_is_drawn_symmetric(columns):
    """One column is folded at either side, which ends at a projector and, of 32, where the report looks."""
    middle = 0.25 - 0.5 / columns
    lines = diagram(wavy(columns, (middle, 1.0 - middle), 0.48 / columns), DiagramOptions(5, 5))
    for role in ("FOLD", "FOLDED"):
        found = np.sort(lines[role][..., 0].astype(np.float64).ravel())
        assert len(found) and found == pytest.approx(-found[::-1], abs=1e-6), role
