# SPDX-License-Identifier: GPL-3.0-or-later
"""The Light Path node of worlds, lamps and materials against Cycles."""

import bpy
import numpy as np
import pytest
from shown_materials import add, both, new_material, scene_with_camera, show

# Three outputs at once, a channel each.
OUTPUTS = (
    ("Is Camera Ray", "Is Shadow Ray", "Is Diffuse Ray"),
    ("Is Glossy Ray", "Is Singular Ray", "Is Reflection Ray"),
    ("Is Transmission Ray", "Ray Depth", "Diffuse Depth"),
    ("Glossy Depth", "Transparent Depth", "Transmission Depth"),
)
WHITE = (1.0, 1.0, 1.0)
# Of the light on diffuse things.
NOISE = 0.02


def asked(tree, names):
    """A colour whose channels are outputs of a Light Path node."""
    path = tree.nodes.new("ShaderNodeLightPath")
    red, green, blue = (path.outputs[name] for name in names)
    return add(tree, "ShaderNodeCombineColor", Red=red, Green=green, Blue=blue).outputs[0]


def paint(kind, **inputs):
    material = new_material(kind)
    show(material.node_tree, add(material.node_tree, f"ShaderNodeBsdf{kind}", **inputs).outputs[0])
    return material


def card(material, place, size=1.0, turn=(0, 0, 0)):
    bpy.ops.mesh.primitive_plane_add(size=size, location=place, rotation=turn)
    bpy.context.object.data.materials.append(material)
    return bpy.context.object


def cards():
    """Four cards before the camera: a mirror, glass, two transparent ones; where the image shows them."""
    card(paint("Anisotropic", Color=WHITE, Roughness=0.0), (1, 1, 0))
    card(paint("Refraction", Color=WHITE, Roughness=0.0, IOR=1.0001), (-1, 1, 0))
    for height in (0.0, -0.5):
        card(paint("Transparent", Color=WHITE), (-1, -1, height))
    return {"mirror": (12, 12), "glass": (12, 3), "transparent": (3, 3), "nothing": (8, 8)}


@pytest.fixture
def scene():
    """A scene whose camera looks straight down at cards two units apart."""
    made = scene_with_camera(16)
    camera = made.camera
    camera.data.type, camera.data.ortho_scale = "ORTHO", 3.6
    camera.location, camera.rotation_euler = (0, 0, 4), (0, 0, 0)
    made.cycles.samples = 128
    made.world.cycles.sampling_method = "NONE"
    return made


def background(scene):
    return next(each for each in scene.world.node_tree.nodes if each.type == "BACKGROUND")


@pytest.mark.parametrize("names", OUTPUTS)
def test_worlds_that_ask_for_the_ray_are_as_in_cycles(names, scene, tmp_path):
    places = cards() | {"diffuse": (3, 12)}
    card(paint("Diffuse", Color=WHITE), (1, -1, 0), turn=(0.2, 0, 0))
    tree = scene.world.node_tree
    tree.links.new(asked(tree, names), background(scene).inputs["Color"])
    ours, cycles = both(scene, tmp_path)
    for name, place in places.items():
        assert ours[place] == pytest.approx(cycles[place], abs=NOISE), name
    assert cycles.any() or names == OUTPUTS[0]


@pytest.mark.parametrize("names", OUTPUTS)
def test_materials_that_ask_for_the_ray_are_as_in_cycles(names, scene, tmp_path):
    """A floor and a ceiling glow in what they are told."""
    background(scene).inputs["Color"].default_value = (0, 0, 0, 1)
    places = cards()
    glow = new_material("Glow")
    tree = glow.node_tree
    show(tree, add(tree, "ShaderNodeEmission", Color=asked(tree, names)).outputs[0])
    card(glow, (0, 0, -2), 20)
    card(glow, (0, 0, 8), 20)
    ours, cycles = both(scene, tmp_path)
    for name, place in places.items():
        assert ours[place] == pytest.approx(cycles[place], abs=1e-4), name


def test_a_studio_shows_one_color_and_lights_with_another(scene, tmp_path, addon):
    """The usual way: Is Camera Ray mixes two Backgrounds. Lamps of nodes that ask for the ray give light."""
    card(paint("Diffuse", Color=WHITE), (0, 0, 0), 2)
    tree = scene.world.node_tree
    seen = add(tree, "ShaderNodeBackground", Color=(0.1, 0.2, 0.3))
    light = add(tree, "ShaderNodeBackground", Color=(0.9, 0.8, 0.7), Strength=0.5)
    path = tree.nodes.new("ShaderNodeLightPath")
    mixed = add(
        tree, "ShaderNodeMixShader", _0=path.outputs["Is Camera Ray"], _1=light.outputs[0], _2=seen.outputs[0]
    )
    end = next(each for each in tree.nodes if each.type == "OUTPUT_WORLD")
    tree.links.new(mixed.outputs[0], end.inputs["Surface"])
    ours, cycles = both(scene, tmp_path)
    for image in (ours, cycles):
        assert image[0, 0] == pytest.approx((0.1, 0.2, 0.3, 1.0), rel=1e-5)
    assert ours[8, 8] == pytest.approx((0.45, 0.4, 0.35, 1.0), abs=NOISE)
    assert cycles[8, 8] == pytest.approx((0.45, 0.4, 0.35, 1.0), abs=NOISE)
    prepare = addon("bridge.render.render_inputs").prepare
    assert prepare(scene, bpy.context.view_layer, scene.camera).scene.warnings == ()


def test_lamps_that_ask_for_the_ray_are_as_in_cycles(scene, tmp_path, addon):
    card(paint("Diffuse", Color=WHITE), (0, 0, 0), 2)
    background(scene).inputs["Color"].default_value = (0, 0, 0, 1)
    lamp = bpy.data.lights.new("Sun", "SUN")
    lamp.energy, lamp.use_nodes = 3.0, True
    scene.collection.objects.link(bpy.data.objects.new("Sun", lamp))
    tree = lamp.node_tree
    emission = next(each for each in tree.nodes if each.type == "EMISSION")
    for names in (("Is Camera Ray", "Is Shadow Ray", "Ray Depth"), OUTPUTS[3]):
        tree.links.new(asked(tree, names), emission.inputs["Color"])
        ours, cycles = both(scene, tmp_path)
        assert ours[8, 8] == pytest.approx(cycles[8, 8], abs=1e-3)
        assert np.any(cycles[8, 8, :3]) == ("Ray Depth" in names)


def test_the_length_of_a_ray_is_named(scene, addon):
    material = new_material("Absorbs")
    tree = material.node_tree
    length = tree.nodes.new("ShaderNodeLightPath").outputs["Ray Length"]
    show(tree, add(tree, "ShaderNodeEmission", Strength=length).outputs[0])
    card(material, (0, 0, 0))
    prepare = addon("bridge.render.render_inputs").prepare
    lines = [str(line) for line in prepare(scene, bpy.context.view_layer, scene.camera).scene.warnings]
    assert any(line.startswith("Not shown as it is: Light Path: Ray Length (in Absorbs)") for line in lines)
