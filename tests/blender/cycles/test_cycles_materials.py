# SPDX-License-Identifier: GPL-3.0-or-later
"""Materials in a lamp's light, compared with Cycles, up to grazing angles."""

import math

import bpy
import numpy as np
import pytest
from engine_images import load_pixels
from rig_scenes import reference

WIDTH, HEIGHT = 80, 60
SAMPLES = 16
# Cosines to the viewer that are left out: where Cycles' own tables have one step.
EDGE_ON = 0.07


@pytest.fixture(autouse=True)
def empty_file(extension):
    """In place of an empty file."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def material(metallic, roughness):
    made = bpy.data.materials.new("Material")
    if made.node_tree is None:
        made.use_nodes = True
    inputs = made.node_tree.nodes["Principled BSDF"].inputs
    inputs["Base Color"].default_value = 0.8, 0.5, 0.3, 1.0
    inputs["Metallic"].default_value, inputs["Roughness"].default_value = metallic, roughness
    return made


def picture(engine, path):
    """(H, W, 3), row 0 at the bottom."""
    scene = bpy.context.scene
    scene.render.engine, scene.render.filepath = engine, str(path)
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format, settings.color_depth, settings.color_mode = "OPEN_EXR", "32", "RGBA"
    bpy.ops.render.render(write_still=True)
    return load_pixels(path)[..., :3]


@pytest.mark.parametrize("height", [0.6, 0.15])
@pytest.mark.parametrize(
    "metallic, roughness", [(0, 0.2), (0, 0.5), (0, 1.0), (0.5, 0.4), (1, 0.3), (1, 0.6), (1, 0.9)]
)
def test_a_plane_against_the_sun_is_as_in_cycles(addon, tmp_path, metallic, roughness, height):
    """A plane to the horizon under a sun of a height in radians, in front of the camera and to the right."""
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_plane_add(size=400)
    bpy.context.object.data.materials.append(material(metallic, roughness))
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = 3.0, 0.0
    placed = bpy.data.objects.new("Sun", sun)
    placed.rotation_euler = height - math.pi / 2, 0.0, 0.5
    scene.collection.objects.link(placed)
    camera = reference.add_camera(WIDTH, HEIGHT, clip_start=0.1, clip_end=300.0, lens=30.0)
    camera.location, camera.rotation_euler = (0, 0, 0.6), (math.pi / 2 - 0.03, 0, 0)
    cycles = scene.cycles
    cycles.samples, cycles.max_bounces, cycles.use_denoising = SAMPLES, 0, False
    cycles.use_adaptive_sampling, cycles.sample_clamp_direct = False, 0.0
    bpy.context.view_layer.update()
    addon("bridge.camera.flexible_camera").volume_from_camera(camera, scene)
    camera.scfpf.samples = SAMPLES
    ours, theirs = (picture(engine, tmp_path / f"{engine}.exr") for engine in ("SCFPF", "CYCLES"))
    # Blocks of pixels: both sample as they like.
    below = (HEIGHT / 2 - 0.5 - np.arange(HEIGHT)) / (30 / 36 * WIDTH)
    rows = np.flatnonzero(np.sin(np.arctan(below) + 0.03) > EDGE_ON)
    rows = rows[: len(rows) // 4 * 4]
    mean = [each[rows].reshape(-1, 4, WIDTH // 4, 4, 3).mean(axis=(1, 3)) for each in (ours, theirs)]
    off = np.abs(mean[0] - mean[1]) / mean[1].clip(1e-3)
    print(f"metallic {metallic}, roughness {roughness}, sun {height}: {np.median(off):.4f}, {off.max():.4f}")
    assert np.median(off) < 0.015 and off.max() < 0.04


@pytest.mark.parametrize("shadow", [True, False])
def test_flat_faces_in_a_sun_are_as_in_cycles(addon, tmp_path, shadow):
    """Nine tenths of the faces of a monkey lie in no plane. The engine takes its fast paths."""
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_monkey_add()
    dull = material(0, 1)
    dull.node_tree.nodes["Principled BSDF"].inputs["Specular IOR Level"].default_value = 0.0
    bpy.context.object.data.materials.append(dull)
    bpy.ops.object.light_add(type="SUN", rotation=(0.9, 0.4, 0.0))
    bpy.context.object.data.angle, bpy.context.object.data.use_shadow = 0.0, shadow
    camera = reference.add_camera(48, 36, lens=60.0)
    camera.location, camera.rotation_euler = (0, -5.0, 0.4), (1.5, 0, 0)
    cycles = scene.cycles
    cycles.samples, cycles.max_bounces, cycles.use_denoising = 1, 0, False
    cycles.pixel_filter_type, cycles.filter_width = "BLACKMAN_HARRIS", reference.JITTER
    camera.scfpf.samples = 1
    ours, theirs = (picture(engine, tmp_path / f"{engine}.exr") for engine in ("SCFPF", "CYCLES"))
    off = np.abs(ours - theirs).max(axis=2)
    assert (theirs > 0.1).any(axis=2).mean() > 0.15
    # Edges pass between Cycles' samples and the centers of pixels here and there.
    assert (off > 1e-3).mean() < 0.01


def add_world(sideways):
    """An image of one colour, or from dark on the left to bright on the right."""
    world = bpy.context.scene.world = bpy.data.worlds.new("World")
    if world.node_tree is None:
        world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    nodes["Background"].inputs["Color"].default_value = 1.0, 1.0, 1.0, 1.0
    if sideways:
        places, axes, strength = (
            nodes.new(f"ShaderNode{kind}") for kind in ("TexCoord", "SeparateXYZ", "Math")
        )
        strength.operation = "MULTIPLY_ADD"
        strength.inputs[1].default_value, strength.inputs[2].default_value = 0.45, 0.55
        links.new(places.outputs["Generated"], axes.inputs[0])
        links.new(axes.outputs["X"], strength.inputs[0])
        links.new(strength.outputs[0], nodes["Background"].inputs["Strength"])
        # Its own choice would be a map of a thousand rows, which takes a second.
        world.cycles.sampling_method, world.cycles.sample_map_resolution = "MANUAL", 64


@pytest.mark.parametrize("lit", ["sun", "world", "sky"])
@pytest.mark.parametrize("metallic, roughness", [(0, 0.3), (0, 0.5), (0, 1.0), (1, 0.5), (1, 0.8), (1, 1.0)])
def test_the_light_of_a_ball_is_that_of_cycles(addon, tmp_path, metallic, roughness, lit):
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(material(metallic, roughness))
    if lit == "sun":
        sun = bpy.data.lights.new("Sun", "SUN")
        sun.energy, sun.angle = 3.0, 0.0
        placed = bpy.data.objects.new("Sun", sun)
        placed.rotation_euler = 0.6, 0.4, 0.0
        scene.collection.objects.link(placed)
    else:
        add_world(lit == "sky")
    camera = reference.add_camera(32, 32, clip_start=0.1, clip_end=10.0, lens=60.0)
    camera.location.z = 5.0
    cycles = scene.cycles
    cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling = 64, False, False
    bpy.context.view_layer.update()
    addon("bridge.camera.flexible_camera").volume_from_camera(camera, scene)
    camera.scfpf.samples = 64
    ball = np.hypot(*np.mgrid[-15.5:16, -15.5:16]) < 8
    ours, theirs = (picture(engine, tmp_path / f"{engine}.exr")[ball] for engine in ("SCFPF", "CYCLES"))
    ratio = ours.mean(axis=0) / theirs.mean(axis=0)
    inner = np.hypot(*np.mgrid[-15.5:16, -15.5:16])[ball] < 4
    middle = ours[inner].mean(axis=0) / theirs[inner].mean(axis=0)
    right = np.mgrid[-15.5:16, -15.5:16][1][ball] > 0
    sides = [ours[side].mean() / theirs[side].mean() for side in (right, ~right)]
    names = f"ball, metallic {metallic}, roughness {roughness}, {lit}"
    print(f"{names}: {np.round(ratio, 4)}, its middle {np.round(middle, 4)}, its sides {np.round(sides, 4)}")
    # Of rough things the sky's light is blurred as on diffuse ones.
    assert np.array(sides) == pytest.approx(1.0, abs=0.04)
    assert ratio == pytest.approx(1.0, abs=0.005)
    assert middle == pytest.approx(1.0, abs=0.01)
