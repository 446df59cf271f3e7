# SPDX-License-Identifier: GPL-3.0-or-later
"""Edits of a volume against their definitions: what stays the same, what changes sign, what lies inside."""

import numpy as np
import pytest

from scfpf_addon.projection.editing import volume_edits
from scfpf_addon.projection.surfaces.kinds import surface_from_parameters
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
from scfpf_addon.projection.volume.inverse import invert
from scfpf_addon.projection.volume.viewing_volume import ViewingVolume, determinant

RANDOM = np.random.default_rng(5)
U, V, T = RANDOM.random((3, 400))


def moved(x=0.0, y=0.0, z=0.0, turn=0.0):
    matrix = np.eye(4)
    matrix[:2, :2] = [[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]]
    matrix[:3, 3] = x, y, z
    return matrix


def grid(rows, columns, z):
    u, v = np.meshgrid(np.linspace(-1, 1, columns), np.linspace(-1, 1, rows))
    points = np.stack([u, v, np.full_like(u, z)], 2)
    return Grid(points + RANDOM.normal(size=points.shape) / 10)


def surface(shape):
    return surface_from_parameters(shape.kind, shape.parameters, shape.points, shape.matrix)


def elevated(surfaces, cells=64):
    shapes = volume_edits.inserted(ViewingVolume(tuple(surfaces)), 0, cells).shapes
    inner = tuple(surface(shape) for shape in shapes)
    return ViewingVolume((surfaces[0], *inner, surfaces[-1])), shapes


VOLUMES = {
    "frustum": (Plane(2, 1, matrix=moved(z=-1)), Plane(20, 10, matrix=moved(z=-10))),
    "pinhole": (Point(matrix=moved(x=0.2)), Plane(4, 3, matrix=moved(z=-5, turn=0.3))),
    "twist": (
        Plane(4, 4, matrix=moved(z=-2)),
        Plane(4, 4, matrix=moved(z=-12, turn=1.5)),
        Plane(4, 4, matrix=moved(z=-22)),
    ),
    "patches": (BilinearPatch(RANDOM.normal(size=(4, 3))), BilinearPatch(RANDOM.normal(size=(4, 3)) - 5)),
    "cylinders": (Cylinder(1, 4, 1), Cylinder(5, 4, 6, matrix=moved(z=0.5)), Cylinder(30, 4, 40)),
    "cones": (Cone(1, 2, 3, 1), Cone(5, 4, 3, 6, matrix=moved(y=0.5))),
    "spheres": (SphereSector(1, 3, -1, 1), SphereSector(9, 3, -1, 1)),
    "discs": (Disc(1, 6), Disc(3, 6, matrix=moved(z=-3))),
    "grids": (grid(3, 5, -1), grid(4, 3, -4), grid(2, 2, -9)),
    "grid_and_plane": (Plane(2, 2), grid(6, 4, -5)),
}
KINDS = {"frustum": "PLANE", "cylinders": "CYLINDER", "cones": "CONE", "spheres": "SPHERE", "discs": "DISC"}


@pytest.mark.parametrize("name", VOLUMES)
def test_elevated_volume_is_the_same(name):
    surfaces = VOLUMES[name]
    volume, shapes = elevated(surfaces)
    assert len(volume.surfaces) == len(surfaces) + 1 and all(shape.exact for shape in shapes)
    if name in KINDS:
        assert {shape.kind for shape in shapes} == {KINDS[name]}
    exact, found = ViewingVolume(surfaces).evaluate(U, V, T), volume.evaluate(U, V, T)
    for before, after in zip(exact, found, strict=True):
        assert np.abs(before - after).max() < 1e-12 * np.abs(before).max()


@pytest.mark.parametrize("basis", ["BEZIER", "B_SPLINE", "NURBS"])
@pytest.mark.parametrize("count", [2, 3, 4])
def test_a_volume_with_a_surface_inserted_is_the_same(basis, count):
    surfaces = tuple(grid(3, 4, -2.0 * i) for i in range(count))
    weights = (0.5, 3.0, 0.2, 7.0)[:count] if basis == "NURBS" else None
    volume = ViewingVolume(surfaces, basis, weights)
    found = volume_edits.inserted(volume, 0, 64)
    assert (found.first, found.replaced) == (1, count - 2) and all(shape.exact for shape in found.shapes)
    inner = tuple(surface(shape) for shape in found.shapes)
    after = ViewingVolume((surfaces[0], *inner, surfaces[-1]), basis, found.weights)
    assert len(after.surfaces) == count + 1
    for one, other in zip(volume.evaluate(U, V, T), after.evaluate(U, V, T), strict=True):
        assert np.abs(one - other).max() < 1e-12 * np.abs(one).max()


@pytest.mark.parametrize("basis", ["B_SPLINE", "NURBS"])
def test_where_knots_allow_no_further_surface_that_is_said(basis):
    volume = ViewingVolume(tuple(grid(3, 4, -2.0 * i) for i in range(5)), basis)
    with pytest.raises(volume_edits.UserError, match="more than four surfaces"):
        volume_edits.inserted(volume, 0, 64)


@pytest.mark.parametrize(
    "surfaces",
    [
        (Plane(2, 1, matrix=moved(z=-1)), Cylinder(10, 3, 5)),
        (Cylinder(1, 2, 1), Cylinder(10, 3, 5)),
        (SphereSector(1, 3, -1, 1), SphereSector(9, 3, -1, 1, matrix=moved(turn=0.3))),
        (grid(3, 3, -1), Disc(4, 3)),
    ],
)
def test_elevation_of_mixed_kinds_is_sampled_and_converges(surfaces):
    exact = ViewingVolume(surfaces).evaluate(U, V, T).position
    deviations = []
    for cells in (32, 64):
        volume, shapes = elevated(surfaces, cells)
        assert [shape.kind for shape in shapes] == ["GRID"] and not shapes[0].exact
        deviations.append(np.abs(volume.evaluate(U, V, T).position - exact).max())
    assert 0 < deviations[1] < 0.3 * deviations[0] < 3e-3, deviations


def test_a_sheared_matrix_is_not_kept_for_an_object_that_cannot_hold_it():
    shear = np.eye(4)
    shear[0, 1] = 0.5
    shape = volume_edits.blend(Cylinder(1, 2, 1, matrix=shear), Cylinder(2, 2, 1, matrix=shear), 0.5, 16)
    assert shape.kind == "GRID" and not shape.exact


class Holed(Plane):
    """A plane without its left half."""

    def local(self, u, v):
        return super().local(u, v)._replace(valid=u > 0.5)


def test_a_surface_with_holes_is_no_grid():
    with pytest.raises(volume_edits.UserError, match="holes"):
        volume_edits.sampled(Holed(), 5, 5)


PARAMETERS = {
    "POINT": {},
    "PLANE": {"width": 2.0, "height": 3.0},
    "DISC": {"radius": 2.0, "arc": 4.0},
    "CYLINDER": {"radius": 2.0, "arc": 4.0, "height": 3.0},
    "CONE": {"radius_start": 2.0, "radius_end": 1.0, "arc": 4.0, "height": 3.0},
    "SPHERE": {"radius": 2.0, "arc": 4.0, "latitude_start": -0.5, "latitude_end": 1.0},
    "PARABOLOID": {"radius": 2.0, "arc": 4.0, "depth": 1.5},
}


@pytest.mark.parametrize("axis", "UV")
@pytest.mark.parametrize("kind", PARAMETERS)
def test_mirrored_surface_answers_at_the_mirrored_parameter(kind, axis):
    placement = moved(1, 2, 3, 0.4)
    if kind in {"DISC", "PARABOLOID"} and axis == "V":
        with pytest.raises(volume_edits.UserError, match="grid"):
            volume_edits.mirrored(kind, PARAMETERS[kind], axis)
        return
    matrix, parameters = volume_edits.mirrored(kind, PARAMETERS[kind], axis)
    after = surface_from_parameters(kind, parameters, None, placement @ matrix).evaluate(U, V)
    mirrored = (1 - U, V) if axis == "U" else (U, 1 - V)
    before = surface_from_parameters(kind, PARAMETERS[kind], None, placement).evaluate(*mirrored)
    assert np.allclose(after.position, before.position, atol=1e-13)


def test_mirroring_changes_the_determinants_sign():
    near, far = VOLUMES["frustum"]
    before = determinant(ViewingVolume((near, far)).evaluate(U, V, T))
    flipped = [
        Plane(one.width, one.height, matrix=one.matrix @ volume_edits.mirrored("PLANE", {}, "U")[0])
        for one in (near, far)
    ]
    assert np.allclose(determinant(ViewingVolume(tuple(flipped)).evaluate(1 - U, V, T)), -before)
    assert (before < 0).all()


@pytest.mark.parametrize(
    ("amounts", "point", "expected"),
    [
        ((np.pi / 2, 0, 0, 0, 1), (0, 0, -1), (1, 0, 0)),
        ((0, np.pi / 2, 0, 0, 1), (0, 0, -1), (0, 1, 0)),
        ((0, 0, np.pi / 2, 0, 1), (1, 0, -1), (0, 1, -1)),
        ((0, 0, 0, 2, 1), (1, 1, -1), (1, 1, -3)),
        ((0, 0, 0, 0, 2), (1, 1, -1), (0.5, 0.5, -1)),
    ],
    ids=["pan", "tilt", "roll", "dolly", "zoom"],
)
def test_framing_moves_the_view_as_named(amounts, point, expected):
    assert np.allclose(volume_edits.framing(*amounts) @ (*point, 1), (*expected, 1), atol=1e-15)


@pytest.mark.parametrize("name", ["frustum", "pinhole", "twist", "cylinders", "spheres"])
def test_what_lies_inside_is_found(name):
    volume = ViewingVolume(VOLUMES[name])
    inner = 0.02 + 0.96 * RANDOM.random((3, 60))
    assert invert(volume, volume.evaluate(*inner).position).found.all()
    outside = volume.evaluate(U[:40], V[:40], np.full(40, 1.05)).position
    assert not invert(volume, outside).found.any()


@pytest.mark.parametrize("weights", [(1.0, 2.0, 0.5), (1.0, 10.0, 0.1), (30.0, 1.0, 0.1), (0.02, 1.0, 40.0)])
def test_what_lies_inside_a_weighted_volume_is_found(weights):
    volume = ViewingVolume(VOLUMES["cylinders"], "NURBS", weights)
    inner = 0.02 + 0.96 * RANDOM.random((3, 60))
    assert invert(volume, volume.evaluate(*inner).position).found.all()
    outside = ViewingVolume(VOLUMES["cylinders"]).evaluate(U[:40], V[:40], np.full(40, 1.05)).position
    assert not invert(volume, outside).found.any()


@pytest.mark.parametrize(
    ("kind", "parameters", "scale", "expected"),
    [
        ("PLANE", {"width": 2.0, "height": 3.0}, (2, -3, 5), {"width": 4.0, "height": 9.0}),
        ("DISC", {"radius": 2.0, "arc": 1.0}, (3, -3, 7), {"radius": 6.0, "arc": 1.0}),
        (
            "CYLINDER",
            {"radius": 2.0, "arc": 1.0, "height": 1.0},
            (3, 2, 3),
            {"radius": 6.0, "arc": 1.0, "height": 2.0},
        ),
        ("SPHERE", {"radius": 2.0}, (0.5, 0.5, 0.5), {"radius": 1.0}),
        ("POINT", {}, (1, 2, 3), {}),
    ],
)
def test_a_scale_goes_into_the_sizes(kind, parameters, scale, expected):
    assert volume_edits.scaled(kind, parameters, scale) == expected


@pytest.mark.parametrize(
    ("kind", "scale", "said"),
    [
        ("GRID", (1, 1, 1), "no sizes"),
        ("SPHERE", (1, 1, 0), "scale is 0"),
        ("DISC", (1, 2, 1), "no longer round"),
    ],
)
def test_a_scale_that_no_size_can_take_is_refused(kind, scale, said):
    with pytest.raises(volume_edits.UserError, match=said):
        volume_edits.scaled(kind, {"radius": 1.0}, scale)


def test_grids_are_blended_on_the_lines_of_both():
    """Of 3 and 4 columns the least common lines are 7: the blend is exact between them."""
    first, second = grid(3, 3, 0.0), grid(2, 4, -1.0)
    made = volume_edits.blend(first, second, 0.25, 5)
    assert made.exact and made.points.shape == (3, 7, 3)
    mixed = 0.75 * first.positions(U, V).position + 0.25 * second.positions(U, V).position
    np.testing.assert_allclose(surface(made).positions(U, V).position, mixed, atol=1e-12)
