# SPDX-License-Identifier: GPL-3.0-or-later
"""The targets of Aim by their operators: made, moved, removed, undone, saved, appended and linked."""

import math

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector


def image_position(camera, point):
    """The image position of a world point through an ordinary camera, by Blender."""
    return np.array(world_to_camera_view(bpy.context.scene, camera, Vector(point))[:2])


def corners(obj):
    return np.array([obj.matrix_world @ Vector(corner) for corner in obj.bound_box]).T


@pytest.fixture
def scene():
    """A box off the middle of the image of an ordinary camera, on a floor."""
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 960, 540
    bpy.ops.mesh.primitive_plane_add(size=40)
    bpy.ops.mesh.primitive_cube_add(location=(1.5, 1.0, 1.0))
    bpy.context.object.name = "Box"
    bpy.ops.object.camera_add(location=(0, -12, 3), rotation=(math.radians(80), 0, 0))
    scene.camera = bpy.context.object
    bpy.context.view_layer.update()
    return scene


@pytest.fixture
def positions(addon):
    """The image positions at which a target shows world points."""
    views = addon("bridge.aim.target_views")

    def found(target, points):
        return views.view_positions(target, points, bpy.context.evaluated_depsgraph_get(), 960 / 540)

    return found


def test_a_view_of_an_ordinary_camera_begins_as_its_image_is(scene, positions):
    camera, box = scene.camera, bpy.data.objects["Box"]
    before = np.stack([image_position(camera, p) for p in corners(box).T], axis=1)
    assert bpy.ops.scfpf.aim_view_add(camera=camera.name, object="Box") == {"FINISHED"}
    assert camera.scfpf.enabled and len(camera.scfpf.surfaces) == 2
    (target,) = camera.scfpf.aim_targets
    assert (target.kind, target.name, target.object, camera.scfpf.active_aim) == ("VIEW", "Box", box, 0)
    assert np.abs(positions(target, corners(box)) - before).max() < 1e-5
    # The new camera frames the thing: all corners are in its own image.
    assert target.eye.type == "CAMERA" and not target.eye.scfpf.enabled
    scene.render.resolution_y = scene.render.resolution_x
    framed = np.stack([image_position(target.eye, p) for p in corners(box).T])
    assert framed.min() > 0.0 and framed.max() < 1.0
    assert np.ptp(framed, axis=0).max() > 0.5


def test_the_selection_is_what_a_view_shows(scene):
    box = bpy.data.objects["Box"]
    bpy.ops.mesh.primitive_uv_sphere_add(location=(1.5, 1, 2.5))
    ball = bpy.context.object
    bpy.ops.object.select_all(action="DESELECT")
    box.select_set(True)
    ball.select_set(True)
    assert bpy.ops.scfpf.aim_view_add() == {"FINISHED"}
    (target,) = scene.camera.scfpf.aim_targets
    assert set(target.collection.all_objects) == {box, ball}
    assert bpy.ops.scfpf.aim_view_add() == {"FINISHED"}
    assert scene.camera.scfpf.aim_targets[1].collection == target.collection


def test_turning_a_view_leads_its_camera_round_the_thing(scene, positions):
    camera, box = scene.camera, bpy.data.objects["Box"]
    bpy.ops.scfpf.aim_view_add(camera=camera.name, object="Box")
    target = camera.scfpf.aim_targets[0]
    centre, eye = Vector((1.5, 1.0, 1.0)), target.eye
    before = eye.matrix_world.translation - centre
    place = positions(target, np.array(centre)[:, None])
    assert bpy.ops.scfpf.aim_turn(camera=camera.name, index=0, left=math.radians(30)) == {"FINISHED"}
    bpy.context.view_layer.update()
    after = eye.matrix_world.translation - centre
    assert after.length == pytest.approx(before.length) and after.z == pytest.approx(before.z, abs=1e-5)
    # Seen from above, moving to the left goes clockwise.
    turned = math.atan2(after.y, after.x) - math.atan2(before.y, before.x)
    assert math.remainder(turned, math.tau) == pytest.approx(-math.radians(30), abs=1e-5)
    assert bpy.ops.scfpf.aim_turn(camera=camera.name, index=0, up=math.radians(20)) == {"FINISHED"}
    bpy.context.view_layer.update()
    assert (eye.matrix_world.translation - centre).z > before.z + 1.0
    # The thing keeps its place and its size.
    assert np.abs(positions(target, np.array(centre)[:, None]) - place).max() < 1e-6
    assert target.width == pytest.approx(camera.scfpf.aim_targets[0].width)
    assert box.name == target.object.name


def test_position_size_and_turn_are_a_similarity_in_pixels(scene, positions):
    bpy.ops.scfpf.aim_view_add(camera=scene.camera.name, object="Box", position=(0.25, 0.5))
    target = scene.camera.scfpf.aim_targets[0]
    pixels = np.array([960.0, 540.0])[:, None]
    points = corners(bpy.data.objects["Box"])
    before = positions(target, points) * pixels
    target.width *= 2
    target.turn = math.radians(90)
    target.position = (0.75, 0.25)
    after = positions(target, points) * pixels
    moved = before - [[240.0], [270.0]]
    assert np.abs(after - ([[720.0], [135.0]] + 2 * np.stack([-moved[1], moved[0]]))).max() < 1e-2


def test_a_pin_takes_what_the_image_shows(scene):
    camera = scene.camera
    place = image_position(camera, (1.5, 0.0, 1.0))
    assert bpy.ops.scfpf.aim_pin_add(camera=camera.name, position=tuple(place)) == {"FINISHED"}
    pin = camera.scfpf.aim_targets[0]
    assert np.abs(np.array(pin.handle.matrix_world.translation) - (1.5, 0, 1)).max() < 1e-3
    assert "Box" in pin.handle.name and tuple(pin.position) == pytest.approx(tuple(place))
    # The other way round: a point gets the position that shows it.
    assert bpy.ops.scfpf.aim_pin_add(camera=camera.name, point=(0, 5, 0), direction=(0, 3, 0)) == {"FINISHED"}
    pin = camera.scfpf.aim_targets[1]
    assert np.abs(np.array(pin.position) - image_position(camera, (0, 5, 0))).max() < 1e-5
    bpy.context.view_layer.update()
    assert pin.use_direction
    assert (pin.handle.matrix_world.to_3x3() @ Vector((0, 0, -1)) - Vector((0, 1, 0))).length < 1e-5


def test_a_line_joins_two_pins(scene):
    camera = scene.camera
    for point in ((0, 0, 0), (1, 0, 0), (2, 5, 0)):
        bpy.ops.scfpf.aim_pin_add(camera=camera.name, point=point)
    first, _, third = (target.handle for target in camera.scfpf.aim_targets)
    made = bpy.ops.scfpf.aim_line_add(camera=camera.name, first=first.name, second=third.name)
    assert made == {"FINISHED"}
    line = camera.scfpf.aim_targets[3]
    assert (line.kind, line.first, line.second) == ("LINE", first, third)
    with pytest.raises(RuntimeError, match="needs two pins"):
        bpy.ops.scfpf.aim_line_add(camera=camera.name, first=first.name, second="Box")


def test_regions_stay(scene):
    image = bpy.data.images.new("Mask", 8, 8)
    assert bpy.ops.scfpf.aim_stay_add(camera=scene.camera.name, object="Plane") == {"FINISHED"}
    assert bpy.ops.scfpf.aim_stay_add(camera=scene.camera.name, mask="Mask") == {"FINISHED"}
    first, second = scene.camera.scfpf.aim_targets
    assert first.object == bpy.data.objects["Plane"] and second.mask == image


def test_removing_and_moving_targets_takes_their_keyframes_along(scene):
    camera = scene.camera
    for point in ((0, 0, 0), (1, 0, 0), (2, 0, 0)):
        bpy.ops.scfpf.aim_pin_add(camera=camera.name, point=point)
    targets = camera.scfpf.aim_targets
    handles = [target.handle.name for target in targets]
    targets[2].keyframe_insert("position", frame=1)
    assert bpy.ops.scfpf.aim_remove(camera=camera.name, index=0) == {"FINISHED"}
    assert handles[0] not in bpy.data.objects and len(targets) == 2
    paths = {curve.data_path for curve in curves(camera)}
    assert paths == {"scfpf.aim_targets[1].position"}
    camera.scfpf.active_aim = 1
    assert bpy.ops.scfpf.aim_move(camera=camera.name, direction="UP") == {"FINISHED"}
    assert [target.handle.name for target in targets] == [handles[2], handles[1]]
    assert {curve.data_path for curve in curves(camera)} == {"scfpf.aim_targets[0].position"}


def curves(owner):
    data = owner.animation_data
    return data.action.layers[0].strips[0].channelbag(data.action_slot).fcurves


def test_bad_names_are_refused_in_words(scene):
    camera = scene.camera
    for call, message in (
        (lambda: bpy.ops.scfpf.aim_view_add(camera="Nobody", object="Box"), "There is no object 'Nobody'"),
        (lambda: bpy.ops.scfpf.aim_view_add(camera=camera.name, collection="X"), "no collection 'X'"),
        (lambda: bpy.ops.scfpf.aim_view_add(camera=camera.name, object="Box", eye="Box"), "cannot be looked"),
        (lambda: bpy.ops.scfpf.aim_view_add(camera="Box", object="Box"), "no camera to aim"),
        (lambda: bpy.ops.scfpf.aim_remove(camera=camera.name, index=7), "no target at place 8"),
        (lambda: bpy.ops.scfpf.aim_pin_add(camera=camera.name, point=(0, -500, 0)), "does not show"),
        (lambda: bpy.ops.scfpf.aim_pin_add(camera=camera.name, position=(0.5, 0.99)), "shows nothing"),
        (lambda: bpy.ops.scfpf.aim_view_add(camera=camera.name, object=camera.name), "no faces"),
    ):
        with pytest.raises(RuntimeError, match=message):
            call()
    assert len(camera.scfpf.aim_targets) == 0


def test_targets_survive_saving_and_appending(scene, tmp_path):
    camera = scene.camera
    bpy.ops.scfpf.aim_view_add(camera=camera.name, object="Box", position=(0.2, 0.6))
    bpy.ops.scfpf.aim_pin_add(camera=camera.name, point=(0, 5, 0))
    name, path = camera.name, str(tmp_path / "aim.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    view, pin = bpy.data.objects[name].scfpf.aim_targets
    assert view.eye.name in bpy.context.scene.objects and tuple(view.position) == pytest.approx((0.2, 0.6))
    assert pin.handle.type == "EMPTY"
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(path) as (_, here):
        here.objects = [name]
    view, pin = bpy.data.objects[name].scfpf.aim_targets
    assert view.object.name == "Box" and view.eye is not None and pin.handle is not None


def test_a_linked_camera_is_refused(scene, tmp_path):
    name, path = scene.camera.name, str(tmp_path / "aim.blend")
    bpy.ops.scfpf.camera_toggle()
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    with bpy.data.libraries.load(path, link=True) as (_, here):
        here.objects = [name]
    bpy.context.scene.collection.objects.link(bpy.data.objects[name])
    with pytest.raises(RuntimeError, match="library override"):
        bpy.ops.scfpf.aim_pin_add(camera=name, point=(0, 5, 0))


def test_an_override_of_a_linked_camera_is_aimed_as_far_as_blender_lets_it(scene, tmp_path):
    name, path = scene.camera.name, str(tmp_path / "aim.blend")
    bpy.ops.scfpf.camera_toggle()
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    with bpy.data.libraries.load(path, link=True) as (there, here):
        here.objects = list(there.objects)
    for obj in here.objects:
        scene.collection.objects.link(obj)
    linked = bpy.data.objects[name]
    camera = linked.override_hierarchy_create(scene, bpy.context.view_layer)
    bpy.context.view_layer.update()
    assert bpy.ops.scfpf.aim_view_add(camera=camera.name, object="Box") == {"FINISHED"}
    assert len(camera.scfpf.aim_targets) == 1 and len(linked.scfpf.aim_targets) == 0
    surfaces = [slot.object for slot in camera.scfpf.surfaces]
    # Its surfaces are another file's: they cannot be replaced, and the message says so.
    with pytest.raises(RuntimeError, match="library override"):
        bpy.ops.scfpf.aim_solve(camera=camera.name)
    assert [slot.object for slot in camera.scfpf.surfaces] == surfaces
    assert bpy.ops.scfpf.aim_remove(camera=camera.name, index=0) == {"FINISHED"}
