# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures of matt things in a sun, joined from renders by Cycles, beside those of our own engine."""

import bpy
import numpy as np
import pytest
from layer_scenes import flexible

WIDTH, HEIGHT = 96, 54


@pytest.fixture
def scene():
    """Matt cubes and a ball on a ground, in a sharp sun and a dark world, without light that bounces."""
    scene = bpy.context.scene
    for obj in list(scene.objects):
        bpy.data.objects.remove(obj)
    bpy.ops.mesh.primitive_plane_add(size=80.0)
    for number, (x, y, size) in enumerate(((-2.5, 3.0, 2.0), (2.0, 5.0, 3.0), (0.5, 1.0, 0.8))):
        bpy.ops.mesh.primitive_cube_add(size=size, location=(x, y, size / 2), rotation=(0, 0, number))
    bpy.ops.mesh.primitive_ico_sphere_add(radius=1.0, subdivisions=4, location=(-0.8, 2.0, 1.0))
    for number, obj in enumerate(list(scene.objects)):
        material = bpy.data.materials.new("Matt")
        material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()
        matt, output = (
            tree.nodes.new(kind) for kind in ("ShaderNodeBsdfDiffuse", "ShaderNodeOutputMaterial")
        )
        matt.inputs["Color"].default_value = (0.2 + 0.15 * number, 0.6 - 0.1 * number, 0.4, 1.0)
        tree.links.new(matt.outputs[0], output.inputs["Surface"])
        obj.data.materials.append(material)
    bpy.ops.object.light_add(type="SUN", rotation=(0.7, 0.4, 0.3))
    bpy.context.object.data.energy, bpy.context.object.data.angle = 3.0, 0.0
    bpy.ops.object.camera_add(location=(0, -5, 1.8), rotation=(1.5, 0, 0))
    scene.camera = bpy.context.object
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, HEIGHT, 100
    render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.max_bounces = 1, False, 0
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.0, 0.0, 0.0, 1.0)
    return scene


def result():
    image = bpy.data.images["SCFPF Render"]
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(HEIGHT, WIDTH, 4)[..., :3]


def edges(image):
    """Pixels beside others of other colours, (H, W)."""
    grown = np.pad(image, [(1, 1), (1, 1), (0, 0)], mode="edge")
    beside = [grown[i : i + HEIGHT, j : j + WIDTH] for i in range(3) for j in range(3)]
    return (np.max(beside, axis=0) - np.min(beside, axis=0)).max(axis=2) > 0.05


@pytest.mark.parametrize("preset", ["cylindrical_panorama", "inverted_perspective", "deep_curvy_volume"])
def test_matt_surfaces_are_as_the_engine_shades_them(scene, addon, preset):
    """Inside surfaces the error is at most 0.01; of all pixels 1 % at most are off by 0.1."""
    flexible(scene.camera, preset)
    scene.camera.scfpf.samples = 16
    addon("engines.anchors_job").render_anchors(bpy.context, scene.camera)
    joined = result()
    assert bpy.ops.scfpf.render(camera=scene.camera.name) == {"FINISHED"}
    ours = result()
    inner, off = ~edges(ours), np.abs(joined - ours).max(axis=2)
    assert inner.mean() > 0.4 and ours.std() > 0.05
    assert np.sqrt(np.mean((joined - ours)[inner] ** 2)) <= 0.01
    assert (off[inner] > 0.1).mean() <= 1e-3
    assert (off > 0.1).mean() <= 0.01


@pytest.mark.parametrize("preset", ["perspective", "inverted_perspective"])
def test_lines_and_paper_are_drawn_over_the_renders(scene, addon, preset):
    """Those of Drawn Style, as our own engine draws them; through a camera's own view as well."""
    flexible(scene.camera, preset)
    scene.camera.scfpf.samples = 16
    assert bpy.ops.scfpf.render(camera=scene.camera.name) == {"FINISHED"}
    plain = result()
    style = scene.scfpf_drawn
    style.use_drawn, style.fill, style.line_color = True, "RENDERED", (1.0, 0.0, 0.0)
    style.use_paper, style.paper_color = True, (0.0, 1.0, 0.0)
    assert bpy.ops.scfpf.render(camera=scene.camera.name) == {"FINISHED"}
    ours = result()
    changed = np.abs(ours - plain).max(axis=2) > 0.2
    assert (changed & (ours[..., 0] > 0.8)).mean() > 0.02 and (changed & (ours[..., 1] > 0.8)).mean() > 0.05
    job = addon("engines.anchors_job").render_anchors(bpy.context, scene.camera)
    off = np.abs(result() - ours).max(axis=2) > 0.1
    assert off.mean() <= 0.01 and not job.warnings
    style.fill = "TOON"
    job = addon("engines.anchors_job").render_anchors(bpy.context, scene.camera)
    assert (np.abs(result() - ours).max(axis=2) > 0.1).mean() <= 0.01
    assert any("Drawn Style's fill is left out" in str(text) for text in job.warnings)
