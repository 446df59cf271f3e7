# SPDX-License-Identifier: GPL-3.0-or-later
"""Surfaces as preset files hold them: as they are if that is so, else as a grid as near as is said."""

import numpy as np
import pytest

from scfpf_addon.projection.editing.resolution import change
from scfpf_addon.projection.presets import stored_surface as stored
from scfpf_addon.projection.presets.stored_surface import GRID_ERROR, stored_surface
from scfpf_addon.projection.surfaces.surface import Cylinder
from scfpf_addon.projection.surfaces.uv_chart import UVChart
from scfpf_addon.projection.surfaces.uv_mesh import UVMesh
from scfpf_addon.projection.user_error import UserError

SIZES = {"radius": 2.0, "arc": 2.5, "height": 3.0}
MOVED = np.array([[0.0, -2.0, 0.0, 1.0], [1.0, 0.0, 0.0, 2.0], [0.0, 0.0, 3.0, -4.0], [0, 0, 0, 1]])


def test_what_it_is_said_to_be_it_stays():
    stored = stored_surface("Far", Cylinder(**SIZES, matrix=MOVED), 0.5, "CYLINDER", SIZES, matrix=MOVED)
    assert (stored.name, stored.kind, stored.parameters, stored.weight) == ("Far", "CYLINDER", SIZES, 0.5)
    np.testing.assert_array_equal(stored.matrix, MOVED)


@pytest.mark.parametrize(
    ("kind", "said", "matrix"),
    [
        ("", None, None),
        ("CYLINDER", SIZES | {"radius": 2.1}, MOVED),
        ("CYLINDER", {"radius": 2.0}, MOVED),
        ("NONSENSE", {}, MOVED),
        ("CYLINDER", SIZES, MOVED + np.eye(4, k=1) * 0.3),
    ],
    ids=["nothing said", "other numbers", "numbers missing", "no kind", "sheared"],
)
def test_else_it_becomes_a_grid_in_camera_space(kind, said, matrix):
    surface = Cylinder(**SIZES, matrix=MOVED)
    stored = stored_surface("Far", surface, 2.0, kind, said, matrix=matrix)
    assert (stored.kind, stored.weight) == ("GRID", 2.0)
    np.testing.assert_array_equal(stored.matrix, np.eye(4))
    rows, columns = stored.points.shape[:2]
    assert change(surface, stored.surface(), columns - 1, rows - 1) <= 1.1 * GRID_ERROR


def holed():
    """Two triangles of the UV square, with a hole between them."""
    uv = np.array([[[0.0, 0], [1, 0], [0, 0.4]], [[1.0, 1], [0, 1], [1, 0.6]]])
    return UVMesh(
        np.random.default_rng(1).normal(size=(6, 3)), UVChart(uv, np.arange(6).reshape(2, 3)), matrix=MOVED
    )


def test_a_uv_mesh_stays_one_holes_and_all():
    surface = holed()
    stored = stored_surface("Sheet", surface, kind="UV_MESH")
    assert stored.kind == "UV_MESH" and stored.chart is surface.chart
    u, v = np.random.default_rng(2).uniform(size=(2, 100))
    one, other = surface.evaluate(u, v), stored.surface().evaluate(u, v)
    np.testing.assert_array_equal(one.valid, other.valid)
    np.testing.assert_allclose(one.position[:, one.valid], other.position[:, one.valid], atol=1e-12)


def test_a_large_uv_mesh_would_be_a_grid_which_has_no_holes(monkeypatch):
    monkeypatch.setattr(stored, "MOST_TRIANGLES", 1)
    with pytest.raises(UserError, match="holes"):
        stored_surface("Sheet", holed(), kind="UV_MESH")
