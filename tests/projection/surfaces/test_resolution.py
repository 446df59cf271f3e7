# SPDX-License-Identifier: GPL-3.0-or-later
"""As many points as a surface needs, and not many more."""

import math

import numpy as np
import pytest

from scfpf_addon.projection.editing.resolution import LEAST_FACES, change, grid_within, patch_within
from scfpf_addon.projection.editing.volume_edits import sampled
from scfpf_addon.projection.surfaces.surface import Cylinder, Grid, Plane, SphereSector


@pytest.mark.parametrize("share", [1e-3, 1e-4, 1e-5])
@pytest.mark.parametrize(
    "surface", [Cylinder(arc=2 * math.pi), SphereSector(arc=3.0)], ids=["turn", "sphere"]
)
def test_a_patch_is_as_near_as_asked(surface, share):
    patch = patch_within(surface, share)
    rows, columns = patch.points.shape[:2]
    # Somewhere between where it was measured, too.
    assert change(surface, patch, 7 * columns, 7 * rows) < 1.05 * share
    assert change(surface, patch, columns, rows) > share / 10


def test_a_turn_of_a_grid_has_as_many_columns_as_its_chords_need():
    share = 1e-4
    columns, rows = grid_within(Cylinder(arc=2 * math.pi), share)
    # A chord of n leaves the circle by 1 - cos(pi / n) of the radius, half of the size at most.
    needed = math.pi / math.acos(1 - 2 * share)
    assert needed <= columns < 1.4 * needed and rows == LEAST_FACES


def test_what_is_flat_needs_no_points():
    assert grid_within(Plane(), 1e-6) == (LEAST_FACES, LEAST_FACES)
    assert np.shape(patch_within(Plane(), 1e-6).points)[:2] == (4, 4)


def test_a_sphere_is_a_grid_as_near_as_asked():
    sphere = SphereSector(arc=3.0, latitude_start=-1.0, latitude_end=1.2)
    columns, rows = grid_within(sphere, 1e-4)
    grid = Grid(sampled(sphere, columns + 1, rows + 1))
    assert 2e-5 < change(sphere, grid, columns, rows) < 1.05e-4
