# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes cut along seams: they cover the image once, and no triangle is on two sides."""

import numpy as np
import pytest

from scfpf_addon.projection.editing.blend_map import BlendMap
from scfpf_addon.projection.editing.seam_mesh import seam_mesh
from scfpf_addon.projection.surfaces.uv_chart import UVChart

ASPECT = 1.6
LINE = BlendMap("LINEAR", centre=(0.4, 0.3), angle=0.7, border=0.0)
BOX = BlendMap("RECTANGLE", centre=(0.6, 0.5), size=(0.5, 0.4), angle=0.3, border=0.0)
# Its sides lie on lines of the lattice.
EVEN = BlendMap("RECTANGLE", centre=(0.5, 0.5), size=(0.5, 0.5), border=0.0)
CIRCLE = BlendMap("RADIAL", centre=(0.45, 0.6), size=(0.5, 0.5), border=0.0)


def areas(mesh):
    a, b, c = np.moveaxis(mesh.places[mesh.triangles], 1, 0)
    (x, y), (z, w) = (b - a).T, (c - a).T
    return 0.5 * (x * w - y * z)


@pytest.mark.parametrize("maps", [(LINE,), (BOX,), (EVEN,), (BOX, LINE, EVEN)], ids=str)
@pytest.mark.parametrize("faces", [1, 8])
def test_straight_seams_are_exact(maps, faces):
    """Random positions: the vertices of the triangle about each are on the side that the formula says."""
    mesh = seam_mesh(maps, ASPECT, faces)
    assert areas(mesh).min() > -1e-15 and areas(mesh).sum() == pytest.approx(1.0, abs=1e-12)
    x, y = np.random.default_rng(3).uniform(size=(2, 4000))
    found = UVChart(mesh.places[mesh.triangles], mesh.triangles).find(x, y)
    assert (found.triangle >= 0).all()
    for blend_map, sides in zip(maps, mesh.sides, strict=True):
        away = np.abs(blend_map.levels(x, y, ASPECT)).min(axis=0) > 1e-6
        wanted = blend_map.values(x, y, ASPECT) == 1.0
        corners = sides[mesh.triangles[found.triangle]]
        assert (corners == wanted[:, None])[away].all()


def test_a_circle_is_a_polygon_of_many_corners():
    mesh = seam_mesh((CIRCLE,), ASPECT, 64)
    within = mesh.sides[0][mesh.triangles].all(axis=1)
    # In shares of the image: an ellipse.
    assert areas(mesh)[within].sum() == pytest.approx(np.pi * 0.25**2 * ASPECT, rel=2e-3)
    rim = np.hypot(mesh.places[:, 0] - 0.45, (mesh.places[:, 1] - 0.6) / ASPECT)
    assert (np.abs(rim - 0.25) < 1e-9).sum() > 200


def test_painted_edges_are_polygons_of_many_corners():
    """A square and stripes as thin as the lattice: no triangle is on the wrong side by more than a pixel."""
    row, column = np.mgrid[:256, :256]
    painted = (np.maximum(abs(column - 90), abs(row - 140)) < 61) | (column > 190) & (row % 16 < 7)
    blend_map = BlendMap("IMAGE", pixels=painted.astype(float), is_sharp=True)
    mesh = seam_mesh((blend_map, LINE), ASPECT, 128)
    assert areas(mesh).min() > -1e-15 and areas(mesh).sum() == pytest.approx(1.0, abs=1e-12)
    within = mesh.sides[0][mesh.triangles]
    assert (within.all(axis=1) | ~within.any(axis=1)).all()
    assert areas(mesh)[within.all(axis=1)].sum() == pytest.approx(painted.mean(), rel=5e-3)
    x, y = np.random.default_rng(3).uniform(size=(2, 4000))
    found = UVChart(mesh.places[mesh.triangles], mesh.triangles).find(x, y)
    near = [np.roll(painted, (i, j), (0, 1)) for i in (-1, 0, 1) for j in (-1, 0, 1)]
    is_plain = (np.all(near, axis=0) | ~np.any(near, axis=0))[(y * 256).astype(int), (x * 256).astype(int)]
    wanted = painted[(y * 256).astype(int), (x * 256).astype(int)]
    assert is_plain.mean() > 0.6
    assert (mesh.sides[0][mesh.triangles[found.triangle, 0]] == wanted)[is_plain].all()


def test_vertices_are_looked_up_inside_of_their_parts():
    mesh = seam_mesh((BOX, CIRCLE), ASPECT, 16)
    found = UVChart(mesh.places[mesh.triangles], mesh.triangles).find(*mesh.inner.T)
    assert (mesh.sides[:, mesh.triangles[found.triangle]] == mesh.sides[:, :, None]).all()
    assert np.abs(mesh.inner - mesh.places).max() <= 2.1e-6
