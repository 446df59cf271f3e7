# SPDX-License-Identifier: GPL-3.0-or-later
"""A changed resolution: the volume is stretched on request, and then shows what a new one would."""

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

U, V, T = np.random.default_rng(51).random((3, 60))


@pytest.fixture
def shown(addon):
    def positions(camera):
        module = addon("bridge.camera.read_projection")
        aspect = addon("bridge.render.image_size").image_aspect(bpy.context.scene)
        bpy.context.view_layer.update()
        depsgraph = bpy.context.evaluated_depsgraph_get()
        return module.read_projection(camera, depsgraph, aspect).volume.evaluate(U, V, T).position

    return positions


@pytest.fixture
def wanted(addon):
    def needed(camera):
        aspect = addon("bridge.render.image_size").image_aspect(bpy.context.scene)
        return addon("bridge.camera.volume_fit").needs_fit(camera, aspect)

    return needed


def resize(width, height):
    bpy.context.scene.render.resolution_x, bpy.context.scene.render.resolution_y = width, height


@pytest.mark.parametrize("preset", ["perspective", "orthographic", "cylindrical_panorama", "around_the_car"])
def test_fitted_volume_is_that_of_a_preset_applied_anew(shown, wanted, preset):
    bpy.ops.object.camera_add(location=(1, 2, 3), rotation=(1.1, 0, 0.4))
    camera = bpy.context.object
    bpy.context.view_layer.update()
    bpy.ops.scfpf.preset_apply(preset=preset, fit=False)
    assert not wanted(camera)
    before = shown(camera)
    resize(900, 1200)
    assert wanted(camera)
    assert bpy.ops.scfpf.volume_fit_picture() == {"FINISHED"}
    assert not wanted(camera)
    fitted, angle = shown(camera), camera.data.angle_x
    assert np.abs(fitted - before).max() > 0.01
    bpy.ops.scfpf.preset_apply(preset=preset, fit=False)
    assert np.abs(shown(camera) - fitted).max() < 1e-5 * np.abs(fitted).max()
    assert camera.data.angle_x == pytest.approx(angle, rel=1e-4)


def test_a_cropped_volume_is_that_of_a_preset_applied_anew(shown, wanted):
    """The surfaces stay, and the ranges are those of the preset: back and forth without loss."""
    bpy.ops.scfpf.camera_add(preset="tiny_planet")
    camera, before = bpy.context.object, shown(bpy.context.object)
    for size, u_range in (((900, 1200), 9 / 16 * 3 / 4), ((1920, 1080), 1.0)):
        resize(*size)
        assert wanted(camera) and bpy.ops.scfpf.volume_fit_picture() == {"FINISHED"} and not wanted(camera)
        ranges, angle = [*camera.scfpf.u_range, *camera.scfpf.v_range], camera.data.angle_x
        assert ranges == pytest.approx([0.5 - u_range / 2, 0.5 + u_range / 2, 0, 1], abs=1e-6)
        bpy.ops.scfpf.preset_apply(preset="tiny_planet", fit=False)
        assert ranges == pytest.approx([*camera.scfpf.u_range, *camera.scfpf.v_range], abs=1e-6)
        assert camera.data.angle_x == pytest.approx(angle, rel=1e-4)
    assert np.abs(shown(camera) - before).max() < 1e-4


@pytest.mark.parametrize("sensor", ["AUTO", "HORIZONTAL", "VERTICAL"])
def test_volume_from_a_camera_stays_that_camera_s_view(shown, sensor):
    """Blender's own view of the new resolution, as long as AUTO does not change sides."""
    bpy.ops.object.camera_add(location=(1, 2, 3), rotation=(1.1, 0, 0.4))
    camera = bpy.context.object
    camera.data.sensor_fit = sensor
    camera.data.clip_start, camera.data.clip_end = 0.5, 9
    bpy.context.view_layer.update()
    bpy.ops.scfpf.camera_from_camera()
    resize(1920, 1440)
    assert bpy.ops.scfpf.volume_fit_picture() == {"FINISHED"}
    positions = shown(camera)
    for point, u, v in zip(positions.T, U, V, strict=True):
        seen = world_to_camera_view(bpy.context.scene, camera, Vector(point))
        assert (seen.x, seen.y) == pytest.approx((u, v), abs=1e-5)


def test_edits_and_animation_stay(shown):
    bpy.ops.scfpf.camera_add(preset="perspective")
    camera = bpy.context.object
    far = camera.scfpf.surfaces[1].object
    far.location.x += 2
    far.keyframe_insert("location", frame=1)
    basis = far.matrix_basis.copy()
    resize(900, 1200)
    bpy.ops.scfpf.volume_fit_picture()
    bpy.context.scene.frame_set(1)
    assert far.matrix_basis == basis and far.animation_data.action
    fitted = shown(camera)
    resize(1920, 1080)
    bpy.ops.scfpf.volume_fit_picture()
    resize(900, 1200)
    bpy.ops.scfpf.volume_fit_picture()
    assert np.abs(shown(camera) - fitted).max() < 1e-4


def test_what_has_no_shape_of_picture_is_left_alone(wanted):
    bpy.ops.scfpf.camera_add(preset="angular_fisheye")
    camera = bpy.context.object
    resize(900, 1200)
    assert not wanted(camera)
    with pytest.raises(RuntimeError, match="does not depend on the picture's shape"):
        bpy.ops.scfpf.volume_fit_picture()


def test_undo_and_redo(shown):
    bpy.ops.scfpf.camera_add(preset="perspective")
    name = bpy.context.object.name
    resize(900, 1200)
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.ops.ed.undo_push(message="resized")
        before = shown(bpy.data.objects[name])
        assert bpy.ops.scfpf.volume_fit_picture("EXEC_DEFAULT", True) == {"FINISHED"}
        after = shown(bpy.data.objects[name])
        bpy.ops.ed.undo()
        assert np.abs(shown(bpy.data.objects[name]) - before).max() == 0
        assert bpy.data.objects[name].scfpf.fitted_aspect == pytest.approx(16 / 9)
        bpy.ops.ed.redo()
        assert np.abs(shown(bpy.data.objects[name]) - after).max() == 0
