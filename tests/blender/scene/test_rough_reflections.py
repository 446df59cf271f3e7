# SPDX-License-Identifier: GPL-3.0-or-later
"""Reflections off rough surfaces: as bright and as blurred as in Cycles, and the same for every border."""

import bpy
import numpy as np
import pytest
from shown_materials import add, both, new_material, scene_with_camera, show

SIZE = 24


def shader(kind, settings=(), **inputs):
    material = new_material(kind)
    node = add(material.node_tree, f"ShaderNode{kind}", settings, **inputs)
    show(material.node_tree, node.outputs[0])
    return material


def plane(material, location=(0, 0, 0), size=4.0, turn=(0, 0, 0)):
    bpy.ops.mesh.primitive_plane_add(size=size, location=location, rotation=turn)
    bpy.context.object.data.materials.append(material)


def glossy_scene(material):
    """A floor of the material before a glowing wall, seen at an angle."""
    scene = scene_with_camera(SIZE)
    plane(material)
    glow = shader("Emission", Color=(1.0, 0.6, 0.3), Strength=3.0)
    plane(glow, (0.2, 0.8, 0.5), 0.8, (np.pi / 2, 0, 0))
    scene.camera.scfpf.samples = 64
    scene.camera.location, scene.camera.rotation_euler = (0.3, -2.5, 1.2), (1.2, 0, 0)
    cycles = scene.cycles
    cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling = 128, False, False
    cycles.max_bounces = 4
    cycles.sample_clamp_indirect = 0.0
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    return scene


METAL = {"Base_Color": (0.9, 0.7, 0.5), "Metallic": 1.0}
WHITE = {"Color": (0.8, 0.8, 0.8), "Roughness": 0.5}
MATERIALS = {
    "polished metal": ("BsdfPrincipled", {}, {**METAL, "Roughness": 0.2}),
    "rough metal": ("BsdfPrincipled", {}, {**METAL, "Roughness": 0.65}),
    "single": ("BsdfGlossy", {"distribution": "GGX"}, WHITE),
    "coat": ("BsdfPrincipled", {}, {"Base_Color": (0.0, 0.0, 0.0), "Roughness": 0.25}),
}


@pytest.mark.parametrize("name", MATERIALS)
def test_a_glow_is_reflected_as_by_cycles(name, tmp_path):
    kind, settings, inputs = MATERIALS[name]
    scene = glossy_scene(shader(kind, settings, **inputs))
    ours, cycles = both(scene, tmp_path)
    # The floor below the wall.
    ours, cycles = ours[: SIZE * 2 // 5, :, :3], cycles[: SIZE * 2 // 5, :, :3]
    ratio = ours.mean(axis=(0, 1)) / cycles.mean(axis=(0, 1))
    print(name, ratio, np.abs(ours - cycles).mean() / cycles.mean())
    assert ratio == pytest.approx(np.ones(3), abs=0.03)
    assert np.abs(ours - cycles).mean() < 0.12 * cycles.mean()


@pytest.mark.parametrize("roughness", [0.06, 0.12, 0.2])
def test_a_soft_lamp_makes_no_speckles_on_paint(roughness, tmp_path):
    """The highlight of an area lamp on a ball, at the samples of a new camera, beside one of many samples."""
    scene = scene_with_camera(45)
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=1.0)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(
        shader("BsdfPrincipled", Base_Color=(0.0, 0.0, 0.0), Metallic=0.0, Roughness=roughness)
    )
    scene.camera.location, scene.camera.rotation_euler = (0, 0, 6), (0, 0, 0)
    lamp = bpy.data.objects.new("Lamp", bpy.data.lights.new("Lamp", "AREA"))
    lamp.location, lamp.data.size, lamp.data.energy = (1.5, 1.5, 4.0), 2.0, 400.0
    scene.collection.objects.link(lamp)
    cycles = scene.cycles
    scene.camera.scfpf.samples, cycles.samples, cycles.max_bounces = 4, 256, 0
    cycles.use_denoising, cycles.use_adaptive_sampling = False, False
    cycles.sample_clamp_indirect, cycles.blur_glossy = 0.0, 0.0
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    ours, cycles = (image[..., :3].mean(axis=2) for image in both(scene, tmp_path))
    assert ours.mean() == pytest.approx(cycles.mean(), rel=0.01)
    assert ours.max() < cycles.max(), "no sample is brighter than the lamp"
    assert np.sqrt(np.mean((ours - cycles) ** 2)) < 0.036


# Of 64 × 64 pixels.
MOST_SPECKLES = {"glow": 11, "window": 20, "sun": 6}


def speckles(image, like):
    """How many pixels are brighter than their neighbours, and than all neighbours there in another image."""
    around = [
        np.roll(each, (up, along), (0, 1))
        for each in (image, like)
        for up in (-1, 0, 1)
        for along in (-1, 0, 1)
    ]
    median, most = np.median(around[:9], axis=0), np.max(around[9:], axis=0)
    return int(((image > 1.5 * median) & (image > 1.5 * most + 0.05)).sum())


def window(world):
    """A bright window of 17 degrees in a dim sky."""
    up, around = np.mgrid[:64, :128] / 64 * np.pi
    height, turn = up - 0.5 * np.pi, around - np.pi
    pixels = np.ones((64, 128, 4), np.float32)
    pixels[..., :3] = np.where((np.abs(height - 0.6) < 0.15) & (np.abs(turn + 1.2) < 0.18), 30.0, 0.3)[
        ..., None
    ]
    image = bpy.data.images.new("Sky", 128, 64, float_buffer=True)
    image.pixels.foreach_set(pixels.ravel())
    image.pack()
    background = next(n for n in world.node_tree.nodes if n.type == "BACKGROUND")
    node = add(world.node_tree, "ShaderNodeTexEnvironment", {"image": image})
    world.node_tree.links.new(node.outputs[0], background.inputs["Color"])


@pytest.mark.parametrize("light", ["glow", "window", "sun"])
def test_bright_small_things_make_no_speckles_on_paint(light, tmp_path):
    """Glossy balls and a glossy floor at the samples of a new camera, beside Cycles' with many.

    A small glowing square, a window in the sky, and the sun's highlights on balls that the floor reflects.
    """
    scene = scene_with_camera(64)
    black = {"Base_Color": (0.0, 0.0, 0.0)}
    plane(shader("BsdfPrincipled", Roughness=0.4, **black), size=20.0)
    for number, roughness in enumerate((0.1, 0.25, 0.4)):
        bpy.ops.mesh.primitive_uv_sphere_add(
            segments=48, ring_count=24, radius=0.5, location=(number - 1, 1, 0.5)
        )
        bpy.ops.object.shade_smooth()
        paint = {"Base_Color": (0.8, 0.5, 0.2), "Metallic": 1.0, "Roughness": roughness}
        bpy.context.object.data.materials.append(shader("BsdfPrincipled", **paint))
    if light == "glow":
        plane(shader("Emission", Strength=60.0), (1.0, -1.0, 3.0), 0.6)
    elif light == "window":
        window(scene.world)
    else:
        bpy.ops.object.light_add(type="SUN", rotation=(0.6, 0.4, 0))
        bpy.context.object.data.energy, bpy.context.object.data.angle = 6, 0.01
    scene.camera.location, scene.camera.rotation_euler = (0, -4, 1.6), (1.3, 0, 0)
    cycles = scene.cycles
    scene.camera.scfpf.samples, cycles.samples = 4, 64
    cycles.use_denoising, cycles.use_adaptive_sampling, cycles.diffuse_bounces = False, False, 0
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    ours, its = (image[..., :3].mean(axis=2) for image in both(scene, tmp_path))
    print(light, ours.mean() / its.mean(), speckles(ours, its))
    if light == "glow":
        assert ours.mean() == pytest.approx(its.mean(), rel=0.06)
    assert speckles(ours, its) <= MOST_SPECKLES[light]


# What is dark beside light of strength 1.
DARK = 0.01
# Roughness, index of refraction, metallic, base colour.
BALLS = [
    (0.3, 1.5, 0.0, 0.8),
    (0.5, 1.3, 0.0, 0.8),
    (0.5, 2.0, 0.0, 0.8),
    (1.0, 2.0, 0.0, 0.8),
    (0.5, 1.5, 1.0, 0.8),
    (0.8, 1.5, 1.0, 0.8),
    (0.3, 1.5, 0.0, 0.0),
    (0.6, 2.0, 0.0, 0.0),
    (1.0, 1.5, 0.0, 0.0),
]


# Of which rays follow no reflection.
ROUGH_METALS = [(0.9 + 0.0125 * step, 1.5, 1.0, 0.8) for step in range(9)]


@pytest.mark.parametrize(
    "light, mean, each, balls, distribution",
    [
        ("sun", 0.05, 0.06, BALLS, "MULTI_GGX"),
        ("even", 0.02, 0.1, BALLS, "MULTI_GGX"),
        ("even", 0.02, 0.1, ROUGH_METALS, "MULTI_GGX"),
        ("even", 0.02, 0.1, ROUGH_METALS, "GGX"),
    ],
)
def test_balls_are_as_bright_as_those_of_cycles(light, mean, each, balls, distribution, tmp_path):
    """Nine balls in the sun and in uniform light: highlights, and the light that they take from the base.

    mean, each: by how much their mean and their pixels may differ. Uniform light without reflection rays is
    the mean over all directions of view. distribution: GGX loses the light that facets send to each other.
    """
    scene = scene_with_camera(45)
    scene.camera.location, scene.camera.rotation_euler = (0, 0, 20), (0, 0, 0)
    scene.camera.data.type, scene.camera.data.ortho_scale = "ORTHO", 6
    scene.camera.scfpf.samples, scene.cycles.samples, scene.cycles.max_bounces = 16, 64, 1
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 1.0
    for number, (roughness, ior, metallic, base) in enumerate(balls):
        at = (number % 3 - 1) * 2, (number // 3 - 1) * 2, 0
        bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24, radius=0.8, location=at)
        bpy.ops.object.shade_smooth()
        # The light alone reaches them.
        seen = bpy.context.object
        seen.visible_glossy = seen.visible_diffuse = seen.visible_shadow = False
        values = {"Roughness": roughness, "IOR": ior, "Metallic": metallic}
        settings = {"distribution": distribution}
        material = shader("BsdfPrincipled", settings, Base_Color=(base,) * 3, **values)
        bpy.context.object.data.materials.append(material)
    background = next(n for n in scene.world.node_tree.nodes if n.type == "BACKGROUND")
    background.inputs["Color"].default_value = (1, 1, 1, 1)
    background.inputs["Strength"].default_value = float(light == "even")
    if light == "sun":
        bpy.ops.object.light_add(type="SUN", rotation=(0.7, 0.3, 0))
        bpy.context.object.data.energy, bpy.context.object.data.angle = 3, 0.05
    ours, cycles = (
        made[..., 0].reshape(3, 15, 3, 15).swapaxes(1, 2).reshape(9, 15, 15) for made in both(scene, tmp_path)
    )
    across, up = np.mgrid[:15, :15] - 7
    whole = across**2 + up**2 < 5.5**2
    for ball, mine, its in zip(balls, ours[:, whole], cycles[:, whole], strict=True):
        assert abs(mine.mean() - its.mean()) < mean * its.mean() + DARK, ball
        assert np.abs(mine - its).mean() < each * its.mean() + DARK, ball


def test_distributions_other_than_ggx_are_listed(addon):
    reading = addon("bridge.scene.read_graph").read_graph(
        shader("BsdfGlossy", {"distribution": "BECKMANN"}, Roughness=0.3).node_tree
    )
    assert reading.graph.reflects and reading.notes == ("Glossy BSDF: Beckmann",)
