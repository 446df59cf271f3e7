# SPDX-License-Identifier: GPL-3.0-or-later
"""Worlds of nodes without Blender: directions, lamps and soft light, rough reflections."""

from dataclasses import replace
from functools import cache
from itertools import product

import numpy as np
import pytest

from scfpf_addon.casting.continuation import cast_rays
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.colors import LUMINANCE
from scfpf_addon.projection.surfaces.surface import Plane
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.lights.sky_light import SkyLight
from scfpf_addon.shading.materials import ggx_sampling
from scfpf_addon.shading.nodes.graph import Closure, MaterialGraph, Operation, Ref
from scfpf_addon.shading.nodes.image import ImageData
from scfpf_addon.shading.passes.data_passes import DataPasses
from scfpf_addon.shading.sampling.adaptive import Adaptive
from scfpf_addon.shading.scene.shading_scene import Light
from scfpf_addon.shading.scene.sky_map import (
    COLUMNS,
    ROWS,
    WorldLight,
    curve_places,
    map_areas,
    map_directions,
)
from scfpf_addon.shading.scene.world import World, reduced
from scfpf_addon.shading.settings.frame_settings import Border, FrameSettings


def constant(*value):
    return Operation("CONSTANT", (), {"value": np.array(value, float)})


def by_direction():
    """A world whose colour is half the direction plus grey."""
    operations = (
        constant(1.0),
        Operation("POSITION"),
        constant(0.5, 0.5, 0.5),
        Operation("VECTOR_MATH", (Ref(1), Ref(2), Ref(2), Ref(0)), {"operation": "MULTIPLY_ADD"}),
    )
    return World(MaterialGraph(operations, (Closure("EMISSION", Ref(0), {"color": Ref(3)}),)))


def of_image(pixels):
    """A world of an equirectangular image (H, W, 3)."""
    data = np.ones((*pixels.shape[:2], 4), np.float32)
    data[..., :3] = pixels
    settings = {"image": "Sky", "projection": "EQUIRECTANGULAR", "interpolation": "Linear"}
    operations = (constant(1.0), Operation("POSITION"), Operation("ENVIRONMENT", (Ref(1),), settings))
    graph = MaterialGraph(operations, (Closure("EMISSION", Ref(0), {"color": Ref(2)}),))
    return World(graph, {"Sky": ImageData(data, False)})


@cache
def sunny(sun=5000.0):
    """A gradient with a sun of a few texels, and the sun's texels."""
    directions = map_directions(COLUMNS, ROWS)
    pixels = 0.5 + 0.4 * directions[2] * np.array([[0.2], [0.6], [1.0]])
    towards = np.array([0.48, -0.6, 0.64])
    pixels[:, towards @ directions > np.cos(0.006)] = sun
    return of_image(pixels.T.reshape(ROWS, COLUMNS, 3)), towards


def bent():
    """Projectors that leave the volume sideways."""
    surfaces = []
    for height, shift, size in ((3.0, 0.0, 1.0), (1.0, 0.3, 1.5), (-1.0, 2.0, 2.5)):
        matrix = np.eye(4)
        matrix[:3, 3] = shift, 0, height
        surfaces.append(Plane(width=size, height=size, matrix=matrix))
    return Projection(ViewingVolume(tuple(surfaces)), aspect=1)


@pytest.mark.parametrize("with_things", [False, True])
def test_the_world_is_seen_where_projectors_leave_the_volume(build, with_things):
    part = (
        build.square(0.2, 2.0)
        if with_things
        else (np.zeros((0, 3)), np.zeros((0, 3), int), np.zeros((0, 3, 3)))
    )
    scene = replace(build.scene([part]), world=by_direction())
    projection = bent()
    clear = render_frame(projection, scene, FrameSettings(9, 9, samples=1, transparent=True)).pixels
    empty = clear[..., 3] == 0.0
    assert not clear[empty].any() and empty.all() != with_things and empty.sum() > 60
    pixels = render_frame(projection, scene, FrameSettings(9, 9, samples=1)).pixels
    x, y = (each.ravel() for each in np.meshgrid((np.arange(9) + 0.5) / 9, (np.arange(9) + 0.5) / 9))
    points = projection.projectors(x, y).points
    way = points[-1] - points[-2]
    expected = (0.5 + 0.5 * way / np.linalg.norm(way, axis=0)).T.reshape(9, 9, 3)
    assert np.abs(pixels[empty][:, :3] - expected[empty]).max() < 1e-6
    assert (pixels[..., 3] == 1.0).all()


def test_lamps_and_soft_light_add_up_to_the_world():
    world, towards = sunny()
    light = world.light
    areas = map_areas(COLUMNS, ROWS)
    assert areas.sum() * COLUMNS == pytest.approx(4 * np.pi)
    directions = map_directions(COLUMNS, ROWS)
    whole = world.radiance(directions).reshape(3, ROWS, COLUMNS) * areas[:, None]
    lamps = sum(color for _, color in light.lamps)
    even = light.soft.light.sum(axis=1)
    assert lamps + even == pytest.approx(whole.sum(axis=(1, 2)), rel=1e-6)
    sun = whole.reshape(3, -1)[:, towards @ directions > np.cos(0.006)].sum(axis=1)
    assert lamps == pytest.approx(sun, rel=0.01)
    places = SkyLight.of(light, 16).lamps[0].sky
    assert (towards @ places).min() > np.cos(0.01)
    # Irradiance on any side is the sum over all directions.
    normals = np.random.default_rng(1).normal(size=(3, 10))
    normals /= np.linalg.norm(normals, axis=0)
    found = SkyLight.of(light, 4).irradiance(normals.astype(np.float32))
    left = light.without_lamps(directions, world.radiance(directions)) * np.repeat(areas, COLUMNS)
    expected = left @ np.maximum(directions.T @ normals, 0.0)
    assert found == pytest.approx(expected, rel=0.005)


def test_a_large_bright_area_becomes_no_lamp():
    """An area as large as a window is whole in mirrors."""
    pixels = np.full((ROWS, COLUMNS, 3), 0.1)
    pixels[300:380, 200:300] = 20.0
    assert of_image(pixels).light.lamps == ()


def test_large_images_are_averaged():
    pixels = np.random.default_rng(2).random((1100, 2100, 4)).astype(np.float32)
    small = reduced(ImageData(pixels, False))
    assert small.pixels.shape == (367, 700, 4)
    assert small.pixels[5, 7] == pytest.approx(pixels[15:18, 21:24].mean(axis=(0, 1)), rel=1e-5)
    eights = (pixels[:, :, :] * 255).astype(np.uint8)
    linear = reduced(ImageData(eights, True))
    assert not linear.encoded and linear.pixels[..., :3].mean() == pytest.approx(1 / 3.2, rel=0.1)


def test_the_curve_goes_from_neighbour_to_neighbour():
    order = np.argsort(curve_places(16))
    row, column = np.divmod(order, 32)
    assert (np.abs(np.diff(row)) + np.abs(np.diff(column)) == 1).all()


def mirror(roughness):
    """A metal that reflects all light."""
    operations = (constant(1.0), constant(1.0, 1.0, 1.0), constant(roughness), Operation("NORMAL"))
    inputs = {"color": Ref(1), "roughness": Ref(2), "normal": Ref(3), "multiscatter": Ref(0)}
    return MaterialGraph(operations, (Closure("GLOSSY", Ref(0), inputs),), reflects=True)


def mirrored_scene(build, roughness, world):
    scene = build.scene([build.square(5.0)])
    materials = replace(scene.materials, graphs={0: mirror(roughness)})
    return replace(scene, materials=materials, world=world)


def test_mirrors_show_the_world_along_the_straight_ray(build):
    """In a furnace a rough mirror reflects all light at any angle."""
    scene = mirrored_scene(build, 0.0, by_direction())
    settings = FrameSettings(4, 4, samples=1)
    pixels = render_frame(build.looking_down(3.0, -3.0, shifts=(0.0, 3.0)), scene, settings).pixels
    way = np.array([3.0, 0.0, 6.0]) / np.sqrt(45.0)
    assert np.abs(pixels[..., :3] - (0.5 + 0.5 * way)).max() < 1e-6
    furnace = of_image(np.ones((8, 16, 3)))
    for roughness in (0.6,):
        view = build.looking_down(3.0, -3.0, shifts=(0.0, 6.0))
        settings = FrameSettings(8, 8, samples=32)
        pixels = render_frame(view, mirrored_scene(build, roughness, furnace), settings).pixels
        assert pixels[..., :3].mean() == pytest.approx(1.0, abs=0.01)


def test_threads_and_borders_change_nothing(build):
    """Random numbers of rough reflections depend on the pixel, those of the sky's shadows on the position."""
    world, _ = sunny()
    parts = [build.square(5.0), build.sphere(8, (0.2, 0.1, 0.6), 0.4)]
    scene = build.scene(parts)
    scene = replace(scene, materials=replace(scene.materials, graphs={0: mirror(0.4)}), world=world)
    settings = FrameSettings(24, 24, samples=4, threads=1)
    whole = render_frame(bent(), scene, settings).pixels
    assert (render_frame(bent(), scene, replace(settings, threads=3)).pixels == whole).all()
    border = Border(5, 7, 20, 16)
    part = render_frame(bent(), scene, replace(settings, border=border)).pixels
    assert (part == whole[7:16, 5:20]).all()
    assert len(np.unique(whole.reshape(-1, 4), axis=0)) > 300


@pytest.mark.parametrize("adaptive", [None, Adaptive(0.02, 2)])
def test_light_passes_add_up_to_the_image(build, adaptive):
    """The sky's light on surfaces is diffuse or specular, the visible sky is the environment."""
    world, _ = sunny(500.0)
    scene = build.scene([build.square(0.6), build.sphere(8, (0.1, 0.1, 0.4), 0.3)])
    scene = replace(scene, materials=replace(scene.materials, graphs={0: mirror(0.3)}), world=world)
    names = ("DIFFUSE", "SPECULAR", "EMISSION", "ENVIRONMENT")
    settings = FrameSettings(12, 12, samples=4, passes=DataPasses(names), adaptive=adaptive)
    frame = render_frame(bent(), scene, settings)
    assert sum(frame.passes[name] for name in names) == pytest.approx(frame.pixels[..., :3], abs=1e-5)
    assert all(frame.passes[name].any() for name in ("DIFFUSE", "SPECULAR", "ENVIRONMENT"))
    clear = render_frame(bent(), scene, replace(settings, transparent=True, adaptive=None))
    assert (clear.pixels[..., 3] < 1.0).any()
    assert clear.passes["ENVIRONMENT"].max() > 0.1


@pytest.mark.parametrize("roughness", [0.3, 0.8])
@pytest.mark.parametrize("cosine", [0.25, 0.9])
def test_facets_reflect_as_their_distribution_says(roughness, cosine):
    """The mean of random samples against the GGX reflectance summed over all directions."""
    alpha = roughness**2
    view = np.array([np.sqrt(1 - cosine**2), 0.0, cosine])
    directions = map_directions(COLUMNS, ROWS)
    upper = directions[2] > 0
    way, area = directions[:, upper], np.repeat(map_areas(COLUMNS, ROWS), COLUMNS)[upper]
    half = way + view[:, None]
    half /= np.linalg.norm(half, axis=0)
    density = alpha**2 / (np.pi * (half[2] ** 2 * (alpha**2 - 1) + 1) ** 2)
    shadow = 1 / (1 + ggx_sampling.smith_lambda(way[2], alpha) + ggx_sampling.smith_lambda(cosine, alpha))
    value = density * shadow / (4 * cosine)
    share = (np.arange(4096)[:, None] * ggx_sampling.R2_STEP % 1.0).T
    many = np.repeat(view[:, None], 4096, axis=1)
    up = np.repeat([[0.0], [0.0], [1.0]], 4096, axis=1)
    lobe = ggx_sampling.RoughLobe.of(-many, up, up, np.full(4096, roughness))
    sampled = lobe.sampled(share)
    way_drawn, passed = sampled.direction, sampled.passed
    # The lobe has axes of its own, so only heights are compared.
    for power in (0, 1, 3):
        expected = (value * way[2] ** power * area).sum()
        assert (passed * np.maximum(way_drawn[2], 0) ** power).mean() == pytest.approx(expected, rel=0.01)
    # A mean over samples is a sum over directions, those below the surface included.
    few = directions.shape[1]
    whole = ggx_sampling.RoughLobe.of(
        *(each[:, :1].repeat(few, 1) for each in (-many, up, up)), np.full(few, roughness)
    )
    density = whole.along(directions).density * np.repeat(map_areas(COLUMNS, ROWS), COLUMNS)
    # No facet faces away.
    density *= directions[2] > -cosine
    assert density.sum() == pytest.approx(1.0, rel=2e-3)
    assert (density * directions[2]).sum() == pytest.approx(way_drawn[2].mean(), abs=2e-3)
    once = ggx_sampling.single_scatter_albedo(np.array([cosine]), np.array([roughness]))[0]
    assert once == pytest.approx((value * area).sum(), rel=0.02)


def test_bright_parts_of_a_sky_are_in_cones():
    """A panel of 20 by 10 degrees in a dim sky: its light is in the cones, which hold little else."""
    directions = map_directions(COLUMNS, ROWS)
    height, turn = np.arcsin(directions[2]), np.arctan2(directions[1], directions[0])
    panel = (np.abs(height - 0.6) < 0.0873) & (np.abs(turn) < 0.1745)
    panorama = np.where(panel, 20.0, 0.5) * np.ones((3, 1))
    spots = WorldLight.of(panorama.reshape(3, ROWS, COLUMNS)).spots
    held = np.any([directions.T @ spot.direction >= spot.cosine for spot in spots], axis=0)
    area = np.repeat(map_areas(COLUMNS, ROWS), COLUMNS)
    assert held[panel].all()
    assert area[held].sum() < 5 * area[panel].sum()
    assert WorldLight.of(np.full((3, ROWS, COLUMNS), 0.5)).spots == ()


def test_rays_off_small_objects_in_a_large_scene_leave_them(build):
    """An object a thousandth of the scene's size: rays that leave a face meet none of its faces."""
    scene = build.geometry(build.square(40.0, -1.0), build.sphere(16, (1.3, -1.1, -0.3), 0.04))
    cast_scene = CastScene(scene.vertices, scene.triangles)
    small = np.flatnonzero(scene.material == 1).astype(np.int32)
    middle = scene.vertices[scene.triangles[small]].mean(axis=1).T
    place = cast_scene.matrix[:3, :3] @ middle + cast_scene.matrix[:3, 3:]
    normals = cast_scene.normals(small)
    lean = np.random.default_rng(4).normal(size=normals.shape)
    way = normals + 0.8 * lean / np.linalg.norm(lean, axis=0)
    way /= np.linalg.norm(way, axis=0)
    hits = cast_rays(cast_scene, cast_scene.offset_origins(place, small, way), way)
    assert not (scene.material[hits.triangle] == 1)[hits.triangle >= 0].any()


def test_luminance_is_that_of_white():
    assert LUMINANCE.sum() == pytest.approx(1.0)


def canyon(build, world, **more):
    """A floor between two walls, under a world, seen from above."""
    corners = [[x, y, z] for x, top in ((-1, 1), (1, 0.2)) for z in (-1, top) for y in (-2, 2)]
    walls = corners, [[0, 1, 3], [0, 3, 2], [4, 5, 7], [4, 7, 6]], None
    return replace(build.scene([build.square(1.0, -1.0), walls], **more), world=world)


@cache
def hidden_floor(width, height):
    """Radiance (H, W, 3) of the white floor of the canyon, under ``sunny(0.4)``.

    It is summed over all directions that the walls do not occlude.
    """
    directions, world = map_directions(256, 128), sunny(0.4)[0]
    light = world.light.without_lamps(directions, world.radiance(directions))
    light = light * np.repeat(map_areas(256, 128), 256) * directions[2]
    light, directions = (values[:, directions[2] > 0] for values in (light, directions))
    across, up = (2 * (np.arange(size) + 0.5) / size - 1 for size in (width, height))
    found = []
    for y, x in product(up, across):
        free = np.ones(len(directions[0]), bool)
        for wall, top in ((-1.0, 2.0), (1.0, 1.2)):
            with np.errstate(divide="ignore"):
                far = (wall - x) / directions[0]
            hit = (far > 0) & (np.abs(y + far * directions[1]) < 2.0) & (far * directions[2] < top)
            free &= ~hit
        found.append(light[:, free].sum(axis=1))
    return np.array(found).reshape(height, width, 3) / np.pi


@pytest.mark.parametrize("samples", [1, 64])
def test_occlusion_of_the_sky_is_unbiased(build, samples):
    """Against a sum over all directions. In the sun there are fewer rays, and the mean is the same."""
    world, _ = sunny(0.4)
    # The image has few pixels, in the sun with few rays each.
    means, each = {1: 0.1, 64: 0.02}, {1: 0.13, 64: 0.07}
    settings = FrameSettings(48, 12, samples=samples)
    view = build.looking_down(3.0, -3.0, size=2.0)
    expected = hidden_floor(48, 12)
    shade = render_frame(view, canyon(build, world), settings).pixels[..., :3]
    open_sky = SkyLight.of(world.light, 4).irradiance(np.float32([[0], [0], [1]]))[:, 0] / np.pi
    assert (expected.mean(axis=(0, 1)) < 0.8 * open_sky).all()
    assert shade.mean(axis=(0, 1)) == pytest.approx(expected.mean(axis=(0, 1)), rel=0.01)
    off = np.abs(shade - expected).mean() / expected.mean()
    assert off < each[samples]
    sun = Light("SUN", np.full(3, 8.0), build.placed())
    lit = render_frame(view, canyon(build, world, lights=[sun]), settings)
    alone = render_frame(view, replace(canyon(build, world, lights=[sun]), world=None), settings).pixels
    found = lit.pixels[..., :3] - alone[..., :3]
    assert found.mean(axis=(0, 1)) == pytest.approx(expected.mean(axis=(0, 1)), rel=means[samples])


@pytest.mark.parametrize("sun, most", [(0.0, 30), (8.0, 12)])
def test_shadow_rays_of_the_sky_are_a_pixels_not_a_samples(build, monkeypatch, sun, most):
    """About the same number for any number of samples; fewer in the sun, which hides their noise."""
    world, _ = sunny(0.4)
    rays, cast = [0], CastScene.occluded

    def counted(self, origins, directions, distances):
        rays[0] += origins.shape[1]
        return cast(self, origins, directions, distances)

    monkeypatch.setattr(CastScene, "occluded", counted)
    lights = [Light("SUN", np.full(3, sun), build.placed(), casts_shadow=False)]
    for samples in (1, 4, 14, 28):
        rays[0] = 0
        settings = FrameSettings(8, 4, samples=samples)
        render_frame(build.looking_down(3.0, -3.0, size=2.0), canyon(build, world, lights=lights), settings)
        assert rays[0] <= max(most, samples) * 32
        assert rays[0] >= 0.9 * 32 * samples
