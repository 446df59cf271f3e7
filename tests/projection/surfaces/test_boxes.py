# SPDX-License-Identifier: GPL-3.0-or-later
"""Boxes around parts of control surfaces, against the surfaces' own points and second differences."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scfpf_addon.projection.editing.interpolation import InterpolatedSurface
from scfpf_addon.projection.surfaces.boxes import boxes_of_cells
from scfpf_addon.projection.surfaces.nurbs import NurbsPatch
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
from scfpf_addon.projection.surfaces.uv_mesh import UVMesh
from scfpf_addon.projection.volume.lattice import LatticeLayer

KINDS = ("LINEAR", "CARDINAL", "CATMULL_ROM", "BSPLINE")


def affine(generator):
    matrix = np.eye(4)
    matrix[:3] = generator.normal(size=(3, 4))
    return matrix


def surfaces(seed):
    """One of each kind that knows its bends, moved at random."""
    generator = np.random.default_rng(seed)
    size, arc = generator.uniform(0.1, 5.0, 9), generator.uniform(0.3, 6.0, 5)
    low, high = np.sort(generator.uniform(-1.5, 1.5, 2))
    moved = [generator.normal(size=(3, 5, 3)), generator.normal(size=(4, 2, 3))]
    along = generator.choice(KINDS, 4)
    made = [
        Point(),
        Plane(width=size[0], height=size[1]),
        BilinearPatch(generator.normal(size=(4, 3))),
        Disc(size[2], arc[0]),
        Cone(size[3], -size[4], arc[1], size[5]),
        Cylinder(size[6], arc[2], size[7]),
        SphereSector(size[8], arc[3], low, high),
        Paraboloid(size[0], arc[4], size[1]),
        Grid(generator.normal(size=(4, 3, 3))),
        LatticeLayer(moved=moved[0], along_u=along[0], along_v=along[1]),
        LatticeLayer(moved=moved[1], along_u=along[2], along_v=along[3]),
    ]
    made = [each.transformed(affine(generator)) for each in made]
    made += [InterpolatedSurface(made[k], made[k + 1], generator.uniform()) for k in range(len(made) - 1)]
    return [each.transformed(affine(generator)) for each in made]


@pytest.mark.parametrize("number", range(len(surfaces(0))))
@settings(max_examples=30)
@given(st.integers(0, 2**32 - 1))
def test_boxes_hold_all_points_of_their_cells(number, seed):
    surface, generator = surfaces(seed)[number], np.random.default_rng(seed)
    u, v = (np.sort(generator.uniform(size=count)) for count in (7, 5))
    boxes = boxes_of_cells(surface, u, v)
    shares = np.concatenate([[0.0, 1.0], generator.uniform(size=9)])
    for row, column in np.ndindex(4, 6):
        across = u[column] + shares * (u[column + 1] - u[column])
        up = v[row] + shares * (v[row + 1] - v[row])
        places = surface.positions(*(each.ravel() for each in np.meshgrid(across, up))).position
        slack = 1e-12 * (1.0 + np.abs(places).max())
        assert (places.min(axis=1) >= boxes.lower[:, row, column] - slack).all()
        assert (places.max(axis=1) <= boxes.upper[:, row, column] + slack).all()


@pytest.mark.parametrize("number", range(len(surfaces(0))))
def test_boxes_of_many_cells_are_tight(number):
    surface = surfaces(number)[number]
    # Twelve steps in each of 64 cells meet the lines of the grids above, too.
    steps, cells = np.linspace(0.0, 1.0, 64 * 12 + 1), slice(0, 64 * 12, 12)
    boxes = boxes_of_cells(surface, steps[::12], steps[::12])
    places = surface.positions(*(each.ravel() for each in np.meshgrid(steps, steps))).position
    places = places.reshape(3, len(steps), len(steps))
    shifted = [places[:, r:, c:][:, cells, cells] for r, c in np.ndindex(13, 13)]
    size = np.ptp(places.reshape(3, -1), axis=1).max() + 1e-12
    surplus = np.maximum(np.min(shifted, axis=0) - boxes.lower, boxes.upper - np.max(shifted, axis=0)) / size
    assert surplus.max() < (0.005 if any(surface.bends) else 1e-12)


@pytest.mark.parametrize("number", range(9))
@pytest.mark.parametrize("seed", range(3))
def test_bends_are_the_greatest_second_derivatives(number, seed):
    surface = surfaces(seed)[number]
    generator, step = np.random.default_rng(seed), 1e-3
    u, v = generator.uniform(0.002, 0.998, (2, 4000))
    for axis, crease in enumerate(surface.creases):
        place = (u, v)[axis]
        # Beside creases the difference is of both sides.
        for line in crease:
            place[np.abs(place - line) < 2 * step] = 0.1
    lengths = []
    for a, b in ((step, 0.0), (0.0, step)):
        before, here, after = (surface.local(u + k * a, v + k * b).position for k in (-1, 0, 1))
        lengths.append(np.linalg.norm((before - 2 * here + after) / step**2, axis=0).max())
    scale = 1.0 + max(np.abs(surface.local(u, v).position).max(), 1.0)
    for found, bend in zip(lengths, surface.bends, strict=True):
        assert found <= bend * (1.0 + 1e-6) + 1e-8 * scale
        assert found >= 0.9 * bend - 1e-8 * scale


def test_kinds_that_do_not_know_their_boxes():
    even = np.linspace(0.0, 1.0, 5)
    for surface in (NurbsPatch(), UVMesh(), InterpolatedSurface(Plane(), UVMesh(), 0.5)):
        assert boxes_of_cells(surface, even, even) is None
