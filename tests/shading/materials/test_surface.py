# SPDX-License-Identifier: GPL-3.0-or-later
"""Normals, sides and coefficients at a hit."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from scfpf_addon.casting.common import parallel
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.shading.materials.coefficients import MaterialCoefficients
from scfpf_addon.shading.materials.constants import Materials
from scfpf_addon.shading.scene.surface import SurfaceTable


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
def test_chunks_and_threads_change_no_table(build, monkeypatch, smooth):
    """The smooth object is the last, so that the first chunks are flat."""
    parts = [build.square(0.5, k / 40) for k in range(30)] + [build.sphere(4)] * smooth
    geometry = build.geometry(*parts)
    whole, _ = table_of(geometry, True)
    monkeypatch.setattr(parallel, "AT_ONCE", 3)
    cut, _ = table_of(geometry, True)
    assert (whole.smooth is not None) == smooth
    for name in ("flat", "smooth", "bulge"):
        assert np.array_equal(getattr(cut, name), getattr(whole, name))


@given(st.tuples(*[st.floats(-1, 1)] * 3).filter(lambda v: abs(v[2]) > 1e-3), st.floats(1e-9, 1e9))
def test_normals_and_view_face_against_the_tangent(build, direction, length):
    table, _ = table_of(build.geometry(build.square()))
    tangent = np.reshape(direction, (3, 1)) * length
    points = table.points(np.zeros(1, np.int32), np.full((2, 1), 1 / 3), np.zeros((3, 1)), tangent)
    assert np.allclose(points.normal[:, 0], [0, 0, -np.sign(direction[2])], atol=1e-6)
    assert np.allclose(points.view, -tangent / np.linalg.norm(tangent), atol=1e-6)


def test_the_side_is_the_triangle_s_not_the_interpolated_normal_s(build):
    """Near a silhouette the interpolated normal may face away from a viewer who sees the front."""
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
    assert np.allclose(points.shadow.flat, flat.T, atol=1e-6) and points.shadow.height is None
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
    """Outside the height reaches the sphere that the normals pretend; inside, in the hollow, it is 0."""
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
        # Tangent planes meet above the sphere, at most as high as the sphere over the facet.
        assert (height > 0.9 * (1 - facet)).all()
        assert (height < 2.1 * (1 - facet)).all()
    else:
        assert not height.any()
    assert np.allclose(
        points.shadow.flat, np.sign(seen_from) * cast_scene.normals(np.arange(len(faces))), atol=1e-6
    )
    off = np.einsum("cn,cn->n", points.shadow.origin - position, points.shadow.flat)
    assert (off > 0).all() and (off < 1e-5).all()


def rows(base, metallic, roughness, f0, emission=(0, 0, 0)):
    """Materials of all given values."""
    shape = np.broadcast_shapes(np.shape(metallic), np.shape(roughness), np.shape(f0))
    count = int(np.prod(shape))
    each = (np.broadcast_to(value, shape).ravel().astype(float) for value in (metallic, roughness, f0))
    return Materials(np.tile(np.float64(base), (count, 1)), *each, np.tile(np.float64(emission), (count, 1)))


def shine(table, number, cosine):
    """Reflectance of a material's facets, (3, 1), seen head-on."""
    material, view = np.full(1, number), table.view_terms(np.full(1, number), np.ones(1, np.float32))
    return np.broadcast_to(table.reflectance(material, np.full(1, cosine, np.float32), view), (3, 1))


def mean_diffuse(table):
    """Diffuse albedo of a table's materials, (3, M), as a mean over the directions to the viewer."""
    cosines = (np.arange(4000, dtype=np.float32) + 0.5) / 4000
    each = [
        table.view_terms(np.full(1, number), cosines).layer_transmittance
        for number in range(table.coverage.size)
    ]
    shares = [
        1.0 if transmittance is None else 2 * np.mean(cosines * transmittance) for transmittance in each
    ]
    return table.diffuse * np.pi * shares


def test_white_materials_reflect_all_light():
    """White metals and dielectrics of any roughness conserve the energy of a uniform environment."""
    grid = np.meshgrid([0.0, 0.25, 1.0], [0.0, 0.3, 0.6, 1.0], [0.0, 0.04, 0.3])
    table = MaterialCoefficients.of(rows((1, 1, 1), *grid), np.array([0.5, 0.5, 1]))
    cosines = (np.arange(4000, dtype=np.float32) + 0.5) / 4000
    for number in range(table.alpha.size):
        material = np.full(1, number)
        light = table.unlit(material, table.view_terms(material, cosines))
        mean = 2 * np.mean(cosines * np.broadcast_to(light, (3, 4000)), axis=1)
        assert np.allclose(mean, [0.5, 0.5, 1], rtol=2e-3)
        # Metals, which have no diffuse light, in all directions to the viewer.
        if table.metal_f0[0, number] == 1:
            assert np.allclose(light, [[0.5], [0.5], [1]], rtol=1e-5)
    # The layer of a dielectric takes from the diffuse light the share that it reflects.
    dull, polished = mean_diffuse(
        MaterialCoefficients.of(rows((1, 1, 1), 0.0, 0.5, [0.0, 0.3]), np.zeros(3))
    )[0]
    assert dull == pytest.approx(1.0) and 0.65 < polished < 0.75


def test_coefficients_are_known_for_simple_materials():
    table = MaterialCoefficients.of(
        rows((0.2, 0.4, 0.6), [0.0, 1.0], 0.08, 0.04, (1, 2, 3)), np.array([0.5, 0.5, 1])
    )
    assert np.allclose(table.emission.T, [1, 2, 3])
    # Polished surfaces have no multiple scattering; head-on it is f0, or the base colour of a metal.
    head_on = np.concatenate([shine(table, number, 1.0) for number in (0, 1)], axis=1)
    assert np.allclose(head_on.T, [[0.04] * 3, [0.2, 0.4, 0.6]], rtol=1e-3) and table.glossy
    assert np.allclose(shine(table, 0, 0.0), 1, rtol=1e-3) and np.allclose(shine(table, 1, 0.0), 1, rtol=1e-3)
    # Diffuse reflectance of a boundary of glass (Walsh's formula for an index of 1.5).
    layer = 0.0918
    assert np.allclose(mean_diffuse(table).T, [(1 - layer) * np.array([0.2, 0.4, 0.6]), [0] * 3], atol=2e-3)
    # Schlick's mean is 1/21 of the way to white.
    metal = np.array([0.2, 0.4, 0.6]) + np.array([0.8, 0.6, 0.4]) / 21
    even = MaterialCoefficients.of(rows((0.2, 0.4, 0.6), [0.0, 1.0], 0.08, 0.04), np.ones(3))
    cosines, second = (np.arange(4000, dtype=np.float32) + 0.5) / 4000, np.ones(4000, np.intp)
    reflected = 2 * np.mean(cosines * even.unlit(second, even.view_terms(second, cosines)), axis=1)
    assert np.allclose(reflected, metal, rtol=2e-2)
    # A glossy shader has F90 = F0, and without f0 there is no highlight at any angle.
    flat = MaterialCoefficients.of(
        replace(rows((0.5,) * 3, 1.0, 0.08, 0.04), grazing=np.zeros(1)), np.zeros(3)
    )
    assert not flat.metal_grazing.any() and flat.metal_f0.mean() == pytest.approx(0.5, rel=1e-3)
    matt = MaterialCoefficients.of(rows((1, 1, 1), 0.0, 0.5, 0.0), np.zeros(3))
    assert (
        not matt.glossy
        and not matt.metal_f0.any()
        and not matt.metal_grazing.any()
        and not matt.specular.any()
    )


def test_coefficients_of_a_hit_do_not_depend_on_other_hits():
    """Rows of single hits give the same bits alone, a few at a time, and all at once."""
    generator = np.random.default_rng(3)
    count = 300
    base, emission = generator.uniform(0, 1, (2, count, 3))
    metallic = generator.choice([0.0, 0.3, 1.0], count)
    materials = Materials(
        base, metallic, generator.uniform(0, 1, count), generator.uniform(0, 0.2, count), emission
    )
    facing, cosine = generator.uniform(0, 1, (2, count)).astype(np.float32)

    def coloured(some):
        part = replace(
            materials,
            **{
                name: getattr(materials, name)[some]
                for name in ("base_color", "metallic", "roughness", "specular_f0", "emission")
            },
        )
        table = MaterialCoefficients.of(part, np.full(3, 0.5), per_hit=True)
        every = np.arange(len(metallic[some]))
        view = table.view_terms(every, facing[some])
        shine = np.broadcast_to(table.reflectance(every, cosine[some], view), (3, len(every)))
        transmittance = (
            np.ones(len(every), np.float32) if view.layer_transmittance is None else view.layer_transmittance
        )
        return np.concatenate(
            [table.unlit(every, view) * np.float32(1), shine, table.diffuse * transmittance]
        )

    whole = coloured(slice(None))
    for size in (1, 7, 64, 65):
        parts = [coloured(slice(start, start + size)) for start in range(0, count, size)]
        assert np.concatenate(parts, axis=1).tobytes() == whole.tobytes()


def test_black_plastic_reflects_a_uniform_environment_by_its_layer():
    """Walsh's formula for an index of 1.5, as a mean over the views; alone and beside white."""
    for base in ([0.0], [0.0, 1.0]):
        number = np.repeat(np.reshape(base, (-1, 1)), 3, axis=1)
        each = [np.full(len(base), value) for value in (0.0, 0.08, 0.04)]
        for per_hit in (False, True):
            table = MaterialCoefficients.of(Materials(number, *each, 0 * number), np.ones(3), per_hit=per_hit)
            cosines = (np.arange(4000, dtype=np.float32) + 0.5) / 4000
            black = np.zeros(4000, np.intp)
            shown = 2 * np.mean(cosines * table.unlit(black, table.view_terms(black, cosines)), axis=1)
            assert shown == pytest.approx(0.0918, abs=2e-3)
