# SPDX-License-Identifier: GPL-3.0-or-later
"""Depth and mist through the rig, compared with an ordinary camera's passes by Cycles."""

import bpy
import numpy as np
import pytest
from engine_images import f12, write_multilayer
from rig_scenes import glowing, reference, switch

pytestmark = pytest.mark.usefixtures("built_groups")

FARTHEST = 1e10
WIDTH, HEIGHT = 48, 32
LENSES = {
    "perspective": {"type": "PERSP", "lens": 28.0, "clip_end": 60.0},
    "shifted": {"type": "PERSP", "lens": 40.0, "shift_x": 0.2, "shift_y": -0.1, "clip_start": 1.0},
    "orthographic": {"type": "ORTHO", "ortho_scale": 9.0, "shift_x": 0.1},
}
FALLOFFS = {"perspective": "QUADRATIC", "shifted": "LINEAR", "orthographic": "INVERSE_QUADRATIC"}


@pytest.fixture
def rig_of(addon):
    return lambda: addon("cycles.rig_data").rig_of(bpy.context.scene)


@pytest.fixture
def camera(tmp_path):
    """An ordinary camera before a slope, spheres and the sky; passes go to a file."""
    scene = bpy.context.scene
    camera = reference.add_camera(WIDTH, HEIGHT)
    camera.location, camera.rotation_euler, camera.scale = (0.5, -8, 2), (1.35, 0.1, 0.1), (2, 2, 2)
    bpy.ops.mesh.primitive_plane_add(size=16, location=(0, 2, 0), rotation=(0.1, 0.05, 0.2))
    for x, y, z, radius in ((-1.3, -4, 1.4, 0.6), (0.6, -1, 1, 0.7), (3, 4, 1.7, 1)):
        bpy.ops.mesh.primitive_uv_sphere_add(radius=radius, location=(x, y, z))
    scene.world = bpy.data.worlds.new("Mist")
    scene.world.mist_settings.start, scene.world.mist_settings.depth = 3.0, 9.0
    scene.render.engine, scene.cycles.samples, scene.cycles.max_bounces = "CYCLES", 1, 0
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    write_multilayer(scene, tmp_path / "passes")
    bpy.context.view_layer.objects.active = camera
    return camera


def ordinary():
    """Depth and Mist (H, W) of an ordinary camera by Cycles."""
    layer = bpy.context.view_layer
    layer.use_pass_z = layer.use_pass_mist = True
    found = f12(bpy.context.scene)
    layer.use_pass_z = layer.use_pass_mist = False
    return found["ViewLayer.Depth"][..., 0], found["ViewLayer.Mist"][..., 0]


def compositor():
    """The scene's compositor tree, and its output node."""
    scene = bpy.context.scene
    tree = getattr(scene, "compositing_node_group", None) or scene.node_tree
    return tree, next(node for node in tree.nodes if node.type in {"COMPOSITE", "GROUP_OUTPUT"})


def composed():
    """Depth and Mist (H, W) of the compositor's node SCFPF Passes through the rig."""
    tree, end = compositor()
    passes = tree.nodes["SCFPF Passes"]
    picture = tree.nodes.new("CompositorNodeCombineColor")
    for name, number in (("Depth", 0), ("Mist", 1)):
        tree.links.new(passes.outputs[name], picture.inputs[number])
    tree.links.new(picture.outputs[0], end.inputs[0])
    found = f12(bpy.context.scene)
    values = next(values for name, values in found.items() if name.startswith("Composite."))
    return values[..., 0], values[..., 1]


@pytest.mark.parametrize("name", LENSES)
def test_depth_and_mist_of_a_cameras_own_view_are_cycles(camera, rig_of, name):
    """Depth to the last digits, also at edges and with several samples; mist at the sample of the depth."""
    scene = bpy.context.scene
    for setting, value in LENSES[name].items():
        setattr(camera.data, setting, value)
    scene.world.mist_settings.falloff = FALLOFFS[name]
    if name == "perspective":
        scene.cycles.samples = 4
    depth, density = ordinary()
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    assert switch(camera) == {"FINISHED"} and bpy.ops.scfpf.cycles_passes() == {"FINISHED"}
    ours, our_density = composed()
    assert (depth < FARTHEST).mean() > 0.5 and np.ptp(depth[depth < FARTHEST]) > 2
    np.testing.assert_allclose(ours, depth, rtol=1e-5)
    off = np.abs(our_density - density)
    assert np.median(off) < 1e-3 and (off.max() < 1e-3 or name == "perspective")


def test_mist_without_a_world(addon, camera):
    """Cycles' own settings, which layers have as well."""
    bpy.context.scene.world = None
    density = ordinary()[1]
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    assert switch(camera) == {"FINISHED"} and bpy.ops.scfpf.cycles_passes() == {"FINISHED"}
    assert 0.02 < density.min() < 0.2
    np.testing.assert_allclose(composed()[1], density, atol=1e-5)
    step = addon("cycles.aov_passes").is_in_step
    assert step(bpy.context.scene)
    bpy.context.scene.world = bpy.data.worlds[0]
    assert not step(bpy.context.scene)
    assert bpy.ops.scfpf.cycles_rig_update() == {"FINISHED"} and step(bpy.context.scene)
    bpy.context.scene.world = None
    assert not step(bpy.context.scene)
    assert addon("cycles.layers.layer_passes").Mist.of(None) == (0.0, 100.0, 1.0)


def test_depth_and_mist_of_another_view_are_lengths(camera, rig_of):
    """From the near surface, once the lens is no longer that of the volume."""
    mist = bpy.context.scene.world.mist_settings
    mist.start, mist.depth, mist.falloff = 0.0, 100.0, "LINEAR"
    depth, density = ordinary()
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    assert switch(camera) == {"FINISHED"} and bpy.ops.scfpf.cycles_passes() == {"FINISHED"}
    assert rig_of().scfpf_rig.is_own_view
    camera.data.lens *= 1.1
    bpy.context.view_layer.update()
    assert not rig_of().scfpf_rig.is_own_view
    ours, our_density = composed()
    seen = depth < FARTHEST
    length = 100.0 * density * (1.0 - camera.data.clip_start / depth)
    np.testing.assert_allclose(ours[seen], length[seen], rtol=1e-5)
    np.testing.assert_allclose(our_density[seen], length[seen] / 100.0, rtol=1e-5)
    assert (ours[~seen] > 9e9).all() and (our_density[~seen] == 1.0).all()
    camera.data.lens /= 1.1
    bpy.context.view_layer.update()
    assert rig_of().scfpf_rig.is_own_view


def test_the_volume_of_an_animated_lens_is_its_own_view_if_it_is_at_all_frames(camera, rig_of):
    scene = bpy.context.scene
    scene.frame_end = 4
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    camera.keyframe_insert("location", frame=1)
    assert switch(camera) == {"FINISHED"}
    assert rig_of().scfpf_rig.is_own_view and rig_of().scfpf_rig.animated
    camera.data.keyframe_insert("lens", frame=1)
    camera.data.lens *= 2
    camera.data.keyframe_insert("lens", frame=4)
    assert bpy.ops.scfpf.cycles_rig_update() == {"FINISHED"}
    assert not rig_of().scfpf_rig.is_own_view


def test_what_the_passes_measure_is_said_before_the_picture(addon, camera, rig_of):
    """Passes of Cycles itself, another world, and nodes of an earlier version, which are made anew."""
    scene, layer = bpy.context.scene, bpy.context.view_layer
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"} and switch(camera) == {"FINISHED"}

    def said():
        return [str(text) for text in addon("cycles.cautions").cautions(scene, layer, rig_of())]

    assert said() == []
    for name in ("use_pass_z", "use_pass_mist"):
        setattr(layer, name, True)
        assert len(said()) == 1 and "SCFPF Passes" in said()[0]
        setattr(layer, name, False)
    assert bpy.ops.scfpf.cycles_passes() == {"FINISHED"} and said() == []
    depth, _density = composed()
    tree, _end = compositor()
    group = tree.nodes["SCFPF Passes"].node_tree
    group["scfpf_build"] -= 1
    assert len(said()) == 1 and "Update Chords" in said()[0]
    assert bpy.ops.scfpf.cycles_rig_update() == {"FINISHED"} and said() == []
    assert tree.nodes["SCFPF Passes"].node_tree != group
    links = len(tree.links)
    np.testing.assert_array_equal(composed()[0], depth)
    assert len(tree.links) > links
    scene.world = bpy.data.worlds.new("Other")
    scene.world.mist_settings.start, scene.world.mist_settings.depth = 0.0, 1.0
    assert len(said()) == 1 and "another world" in said()[0]
    assert bpy.ops.scfpf.cycles_rig_update() == {"FINISHED"} and said() == []
    assert (composed()[1] == 1.0).all()


def shining():
    """Let the objects shine in colours of their own, without noise."""
    for number, obj in enumerate(obj for obj in bpy.context.scene.objects if obj.type == "MESH"):
        glowing(obj.name, (1.0, 0.9 - 0.25 * number, 0.1 + 0.25 * number))
        tree = obj.data.materials[0].node_tree
        checks = tree.nodes.new("ShaderNodeTexChecker")
        checks.inputs["Scale"].default_value = 12.0
        tree.links.new(checks.outputs["Color"], tree.nodes["Emission"].inputs["Strength"])


def defocused(node, scale=3.0, sharp=5.0):
    """F12's picture (H, W, 4) with the guide's recipe of blur, by a node's outputs Image and Depth.

    scale: the widest blur in pixels. sharp: the depth that is sharp.
    """
    scene = bpy.context.scene
    tree, end = compositor()
    images = [output for each in tree.nodes for output in each.outputs if output.name == "Image"]
    away = tree.nodes.new("ShaderNodeMath")
    away.operation, away.inputs[1].default_value = "SUBTRACT", sharp
    size = tree.nodes.new("ShaderNodeMath")
    size.operation = "ABSOLUTE"
    share = tree.nodes.new("ShaderNodeMath")
    share.operation = "DIVIDE"
    wide = tree.nodes.new("ShaderNodeMath")
    wide.operation, wide.inputs[1].default_value = "MULTIPLY", scale
    blur = tree.nodes.new("CompositorNodeDefocus")
    blur.use_zbuffer = False
    for source, target in (
        (node.outputs["Depth"], away.inputs[0]),
        (away.outputs[0], size.inputs[0]),
        (size.outputs[0], share.inputs[0]),
        (node.outputs["Depth"], share.inputs[1]),
        (share.outputs[0], wide.inputs[0]),
        (wide.outputs[0], blur.inputs["Z"]),
        (images[0], blur.inputs["Image"]),
        (blur.outputs[0], end.inputs[0]),
    ):
        tree.links.new(source, target)
    return next(values for name, values in f12(scene).items() if name.startswith("Composite."))


def test_the_recipe_of_blur_by_depth_is_that_of_an_ordinary_camera(addon, camera, rig_of):
    """Defocus fed with the rig's Depth, and with that of an ordinary camera by Cycles."""
    scene = bpy.context.scene
    shining()
    bpy.context.view_layer.use_pass_z = True
    addon("bridge.blender.versions").compositor_tree(scene, "scfpf_test")
    tree, _end = compositor()
    expected = defocused(next(node for node in tree.nodes if node.type == "R_LAYERS"))
    sharp = f12(scene)["ViewLayer.Combined"]
    bpy.context.view_layer.use_pass_z = False
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    assert switch(camera) == {"FINISHED"} and bpy.ops.scfpf.cycles_passes() == {"FINISHED"}
    found = defocused(compositor()[0].nodes["SCFPF Passes"])
    np.testing.assert_allclose(found, expected, atol=1e-3)
    assert np.abs(expected - sharp).mean() > 0.01


@pytest.mark.parametrize("lens", LENSES)
def test_the_recipe_works_with_the_engines_own_depth(addon, camera, lens):
    """Defocus fed with Depth by the engine, and with that by Cycles; a pixel of an edge may differ."""
    scene = bpy.context.scene
    for name, value in LENSES[lens].items():
        setattr(camera.data, name, value)
    shining()
    bpy.context.view_layer.use_pass_z = True
    addon("bridge.blender.versions").compositor_tree(scene, "scfpf_test")
    node = next(each for each in compositor()[0].nodes if each.type == "R_LAYERS")
    expected, sharp = defocused(node), f12(scene)["ViewLayer.Combined"]
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    scene.render.engine, camera.scfpf.samples = "SCFPF", 1
    found = defocused(node)
    off = np.abs(found - expected)[..., :3].max(axis=2)
    assert (off > 1e-3).mean() < 0.005
    assert np.abs(expected - sharp).mean() > 0.01
