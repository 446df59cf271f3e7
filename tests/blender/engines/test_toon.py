# SPDX-License-Identifier: GPL-3.0-or-later
"""Toon pictures by EEVEE through anchors: ramps of light, and outlines of inverted hulls."""

import bpy
import numpy as np
import pytest
from layer_scenes import add, collected, flexible, looking, new_camera, select_only

WIDTH, HEIGHT = 96, 54
RADIUS, THICKNESS = 2.0, 0.6


def emission(name, color):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    glow, output = (tree.nodes.new(kind) for kind in ("ShaderNodeEmission", "ShaderNodeOutputMaterial"))
    glow.inputs["Color"].default_value = (*color, 1.0)
    tree.links.new(glow.outputs[0], output.inputs["Surface"])
    return material


def ramp():
    """Two tones of light, by Shader to RGB."""
    material = emission("Ramp", (0, 0, 0))
    tree = material.node_tree
    diffuse, rgb, tones = (
        tree.nodes.new(kind)
        for kind in ("ShaderNodeBsdfDiffuse", "ShaderNodeShaderToRGB", "ShaderNodeValToRGB")
    )
    tones.color_ramp.interpolation = "CONSTANT"
    tones.color_ramp.elements[0].color, tones.color_ramp.elements[1].color = (0.25, 0, 0, 1), (1, 0, 0, 1)
    tones.color_ramp.elements[1].position = 0.15
    tree.links.new(diffuse.outputs[0], rgb.inputs[0])
    tree.links.new(rgb.outputs[0], tones.inputs[0])
    tree.links.new(tones.outputs[0], next(n for n in tree.nodes if n.type == "EMISSION").inputs["Color"])
    return material


@pytest.fixture
def toon():
    """A sphere of two red tones with a blue outline, before a green wall."""
    scene = bpy.context.scene
    for obj in list(scene.objects):
        bpy.data.objects.remove(obj)
    bpy.ops.mesh.primitive_uv_sphere_add(radius=RADIUS, segments=64, ring_count=32)
    ball = bpy.context.object
    ball.data.shade_smooth()
    hull = emission("Hull", (0, 0, 1))
    hull.use_backface_culling = hull.use_backface_culling_shadow = True
    ball.data.materials.append(ramp())
    ball.data.materials.append(hull)
    modifier = ball.modifiers.new("Outline", "SOLIDIFY")
    modifier.thickness, modifier.offset, modifier.use_flip_normals = THICKNESS, 1.0, True
    modifier.use_rim, modifier.material_offset = False, 1
    bpy.ops.mesh.primitive_plane_add(size=60.0, location=(0, 0, -6))
    bpy.context.object.data.materials.append(emission("Wall", (0, 0.5, 0)))
    bpy.ops.object.light_add(type="SUN", rotation=(0.6, 0.5, 0))
    bpy.ops.object.camera_add(location=(0, 0, 4))
    scene.camera = bpy.context.object
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = WIDTH, HEIGHT, 100
    scene.eevee.taa_render_samples = 1
    scene.view_settings.view_transform = "Standard"
    return scene


def rendered(addon, scene, preset):
    """The picture by EEVEE through a preset, and the distances (H, W) of its projectors from the origin."""
    flexible(scene.camera, preset)
    scene.camera.scfpf.samples = 1
    renderer = addon("bridge.blender.versions").EEVEE
    addon("engines.anchors_job").render_anchors(bpy.context, scene.camera, renderer=renderer)
    image = bpy.data.images["SCFPF Render"]
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    projection = addon("bridge.camera.read_projection").read_projection(
        scene.camera, depsgraph, WIDTH / HEIGHT
    )
    x, y = (np.arange(WIDTH) + 0.5) / WIDTH, (np.arange(HEIGHT) + 0.5) / HEIGHT
    points = projection.projectors(*(grid.ravel() for grid in np.meshgrid(x, y))).points
    begin, way = points[0], points[-1] - points[0]
    # The distance of straight projectors from the ball's centre.
    along = -np.einsum("cn,cn->n", begin, way) / np.einsum("cn,cn->n", way, way)
    distance = np.linalg.norm(begin + way * along, axis=0)
    return values.reshape(HEIGHT, WIDTH, 4), distance.reshape(HEIGHT, WIDTH)


def test_an_inverted_hull_is_an_outline(toon, addon):
    """Round the ball, as thick as its hull: by the distances of projectors from the ball's centre."""
    image, distance = rendered(addon, toon, "orthographic")
    step = 1.5 * np.abs(np.diff(distance, axis=1)).max()
    red, green, blue = (image[..., k] > 0.2 for k in range(3))
    ball = distance < RADIUS - step
    outline = (distance > RADIUS + step) & (distance < RADIUS + THICKNESS - step)
    around = distance > RADIUS + THICKNESS + step
    assert min(ball.sum(), outline.sum(), around.sum()) > 20
    assert (red & ~blue)[ball].mean() > 0.995 and (blue & ~red)[outline].mean() > 0.995
    assert green[around].mean() > 0.98
    tones = np.unique(np.round(image[..., 0][ball], 1))
    assert len(tones) >= 2, "both tones of the ramp"


@pytest.mark.parametrize("layer", [False, True])
def test_data_passes_and_cryptomattes_leave_backs_out(toon, addon, monkeypatch, layer):
    """Within the outline they show the ball, whose distances are known, and not the hull before it."""
    view_layer = toon.view_layers[0]
    for name in ("use_pass_position", "use_pass_material_index", "use_pass_cryptomatte_material"):
        setattr(view_layer, name, True)
    view_layer.pass_cryptomatte_depth = 2
    bpy.data.materials["Ramp"].pass_index, bpy.data.materials["Hull"].pass_index = 5, 6
    found = {}
    monkeypatch.setattr(
        addon("cycles.layers.layers_job"), "deliver_passes", lambda passes, *_: found.update(passes) or ""
    )
    if layer:
        flexible(toon.camera, "orthographic")
        bpy.ops.mesh.primitive_cube_add(size=0.5, location=(0, 0, -20))
        toon.camera.name = "Master"
        collected("Things", bpy.context.object.name)
        flexible(new_camera("Side", looking((0, 0, -30), (0, 0, -40))))
        select_only(toon.camera)
        add(front="DEPTH")
    _, distance = rendered(addon, toon, "orthographic")
    step = 1.5 * np.abs(np.diff(distance, axis=1)).max()
    ball, outline = (
        distance < RADIUS - step,
        (distance > RADIUS + step) & (distance < RADIUS + THICKNESS - step),
    )
    place = found["Position"].values
    off = np.linalg.norm(place[ball], axis=1)
    assert np.abs(off - RADIUS).max() < 0.02
    index = found[addon("bridge.blender.versions").index_pass_names()[1]].values[..., 0]
    assert (index[ball] == 5).mean() > 0.995 and (index[outline] == 6).mean() > 0.995
    crypto = next(each.values for name, each in found.items() if name.startswith("CryptoMaterial00"))
    ball_id, outline_id = np.median(crypto[ball][:, 0]), np.median(crypto[outline][:, 0])
    assert ball_id != outline_id
    assert (crypto[ball][:, 0] == ball_id).mean() > 0.99 and (
        crypto[outline][:, 0] == outline_id
    ).mean() > 0.99


def test_workbench_culls_all_backs_if_it_is_told_to(toon, addon):
    """A box around the camera is open towards it."""
    toon.render.engine = "BLENDER_WORKBENCH"
    culling = addon("engines.backface_culling")
    names, material = ("Ramp", "Hull"), np.array([0, 1, 1])
    assert culling.one_sided(toon, names, material) is None
    toon.display.shading.show_backface_culling = True
    assert culling.one_sided(toon, names, material).all()
    toon.render.engine = "CYCLES"
    assert culling.one_sided(toon, names, material) is None
    toon.render.engine = addon("bridge.blender.versions").EEVEE
    np.testing.assert_array_equal(culling.one_sided(toon, names, material), [False, True, True])
