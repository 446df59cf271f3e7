# SPDX-License-Identifier: GPL-3.0-or-later
"""Lobes of shaders: bodies, reflections, glass and transparency, at most 1 in total."""

from typing import NamedTuple

import numpy as np
import pytest

from scfpf_addon.casting.common.geometry import Geometry
from scfpf_addon.shading.materials.coefficients import MaterialCoefficients
from scfpf_addon.shading.materials.constants import Materials
from scfpf_addon.shading.materials.lobes import RoughReflectance, bodies, split
from scfpf_addon.shading.materials.microfacet import ior_of
from scfpf_addon.shading.materials.parameters import ClosureRows
from scfpf_addon.shading.nodes.context import ShadingContext
from scfpf_addon.shading.nodes.graph import Closure, MaterialGraph, Operation, Ref
from scfpf_addon.shading.tracing.closure_table import closures_at
from scfpf_addon.shading.tracing.lobe_sampling import CLEAR, LAYER, METAL, MIRRORED, REFRACTED, SentLobes

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


class Shader(NamedTuple):
    """The lobes of one closure of constants. sent: by kind, those of any light."""

    rows: ClosureRows
    body: Materials
    sent: dict[int, SentLobes]

    def reflectance(self, kind, cosine):
        """The reflectance (3, COUNT) of metal or a layer, by the cosine to the facets."""
        rough = RoughReflectance.of(self.rows, COUNT if kind == METAL else 0)
        return rough.at(np.full(COUNT, cosine), np.ones(COUNT))


def shader(kind, weight=1.0, cosine=0.8, back=0.0, **inputs):
    """The lobes of one closure of constants."""
    operations = [Operation("CONSTANT", (), {"value": weight}), Operation("NORMAL")]
    refs = {"normal": Ref(1)}
    for name, value in inputs.items():
        refs[name] = Ref(len(operations))
        operations.append(Operation("CONSTANT", (), {"value": value}))
    graph = MaterialGraph(tuple(operations), (Closure(kind, Ref(0), refs),))
    ((rows, _),) = closures_at(graph, at_surface(cosine, back))
    split(rows)
    lobes = SentLobes.of(rows, np.full(COUNT, cosine), np.full(COUNT, back > 0.0))
    kinds = {number: lobes.take(np.flatnonzero(lobes.kind == number)) for number in np.unique(lobes.kind)}
    sent = {number: each for number, each in kinds.items() if each.tint.any()}
    return Shader(rows, bodies(rows), sent)


def schlick(r0, cosine):
    return r0 + (1 - r0) * (1 - cosine) ** 5


def fresnel(cosine, ior):
    """Reflectance by Snell's law and Fresnel's equations for both polarisations."""
    other = np.sqrt(1 - (1 - cosine**2) / ior**2)
    s, p = (cosine - ior * other) / (cosine + ior * other), (ior * cosine - other) / (ior * cosine + other)
    return (s * s + p * p) / 2


def test_diffuse_and_emission_are_bodies():
    matt = shader("DIFFUSE", 0.7, color=COLOR)
    assert not matt.sent and (matt.rows["body"] == 0.7).all()
    np.testing.assert_array_equal(matt.body.base_color, np.tile(COLOR, (COUNT, 1)))
    assert not matt.body.emission.any() and not matt.body.specular_f0.any()
    glow = shader("EMISSION", color=3 * COLOR)
    assert not glow.sent and not glow.body.base_color.any()
    np.testing.assert_allclose(glow.body.emission, np.tile(3 * COLOR, (COUNT, 1)))


def test_weights_of_zero_or_nan_make_no_lobe():
    for weight in (0.0, -1.0, np.nan):
        nothing = shader("DIFFUSE", weight, color=COLOR)
        assert not nothing.rows["body"].any() and not nothing.sent
    black = shader("DIFFUSE", color=np.array([np.nan, np.inf, -2.0]))
    np.testing.assert_array_equal(black.body.base_color, 0.0)


def test_a_transparent_lobe_has_the_closures_colour():
    made = shader("TRANSPARENT", 0.5, color=COLOR)
    assert not made.rows["body"].any() and set(made.sent) == {CLEAR}
    np.testing.assert_allclose(made.sent[CLEAR].tint, np.tile(0.5 * COLOR[:, None], COUNT))


@pytest.mark.parametrize("back", [0.0, 1.0])
@pytest.mark.parametrize("cosine", [1.0, 0.8])
def test_glass_reflects_fresnels_share_and_refracts_the_rest(cosine, back):
    sent = shader("GLASS", cosine=cosine, back=back, color=np.ones(3), roughness=0.0, ior=1.3).sent
    mirror, refracted = sent.pop(MIRRORED), sent.pop(REFRACTED)
    ratio = 1 / 1.3 if back else 1.3
    assert not sent
    np.testing.assert_allclose(refracted.ior, ratio)
    np.testing.assert_allclose(mirror.tint, fresnel(cosine, ratio), atol=1e-12)
    np.testing.assert_allclose(mirror.tint + refracted.tint, 1.0, atol=1e-12)


def test_coloured_glass_tints_its_reflection_and_what_is_behind():
    sent = shader("GLASS", color=COLOR, roughness=0.0, ior=1.3).sent
    np.testing.assert_allclose(sent[MIRRORED].tint[:, 0], COLOR * fresnel(0.8, 1.3))
    np.testing.assert_allclose(sent[REFRACTED].tint[:, 0], COLOR * (1 - fresnel(0.8, 1.3)))


def test_refraction_ends_at_the_critical_angle():
    for cosine, let_in in ((0.9, 1.0), (0.3, 0.0)):
        made = shader("REFRACTION", cosine=cosine, back=1.0, color=COLOR, ior=1.5)
        assert set(made.sent) == ({REFRACTED} if let_in else set())
        for refracted in made.sent.values():
            np.testing.assert_allclose(refracted.tint, np.tile(let_in * COLOR[:, None], COUNT))


def test_a_glossy_surface_is_followed_as_far_as_it_is_smooth():
    for roughness, share in ((0.2, 1.0), (0.8, 0.5), (1.0, 0.0)):
        made = shader("GLOSSY", color=COLOR, roughness=roughness, multiscatter=0.0)
        np.testing.assert_allclose(made.body.ambient, 1.0 - share, atol=1e-12)
        assert set(made.sent) == ({METAL} if share else set())
        for mirror in made.sent.values():
            np.testing.assert_allclose(mirror.tint, share)
            np.testing.assert_allclose(made.reflectance(METAL, 0.3), np.tile(COLOR[:, None], COUNT))


def test_a_rough_metal_reflects_by_schlick():
    made = shader("PRINCIPLED", **PRINCIPLED | {"metallic": 1.0, "roughness": 0.3})
    assert set(made.sent) == {METAL}
    np.testing.assert_allclose(made.reflectance(METAL, 0.4)[:, 0], schlick(COLOR, 0.4))
    np.testing.assert_allclose(made.reflectance(METAL, 1.0)[:, 0], COLOR)
    assert (made.body.metallic == 1.0).all() and (made.body.ambient == 0.0).all()


def test_a_dielectric_layer_takes_fresnels_share_from_the_diffuse_light():
    made = shader("PRINCIPLED", cosine=0.5, **PRINCIPLED | {"roughness": 0.1})
    lost = fresnel(0.5, 1.5)
    table, every = MaterialCoefficients.of(made.body, np.zeros(3)), np.arange(COUNT)
    left = (
        table.diffuse * table.view_terms(every, np.full(COUNT, 0.5, np.float32)).layer_transmittance * np.pi
    )
    np.testing.assert_allclose(left[:, 0], COLOR * (1 - lost), rtol=2e-3)
    assert set(made.sent) == {LAYER}
    np.testing.assert_allclose(made.reflectance(LAYER, 0.5), lost)
    np.testing.assert_allclose(made.body.specular_f0, 0.04)


def test_alpha_and_transmission_share_a_surface():
    made = shader("PRINCIPLED", **PRINCIPLED | {"alpha": 0.25, "transmission": 1.0})
    assert set(made.sent) == {CLEAR, REFRACTED, MIRRORED}
    np.testing.assert_allclose(made.sent[CLEAR].tint, 0.75)
    # Light that enters and leaves has the base colour, so each way the root of it.
    share = fresnel(0.8, 1.5)
    np.testing.assert_allclose(made.sent[MIRRORED].tint, 0.25 * share)
    np.testing.assert_allclose(made.sent[REFRACTED].tint[:, 0], 0.25 * (1 - share) * np.sqrt(COLOR))
    np.testing.assert_allclose(made.body.base_color, 0.0, atol=1e-12)


@pytest.mark.parametrize("ior", [1.0, 1.5, 2.4])
def test_indices_of_refraction_are_recovered_from_f0(ior):
    f0 = np.array([[((ior - 1) / (ior + 1)) ** 2]])
    assert ior_of(f0) == pytest.approx(ior)
