# SPDX-License-Identifier: GPL-3.0-or-later
"""Passes of joined pictures: light and AOVs of the renders, data of the caster."""

import bpy
import numpy as np
import pytest
from layer_scenes import flexible

WIDTH, HEIGHT = 64, 36


@pytest.fixture
def scene():
    """A room of two colours with a glow, in Cycles' direct light, and an AOV of its own."""
    scene = bpy.context.scene
    for obj in list(scene.objects):
        bpy.data.objects.remove(obj)
    for number, (size, at) in enumerate(((8.0, (0, 0, 0)), (1.5, (1.0, 0.5, -2.0)))):
        bpy.ops.mesh.primitive_cube_add(size=size, location=at)
        material = bpy.data.materials.new(f"Matt {number}")
        material.use_nodes = True
        tree = material.node_tree
        shader = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED")
        shader.inputs["Base Color"].default_value = (0.8, 0.4 + 0.4 * number, 0.2, 1.0)
        shader.inputs["Roughness"].default_value = 1.0
        shader.inputs["Specular IOR Level"].default_value = 0.0
        shader.inputs["Emission Color"].default_value = (0.0, 0.1, 0.1, 1.0)
        shader.inputs["Emission Strength"].default_value = 1.0
        aov = tree.nodes.new("ShaderNodeOutputAOV")
        aov.aov_name = "Mark"
        aov.inputs["Color"].default_value = (float(number), 0.5, 0.25, 1.0)
        bpy.context.object.data.materials.append(material)
    bpy.ops.object.light_add(type="POINT", location=(0, 2, 2))
    bpy.context.object.data.energy, bpy.context.object.data.shadow_soft_size = 300.0, 0.0
    bpy.ops.object.camera_add()
    camera = scene.camera = bpy.context.object
    camera.data.clip_start = 0.01
    scene.world = None
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, HEIGHT, 100
    render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 1, False, False
    scene.cycles.max_bounces = 0
    layer = scene.view_layers[0]
    for name in ("use_pass_diffuse_direct", "use_pass_diffuse_color", "use_pass_emit", "use_pass_normal"):
        setattr(layer, name, True)
    layer.use_pass_object_index = layer.use_pass_cryptomatte_object = True
    bpy.data.objects["Cube.001"].pass_index = 7
    layer.aovs.add().name = "Mark"
    return scene


def test_passes_of_renders_and_of_the_caster(scene, addon, monkeypatch):
    """Marks lie where the caster finds the things that have them, and light is the sum of its parts."""
    flexible(scene.camera, "perspective")
    scene.camera.scfpf.samples = 1
    jobs = addon("cycles.layers.layers_job")
    found = {}
    monkeypatch.setattr(jobs, "deliver_passes", lambda passes, *_: found.update(passes) or "")
    addon("engines.anchors_job").render_anchors(bpy.context, scene.camera)
    mark = found["Mark"].values[..., :3]
    box = found[addon("bridge.blender.versions").index_pass_names()[0]].values[..., 0] == 7
    assert 0.02 < box.mean() < 0.5
    # Each thing has its own mark, up to the pixels at its edge.
    np.testing.assert_allclose(np.median(mark[box], axis=0), (1.0, 0.5, 0.25), atol=1e-5)
    np.testing.assert_allclose(np.median(mark[~box], axis=0), (0.0, 0.5, 0.25), atol=1e-5)
    assert (np.abs(mark[..., 0] - box) > 0.1).mean() < 0.03
    # Light is the sum of its parts.
    light, color, glow = (
        next(each.values for name, each in found.items() if name in names)
        for names in (
            ("Diffuse Direct", "DiffDir"),
            ("Diffuse Color", "DiffCol"),
            (addon("bridge.blender.versions").light_pass_names()[0],),
        )
    )
    combined = found["Combined"].values[..., :3]
    np.testing.assert_allclose(light * color + glow, combined, atol=2e-3)
    normal = found["Normal"].values
    np.testing.assert_allclose(np.linalg.norm(normal, axis=2), 1.0, atol=1e-3)
    assert any(name.startswith("CryptoObject") for name in found)


def test_passes_that_neither_has_are_named(scene, addon):
    flexible(scene.camera, "orthographic")
    scene.camera.scfpf.samples = 1
    scene.view_layers[0].use_pass_vector = True
    job = addon("engines.anchors_job").render_anchors(bpy.context, scene.camera)
    assert any("lack some passes" in str(text) and "Vector" in str(text) for text in job.warnings)


@pytest.mark.parametrize("preset", ["angular_fisheye", "deep_curvy_volume", ""])
def test_mist(scene, addon, monkeypatch, preset):
    """The world's, by each sample's distance along its projector; by an ordinary camera that of Cycles."""
    scene.world = bpy.data.worlds.new("World")
    mist = scene.world.mist_settings
    mist.start, mist.depth, mist.falloff = 1.0, 5.0, "LINEAR"
    scene.view_layers[0].use_pass_mist = True
    found = {}
    monkeypatch.setattr(
        addon("cycles.layers.layers_job"), "deliver_passes", lambda passes, *_: found.update(passes) or ""
    )
    flexible(scene.camera, *([preset] if preset else []))
    scene.camera.scfpf.samples = 1
    addon("engines.anchors_job").render_anchors(bpy.context, scene.camera)
    value = found["Mist"].values[..., 0]
    inputs = addon("bridge.render.render_inputs")
    seen = addon("bridge.scene.render_depsgraph").with_render_depsgraph(
        scene,
        bpy.context.view_layer,
        lambda depsgraph: inputs.read_inputs(
            depsgraph, scene.camera, (WIDTH, HEIGHT), passes=("DEPTH", "POSITION")
        ),
    )
    frame = addon("shading.frame").render_frame(seen.projection, seen.scene, seen.settings)
    depth = frame.passes["DEPTH"][..., 0]
    if not preset:
        depth = np.linalg.norm(frame.passes["POSITION"], axis=2)
    wanted = np.clip((depth - 1.0) / 5.0, 0.0, 1.0)
    assert wanted.std() > 0.02
    off = np.abs(value - wanted)
    assert np.median(off) < 2e-3 and (off < 0.05).mean() > 0.9
