# SPDX-License-Identifier: GPL-3.0-or-later
"""The preview applied: an ordinary camera sees in the meshes what Blender's own sees in the scene."""

import bpy
import numpy as np
import pytest

pytestmark = pytest.mark.usefixtures("built_groups")

WIDTH, HEIGHT = 160, 90
# Share of pixels that may differ: those at silhouettes, which are drawn without smoothing.
AT_EDGES = 0.02
COLOURS = {"Wall": (0.8, 0.1, 0.1), "Floor": (0.1, 0.7, 0.2), "Ball": (0.1, 0.2, 0.9)}


@pytest.fixture
def camera(addon):
    """A flexible camera with the view of Blender's own, turned and moved."""
    scene = bpy.context.scene
    made = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    made.location, made.rotation_euler = (1.0, -6.0, 2.0), (1.3, 0.0, 0.15)
    scene.collection.objects.link(made)
    scene.camera = made
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    bpy.context.view_layer.update()
    addon("bridge.camera.flexible_camera").volume_from_camera(made, scene)
    bpy.context.view_layer.objects.active = made
    return made


@pytest.fixture
def scene(camera):
    """A wall, a floor and a ball in three colours."""
    bpy.ops.mesh.primitive_plane_add(size=8.0, location=(0, 4, 0), rotation=(1.2, 0.3, 0))
    bpy.context.object.name = "Wall"
    bpy.ops.mesh.primitive_plane_add(size=6.0)
    bpy.context.object.name = "Floor"
    bpy.ops.mesh.primitive_uv_sphere_add(segments=24, ring_count=12, location=(0.5, 0, 1))
    bpy.context.object.name = "Ball"
    for name, colour in COLOURS.items():
        material = bpy.data.materials.new(name)
        material.diffuse_color = (*colour, 1.0)
        bpy.data.objects[name].data.materials.append(material)
    return bpy.context.scene


def drawn(scene, camera, path):
    """Workbench's image of a scene through a camera in flat colours, (H, W, 3)."""
    scene.camera = camera
    scene.render.engine = "BLENDER_WORKBENCH"
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    scene.render.resolution_percentage = 100
    scene.render.filepath = str(path)
    scene.display.render_aa = "OFF"
    scene.display.shading.light, scene.display.shading.color_type = "FLAT", "MATERIAL"
    bpy.ops.render.render(write_still=True, scene=scene.name)
    image = bpy.data.images.load(str(path))
    pixels = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(pixels)
    return pixels.reshape(HEIGHT, WIDTH, -1)[..., :3]


def test_applied_meshes_look_as_the_scene_through_an_ordinary_camera(addon, scene, camera, tmp_path):
    data = addon("scanline.preview.preview_data")
    expected = drawn(scene, camera, tmp_path / "expected.png")
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.preview_toggle() == {"FINISHED"}
    source = data.preview_of(camera, scene)
    depsgraph = bpy.context.evaluated_depsgraph_get()
    other = bpy.data.scenes.new("Applied")
    for picture in data.pictures_of(source):
        applied = bpy.data.meshes.new_from_object(picture.evaluated_get(depsgraph))
        made = bpy.data.objects.new("Applied", applied)
        made.matrix_world = picture.matrix_world
        other.collection.objects.link(made)
    view = source.scfpf_preview.view_camera
    ordinary = bpy.data.objects.new("Ordinary", view.data.copy())
    ordinary.matrix_world = view.matrix_world
    other.collection.objects.link(ordinary)
    assert bpy.ops.scfpf.preview_toggle() == {"FINISHED"}
    found = drawn(other, ordinary, tmp_path / "found.png")
    assert len(np.unique(expected.reshape(-1, 3).round(2), axis=0)) >= 3
    differs = np.abs(found - expected).max(axis=2) > 0.1
    assert differs.mean() < AT_EDGES
