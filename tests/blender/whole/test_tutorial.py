# SPDX-License-Identifier: GPL-3.0-or-later
"""The tutorial of README.md, followed without a window: its scene, and the little planet in it."""

import bpy
import numpy as np
import pytest

from demo import render_demo


@pytest.fixture
def towers():
    assert bpy.ops.scfpf.tutorial_scene() == {"FINISHED"}
    bpy.context.view_layer.update()
    return bpy.context.scene


def test_the_scene_is_new_and_shown(towers):
    assert towers == bpy.context.window.scene and len(bpy.data.scenes) == 2
    assert towers.camera is None and towers.render.engine == "SCFPF"
    depsgraph = bpy.context.evaluated_depsgraph_get()
    town = [obj.evaluated_get(depsgraph) for obj in towers.objects if obj.name.endswith("Tower")]
    assert [len(obj.data.polygons) for obj in town] == [64 * 6] * 4
    corners = np.array([obj.matrix_world @ vertex.co for obj in town for vertex in obj.data.vertices])
    low, high = corners.min(axis=0), corners.max(axis=0)
    # Rows 3 m apart about the middle, on the ground.
    np.testing.assert_allclose(low, (-22.5 - 0.8, -22.5 - 0.8, 0.0), atol=1e-5)
    np.testing.assert_allclose(high, (22.5 + 0.8, 22.5 + 0.8, 5.5), atol=1e-5)


def test_faces_look_outwards(towers):
    depsgraph = bpy.context.evaluated_depsgraph_get()
    above = towers.ray_cast(depsgraph, (0.0, 0.0, 50.0), (0.0, 0.0, -1.0))
    assert above[0] and above[2].z == pytest.approx(1.0) and above[4].name == "Lawn"
    for start, along in (
        ((-30, 1.5, 1.0), (1, 0, 0)),
        ((1.5, 30, 1.0), (0, -1, 0)),
        ((1.5, 1.5, 30), (0, 0, -1)),
    ):
        hit, _place, normal, _face, obj, _matrix = towers.ray_cast(depsgraph, start, along)
        assert hit and obj.name.endswith("Tower")
        assert normal.dot(along) == pytest.approx(-1.0, abs=1e-6)


def test_the_little_planet(towers):
    render = towers.render
    render.resolution_x = render.resolution_y = 60
    assert bpy.ops.scfpf.camera_add(preset="mirror_ball") == {"FINISHED"}
    camera = bpy.context.object
    camera.location, camera.rotation_euler = (0.0, 0.0, 7.0), (0.0, 0.0, 0.0)
    assert bpy.ops.scfpf.render() == {"FINISHED"}
    image = bpy.data.images["SCFPF Render"]
    pixels = np.array(image.pixels[:], np.float32).reshape(60, 60, 4)
    red, green, blue, alpha = np.moveaxis(pixels, 2, 0)
    y, x = np.mgrid[:60, :60]
    radius = np.hypot(x - 29.5, y - 29.5) / 30
    assert not alpha[radius > 1.03].any() and alpha[radius < 0.97].all()
    # Below the camera is the lawn, and half-way to the rim, at 90 degrees, the horizon: beyond it all is sky.
    assert (green > np.maximum(red, blue))[radius < 0.02].all()
    rim = (radius > 0.8) & (radius < 0.97)
    np.testing.assert_allclose(pixels[rim][:, :3], pixels[rim][:1, :3].repeat(rim.sum(), 0), atol=1e-5)
    assert (blue > red)[rim].all()
    ring = (radius > 0.3) & (radius < 0.68)
    assert (red > blue)[ring].mean() > 0.1, "red, white and yellow towers stand all round"


def test_another_one_beside_it_and_undo(towers):
    bpy.ops.ed.undo_push(message="One")
    assert bpy.ops.scfpf.tutorial_scene() == {"FINISHED"}
    assert bpy.context.scene.name == "Towers.001" and len(bpy.data.scenes) == 3
    bpy.ops.ed.undo_push(message="Two")
    bpy.ops.ed.undo()
    assert bpy.context.scene.name == "Towers" and len(bpy.data.scenes) == 2
    assert not [obj.name for obj in bpy.data.objects if obj.name.startswith("Lawn.")]


def test_the_demo_writes_it_as_a_file(tmp_path):
    path = tmp_path / "tutorial.blend"
    render_demo.save_tutorial(path)
    assert path.stat().st_size < 500_000
    bpy.ops.wm.open_mainfile(filepath=str(path))
    (scene,) = bpy.data.scenes
    assert scene.name == "Towers" and {"Lawn", "Sun", "Red Tower"} <= set(scene.objects.keys())


def test_only_in_object_mode():
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.object.mode_set(mode="EDIT")
    with pytest.raises(RuntimeError, match="Object Mode"):
        bpy.ops.scfpf.tutorial_scene()
