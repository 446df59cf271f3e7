# SPDX-License-Identifier: GPL-3.0-or-later
"""Lamps, shadows and highlights against closed forms."""

import numpy as np
import pytest

from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.shading.materials.ggx_sampling import single_scatter_albedo
from scfpf_addon.shading.scene.shading_scene import Light

DOWN = (0, 0, -1)
ALBEDO = np.array([0.8, 0.5, 0.2])


def point(build, location, watts=100.0, **more):
    return Light("POINT", np.full(3, watts), build.placed(location), casts_shadow=False, **more)


@pytest.mark.parametrize("degrees", [0, 30, 60, 85])
def test_diffuse_plane_under_a_sun(build, degrees):
    angle = np.radians(degrees)
    sun = Light("SUN", np.array([3, 2, 1.0]), build.placed((7, 8, 9), (np.sin(angle), 0, -np.cos(angle))))
    color = build.shade(build.scene(lights=[sun], base=ALBEDO), 0, [0.3, -0.2, 0])
    assert np.allclose(color[:, 0], ALBEDO / np.pi * np.array([3, 2, 1]) * np.cos(angle), rtol=1e-5)


def test_a_sun_from_below_the_visible_side_lights_nothing(build):
    sun = Light("SUN", np.ones(3), build.placed((0, 0, 0), (0, 0, 1)))
    assert not build.shade(build.scene(lights=[sun]), 0, [0, 0, 0]).any()


def test_faces_are_lit_on_the_visible_side(build):
    scene = build.scene(lights=[Light("SUN", np.ones(3), build.placed((0, 0, 0), (0, 0, 1)))])
    seen_from_below = build.shade(scene, 0, [0, 0, 0], tangent=(0, 0, 1))
    assert np.allclose(seen_from_below, 1 / np.pi)


def test_normals_that_oppose_the_winding_change_nothing(build):
    sun = Light("SUN", np.ones(3), build.placed((0, 0, 0), (0.5, 0, -1)))
    vertices, faces, _ = build.square()
    turned = build.scene([(vertices, faces, np.tile([0.0, 0, -1], (2, 3, 1)))], lights=[sun])
    assert np.allclose(
        build.shade(turned, 0, [0, 0, 0]), build.shade(build.scene(lights=[sun]), 0, [0, 0, 0])
    )


@pytest.mark.parametrize("unit", [1e-3, 1.0, 1e4])
@pytest.mark.parametrize("distance", [0.1, 1.0, 7.0])
def test_point_lamp_in_watts(build, unit, distance):
    """P/(4π d²) cos θ, in any unit of length and away from the origin."""
    shift = np.array([50.0, -20.0, 30.0]) * unit
    vertices, faces, normals = build.square()
    lamp_at = np.array([0.6, 0, 0.8]) * distance * unit
    scene = build.scene([(vertices * unit + shift, faces, normals)], [point(build, lamp_at + shift)])
    expected = 100 / (4 * np.pi * (distance * unit) ** 2) * 0.8 / np.pi
    assert np.allclose(build.shade(scene, 0, shift), expected, rtol=2e-5)


def test_soft_point_lamp_is_a_disc_that_faces_the_point(build):
    """Irradiance of a disc of radius r from its axis: the intensity times cos θ/(d² + r²)."""
    scene = build.scene(lights=[point(build, (0.6, 0, 0.8), radius=0.15)])
    soft = build.mean_shade(scene, 0, [0, 0, 0], 256).mean()
    assert soft == pytest.approx(100 / (4 * np.pi) * 0.8 / (1 + 0.15**2) / np.pi, rel=2e-3)


def mean_light(build, light, where=(0, 0, 0), samples=256):
    """Radiance of a point on a white diffuse square, over all samples."""
    return build.mean_shade(build.scene(lights=[light]), 0, where, samples)[0, 0]


@pytest.mark.parametrize("distance", [0.5, 3.0])
def test_a_sphere_lights_as_a_point_in_its_middle(build, distance):
    """A sphere wholly above the ground has the irradiance I cos θ/d²; inside the sphere it is I/r²."""
    place, radius = np.array((0.6, 0, 0.8)) * distance, 0.35 * distance
    sphere = point(build, place, radius=radius, sphere=True)
    assert mean_light(build, sphere) == pytest.approx(100 / (4 * np.pi) * 0.8 / distance**2 / np.pi, rel=2e-3)
    around = point(build, (0, 0.1, 0.1), radius=radius, sphere=True)
    assert mean_light(build, around) == pytest.approx(100 / (4 * np.pi) / radius**2 / np.pi, rel=0.02)


def test_a_soft_lamp_nearby_is_a_disc_that_faces_the_point(build):
    """Closed form of the disc, at half its radius; places in a ball approximate an even disc to 1 %."""
    lamp = point(build, (0, 0, 0.5), radius=1.0)
    assert mean_light(build, lamp) == pytest.approx(100 / (4 * np.pi) / (0.5**2 + 1) / np.pi, rel=0.01)


@pytest.mark.parametrize("ellipse", [False, True])
@pytest.mark.parametrize("degrees", [0, 1, 20, 60, 120])
def test_below_a_large_lamp_light_is_that_of_parallel_beams(build, degrees, ellipse):
    """If all light within the spread is from the lamp, irradiance is power by area for any spread."""
    size, height = (4.0, 5.0), 0.7
    lamp = area(
        build,
        100.0,
        build.placed((0.2, 0.1, height)),
        size=size,
        ellipse=ellipse,
        spread=np.radians(degrees),
    )
    expected = 100 / (4 * 5 * (np.pi / 4 if ellipse else 1)) / np.pi
    assert mean_light(build, lamp) == pytest.approx(expected, rel=5e-3)


def test_a_spread_of_nearly_half_a_turn_is_none(build):
    lamp, wide = (
        area(build, 100.0, build.placed((0.3, 0, 0.8)), size=(0.5, 0.3), spread=spread)
        for spread in (np.pi, np.pi - 1e-4)
    )
    assert mean_light(build, wide) == pytest.approx(mean_light(build, lamp), rel=1e-3)


def test_a_spread_ends_at_its_angle(build):
    lamp = area(build, 100.0, build.placed((0, 0, 1)), size=(0.5, 0.3), spread=1.0)
    edge = 0.25 + np.tan(0.5)
    scene = build.scene([build.square(4)], [lamp])
    where = np.array([[0.97, 1.01], [0, 0], [0, 0]]) * edge
    light = build.mean_shade(scene, 0, where, 16)[0]
    assert (light > 0).tolist() == [True, False]


def spot(build, angle, blend, matrix=None):
    matrix = build.placed((0, 0, 2)) if matrix is None else matrix
    return Light("SPOT", np.full(3, 100.0), matrix, False, spot_angle=angle, spot_blend=blend)


def test_spot_has_a_hard_edge_without_blend(build):
    scene = build.scene([build.square(4)], [spot(build, 1.0, 0.0)])
    edge = 2 * np.tan(0.5)
    inside, outside = build.shade(scene, 0, np.array([[0.998, 1.002], [0, 0], [0, 0]]) * edge)[0]
    as_point = build.shade(build.scene([build.square(4)], [point(build, (0, 0, 2))]), 0, [0.998 * edge, 0, 0])
    assert inside == pytest.approx(as_point[0, 0], rel=1e-5)
    assert outside == 0


def test_spot_blends_as_a_smoothstep_of_the_cosine(build):
    angle, blend = 1.4, 0.6
    scene = build.scene([build.square(4)], [spot(build, angle, blend)])
    bright = build.scene([build.square(4)], [point(build, (0, 0, 2))])
    share = np.array([0.0, 0.25, 0.5, 0.75, 1.0])
    cosine = np.cos(angle / 2) + share * blend * (1 - np.cos(angle / 2))
    where = np.stack([2 * np.tan(np.arccos(cosine)), 0 * share, 0 * share])
    ratio = build.shade(scene, 0, where)[0] / build.shade(bright, 0, where)[0]
    assert np.allclose(ratio, share**2 * (3 - 2 * share), atol=1e-4)


def test_spot_cone_follows_the_lamp_s_scale(build):
    """Twice as wide along X: the edge lies at twice the tangent there, and at the same along Y."""
    wide = build.placed((0, 0, 2)) @ np.diag([2.0, 1, 1, 1])
    scene = build.scene([build.square(8)], [spot(build, 1.0, 0.0, wide)])
    x, y = wide[:3, 0] / 2, wide[:3, 1]
    edge = 2 * np.tan(0.5)
    where = np.stack([x * 1.99 * edge, x * 2.01 * edge, y * 0.99 * edge, y * 1.01 * edge], axis=1)
    assert (build.shade(scene, 0, where * [[1], [1], [0]])[0] > 0).tolist() == [True, False, True, False]


def area(build, watts, matrix, **more):
    return Light("AREA", np.full(3, watts), matrix, casts_shadow=False, **more)


@pytest.mark.parametrize("ellipse", [False, True])
def test_far_area_lamp_equals_a_point_of_the_same_intensity(build, ellipse):
    """On its axis an area lamp of P watts has the intensity P/π, that of a point of 4 P."""
    lamp = area(build, 100.0, build.placed((0, 0, 50)), size=(0.4, 0.2), ellipse=ellipse)
    far = mean_light(build, lamp, samples=16)
    one = build.shade(build.scene(lights=[point(build, (0, 0, 50), 400.0)]), 0, [0, 0, 0])[0, 0]
    assert far == pytest.approx(one, rel=1e-3)


def test_near_area_lamp_has_the_form_factor_of_a_rectangle(build):
    """Irradiance L π F below the middle of a parallel rectangle, F in closed form."""
    width, depth, height = 2.0, 1.0, 0.7
    lamp = area(build, 100.0, build.placed((0, 0, height)), size=(width, depth))
    a, b = width / 2 / height, depth / 2 / height
    root_a, root_b = np.sqrt(1 + a * a), np.sqrt(1 + b * b)
    factor = 4 / (2 * np.pi) * (a / root_a * np.arctan(b / root_a) + b / root_b * np.arctan(a / root_b))
    expected = 100 / (np.pi * width * depth) * factor
    assert mean_light(build, lamp) == pytest.approx(expected, rel=5e-3)


def test_near_disc_lamp_has_the_form_factor_of_a_disc(build):
    radius, height = 0.8, 0.6
    lamp = area(build, 100.0, build.placed((0, 0, height)), size=(2 * radius,) * 2, ellipse=True)
    expected = 100 / (np.pi * np.pi * radius**2) * radius**2 / (radius**2 + height**2)
    assert mean_light(build, lamp) == pytest.approx(expected, rel=5e-3)


def test_area_lamp_is_dark_behind(build):
    lamp = area(build, 100.0, build.placed((0, 0, 1), (0, 0, 1)))
    assert not build.shade(build.scene(lights=[lamp]), 0, [0, 0, 0]).any()


def test_area_lamp_s_power_does_not_grow_with_its_scale(build):
    grown = build.placed((0, 0, 50)) @ np.diag([3.0, 2.0, 1, 1])
    colors = [
        build.shade(build.scene(lights=[area(build, 100.0, m)]), 0, [0, 0, 0])[0, 0]
        for m in (build.placed((0, 0, 50)), grown)
    ]
    assert colors[0] == pytest.approx(colors[1], rel=1e-5)


def hemisphere(rings=1000, around=80):
    """Directions (3, N) and solid angles (N,) of the upper hemisphere, cell by cell."""
    z = (np.arange(rings) + 0.5) / rings
    turn = (np.arange(around) + 0.5) / around * 2 * np.pi
    z, turn = (a.ravel() for a in np.meshgrid(z, turn, indexing="ij"))
    ring = np.sqrt(1 - z * z)
    return np.stack([ring * np.cos(turn), ring * np.sin(turn), z]), np.full(len(z), 2 * np.pi / len(z))


@pytest.mark.parametrize("roughness", [0.3, 0.5, 0.8, 1.0])
@pytest.mark.parametrize("degrees", [0, 50])
def test_the_lobe_reflects_the_light_that_arrives(build, roughness, degrees):
    """A white metal: single scattering off random facets, with energy compensation at each angle."""
    angle = np.radians(degrees)
    sun = Light("SUN", np.ones(3), build.placed((0, 0, 0), (np.sin(angle), 0, -np.cos(angle))), False)
    metal = build.scene(lights=[sun], metallic=1.0, roughness=roughness, f0=0.04)
    towards, solid_angle = hemisphere()
    leaving = build.shade(metal, 0, np.zeros((3, len(solid_angle))), tangent=-towards)[0]
    leaving *= single_scatter_albedo(towards[2], np.full(len(solid_angle), roughness))
    reflected = (leaving * towards[2] * solid_angle).sum() / np.cos(angle)
    once = single_scatter_albedo(np.array([np.cos(angle)]), np.array([roughness]))[0]
    assert reflected == pytest.approx(once, rel=1e-2)


def test_a_metal_has_no_diffuse_light(build):
    sun = Light("SUN", np.ones(3), build.placed((0, 0, 0), DOWN))
    metal = build.scene(lights=[sun], metallic=1.0, roughness=0.1, f0=0.04)
    assert build.shade(metal, 0, [0, 0, 0], tangent=(1, 0, -0.3))[0, 0] == pytest.approx(0, abs=3e-4)


@pytest.mark.parametrize("roughness", [0.0, 0.25, 0.6])
def test_the_highlight_lies_where_the_tangent_mirrors_the_lamp(build, roughness):
    towards, _ = hemisphere(60, 120)
    light = np.array([0.6, 0, 0.8])
    sun = Light("SUN", np.ones(3), build.placed((0, 0, 0), -light), casts_shadow=False)
    metal = build.scene(lights=[sun], metallic=1.0, roughness=roughness)
    mirrored = np.array([[-0.6], [0], [0.8]])
    towards = np.concatenate([mirrored, towards], axis=1)
    leaving = build.shade(metal, 0, np.zeros_like(towards), tangent=-3.7 * towards)[0]
    # The brightest points of rough surfaces lie nearer to their horizon.
    assert leaving.argmax() == 0 or roughness > 0.5
    rough = max(roughness, 0.08)
    squared = rough**4
    # GGX's density over masking by Smith, both at the middle, times Lambert's cosine.
    full = 1 / (np.pi * squared) / (4 * 0.8 * np.sqrt(squared + (1 - squared) * 0.64)) * 0.8
    full /= single_scatter_albedo(np.array([0.8]), np.array([rough]))[0]
    assert leaving[0] == pytest.approx(full, rel=2e-2 if not roughness else 3e-3)


def test_emission_and_world_add_up(build):
    scene = build.scene(base=ALBEDO, emission=(1, 2, 3), world=(0.5, 0.25, 1))
    assert np.allclose(build.shade(scene, 0, [0, 0, 0])[:, 0], [1.4, 2.125, 3.2])


def test_lamps_add_up(build):
    lamps = [point(build, (0, 0, 1)), point(build, (1, 0, 1)), point(build, (0, 1, 2), 30.0)]
    each = [build.shade(build.scene(lights=[lamp], f0=0.3), 0, [0.1, 0, 0]) for lamp in lamps]
    assert np.allclose(build.shade(build.scene(lights=lamps, f0=0.3), 0, [0.1, 0, 0]), sum(each), rtol=1e-5)


def blocked(build, lamp, **more):
    """A floor with a small level square 1 above it, whose edges lie at x, y = ±0.25."""
    return build.scene([build.square(3), build.square(0.25, 1.0)], [lamp], **more)


def test_faint_lamps_get_few_rays_and_the_same_mean(build, monkeypatch):
    """Beside each lamp alone, which gets all its rays: light adds up. In the open there is no noise."""
    bright = Light("SUN", np.array([40.0, 20, 20]), build.placed((0, 0, 0), (2, 0, -1)))
    faint = [
        Light("SUN", np.array([0.1, 0.1, 0.2]), build.placed((0, 0, 0), (k, 0, -1))) for k in (-0.1, 0.1)
    ]
    places = np.random.default_rng(3).uniform(-0.6, 0.6, (3, 20_000)) * [[1], [1], [0]]
    rays, cast = [0], CastScene.occluded

    def counted(self, origins, directions, distances):
        hidden = cast(self, origins, directions, distances)
        rays[0] += np.count_nonzero(np.broadcast_to(distances, hidden.shape))
        return hidden

    monkeypatch.setattr(CastScene, "occluded", counted)

    def light(*lamps):
        rays[0] = 0
        scene = build.scene([build.square(3), build.square(0.25, 1.0)], lamps, f0=0.04)
        return build.shade(scene, 0, places), rays[0]

    alone, all_rays = (sum(parts) for parts in zip(*(light(each) for each in (bright, *faint)), strict=True))
    made, few = light(bright, *faint)
    assert few < 0.75 * all_rays and (made >= 0.0).all()
    assert made.mean(axis=1) == pytest.approx(alone.mean(axis=1), rel=0.002)
    dark = np.abs(alone - alone.max(axis=1, keepdims=True)) > 1e-4
    assert dark.any() and np.abs(made - alone)[dark].max() > 1e-3
    assert np.allclose(made[~dark], alone[~dark], rtol=1e-5)


def test_the_edge_of_a_sun_s_shadow(build):
    """The sun goes 0.5 to the right on its way down by 1, so the shadow is moved by that."""
    scene = blocked(build, Light("SUN", np.ones(3), build.placed((0, 0, 0), (0.5, 0, -1))))
    x = np.array([0.249, 0.251, 0.749, 0.751])
    lit = build.shade(scene, 0, np.stack([x, 0 * x, 0 * x]))[0] > 0
    assert lit.tolist() == [True, False, False, True]


def test_the_rim_of_a_wide_sun_s_shadow(build):
    """A disc of the sky of 0.2 rad, straight above: its rim is 2 tan 0.1 wide at the depth 1.

    Where the fraction s of its diameter is hidden, by a straight edge, the segment of a disc is.
    """
    sun = Light("SUN", np.ones(3), build.placed((0, 0, 0), DOWN), angle=0.2)
    scene = blocked(build, sun)
    reach = np.tan(0.1)
    for share in (0.1, 0.5, 0.8):
        x = 0.25 + reach * (2 * share - 1)
        lit = build.mean_shade(scene, 0, [x, 0, 0], 256)[0, 0]
        height = 2 * share - 1
        seen = 1 - (np.arccos(height) - height * np.sqrt(1 - height**2)) / np.pi
        assert lit == pytest.approx(seen / np.pi, abs=0.02 / np.pi)


def test_the_edge_of_a_point_lamp_s_shadow(build):
    """From (0, 0, 3) the square's edge at (0.25, ·, 1) falls on x = 0.375."""
    scene = blocked(build, Light("POINT", np.ones(3), build.placed((0, 0, 3))))
    x = np.array([-0.376, -0.374, 0.374, 0.376])
    lit = build.shade(scene, 0, np.stack([x, 0 * x, 0 * x]))[0] > 0
    assert lit.tolist() == [True, False, False, True]


def test_nothing_beyond_the_lamp_casts_a_shadow(build):
    scene = blocked(build, Light("POINT", np.ones(3), build.placed((0, 0, 0.9))))
    assert build.shade(scene, 0, [0, 0, 0]).all()


def test_a_lamp_without_shadow_shines_through(build):
    scene = blocked(build, Light("SUN", np.ones(3), build.placed((0, 0, 0), DOWN), casts_shadow=False))
    assert np.allclose(build.shade(scene, 0, [0, 0, 0]), 1 / np.pi)


@pytest.mark.parametrize("kind", ["AREA", "POINT"])
def test_half_of_a_soft_shadow(build, kind):
    """Half of the lamp is visible where the occluder's edge covers its middle."""
    size = {"size": (0.4, 0.4)} if kind == "AREA" else {"radius": 0.2}
    scene = blocked(build, Light(kind, np.ones(3), build.placed((0.25, 0, 3)), **size))
    open_floor = build.scene([build.square(3)], scene.lights)
    found, unblocked = (build.mean_shade(s, 0, [0.25, 0, 0], 64)[0, 0] for s in (scene, open_floor))
    assert found / unblocked == pytest.approx(0.5, abs=0.05)


@pytest.mark.parametrize("shift", [0.0, 1e5])
def test_a_lit_facet_does_not_shadow_itself(build, shift):
    """At every angle, down to light that grazes by a degree."""
    vertices, faces, _ = build.sphere(24, centre=(shift, shift, 0))
    weights = np.random.default_rng(3).dirichlet(np.ones(3), len(faces))
    where = np.einsum("tk,tkc->ct", weights, vertices[faces])
    part = (vertices, faces, None)
    flat = build.geometry(part).corner_normals[:, 0].T
    for angle in np.radians(np.arange(1, 90, 8)):
        towards = np.array([np.cos(angle), 0, np.sin(angle)])
        sun = Light("SUN", np.ones(3), build.placed((0, 0, 0), -towards))
        lit = build.shade(build.scene([part], [sun]), np.arange(len(faces)), where, -flat)[0] > 0
        facing = towards @ flat
        assert lit[facing > np.sin(np.radians(1))].all()
        assert not lit[facing < 0].any()


def test_smooth_shading_hides_the_facets_where_light_grazes(build):
    """A coarse smooth sphere is lit up to the terminator of the pretended surface, not facet by facet."""
    vertices, faces, normals = build.sphere(8)
    rng = np.random.default_rng(5)
    chosen = rng.integers(0, len(faces), 4000)
    weights = rng.dirichlet(np.ones(3), 4000)
    where = np.einsum("nk,nkc->cn", weights, vertices[faces[chosen]])
    normal = np.einsum("nk,nkc->cn", weights, normals[chosen])
    cosine = np.array([0.6, 0, 0.8]) @ normal / np.linalg.norm(normal, axis=0)
    sun = Light("SUN", np.ones(3), build.placed((0, 0, 0), (-0.6, 0, -0.8)))
    lit = build.shade(build.scene([(vertices, faces, normals)], [sun]), chosen, where, -normal)[0] > 0
    certain = np.abs(cosine) > 1e-3
    assert (lit == (cosine > 0))[certain].all()


def test_smooth_shading_keeps_shadows_at_their_place(build):
    """A box shaded smooth pretends to bulge far out; light that does not graze its faces is not affected."""
    corners = np.array(np.meshgrid([-1.0, 1], [-1.0, 1], [-1.0, 1], indexing="ij")).reshape(3, -1).T
    top = [[1, 5, 7], [1, 7, 3]]
    box = corners, top, (corners / np.sqrt(3))[np.array(top)]
    sun = Light("SUN", np.ones(3), build.placed(shines=(1, 0, -1)))
    lid = build.square(0.25, 1.01)
    scene = build.scene([box, lid], [sun])
    x = np.array([-0.241, -0.239, 0.259, 0.261])
    lit = build.shade(scene, 1, np.stack([x, 0 * x + 0.1, 0 * x + 1]))[0] > 0
    assert lit.tolist() == [True, False, False, True]
