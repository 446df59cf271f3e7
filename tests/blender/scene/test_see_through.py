# SPDX-License-Identifier: GPL-3.0-or-later
"""Alpha, mirrors and glass, against Cycles; alpha through a curved volume, against an image without it."""

import bpy
import numpy as np
import pytest
from shown_materials import add, both, emit, new_material, picture, scene_with_camera, show

# Cycles' samples lie within a hundredth of a pixel: a hard edge of the checker passes through these at times.
STEP, MOST_EDGES = 0.02, 0.08
SIZE = 48


def checker():
    """Glowing squares in the object's own coordinates."""
    material = new_material("Checker")
    tree = material.node_tree
    vector = add(tree, "ShaderNodeTexCoord").outputs["Object"]
    colors = {"_1": (0.9, 0.2, 0.1), "_2": (0.1, 0.4, 0.8)}
    emit(tree, add(tree, "ShaderNodeTexChecker", _0=vector, **colors, _3=3.0).outputs[0])
    return material


def shader(kind, **inputs):
    material = new_material(kind)
    show(material.node_tree, add(material.node_tree, f"ShaderNodeBsdf{kind}", **inputs).outputs[0])
    return material


def veil(alpha=0.4):
    """A transparent green glow."""
    inputs = {"Base_Color": (0, 0, 0), "Roughness": 1.0, "Specular_IOR_Level": 0.0, "Alpha": alpha}
    return shader("Principled", **inputs, Emission_Color=(0.2, 0.8, 0.1), Emission_Strength=1.0)


def plane(material, location=(0, 0, 0), size=1.0, turn=(0, 0, 0)):
    bpy.ops.mesh.primitive_plane_add(size=size, location=location, rotation=turn)
    bpy.context.object.data.materials.append(material)
    return bpy.context.object


def surroundings():
    squares = checker()
    plane(squares, (0, 0, -1.2), 6)
    plane(squares, (0, 3, 0), 6, (np.pi / 2, 0, 0))
    plane(squares, (0, 0, 6), 6)


def sphere(material):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16, radius=0.8)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(material)


def cube(material):
    bpy.ops.mesh.primitive_cube_add(size=1.2)
    bpy.context.object.data.materials.append(material)


def compare(tmp_path):
    scene = scene_with_camera(SIZE)
    ours = picture(scene, "SCFPF", tmp_path)
    scene.cycles.samples = 64
    cycles = picture(scene, "CYCLES", tmp_path)
    return ours, cycles


def assert_like(ours, cycles):
    off = np.abs(ours - cycles).max(axis=2) > STEP
    assert off.mean() < MOST_EDGES
    assert np.abs(ours.mean(axis=(0, 1)) - cycles.mean(axis=(0, 1))).max() < 0.005


def test_alpha_shows_the_background(tmp_path):
    plane(checker(), (0, 0, -1), 4)
    for number in range(3):
        plane(veil(), (0.2 * number, 0.1 * number, 0.3 * number))
    assert_like(*compare(tmp_path))


def sun():
    bpy.ops.object.light_add(type="SUN", rotation=(0.4, 0.3, 0))
    bpy.context.object.data.angle = 0.0


@pytest.mark.parametrize("film", [False, True])
def test_alpha_of_zero_shows_the_background(film, tmp_path):
    """A ball of alpha 0 in the sun before squares, alone in most of the image's tiles."""
    squares = plane(checker(), (0, 0, -1), 2)
    squares.visible_shadow = False
    sun()
    sphere(shader("Principled", Alpha=0.0))
    bpy.context.object.visible_shadow = False
    bpy.context.scene.render.film_transparent = film
    assert_like(*compare(tmp_path))
    bpy.data.objects.remove(squares)
    ours, cycles = both(bpy.context.scene, tmp_path)
    assert_like(ours, cycles)
    assert ours[..., 3].max() == (not film)


def leaf(is_cut):
    """A material of an image with alpha, which a node clips at a half, or which is soft."""
    image = bpy.data.images.new("Leaf", 16, 16, alpha=True)
    y, x = np.mgrid[-1:1:16j, -1:1:16j]
    pixels = np.stack([x + 1, y + 1, 0.6 + 0 * x, 1.6 - 2 * np.hypot(x, y)], -1).clip(0, 1)
    image.pixels.foreach_set(pixels.astype(np.float32).ravel())
    image.pack()
    material = new_material("Leaf")
    tree = material.node_tree
    node = add(tree, "ShaderNodeTexImage", {"image": image})
    alpha = node.outputs["Alpha"]
    if is_cut:
        alpha = add(tree, "ShaderNodeMath", {"operation": "GREATER_THAN"}, _0=alpha, _1=0.5).outputs[0]
    inputs = {"Base_Color": node.outputs["Color"], "Alpha": alpha, "Roughness": 0.6}
    show(tree, add(tree, "ShaderNodeBsdfPrincipled", **inputs).outputs[0])
    return material


@pytest.mark.parametrize("is_cut", [True, False])
def test_leaves_on_cards_are_as_in_cycles(is_cut, tmp_path):
    """In the sun and before a mirror, without shadows."""
    plane(checker(), (0, 0, -1), 4)
    plane(shader("Glossy", Color=(0.9, 0.9, 0.9), Roughness=0.0), (0, 1.1, 0.2), 2.4, (1.4, 0, 0))
    cards, generator = leaf(is_cut), np.random.default_rng(3)
    for _ in range(12):
        plane(cards, generator.uniform(-0.8, 0.8, 3), 0.7, generator.uniform(-1, 1, 3))
        bpy.context.object.visible_shadow = False
    sun()
    bpy.context.scene.cycles.diffuse_bounces = 0
    ours, cycles = compare(tmp_path)
    off = np.abs(ours - cycles).max(axis=2) > STEP
    print(off.mean(), np.abs(ours.mean(axis=(0, 1)) - cycles.mean(axis=(0, 1))).max())
    assert_like(ours, cycles)


def test_transparent_surfaces_end_at_the_limit_of_the_light_paths(tmp_path):
    plane(checker(), (0, 0, -1), 4)
    clear = shader("Transparent", Color=(0.9, 0.95, 1.0))
    for number in range(5):
        plane(clear, (0, 0, 0.1 * number))
    bpy.context.scene.cycles.transparent_max_bounces = 6
    seen = compare(tmp_path)
    assert_like(*seen)
    assert seen[0][SIZE // 2, SIZE // 2, :3].max() > 0.1
    bpy.context.scene.cycles.transparent_max_bounces = 3
    seen = compare_again(tmp_path)
    assert_like(*seen)
    assert seen[0][SIZE // 2, SIZE // 2, :3].max() == 0.0


@pytest.mark.parametrize("limit", [0, 1, 2, 3])
@pytest.mark.parametrize("veils", [1, 2])
def test_surfaces_behind_the_last_transparent_one_only_emit(limit, veils, tmp_path):
    """A matte object in the sun, a glowing one and the world."""
    plane(shader("Diffuse", Color=(0.8, 0.5, 0.2)), (-0.6, 0, -1), 1)
    plane(checker(), (0.6, 0, -1), 1)
    for number in range(veils):
        # Cycles' shadows of what is clear are not black.
        plane(shader("Transparent", Color=(0.9, 0.9, 1.0)), (0, 0, 0.1 * number), 1.5).visible_shadow = False
    bpy.ops.object.light_add(type="SUN", rotation=(0.4, 0.3, 0))
    bpy.context.object.data.angle = 0.0
    cycles = bpy.context.scene.cycles
    cycles.transparent_max_bounces, cycles.diffuse_bounces = limit, 0
    ours, theirs = compare(tmp_path)
    # The world and what glows light the dull thing in Cycles by a little more or less.
    off = np.abs(ours - theirs).max(axis=2) > 0.1
    assert off.mean() < 0.01


def compare_again(tmp_path):
    scene = bpy.context.scene
    scene.cycles.samples = 1
    return both(scene, tmp_path)


def test_a_transparent_film_is_seen_through_veils(tmp_path):
    plane(veil(), size=2)
    bpy.context.scene.render.film_transparent = True
    ours, cycles = compare(tmp_path)
    assert ours[SIZE // 2, SIZE // 2, 3] == pytest.approx(0.4, abs=1e-6)
    assert_like(ours, cycles)


@pytest.mark.parametrize(
    "kind, inputs",
    [
        ("Glossy", {"Color": (0.9, 0.8, 0.6), "Roughness": 0.0}),
        ("Principled", {"Base_Color": (0.9, 0.8, 0.6), "Metallic": 1.0, "Roughness": 0.0}),
        ("Principled", {"Base_Color": (0, 0, 0), "Roughness": 0.0}),
        ("Glass", {"Color": (0.9, 0.8, 0.6), "Roughness": 0.0, "IOR": 1.5}),
        ("Principled", {"Base_Color": (0.9, 0.8, 0.6), "Transmission_Weight": 1.0, "Roughness": 0.0}),
    ],
)
def test_mirrors_and_glass_are_as_in_cycles(kind, inputs, tmp_path):
    surroundings()
    sphere(shader(kind, **inputs))
    assert_like(*compare(tmp_path))


LIMITS = [{"max": 0}, {"max": 1}, {"max": 2}, {"glossy": 0}, {"glossy": 1, "transmission": 1}]


@pytest.mark.parametrize("limits", LIMITS)
@pytest.mark.parametrize("kind", ["Glossy", "Principled", "Glass"])
def test_beyond_a_limit_only_the_world_and_emission_are_seen(kind, limits, tmp_path):
    """A ball between a mirror and glowing squares and a glowing veil, in a uniform world."""
    plane(checker(), (0, 3, 0), 6, (np.pi / 2, 0, 0))
    plane(shader("Glossy", Color=(0.7, 0.9, 0.7), Roughness=0.0), (3, 0, 0), 4, (0, -np.pi / 2, 0))
    plane(veil(), (-1.5, 0, 0), 2, (0, np.pi / 2, 0))
    inputs = {"Metallic": 1.0, "Base_Color": (0.9, 0.8, 0.6)} if kind == "Principled" else {}
    sphere(shader(kind, Roughness=0.0, **inputs))
    cycles = bpy.context.scene.cycles
    for name, limit in limits.items():
        setattr(cycles, f"{name}_bounces", limit)
    ours, theirs = compare(tmp_path)
    assert_like(ours, theirs)
    if kind != "Glass" and 0 in limits.values():
        # What is dull is black in the mirror, whatever shines on it.
        plane(shader("Diffuse", Color=(0.8, 0.5, 0.2)), (0, 0, 5), 6)
        darker, theirs = both(bpy.context.scene, tmp_path)
        assert_like(darker, theirs)
        black = ((each[..., :3].max(axis=2) == 0.0).mean() for each in (ours, darker))
        assert next(black) + 0.015 < next(black)


@pytest.mark.parametrize("kind, inputs", [("Glass", {"IOR": 1.5}), ("Refraction", {"IOR": 1.3})])
def test_light_is_reflected_within_a_cube_of_glass(kind, inputs, tmp_path):
    surroundings()
    cube(shader(kind, Color=(0.9, 0.8, 0.6), Roughness=0.0, **inputs))
    assert_like(*compare(tmp_path))


@pytest.mark.parametrize(
    "basis, pixel_error", [("BEZIER", 0.1), ("BEZIER", 0.0), ("B_SPLINE", 0.1), ("POLYLINE", 0.1)]
)
def test_a_clear_object_does_not_displace_its_background(basis, pixel_error, tmp_path, addon):
    """A curved volume: a clear sphere and two clear planes displace nothing."""
    scene = scene_with_camera(SIZE)
    module = addon("bridge.camera.flexible_camera")
    camera = scene.camera
    module.make_flexible(camera)
    for number, (x, z) in enumerate(((0, -1.5), (0.5, -2.5), (-0.3, -3.5), (0.4, -6.0))):
        size = {"width": 1.5 + number, "height": 1.5 + number}
        surface = module.add_surface(camera, "PLANE", parameters=size)
        surface.location = (x, 0, z)
    camera.scfpf.basis, camera.scfpf.pixel_error, camera.scfpf.samples = basis, pixel_error, 1
    plane(checker(), (0, 0, -1), 6)
    hidden = picture(scene, "SCFPF", tmp_path)
    clear = shader("Transparent", Color=(1, 1, 1))
    sphere(clear)
    plane(clear, (0, 0, 0.1), 3, (0.3, 0.2, 0))
    plane(clear, (0, 0, 1.1), 0.8)
    seen = picture(scene, "SCFPF", tmp_path)
    assert len(np.unique(hidden.reshape(-1, 4), axis=0)) >= 3
    off = np.abs(seen - hidden).max(axis=2) > 1e-3
    # An edge of the checker passes through a pixel's centre here and there.
    assert off.mean() < 0.005


def test_a_border_of_objects_seen_through_is_that_of_the_whole(tmp_path):
    scene = scene_with_camera(SIZE)
    surroundings()
    sphere(shader("Glass", Color=(0.9, 0.8, 0.6), Roughness=0.0, IOR=1.5))
    plane(veil(), (0, 0, 1), 1.5)
    whole = picture(scene, "SCFPF", tmp_path)
    render = scene.render
    render.use_border, render.use_crop_to_border = True, True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.75, 0.5, 1.0
    part = picture(scene, "SCFPF", tmp_path)
    quarter = SIZE // 4
    assert (part == whole[2 * quarter :, quarter : 3 * quarter]).all()
