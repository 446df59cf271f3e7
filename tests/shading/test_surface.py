# SPDX-License-Identifier: GPL-3.0-or-later
"""Normals, sides and coefficients at a hit."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scfpf_addon.casting.scene import CastScene
from scfpf_addon.shading import normals
from scfpf_addon.shading.scene import Materials
from scfpf_addon.shading.surface import PhongTable, SurfaceTable


def table_of(geometry, shadows=False):
    cast_scene = CastScene(geometry.vertices, geometry.triangles)
    return SurfaceTable.of(geometry, cast_scene, shadows), cast_scene


def test_normals_of_a_sphere_are_interpolated(build):
    """Against the interpolation in float64, and near the true normal."""
    vertices, faces, at_corners = build.sphere(32)
    table, cast_scene = table_of(build.geometry((vertices, faces, at_corners)))
    rng = np.random.default_rng(2)
    triangle = rng.integers(0, len(faces), 3000)
    weights = rng.dirichlet(np.ones(3), 3000)
    expected = np.einsum("nk,nkc->cn", weights, at_corners[triangle])
    expected /= np.linalg.norm(expected, axis=0)
    position = np.einsum("nk,nkc->cn", weights, vertices[faces[triangle]])
    points = table.points(triangle, weights[:, 1:].T, position * cast_scene.scale, -position)
    assert np.allclose(points.normal, expected, atol=1e-6)
    assert np.allclose(points.normal, position / np.linalg.norm(position, axis=0), atol=0.01)


@pytest.mark.parametrize("smooth", [False, True])
def test_portions_and_threads_change_no_table(build, monkeypatch, smooth):
    """The smooth thing is the last, so that the first portions are flat."""
    parts = [build.square(0.5, k / 40) for k in range(30)] + [build.sphere(4)] * smooth
    geometry = build.geometry(*parts)
    whole, _ = table_of(geometry, True)
    monkeypatch.setattr(normals, "PORTION", 3)
    portions, _ = table_of(geometry, True)
    assert (whole.smooth is not None) == smooth
    for name in ("flat", "smooth", "bulge"):
        assert np.array_equal(getattr(portions, name), getattr(whole, name))


@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: abs(v[2]) > 1e-3), st.floats(1e-9, 1e9))
def test_normals_and_view_face_against_the_tangent(build, direction, length):
    table, _ = table_of(build.geometry(build.square()))
    tangent = np.reshape(direction, (3, 1)) * length
    points = table.points(np.zeros(1, np.int32), np.full((2, 1), 1 / 3), np.zeros((3, 1)), tangent)
    assert np.allclose(points.normal[:, 0], [0, 0, -np.sign(direction[2])], atol=1e-6)
    assert np.allclose(points.view, -tangent / np.linalg.norm(tangent), atol=1e-6)


def test_the_side_is_the_triangle_s_not_the_interpolated_normal_s(build):
    """Near a silhouette the interpolated normal may look away from a viewer who sees the front."""
    vertices, faces, _ = build.square()
    leaning = np.tile([0.8, 0, 0.6], (2, 3, 1))
    table, _ = table_of(build.geometry((vertices, faces, leaning)))
    tangent = np.array([[0.9], [0], [-0.1]])
    points = table.points(np.zeros(1, np.int32), np.full((2, 1), 1 / 3), np.zeros((3, 1)), tangent)
    assert np.allclose(points.normal[:, 0], [0.8, 0, 0.6], atol=1e-6)


@pytest.mark.parametrize("side", [1, -1])
def test_flat_shading_needs_no_weights(build, side):
    """Not even beside a triangle without area; the normals may be turned inwards."""
    vertices, faces, _ = build.sphere(12)
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    flat = np.cross(b - a, c - a)
    flat /= np.linalg.norm(flat, axis=1, keepdims=True)
    faces = np.concatenate([faces, faces[:1, [0, 0, 1]]])
    normals = side * np.repeat(np.concatenate([flat, [[0, 0, 1]]])[:, None], 3, 1)
    table, cast_scene = table_of(build.geometry((vertices, faces, normals)), shadows=True)
    assert not table.weighted
    triangle = np.arange(len(flat))
    middle = vertices[faces[triangle]].mean(axis=1).T * cast_scene.scale
    points = table.points(triangle, np.zeros((2, len(flat))), middle, -flat.T)
    assert np.allclose(points.normal, flat.T, atol=1e-6)
    assert np.allclose(points.shadow.flat, flat.T, atol=1e-6) and not points.shadow.height.any()
    leaning = normals.copy()
    leaning[0, 1] = [0.6, 0, 0.8]
    assert table_of(build.geometry((vertices, faces, leaning)))[0].weighted


def test_a_vanishing_tangent_gives_no_nan(build):
    table, _ = table_of(build.geometry(build.square()))
    points = table.points(np.zeros(1, np.int32), np.full((2, 1), 1 / 3), np.zeros((3, 1)), np.zeros((3, 1)))
    assert not points.view.any()
    assert np.isfinite(points.normal).all()


def test_materials_are_looked_up_by_triangle(build):
    table, _ = table_of(build.geometry(build.square(), build.square(height=1)))
    points = table.points(np.array([3, 0, 2], np.int32), np.zeros((2, 3)), np.zeros((3, 3)), np.ones((3, 3)))
    assert points.material.tolist() == [1, 0, 1]


@pytest.mark.parametrize("seen_from", [1, -1])
def test_a_smooth_bump_has_a_height_over_its_facets_on_its_outside_only(build, seen_from):
    """Outside the height leads to the sphere that the normals pretend; the hollow inside has none."""
    vertices, faces, normals = build.sphere(16)
    table, cast_scene = table_of(build.geometry((vertices, faces, normals)), shadows=True)
    middle = vertices[faces].mean(axis=1).T
    position = cast_scene.matrix[:3, :3] @ middle + cast_scene.matrix[:3, 3:]
    points = table.points(
        np.arange(len(faces)), np.full((2, len(faces)), 1 / 3), position, -seen_from * middle
    )
    facet = np.linalg.norm(middle, axis=0)
    height = points.shadow.height / cast_scene.scale
    if seen_from > 0:
        # Tangent planes meet above the sphere, by at most its own height over the facet.
        assert (height > 0.9 * (1 - facet)).all()
        assert (height < 2.1 * (1 - facet)).all()
    else:
        assert not height.any()
    assert np.allclose(
        points.shadow.flat, np.sign(seen_from) * cast_scene.normals(np.arange(len(faces))), atol=1e-6
    )
    off = np.einsum("cn,cn->n", points.shadow.origin - position, points.shadow.flat)
    assert (off > 0).all() and (off < 1e-5).all()


def test_phong_coefficients():
    table = PhongTable.of(
        Materials(
            np.array([[1.0, 0.5, 0], [0.2, 0.4, 0.6]]),
            np.array([0.0, 0.25]),
            np.array([1.0, 0.5]),
            np.array([0.04, 0.08]),
            np.array([[0.0, 0, 0], [1, 2, 3]]),
        ),
        np.array([0.5, 0.5, 1]),
    )
    assert np.allclose(table.emitted.T, [[0.5, 0.25, 0], [1.1, 2.2, 3.6]])
    assert np.allclose(table.diffuse.T * np.pi, [[1, 0.5, 0], [0.15, 0.3, 0.45]])
    assert np.allclose(table.exponent, [0, 7.5])
    # Reflectance at normal incidence goes from f0 to the base colour with metallic.
    assert np.allclose(table.gloss.T * np.pi, [[0.04] * 3, np.array([0.11, 0.16, 0.21]) * 9.5 / 2])
    assert table.glossy
