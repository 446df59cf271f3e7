# SPDX-License-Identifier: GPL-3.0-or-later
"""Vector and Cryptomatte passes of the engine, against Cycles' own files."""

import json
import re

import bpy
import numpy as np
import pytest
from engine_images import f12


@pytest.fixture
def ordinary(engine_scene):
    """Two cubes of which one moves and turns, an ordinary camera that moves; one sample, at the centre."""
    bpy.ops.mesh.primitive_cube_add(size=0.9, location=(0.6, 1.5, 0))
    cube = bpy.context.object
    cube.name = "Würfel"
    cube.data.materials.append(bpy.data.materials.new("Gelb"))
    for frame, x, turn in ((0, 0.4, 0), (1, 0.6, 0.3), (2, 1.1, 0.8)):
        cube.location.x, cube.rotation_euler.z = x, turn
        cube.keyframe_insert("location", frame=frame)
        cube.keyframe_insert("rotation_euler", frame=frame)
    bpy.data.objects["Cube"].location = (-1.4, 2.0, 0.2)
    bpy.ops.object.camera_add(location=(0, -5, 0.3), rotation=(np.pi / 2, 0, 0))
    camera = engine_scene.camera = bpy.context.object
    for frame, x in ((0, -0.3), (1, 0), (2, 0.2)):
        camera.location.x = x
        camera.keyframe_insert("location", frame=frame)
    camera.scfpf.samples = 1
    cycles = engine_scene.cycles
    cycles.samples, cycles.use_denoising, cycles.use_adaptive_sampling = 1, False, False
    cycles.pixel_filter_type, cycles.filter_width = "GAUSSIAN", 0.01
    cycles.max_bounces = 0
    engine_scene.frame_set(1)
    return engine_scene


def both(scene):
    made = []
    for engine in ("SCFPF", "CYCLES"):
        scene.render.engine = engine
        made.append(f12(scene))
    return made


def test_vectors_are_those_of_cycles(ordinary):
    layer = ordinary.view_layers[0]
    layer.use_pass_vector = layer.use_pass_object_index = True
    # The moving one: its triangles are others in between, but the same at whole frames.
    bpy.data.objects["Würfel"].pass_index = 5
    ours, theirs = both(ordinary)
    index = next(name for name in ours if "bject" in name or name.endswith("OB"))
    same = ours[index] == theirs[index]
    vector, expected = ours["ViewLayer.Vector"], theirs["ViewLayer.Vector"]
    assert same.mean() > 0.97 and np.abs(expected).max() > 3
    # Cycles' samples lie up to 0.015 pixels beside the centre, and its numbers are float32.
    assert np.abs(vector - expected)[same[..., 0]].max() < 0.02
    assert np.abs(vector - expected)[same[..., 0]].mean() < 1e-3
    assert ordinary.frame_current == 1 and ordinary.frame_subframe == 0


def header(scene):
    """The metadata of cryptomattes in the file: {field: value}."""
    with open(f"{scene.render.filepath}.exr", "rb") as file:
        data = file.read(20000)
    fields = {}
    for match in re.finditer(rb"cryptomatte/([0-9a-f]{7}/[a-z]+)\0string\0(.{4})", data, re.S):
        size = int.from_bytes(match[2], "little")
        fields[match[1].decode()] = data[match.end() : match.end() + size].decode()
    return fields


def test_cryptomattes_are_those_of_cycles(ordinary):
    layer = ordinary.view_layers[0]
    layer.use_pass_cryptomatte_object = layer.use_pass_cryptomatte_material = True
    layer.pass_cryptomatte_depth = 4
    ordinary.cycles.samples = ordinary.camera.scfpf.samples = 64
    ordinary.cycles.pixel_filter_type = "BLACKMAN_HARRIS"
    ordinary.cycles.filter_width = ordinary.render.filter_size = 1.5
    ordinary.render.engine = "SCFPF"
    ours, fields = f12(ordinary), header(ordinary)
    ordinary.render.engine = "CYCLES"
    theirs, expected = f12(ordinary), header(ordinary)
    crypto = {name for name in theirs if "Crypto" in name}
    assert crypto == {name for name in ours if "Crypto" in name} and len(crypto) == 4
    for name in crypto:
        same = ours[name][..., ::2] == theirs[name][..., ::2]
        # Of two shares that are almost equal noise says which is the larger.
        assert same.mean() > 0.98
        assert np.abs(ours[name] - theirs[name])[..., 1::2][same].max() < 0.12
    assert fields.keys() == expected.keys() and len(fields) == 8
    for field, value in fields.items():
        if field.endswith("manifest"):
            assert json.loads(value).items() <= json.loads(expected[field]).items()
        else:
            assert value == expected[field]


def test_a_volumes_vectors_and_chords_are_in_the_file(addon, engine_scene):
    bpy.context.view_layer.objects.active = engine_scene.camera
    assert bpy.ops.scfpf.preset_apply(preset="nonlinear_twist") == {"FINISHED"}
    surface = engine_scene.camera.scfpf.surfaces[1].object
    for frame, angle in ((0, 0.0), (2, 0.3)):
        surface.rotation_euler.z = angle
        surface.keyframe_insert("rotation_euler", frame=frame)
    engine_scene.frame_set(1)
    engine_scene.camera.scfpf.pixel_error = 0.003
    layer = engine_scene.view_layers[0]
    layer.use_pass_vector = layer.use_pass_position = True
    layer.scfpf.use_pass_chord_count = layer.scfpf.use_pass_chord_error = True
    made = f12(engine_scene)
    count, error = (made[f"ViewLayer.{name}"][..., 0] for name in ("ChordCount", "ChordError"))
    assert count.max() > 2 and 0 < error.max() <= 1.05 * engine_scene.camera.scfpf.pixel_error
    vector, position = made["ViewLayer.Vector"], made["ViewLayer.Position"]
    hit = position.any(axis=-1)
    assert np.abs(vector[hit]).max() > 0.5 and not vector[~hit].any()
    # The next frame's volume has the place that the vector leads to.
    engine_scene.frame_set(2)
    read = addon("bridge.camera.read_projection").read_projection
    after = read(engine_scene.camera, bpy.context.evaluated_depsgraph_get(), 64 / 36)
    rows, columns = np.nonzero(hit)
    x = (columns + 0.5 - vector[hit][:, 2]) / 64
    y = (rows + 0.5 - vector[hit][:, 3]) / 36
    inside = (x > 0.01) & (x < 0.99) & (y > 0.01) & (y < 0.99)
    find = addon("projection.volume.inverse").find_in_image
    place = find(after, position[hit][inside].T.astype(float))
    assert place.found.all() and inside.sum() > 50
    assert np.abs(place.x - x[inside]).max() < 1e-4 and np.abs(place.y - y[inside]).max() < 1e-4


def test_the_compositor_has_the_new_sockets(addon, engine_scene):
    if hasattr(engine_scene, "compositing_node_group"):
        tree = engine_scene.compositing_node_group = bpy.data.node_groups.new("Comp", "CompositorNodeTree")
    else:
        engine_scene.use_nodes = True
        tree = engine_scene.node_tree
    node = tree.nodes.new("CompositorNodeRLayers")
    layer = engine_scene.view_layers[0]
    layer.use_pass_vector = layer.use_pass_cryptomatte_object = True
    layer.scfpf.use_pass_chord_count = layer.scfpf.use_pass_chord_error = True
    layer.scfpf.use_pass_diffuse = layer.use_pass_emit = layer.use_pass_shadow = True
    sockets = {socket.name for socket in node.outputs if socket.enabled}
    assert {"Vector", "ChordCount", "ChordError", "CryptoObject00", "CryptoObject02"} <= sockets
    emission, _world = addon("bridge.blender.versions").light_pass_names()
    assert {"Diffuse", "Shadow", emission} <= sockets
