# SPDX-License-Identifier: GPL-3.0-or-later
"""Worlds of nodes against Cycles: seen directly, and as light on objects."""

import bpy
import numpy as np
import pytest
from shown_materials import add, both, new_material, scene_with_camera, show

SIZE = 24
# Cycles meets a texel at a place that float32 has rounded: so many pixels may differ by more than a step.
STEP, MOST_PIXELS = 2 / 255, 3


def sky_image(width=64, height=32, sun=40.0, as_bytes=False):
    """A gradient from a brown ground to a blue sky, with stripes and a bright spot."""
    image = bpy.data.images.new("Sky", width, height, float_buffer=not as_bytes)
    y, x = np.mgrid[:height, :width]
    up = (y + 0.5) / height
    pixels = np.ones((height, width, 4), np.float32)
    pixels[..., 0] = np.where(up < 0.5, 0.3, 0.25 + 0.2 * up)
    pixels[..., 1] = np.where(up < 0.5, 0.2, 0.5 * up) + 0.1 * np.sin(x * 2 * np.pi / width)
    pixels[..., 2] = np.where(up < 0.5, 0.1, up)
    if sun:
        pixels[height * 3 // 4, width // 3, :3] = sun, 0.9 * sun, 0.7 * sun
    image.pixels.foreach_set(pixels.ravel())
    image.update()
    image.pack()
    return image


def new_world(link, strength=1.0):
    """A world whose background is the colour socket that ``link(tree)`` returns."""
    world = bpy.context.scene.world = bpy.data.worlds.new("World")
    if world.node_tree is None:
        world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    background = add(tree, "ShaderNodeBackground", Color=link(tree), Strength=strength)
    output = add(tree, "ShaderNodeOutputWorld")
    tree.links.new(background.outputs[0], output.inputs["Surface"])
    # Cycles' own way takes seconds to get ready.
    world.cycles.sampling_method = "NONE"
    return world


def environment(image, **settings):
    def link(tree):
        node = add(tree, "ShaderNodeTexEnvironment", settings)
        node.image = image()
        return node.outputs[0]

    return link


def turned(tree):
    vector = add(tree, "ShaderNodeTexCoord").outputs["Generated"]
    mapping = add(tree, "ShaderNodeMapping", Vector=vector, Rotation=(0.3, -0.5, 1.2))
    node = add(tree, "ShaderNodeTexEnvironment", Vector=mapping.outputs[0])
    node.image = sky_image(sun=0)
    return node.outputs[0]


def gradient(tree):
    """A ramp by height, as of a vertical Gradient Texture."""
    vector = add(tree, "ShaderNodeTexCoord").outputs["Generated"]
    mapping = add(tree, "ShaderNodeMapping", Vector=vector, Rotation=(0, np.pi / 2, 0), Scale=(0.5, 1, 1))
    shade = add(tree, "ShaderNodeTexGradient", Vector=mapping.outputs[0])
    ramp = add(tree, "ShaderNodeValToRGB", Fac=shade.outputs["Fac"])
    ramp.color_ramp.elements[0].color = (0.8, 0.3, 0.1, 1)
    ramp.color_ramp.elements[1].color = (0.1, 0.3, 0.9, 1)
    return ramp.outputs[0]


def coordinate(name):
    def link(tree):
        vector = add(tree, "ShaderNodeTexCoord").outputs[name]
        return add(
            tree,
            "ShaderNodeVectorMath",
            {"operation": "MULTIPLY_ADD"},
            _0=vector,
            _1=(0.4,) * 3,
            _2=(0.5,) * 3,
        ).outputs[0]

    return link


SKY_KINDS = {each.identifier for each in bpy.types.ShaderNodeTexSky.bl_rna.properties["sky_type"].enum_items}
ONCE = "NISHITA" if "NISHITA" in SKY_KINDS else "SINGLE_SCATTERING"


def clear_sky(tree, kind=ONCE):
    """Single scattering, under either name, with a visible sun."""
    node = add(tree, "ShaderNodeTexSky", {"sky_type": kind})
    node.sun_direction, node.turbidity = (0.6, 0.5, 0.4), 3.0
    node.sun_elevation, node.sun_rotation, node.altitude = 0.4, 0.7, 200.0
    return node.outputs[0]


BACKGROUNDS = {
    "floats": environment(lambda: sky_image(sun=0)),
    "bytes, closest": environment(lambda: sky_image(sun=0, as_bytes=True), interpolation="Closest"),
    "mirror ball, cubic": environment(
        lambda: sky_image(32, 32, 0), projection="MIRROR_BALL", interpolation="Cubic"
    ),
    "missing": environment(lambda: None),
    "turned": turned,
    "gradient": gradient,
    "Normal": coordinate("Normal"),
    "Object": coordinate("Object"),
}


def look_up(scene, lens=12):
    camera = scene.camera
    camera.location, camera.rotation_euler = (3, 1, 2), (1.9, 0.2, 0.7)
    camera.data.lens = lens


@pytest.mark.parametrize("name", BACKGROUNDS)
def test_the_background_is_that_of_cycles(name, tmp_path):
    scene = scene_with_camera(SIZE)
    new_world(BACKGROUNDS[name], 0.8)
    look_up(scene)
    ours, cycles = both(scene, tmp_path)
    off = np.abs(ours - cycles).max(axis=2) > STEP
    print(
        name, off.sum(), np.abs(ours - cycles).max(), ours[0, 0], cycles[0, 0], ours[-1, -1], cycles[-1, -1]
    )
    assert np.ptp(cycles[..., :3]) > 0.1 or name == "missing"
    assert off.sum() <= MOST_PIXELS


def diffuse(color=(0.8, 0.8, 0.8)):
    material = new_material("Diffuse")
    show(material.node_tree, add(material.node_tree, "ShaderNodeBsdfDiffuse", Color=color).outputs[0])
    return material


def ball(material, location=(0, 0, 0), radius=0.9):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, radius=radius, location=location)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(material)


def lit(scene, folder, samples, cycles_samples):
    """The scene by both engines, with direct light only in Cycles."""
    scene.camera.scfpf.samples = samples
    scene.cycles.samples, scene.cycles.max_bounces = cycles_samples, 0
    scene.cycles.use_light_tree = False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BOX", 1.0
    scene.world.cycles.sampling_method, scene.world.cycles.sample_map_resolution = "MANUAL", 512
    scene.cycles.sample_clamp_direct = scene.cycles.sample_clamp_indirect = 0.0
    return both(scene, folder)


@pytest.mark.parametrize("kind", sorted(SKY_KINDS))
def test_skies_are_like_those_of_cycles(kind, tmp_path):
    """The whole sky in one image: the mean colour, and the brightness by direction."""
    scene = scene_with_camera(SIZE)
    new_world(lambda tree: clear_sky(tree, kind), 0.1)
    camera = scene.camera
    camera.location, camera.rotation_euler, camera.data.lens = (0, 0, 0), (2.1, 0, 0.8), 9
    ours, cycles = both(scene, tmp_path)
    seen = cycles[..., 2] > 0.02
    ratio = ours[seen][:, :3].mean(axis=0) / cycles[seen][:, :3].mean(axis=0)
    print(kind, ratio)
    least = {ONCE: 0.03, "MULTIPLE_SCATTERING": 0.1, "PREETHAM": 0.001, "HOSEK_WILKIE": 0.5}[kind]
    assert ratio == pytest.approx(np.ones(3), abs=least)
    if kind == "PREETHAM":
        assert np.abs(ours - cycles).max() < 0.002 * cycles.max()


def test_a_world_of_constants_is_one_colour(addon):
    """It is evaluated while the scene is read, and costs as much as a plain colour."""
    read_world = addon("bridge.scene.read_world").read_world

    def link(tree):
        mixed = add(tree, "ShaderNodeMixRGB", Fac=0.25, Color1=(0.2, 0.4, 0.8), Color2=(1, 1, 1))
        return add(tree, "ShaderNodeGamma", Color=mixed.outputs[0], Gamma=2.0).outputs[0]

    new_world(link, 3.0)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    color, world, warnings = read_world(depsgraph.scene_eval, depsgraph.view_layer_eval)
    assert world is None and warnings == ()
    assert color == pytest.approx(3.0 * np.array([0.4, 0.55, 0.85]) ** 2, rel=1e-6)


def test_images_of_a_world_that_nothing_shows_are_not_read(addon):
    """Behind a transparent film only lit or reflecting surfaces need the world."""
    scene = scene_with_camera(8)
    new_world(environment(lambda: sky_image(sun=0)))
    glow = new_material("Glow")
    show(glow.node_tree, add(glow.node_tree, "ShaderNodeEmission", Color=(1, 0.5, 0.2)).outputs[0])
    ball(glow)
    prepare = addon("bridge.render.render_inputs").prepare
    for transparent, material, wanted in ((False, glow, True), (True, glow, False), (True, diffuse(), True)):
        scene.render.film_transparent = transparent
        bpy.context.object.data.materials[0] = material
        world = prepare(scene, bpy.context.view_layer, scene.camera).scene.world
        assert (world is not None and bool(world.images)) is wanted


@pytest.mark.parametrize("name", ["sun", "clear sky", "one color"])
def test_light_and_shadows_of_the_sky_are_those_of_cycles(name, tmp_path):
    """A ball on a floor: means, and pixel by pixel up to noise."""
    scene = scene_with_camera(SIZE)
    if name == "clear sky":
        new_world(clear_sky, 0.1)
    elif name == "one color":
        scene.scfpf_sampling.world_shadows = True
        new_world(lambda tree: add(tree, "ShaderNodeGamma", Color=(0.6, 0.7, 0.9)).outputs[0])
    else:
        new_world(environment(lambda: sky_image(256, 128, sun=400.0)))
    bpy.ops.mesh.primitive_plane_add(size=20, location=(0, 0, -0.5))
    bpy.context.object.data.materials.append(diffuse())
    ball(diffuse(), radius=0.5)
    scene.render.resolution_x = scene.render.resolution_y = 48
    ours, cycles = lit(scene, tmp_path, 16, 128)
    ratio = ours[..., :3].mean((0, 1)) / cycles[..., :3].mean((0, 1))
    apart = np.abs(ours - cycles).mean() / cycles.mean()
    print(name, ratio, apart)
    assert ratio == pytest.approx(np.ones(3), abs=0.02)
    assert apart < 0.04
