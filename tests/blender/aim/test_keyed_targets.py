# SPDX-License-Identifier: GPL-3.0-or-later
"""Keyframed targets: a solution at each key, interpolated by shape keys."""

import math

import bpy
import numpy as np
import pytest
from aim_scenes import box_scene, points_of, solve, turned_view

FRONT = [(1.0, -0.8, 1.0)]


@pytest.fixture
def keyed():
    """A camera whose view goes 48 pixels to the right from frame 1 to 21, and stays until frame 31."""
    camera = turned_view(box_scene(bpy.context.scene), 0.0)
    target = camera.scfpf.aim_targets[0]
    left = target.position[0]
    for frame, off in ((1, 0.0), (21, 0.05), (31, 0.05)):
        target.position[0] = left + off
        target.keyframe_insert("position", frame=frame)
    bpy.context.scene.frame_set(5)
    return camera


def at(frame):
    bpy.context.scene.frame_set(frame)
    return bpy.context.view_layer.update()


def test_keys_are_solved_and_interpolated(keyed, places):
    at(1)
    start = places(keyed, FRONT)[0]
    at(5)
    assert solve(keyed) == {"FINISHED"}
    assert bpy.context.scene.frame_current == 5
    aim = keyed.scfpf.aim
    assert aim.message.startswith("3 keys") and 0.0 <= aim.between < 3.0
    moved = []
    for frame in (-10, 1, 11, 21, 26, 31, 50):
        at(frame)
        moved.append(places(keyed, FRONT)[0] - start)
    moved = np.array(moved)
    assert np.abs(moved[[0, 1], 0]).max() < 1.0
    assert np.abs(moved[[3, 4, 5, 6], 0] - 48.0).max() < 1.5
    assert abs(moved[2, 0] - 24.0) < 3.0
    assert np.abs(moved[:, 1]).max() < 3.0
    # Values of each shape: one at its key, none at the others'.
    keys = keyed.scfpf.surfaces[1].object.data.shape_keys.key_blocks
    assert [key.name for key in keys] == ["Start", "Aim 1", "Aim 21", "Aim 31"]
    at(21)
    assert [key.value for key in keys[1:]] == [0.0, 1.0, 0.0]


def test_a_keyed_volume_is_solved_again_and_freed(keyed, addon, places):
    solve(keyed)
    volume = addon("bridge.aim.aimed_volume")
    assert volume.start_of(keyed) is not None and volume.is_keyed(keyed)
    at(21)
    before = places(keyed, FRONT)
    assert solve(keyed) == {"FINISHED"}
    at(21)
    assert np.abs(places(keyed, FRONT) - before).max() < 0.5
    assert len(keyed.scfpf.surfaces[0].object.data.shape_keys.key_blocks) == 4
    # Without keyframes the volume is a plain one, and nothing of the shapes is left.
    keyed.animation_data_clear()
    assert solve(keyed) == {"FINISHED"}
    assert not volume.is_keyed(keyed) and keyed.scfpf.aim.between == -1.0
    assert [action.name for action in bpy.data.actions] == ["CameraAction"]


def test_a_turning_eye_is_keyed_too(addon):
    camera = turned_view(box_scene(bpy.context.scene), 0.0)
    eye = camera.scfpf.aim_targets[0].eye
    for frame, angle in ((1, 0.0), (10, math.radians(10))):
        bpy.ops.scfpf.aim_turn(camera=camera.name, left=angle)
        eye.keyframe_insert("location", frame=frame)
        eye.keyframe_insert("rotation_euler", frame=frame)
    assert addon("bridge.aim.keyed_targets").key_frames(camera) == [1.0, 10.0]
    camera.scfpf.aim_targets[0].is_on = False
    assert addon("bridge.aim.keyed_targets").key_frames(camera) == []


def test_a_fault_at_a_key_names_its_frame_and_changes_nothing(keyed):
    target = keyed.scfpf.aim_targets[0]
    target.position[0] = 2.5
    target.keyframe_insert("position", frame=41)
    at(5)
    before = [slot.object for slot in keyed.scfpf.surfaces]
    with pytest.raises(RuntimeError, match="At frame 41: The view 'Box' is outside the picture"):
        solve(keyed)
    assert [slot.object for slot in keyed.scfpf.surfaces] == before
    assert bpy.context.scene.frame_current == 5


def test_a_keyed_volume_survives_saving_and_cannot_be_dragged(keyed, addon, places, tmp_path):
    solve(keyed)
    at(21)
    name, path, before = keyed.name, str(tmp_path / "keyed.blend"), places(keyed, FRONT)
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    camera = bpy.data.objects[name]
    assert np.abs(places(camera, FRONT) - before).max() < 1e-3
    assert len(points_of(camera)) == 4 * 48 * 3
    with pytest.raises(addon("projection.user_error").UserError, match="keyframed"):
        addon("bridge.aim.follower").Follower(camera, bpy.context.evaluated_depsgraph_get())
