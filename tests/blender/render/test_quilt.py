# SPDX-License-Identifier: GPL-3.0-or-later
"""Quilts: each view is that of an off-axis camera beside the flexible one, where players expect it."""

import math

import bpy
import numpy as np
import pytest

WIDTH, HEIGHT = 48, 32


@pytest.fixture
def camera():
    """A camera five units before three cubes of different depths."""
    scene = bpy.context.scene
    for number, place in enumerate(((-1.2, 0, 0), (0, 2, 0.4), (1.3, -1.5, -0.3))):
        bpy.ops.mesh.primitive_cube_add(size=1, location=place)
        material = bpy.data.materials.new(f"Color {number}")
        material.diffuse_color = (*np.eye(3)[number], 1.0)
        bpy.context.object.data.materials.append(material)
    bpy.ops.object.light_add(type="SUN", rotation=(0.5, 0.4, 0))
    bpy.ops.object.camera_add(location=(0, -5, 0), rotation=(math.pi / 2, 0, 0))
    camera = bpy.context.object
    camera.data.clip_start, camera.data.clip_end = 0.5, 20.0
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    bpy.ops.scfpf.camera_from_camera()
    bpy.context.view_layer.update()
    return camera


def image():
    shown = bpy.data.images["SCFPF Render"]
    pixels = np.empty(shown.size[0] * shown.size[1] * 4, np.float32)
    shown.pixels.foreach_get(pixels)
    return pixels.reshape(shown.size[1], shown.size[0], 4)


def render():
    assert bpy.ops.scfpf.render() == {"FINISHED"}
    return image()


def test_views_are_those_of_cameras_side_by_side(camera):
    """Of ordinary cameras whose lens is shifted so that the focus stays where it is."""
    columns, rows, focus, cone = 3, 2, 5.0, math.radians(30)
    assert bpy.ops.scfpf.quilt(columns=columns, rows=rows, cone=cone, focus=focus) == {"FINISHED"}
    quilt = image()
    assert quilt.shape == (rows * HEIGHT, columns * WIDTH, 4)
    camera.scfpf.enabled = False
    lens, reach = camera.data, focus * math.tan(cone / 2)
    for number, offset in enumerate(np.linspace(-reach, reach, columns * rows)):
        camera.location.x = offset
        # The lens shows sensor_width / lens of the depth across.
        lens.shift_x = -offset / focus * lens.lens / lens.sensor_width
        bpy.ops.scfpf.camera_from_camera()
        bpy.context.view_layer.update()
        alone = render()
        row, column = divmod(number, columns)
        view = quilt[row * HEIGHT : (row + 1) * HEIGHT, column * WIDTH : (column + 1) * WIDTH]
        # Edges that touch a sample may differ by rounding.
        assert (np.abs(view - alone).max(axis=2) > 1e-3).mean() < 0.01, number
    # The row of views does move.
    assert np.abs(quilt[:HEIGHT, :WIDTH] - quilt[HEIGHT:, -WIDTH:]).mean() > 0.01


def test_a_cone_of_0_repeats_the_picture(camera):
    alone = render()
    assert bpy.ops.scfpf.quilt(columns=2, rows=1, cone=0.0) == {"FINISHED"}
    quilt = image()
    assert np.array_equal(quilt[:, :WIDTH], alone) and np.array_equal(quilt[:, WIDTH:], alone)


def test_the_scene_and_its_volume_stay(camera):
    before = [np.array(slot.object.matrix_world) for slot in camera.scfpf.surfaces]
    names = {obj.name for obj in bpy.data.objects}
    assert bpy.ops.scfpf.quilt(columns=2, rows=2) == {"FINISHED"}
    after = [np.array(slot.object.matrix_world) for slot in camera.scfpf.surfaces]
    assert np.array_equal(before, after) and names == {obj.name for obj in bpy.data.objects}


def test_what_cannot_be_is_refused_and_the_picture_stays(camera):
    alone = render()
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 4096
    with pytest.raises(RuntimeError, match="would need about"):
        bpy.ops.scfpf.quilt(columns=64, rows=64)
    assert np.array_equal(image(), alone)
