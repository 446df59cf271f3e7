# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames of an animation use the renders of earlier frames where nothing but the volume moves."""

from pathlib import Path

import bpy
import numpy as np
import pytest
from layer_scenes import flexible

WORKBENCH = "BLENDER_WORKBENCH"


@pytest.fixture
def scene():
    """Cubes in a room, before a camera whose bent volume moves in four frames."""
    scene = bpy.context.scene
    for number, (size, at) in enumerate(((8.0, (0, 0, 0)), (1.2, (1.5, 1, -2)), (1.5, (0, -1.5, 2)))):
        bpy.ops.mesh.primitive_cube_add(size=size, location=at)
        material = bpy.data.materials.new(f"Color {number}")
        material.use_nodes = True
        material.diffuse_color = (0.2 + 0.3 * number, 0.9 - 0.4 * number, 0.5, 1.0)
        bpy.context.object.data.materials.append(material)
    bpy.context.object.name = "Cube"
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    bpy.ops.object.light_add(type="POINT")
    bpy.context.object.name = "Lamp"
    bpy.ops.object.camera_add()
    scene.camera = bpy.context.object
    flexible(scene.camera, "inverted_perspective")
    scene.camera.scfpf.samples = 1
    render = scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 48, 27, 100
    scene.frame_start, scene.frame_end = 1, 4
    _key(scene.camera, "location", x=0.3)
    scene.display.shading.light, scene.display.shading.color_type = "FLAT", "MATERIAL"
    return scene


def _key(owner, path, **changes):
    """Keyframes of a property at frames 1 and 4; changes: of its values, in order."""
    owner.keyframe_insert(path, frame=1)
    value = getattr(owner, path)
    for name, change in changes.items():
        setattr(value, name, getattr(value, name) + change)
    owner.keyframe_insert(path, frame=4)


def test_a_still_scene_is_rendered_once_from_each_place(scene, jobs, tmp_path, monkeypatch):
    """Bit for bit the same pictures as by renders of their own."""
    counts, rendered, pictures = [], jobs.AnchorsJob.render, []

    def counted(job, in_window):
        counts[-1] += 1
        rendered(job, in_window)

    monkeypatch.setattr(jobs.AnchorsJob, "render", counted)
    for is_shared in (True, False):
        if not is_shared:
            monkeypatch.setattr(jobs, "stands_still", lambda *_: False)
        counts.append(0)
        path = str(tmp_path / f"{is_shared}_##.exr")
        jobs.render_anchors(bpy.context, scene.camera, (1, 2, 3, 4), path, WORKBENCH)
        found = []
        for frame in (1, 2, 3, 4):
            image = bpy.data.images.load(str(tmp_path / f"{is_shared}_{frame:02}.exr"))
            found.append(np.array(image.pixels[:]))
        pictures.append(np.array(found))
    assert counts[0] < 0.5 * counts[1]
    np.testing.assert_array_equal(*pictures)
    assert pictures[0].std() > 0.05 and np.abs(np.diff(pictures[0], axis=0)).max() > 0.05


def _animated_material():
    _key(bpy.data.materials["Color 1"], "diffuse_color")


def _animated_nodes():
    tree = bpy.data.materials["Color 1"].node_tree
    socket = next(node for node in tree.nodes if node.type == "BSDF_PRINCIPLED").inputs["Roughness"]
    _key(socket, "default_value")


def _animated_world():
    node = next(node for node in bpy.data.worlds["World"].node_tree.nodes if node.type == "BACKGROUND")
    _key(node.inputs["Strength"], "default_value")


def _frame_in_a_material():
    node = bpy.data.materials["Color 1"].node_tree.nodes.new("ShaderNodeAttribute")
    node.attribute_type, node.attribute_name = "VIEW_LAYER", "frame_current"


def _camera_in_a_material():
    node = bpy.data.materials["Color 1"].node_tree.nodes.new("ShaderNodeTexCoord")
    node.object = bpy.context.scene.camera


def _driven_light():
    bpy.data.objects["Lamp"].data.driver_add("energy").driver.expression = "frame"


def _movie():
    bpy.data.images.new("Movie", 4, 4).source = "SEQUENCE"


def _drawings():
    kind = "grease_pencils" if bpy.app.version >= (5, 0, 0) else "grease_pencils_v3"
    data = getattr(bpy.data, kind).new("Drawing")
    frames = data.layers.new("Lines").frames
    frames.new(1), frames.new(3)
    _linked("Drawing", data)


def _scene_time():
    group = bpy.data.node_groups.new("Time", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    group.nodes.new("GeometryNodeInputSceneTime")
    bpy.data.objects["Cube"].modifiers.new("Time", "NODES").node_group = group


def _shape_keys():
    cube = bpy.data.objects["Cube"]
    cube.shape_key_add()
    _key(cube.shape_key_add(), "value")


def _smoke():
    volume = bpy.data.volumes.new("Smoke")
    volume.is_sequence = True
    _linked("Smoke", volume)


def _instance():
    collection = bpy.data.collections.new("Elsewhere")
    member = bpy.data.objects.new("Member", bpy.data.objects["Cube"].data)
    collection.objects.link(member)
    _key(member, "location", x=1.0)
    holder = _linked("Holder", None)
    holder.instance_type, holder.instance_collection = "COLLECTION", collection


def _linked(name, data):
    obj = bpy.data.objects.new(name, data)
    bpy.context.scene.collection.objects.link(obj)
    return obj


def _tracking():
    bpy.data.objects["Cube"].constraints.new("TRACK_TO").target = bpy.context.scene.camera


CHANGES = {
    "material": _animated_material,
    "nodes": _animated_nodes,
    "world": _animated_world,
    "frame": _frame_in_a_material,
    "camera": _camera_in_a_material,
    "light": _driven_light,
    "lamp": lambda: _key(bpy.data.objects["Lamp"], "location", x=1.0),
    "thing": lambda: _key(bpy.data.objects["Cube"], "location", x=1.0),
    "child": lambda: setattr(bpy.data.objects["Cube"], "parent", bpy.context.scene.camera),
    "movie": _movie,
    "drawings": _drawings,
    "scene time": _scene_time,
    "shape keys": _shape_keys,
    "smoke": _smoke,
    "instance": _instance,
    "tracking": _tracking,
    "particles": lambda: bpy.data.objects["Cube"].modifiers.new("Hair", "PARTICLE_SYSTEM"),
    "hiding": lambda: _key(bpy.data.objects["Cube"], "hide_render"),
    "object color": lambda: _key(bpy.data.objects["Cube"], "color"),
    "scene": lambda: _key(bpy.context.scene, "gravity"),
}


@pytest.mark.parametrize("change", CHANGES)
def test_what_may_change_is_rendered_at_each_frame(scene, addon, change):
    stands_still = addon("engines.standstill").stands_still
    assert stands_still(scene, WORKBENCH) and stands_still(scene, addon("bridge.blender.versions").EEVEE)
    CHANGES[change]()
    assert not stands_still(scene, WORKBENCH)


def test_noise_that_changes_is_rendered_at_each_frame(scene, addon):
    assert not addon("engines.standstill").stands_still(scene, "CYCLES")


def test_handlers_of_others_may_change_anything(scene, addon):
    stands_still, events = addon("engines.standstill").stands_still, bpy.app.handlers.frame_change_post

    def handler(*_):
        pass

    events.append(handler)
    try:
        assert not stands_still(scene, WORKBENCH)
    finally:
        events.remove(handler)
    assert stands_still(scene, WORKBENCH)


def test_only_renders_of_the_frame_before_are_kept(addon):
    """Their files go with what no frame uses, and all of them at the end."""
    module = addon("engines.shared_renders")
    shared = module.SharedRenders()
    keys = [module.RenderKey(bytes([number]), (), 0, False, False, False) for number in range(2)]
    pixels = np.arange(12, dtype=np.float32).reshape(2, 2, 3)
    paths = []
    for key in keys:
        assert shared.find(key) is None
        kept = shared.keep(key, pixels, pixels[..., 0])
        paths += [Path(values.filename) for values in kept]
    del kept
    shared.begin_frame()
    np.testing.assert_array_equal(shared.find(keys[0]).color, pixels)
    shared.begin_frame()
    assert shared.find(keys[1]) is None and shared.find(keys[0]) is not None
    assert [path.exists() for path in paths] == [True, True, False, False]
    shared.remove()
    assert not paths[0].parent.exists()
