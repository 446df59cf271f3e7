# SPDX-License-Identifier: GPL-3.0-or-later
"""Worlds of nodes as Cycles has them: seen directly, and as light on things."""

import bpy
import numpy as np
import pytest
from shown_materials import add, both, new_material, picture, scene_with_camera, show

SIZE = 24
# A texel of an image is met at a place that float32 has rounded: so many pixels may differ by more than a step.
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
    """A world whose background shows what ``link(tree)`` gives, a colour's socket."""
    world = bpy.context.scene.world = bpy.data.worlds.new("World")
    if world.node_tree is None:
        world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    background = add(tree, "ShaderNodeBackground", Color=link(tree), Strength=strength)
    output = add(tree, "ShaderNodeOutputWorld")
    tree.links.new(background.outputs[0], output.inputs["Surface"])
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


def mixed(tree):
    node = add(tree, "ShaderNodeTexEnvironment")
    node.image = sky_image(sun=0)
    return add(
        tree, "ShaderNodeMixRGB", {"blend_type": "MULTIPLY"}, Fac=0.7, Color1=node.outputs[0], Color2=(1, 0.5, 0.2)
    ).outputs[0]


def gradient(tree):
    """A ramp by height, as of the Gradient Texture turned up."""
    vector = add(tree, "ShaderNodeTexCoord").outputs["Generated"]
    mapping = add(tree, "ShaderNodeMapping", Vector=vector, Rotation=(0, np.pi / 2, 0), Scale=(0.5, 1, 1))
    shade = add(tree, "ShaderNodeTexGradient", Vector=mapping.outputs[0])
    ramp = add(tree, "ShaderNodeValToRGB", Fac=shade.outputs["Fac"])
    ramp.color_ramp.elements[0].color = (0.8, 0.3, 0.1, 1)
    ramp.color_ramp.elements[1].color = (0.1, 0.3, 0.9, 1)
    return ramp.outputs[0]


def geometry_node(name):
    def link(tree):
        vector = add(tree, "ShaderNodeNewGeometry").outputs[name]
        return add(tree, "ShaderNodeVectorMath", {"operation": "MULTIPLY_ADD"}, _0=vector, _1=(0.4,) * 3, _2=(0.5,) * 3).outputs[0]

    return link


def coordinate(name):
    def link(tree):
        vector = add(tree, "ShaderNodeTexCoord").outputs[name]
        return add(tree, "ShaderNodeVectorMath", {"operation": "MULTIPLY_ADD"}, _0=vector, _1=(0.4,) * 3, _2=(0.5,) * 3).outputs[0]

    return link


def noise(tree):
    return add(tree, "ShaderNodeTexNoise", Scale=3.0).outputs["Color"]


BACKGROUNDS = {
    "floats": environment(lambda: sky_image(sun=0)),
    "bytes, closest": environment(lambda: sky_image(sun=0, as_bytes=True), interpolation="Closest"),
    "mirror ball, cubic": environment(lambda: sky_image(32, 32, 0), projection="MIRROR_BALL", interpolation="Cubic"),
    "missing": environment(lambda: None),
    "turned": turned,
    "mixed": mixed,
    "gradient": gradient,
    "noise": noise,
    "Normal": coordinate("Normal"),
    "Object": coordinate("Object"),
    "Reflection": coordinate("Reflection"),
    "Incoming": geometry_node("Incoming"),
    "Position": geometry_node("Position"),
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
    print(name, off.sum(), np.abs(ours - cycles).max(), ours[0,0], cycles[0,0], ours[-1,-1], cycles[-1,-1])
    assert np.ptp(cycles[..., :3]) > 0.1 or name == "missing"
    assert off.sum() <= MOST_PIXELS
