# SPDX-License-Identifier: GPL-3.0-or-later
"""Lobes of shaders: bodies, reflections, glass and transparency, at most 1 in total."""

import numpy as np
import pytest

from scfpf_addon.casting.common.geometry import Geometry
from scfpf_addon.shading.materials.coefficients import MaterialCoefficients
from scfpf_addon.shading.materials.lobes import Body, ScatteredLobe, lobes
from scfpf_addon.shading.materials.microfacet import ior_of
from scfpf_addon.shading.nodes.context import ShadingContext
from scfpf_addon.shading.nodes.graph import Closure, MaterialGraph, Operation, Ref

COUNT = 4
COLOR = np.array([0.8, 0.5, 0.2])
PRINCIPLED = {
    "base_color": COLOR,
    "metallic": 0.0,
    "roughness": 0.5,
    "specular_level": 0.5,
    "ior": 1.5,
    "transmission": 0.0,
    "alpha": 1.0,
    "emission": np.zeros(3),
    "multiscatter": 0.0,
}


def at_surface(cosine, back=0.0):
    """Hits on a level face, seen at an angle."""
    one = np.zeros(1, np.int32)
    geometry = Geometry(np.eye(3), np.array([[0, 1, 2]], np.int32), np.zeros((1, 3, 3), np.float32), one, one)
    up = np.repeat([[0.0], [0.0], [1.0]], COUNT, axis=1)
    view = np.repeat([[np.sqrt(1 - cosine**2)], [0.0], [cosine]], COUNT, axis=1)
    nothing = np.zeros((2, COUNT))
    return ShadingContext(
        geometry, {}, np.zeros(COUNT, int), nothing, up, up, up, view, np.full((1, COUNT), back)
    )


def shader(kind, weight=1.0, cosine=0.8, back=0.0, **inputs):
    """The bodies and the scattered lobes of one closure of constants."""
    operations = [Operation("CONSTANT", (), {"value": weight}), Operation("NORMAL")]
    refs = {"normal": Ref(1)}
    for name, value in inputs.items():
        refs[name] = Ref(len(operations))
        operations.append(Operation("CONSTANT", (), {"value": value}))
    made = list(
        lobes(MaterialGraph(tuple(operations), (Closure(kind, Ref(0), refs),)), at_surface(cosine, back))
    )
    return [one for one in made if isinstance(one, Body)], [
        one for one in made if isinstance(one, ScatteredLobe)
    ]


def schlick(r0, cosine):
    return r0 + (1 - r0) * (1 - cosine) ** 5


def fresnel(cosine, ior):
    """Reflectance by Snell's law and Fresnel's equations for both polarisations."""
    other = np.sqrt(1 - (1 - cosine**2) / ior**2)
    s, p = (cosine - ior * other) / (cosine + ior * other), (ior * cosine - other) / (ior * cosine + other)
    return (s * s + p * p) / 2


def test_diffuse_and_emission_are_bodies():
    (body,), sent = shader("DIFFUSE", 0.7, color=COLOR)
    assert not sent and (body.weight == 0.7).all()
    np.testing.assert_array_equal(body.materials.base_color, np.tile(COLOR, (COUNT, 1)))
    assert not body.materials.emission.any()
    (glow,), sent = shader("EMISSION", color=3 * COLOR)
    assert not sent and not glow.materials.base_color.any()
    np.testing.assert_allclose(glow.materials.emission, np.tile(3 * COLOR, (COUNT, 1)))


def test_weights_of_zero_or_nan_make_no_lobe():
    assert shader("DIFFUSE", 0.0, color=COLOR) == ([], [])
    assert shader("DIFFUSE", -1.0, color=COLOR) == ([], [])
    assert shader("DIFFUSE", np.nan, color=COLOR) == ([], [])
    (body,), _ = shader("DIFFUSE", color=np.array([np.nan, np.inf, -2.0]))
    np.testing.assert_array_equal(body.materials.base_color, 0.0)


def test_a_transparent_lobe_has_the_closures_colour():
    bodies, (through,) = shader("TRANSPARENT", 0.5, color=COLOR)
    assert not bodies and through.kind == "TRANSPARENT"
    np.testing.assert_allclose(through.tint, np.tile(0.5 * COLOR[:, None], COUNT))


@pytest.mark.parametrize("back", [0.0, 1.0])
@pytest.mark.parametrize("cosine", [1.0, 0.8])
def test_glass_reflects_fresnels_share_and_refracts_the_rest(cosine, back):
    white = np.ones(3)
    _, sent = shader("GLASS", cosine=cosine, back=back, color=white, roughness=0.0, ior=1.3)
    mirror, refracted = sent
    assert (mirror.kind, refracted.kind) == ("GLOSSY", "TRANSMISSION")
    ratio = 1 / 1.3 if back else 1.3
    np.testing.assert_allclose(refracted.ior, ratio)
    np.testing.assert_allclose(mirror.tint, fresnel(cosine, ratio), atol=1e-12)
    np.testing.assert_allclose(mirror.tint + refracted.tint, 1.0, atol=1e-12)


def test_refraction_ends_at_the_critical_angle():
    for cosine, let_in in ((0.9, 1.0), (0.3, 0.0)):
        _, (refracted,) = shader("REFRACTION", cosine=cosine, back=1.0, color=COLOR, ior=1.5)
        np.testing.assert_allclose(refracted.tint, np.tile(let_in * COLOR[:, None], COUNT))


def test_a_glossy_surface_is_followed_as_far_as_it_is_smooth():
    for roughness, share in ((0.2, 1.0), (0.8, 0.5), (1.0, 0.0)):
        (body,), sent = shader("GLOSSY", color=COLOR, roughness=roughness, multiscatter=0.0)
        np.testing.assert_allclose(body.materials.ambient, 1.0 - share, atol=1e-12)
        assert bool(sent) == (share > 0)
        for mirror in sent:
            np.testing.assert_allclose(mirror.tint, share)
            np.testing.assert_allclose(
                mirror.rough.reflectance(np.full(COUNT, 0.3)), np.tile(COLOR[:, None], COUNT)
            )


def test_a_rough_metal_reflects_by_schlick():
    bodies, (mirror,) = shader("PRINCIPLED", **PRINCIPLED | {"metallic": 1.0, "roughness": 0.3})
    np.testing.assert_allclose(mirror.rough.reflectance(np.full(COUNT, 0.4))[:, 0], schlick(COLOR, 0.4))
    np.testing.assert_allclose(mirror.rough.reflectance(np.ones(COUNT))[:, 0], COLOR)
    (body,) = bodies
    assert (body.materials.metallic == 1.0).all() and (body.materials.ambient == 0.0).all()
    some = mirror.take(np.array([2]))
    assert some.tint.shape == (3, 1) and some.rough.f0.shape == (3, 1)


def test_a_dielectric_layer_takes_fresnels_share_from_the_diffuse_light():
    (body,), (coat,) = shader("PRINCIPLED", cosine=0.5, **PRINCIPLED | {"roughness": 0.1})
    lost = fresnel(0.5, 1.5)
    table, every = MaterialCoefficients.of(body.materials, np.zeros(3)), np.arange(COUNT)
    left = (
        table.diffuse * table.view_terms(every, np.full(COUNT, 0.5, np.float32)).layer_transmittance * np.pi
    )
    np.testing.assert_allclose(left[:, 0], COLOR * (1 - lost), rtol=2e-3)
    np.testing.assert_allclose(coat.rough.reflectance(np.full(COUNT, 0.5)), lost)
    np.testing.assert_allclose(body.materials.specular_f0, 0.04)


def test_alpha_and_transmission_share_a_surface():
    bodies, sent = shader("PRINCIPLED", **PRINCIPLED | {"alpha": 0.25, "transmission": 1.0})
    through, mirror, refracted = sent
    assert [one.kind for one in sent] == ["TRANSPARENT", "GLOSSY", "TRANSMISSION"]
    np.testing.assert_allclose(through.tint, 0.75)
    # Light that enters and leaves has the base colour, so each way the root of it.
    share = fresnel(0.8, 1.5)
    np.testing.assert_allclose(mirror.tint, 0.25 * share)
    np.testing.assert_allclose(refracted.tint[:, 0], 0.25 * (1 - share) * np.sqrt(COLOR))
    np.testing.assert_allclose(bodies[0].materials.base_color, 0.0, atol=1e-12)


@pytest.mark.parametrize("ior", [1.0, 1.5, 2.4])
def test_indices_of_refraction_are_recovered_from_f0(ior):
    f0 = np.array([[((ior - 1) / (ior + 1)) ** 2]])
    assert ior_of(f0) == pytest.approx(ior)
