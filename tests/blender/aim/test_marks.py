# SPDX-License-Identifier: GPL-3.0-or-later
"""The marks of Aim in the image and in the scene, against Blender's own projections, and pins by click."""

import math
import types

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector

WIDTH, HEIGHT = 960, 540
# A region of 480 × 270 pixels that shows the image from pixel (40, 30) on.
FRAME = (40.0, 30.0, 480.0, 270.0)


def image_position(camera, point):
    """The image position of a world point through an ordinary camera, by Blender."""
    return np.array(world_to_camera_view(bpy.context.scene, camera, Vector(point))[:2])


@pytest.fixture
def camera():
    """A flexible camera before a box and a ball on a floor, with a view of the box."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = WIDTH, HEIGHT
    bpy.ops.mesh.primitive_plane_add(size=40)
    bpy.ops.mesh.primitive_cube_add(location=(1.5, 1.0, 1.0))
    bpy.context.object.name = "Box"
    bpy.ops.mesh.primitive_uv_sphere_add(location=(-2.0, 0.0, 1.0))
    bpy.context.object.name = "Ball"
    bpy.ops.object.camera_add(location=(0, -12, 3), rotation=(math.radians(80), 0, 0))
    scene.camera = bpy.context.object
    bpy.context.view_layer.update()
    bpy.ops.scfpf.aim_view_add(camera=scene.camera.name, object="Box")
    bpy.context.view_layer.update()
    return scene.camera


@pytest.fixture
def shown(addon, camera):
    """The module, and an image of the camera in a region."""
    module = addon("bridge.aim.shown_targets")
    rectangle = addon("bridge.render.view_painter").Rectangle(*FRAME)
    return module, addon("bridge.frames.shown_image").ShownImage(camera, rectangle)


def test_a_new_views_frame_is_the_box_that_blender_sees(shown, camera):
    module, image = shown
    (found,) = module.shown_targets(bpy.context, image)
    box = bpy.data.objects["Box"]
    seen = np.array([image_position(camera, box.matrix_world @ Vector(c)) for c in box.bound_box])
    expected = np.array(FRAME[:2]) + seen * FRAME[2:]
    corners = found.frame.corners.T
    assert np.abs(corners.min(axis=0) - expected.min(axis=0)).max() < 0.05
    assert np.abs(corners.max(axis=0) - expected.max(axis=0)).max() < 0.05


def test_handles_come_before_bodies_and_the_active_target_before_others(shown, camera, addon):
    module, image = shown
    frame_at = addon("bridge.frames.shown_frame").frame_at
    bpy.ops.scfpf.aim_view_add(camera=camera.name, object="Ball")
    targets = camera.scfpf.aim_targets
    targets[1].position, targets[1].width = targets[0].position, targets[0].width
    for active in (0, 1):
        camera.scfpf.active_aim = active
        found = module.shown_targets(bpy.context, image)
        assert [one.index for one in found] == [1 - active, active]
        middle = found[0].origin
        assert frame_at(found, *middle, 1.0) == (active, 4 + 1)
        for one in found:
            corner = one.frame.corners[:, 2]
            # A handle inside of the other's body is the handle of one of them.
            assert frame_at(found, *corner, 1.0)[1] == 2
    assert frame_at(found, 0.0, 0.0, 1.0) is None


def test_targets_that_are_off_or_show_nothing_have_no_frame(shown, camera):
    module, image = shown
    target = camera.scfpf.aim_targets[0]
    target.object = None
    (found,) = module.shown_targets(bpy.context, image)
    assert found.frame is None
    assert np.allclose(found.origin, np.array(FRAME[:2]) + np.array(target.position) * FRAME[2:])
    target.is_on = False
    assert module.shown_targets(bpy.context, image) == []


def test_a_click_pins_what_blender_shows_there(camera):
    for name in ("Box", "Ball"):
        middle = bpy.data.objects[name].matrix_world.translation
        x, y = image_position(camera, middle)
        assert bpy.ops.scfpf.aim_pin_click(x=x, y=y) == {"FINISHED"}
        target = camera.scfpf.aim_targets[camera.scfpf.active_aim]
        assert target.kind == "PIN" and tuple(target.position) == pytest.approx((x, y))
        # The pinned point is on the line of sight, in front of the thing's middle.
        bpy.context.view_layer.update()
        point = target.handle.matrix_world.translation
        assert image_position(camera, point) == pytest.approx((x, y), abs=1e-4)
        eye = camera.matrix_world.translation
        assert (point - eye).length < (middle - eye).length
    with pytest.raises(RuntimeError, match="shows nothing"):
        bpy.ops.scfpf.aim_pin_click(x=0.5, y=0.99)


def test_lines_are_drawn_between_the_marks_of_their_pins(shown, camera):
    module, image = shown
    for x in (0.4, 0.6):
        bpy.ops.scfpf.aim_pin_click(x=x, y=0.2)
    first, second = (target.handle.name for target in list(camera.scfpf.aim_targets)[1:])
    bpy.ops.scfpf.aim_line_add(camera=camera.name, first=first, second=second)
    ((begin, end),) = module.straight_lines(camera.scfpf, image)
    assert begin == pytest.approx((40 + 0.4 * 480, 30 + 0.2 * 270))
    assert end == pytest.approx((40 + 0.6 * 480, 30 + 0.2 * 270))


@pytest.mark.parametrize("kind", ["PERSP", "ORTHO", "EMPTY"])
def test_lines_in_the_scene_enclose_the_thing_as_its_eye_sees_it(addon, camera, kind):
    marks, target = addon("bridge.aim.scene_marks"), camera.scfpf.aim_targets[0]
    eye = target.eye
    if kind == "EMPTY":
        target.eye = bpy.data.objects.new("Eye", None)
        bpy.context.scene.collection.objects.link(target.eye)
        target.eye.matrix_world = eye.matrix_world
    else:
        eye.data.type = kind
    bpy.context.view_layer.update()
    lines = marks.target_lines(target, bpy.context.evaluated_depsgraph_get())
    box = bpy.data.objects["Box"]
    framed = np.array([image_position(eye, end) for end in lines.reshape(-1, 4, 3)[:, :2].reshape(-1, 3)])
    seen = np.array([image_position(eye, box.matrix_world @ Vector(c)) for c in box.bound_box])
    assert np.abs(framed.min(axis=0) - seen.min(axis=0)).max() < 1e-3
    assert np.abs(framed.max(axis=0) - seen.max(axis=0)).max() < 1e-3
    if kind != "ORTHO":
        assert np.allclose(lines[3::4], eye.matrix_world.translation, atol=1e-5)


def test_the_arrow_of_a_pin_ends_at_its_point(addon, camera):
    marks = addon("bridge.aim.scene_marks")
    way = Vector((0.6, 0.8, 0.0))
    bpy.ops.scfpf.aim_pin_add(camera=camera.name, point=(1, 0, 1), position=(0.5, 0.5), direction=way)
    bpy.context.view_layer.update()
    target = camera.scfpf.aim_targets[camera.scfpf.active_aim]
    lines = marks.target_lines(target, None)
    assert np.allclose(lines[1], (1, 0, 1), atol=1e-5)
    shaft = Vector(lines[1]) - Vector(lines[0])
    assert shaft.normalized().dot(way) == pytest.approx(1.0, abs=1e-5)
    target.use_direction = False
    assert marks.target_lines(target, None) is None


def test_the_eye_and_the_handle_stand_for_the_aimed_camera(addon, camera):
    target_of = addon("operators.common.target").camera_of
    eye = camera.scfpf.aim_targets[0].eye
    context = types.SimpleNamespace(object=eye, scene=bpy.context.scene)
    assert target_of(context) == camera
    other = bpy.data.objects.new("Other", bpy.data.cameras.new("Other"))
    bpy.context.scene.collection.objects.link(other)
    context.object = other
    assert target_of(context) == other
