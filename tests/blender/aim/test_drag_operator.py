# SPDX-License-Identifier: GPL-3.0-or-later
"""The operator that drags targets, with numbers instead of the mouse, and the panel of targets."""

import math

import bpy
import numpy as np
import pytest
from aim_scenes import box_scene, points_of, solve, turned_view
from mathutils import Vector
from recorded_layout import RecordingLayout, drawn, texts

CORNER = [(1.0, -0.8, 1.0)]


@pytest.fixture
def camera():
    """An aimed camera, active, with a solved view of a box."""
    camera = turned_view(box_scene(bpy.context.scene), 5.0)
    assert solve(camera) == {"FINISHED"}
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    bpy.context.view_layer.objects.active = camera
    bpy.context.view_layer.update()
    return camera


def test_the_image_moves_by_the_numbers(camera, places):
    before, target = places(camera, CORNER), camera.scfpf.aim_targets[0]
    place = np.array(target.position)
    assert bpy.ops.scfpf.aim_drag(shift=(0.03, -0.02)) == {"FINISHED"}
    bpy.context.view_layer.update()
    assert np.allclose(np.array(target.position) - place, (0.03, -0.02), atol=1e-6)
    moved = places(camera, CORNER) - before
    assert np.abs(moved - (0.03 * 960, -0.02 * 540)).max() < 2.0
    assert target.residual_max >= 0.0


def test_size_and_turn_are_relative(camera):
    target = camera.scfpf.aim_targets[0]
    width = target.width
    assert bpy.ops.scfpf.aim_drag(factor=1.1, turn=math.radians(4)) == {"FINISHED"}
    assert target.width == pytest.approx(1.1 * width) and target.turn == pytest.approx(math.radians(4))


def test_the_camera_of_a_view_is_led_round_its_thing(camera):
    """The thing stays at the same distance in the middle of what its camera sees, and that camera turns."""
    eye = camera.scfpf.aim_targets[0].eye
    box = bpy.data.objects["Box"]
    middle = box.matrix_world @ (sum((Vector(corner) for corner in box.bound_box), Vector()) / 8)
    start = eye.matrix_world.copy()
    assert bpy.ops.scfpf.aim_drag(orbit=(math.radians(3), 0.0)) == {"FINISHED"}
    bpy.context.view_layer.update()
    before, after = (matrix.inverted() @ middle for matrix in (start, eye.matrix_world))
    assert (before - after).length < 1e-4
    turned = start.to_quaternion().rotation_difference(eye.matrix_world.to_quaternion())
    assert turned.angle == pytest.approx(math.radians(3), abs=1e-4)


def test_the_buttons_turn_a_view_to_their_sides(camera):
    """Left brings the camera to its left, and Up brings it higher."""
    eye = camera.scfpf.aim_targets[0].eye
    for side, (left, up) in {"Left": (0.17, 0.0), "Right": (-0.17, 0.0), "Up": (0.0, 0.17)}.items():
        start = eye.matrix_world.copy()
        assert bpy.ops.scfpf.aim_turn(left=left, up=up) == {"FINISHED"}
        bpy.context.view_layer.update()
        went = start.inverted() @ eye.matrix_world.translation
        share = {"Left": -went.x, "Right": went.x, "Up": went.y}[side]
        assert share > 0.9 * went.length, side


def test_what_is_not_taken_leaves_the_target_and_the_volume(camera, addon, monkeypatch):
    module, error = addon("operators.aim.drag"), addon("projection.user_error").UserError
    target, before = camera.scfpf.aim_targets[0], points_of(camera)
    place, eye = tuple(target.position), target.eye.matrix_world.copy()

    def refuse(_self, _depsgraph):
        raise error("Not taken, because of the test")

    monkeypatch.setattr(module.Follower, "finishing", refuse)
    with pytest.raises(RuntimeError, match="Not taken"):
        bpy.ops.scfpf.aim_drag(shift=(0.2, 0.0), orbit=(0.3, 0.1))
    bpy.context.view_layer.update()
    assert tuple(target.position) == place and target.eye.matrix_world == eye
    assert np.array_equal(points_of(camera), before)


def test_targets_without_a_place_and_broken_volumes_are_refused(camera):
    target = camera.scfpf.aim_targets[0]
    place = tuple(target.position)
    with pytest.raises(RuntimeError, match="has no view or pin at place 8"):
        bpy.ops.scfpf.aim_drag(shift=(0.1, 0.0), index=7)
    camera.scfpf.surfaces[1].object = None
    with pytest.raises(RuntimeError, match="is empty"):
        bpy.ops.scfpf.aim_drag(shift=(0.1, 0.0))
    assert tuple(target.position) == place


def test_a_list_without_views_and_pins_has_nothing_to_drag(camera):
    camera.scfpf.aim_targets[0].kind = "STAY"
    assert not bpy.ops.scfpf.aim_drag.poll()


@pytest.mark.parametrize("place", ["data", "view"])
def test_the_panel_shows_the_active_target_and_its_remedy(camera, place):
    section = getattr(bpy.types, f"SCFPF_PT_{place}_aim")
    record = drawn(section)
    assert ("list", "SCFPF_UL_aim") in record and ("operator", "scfpf.aim_solve") in record
    assert "Box: 95 % within" in texts(record)
    assert record.count(("operator", "scfpf.aim_turn")) == 5
    target = camera.scfpf.aim_targets[0]
    target.hidden, target.hidden_by, target.free_turn = 0.5, "Left Wall", (0.2, 0.0)
    target.message = "Hidden by 'Left Wall'"
    changed = drawn(section)
    assert "Hidden by 'Left Wall'" in texts(changed)
    assert [entry[0] for entry in changed] == [entry[0] for entry in record], "messages move nothing"
    bpy.ops.scfpf.aim_pin_add(camera=camera.name, point=(0, 0, 0), position=(0.5, 0.4))
    names = {entry[2] for entry in drawn(section) if entry[0] == "prop"}
    assert {"handle", "position", "use_direction"} <= names and "eye" not in names
    assert ("operator", "scfpf.aim_turn") not in drawn(section)
    settings = drawn(getattr(bpy.types, f"SCFPF_PT_{place}_aim_settings"))
    assert {"columns", "rows", "degree"} <= {entry[2] for entry in settings if entry[0] == "prop"}
    camera.scfpf.aim_targets.clear()
    assert ("operator", "scfpf.aim_view_add") in drawn(section)


def test_before_the_first_solve_the_panel_says_what_comes_next(camera):
    section, settings = bpy.types.SCFPF_PT_view_aim, camera.scfpf
    solved = drawn(section)
    settings.aim.message = settings.aim_targets[0].message = ""
    fresh = drawn(section)
    assert "then press Solve" in texts(fresh) and "then press Solve" not in texts(solved)
    assert [entry[0] for entry in fresh] == [entry[0] for entry in solved]


def test_every_kind_of_target_is_drawn(camera, addon):
    panel = addon("panels.aim")
    for kind in ("VIEW", "PIN", "LINE", "STAY"):
        camera.scfpf.aim_targets[0].kind = kind
        one = RecordingLayout()
        panel.draw_target(one, camera.scfpf.aim_targets[0])
        assert {"weight"} <= {entry[2] for entry in one.record if entry[0] == "prop"}
        assert kind in panel.ICONS and kind in panel.NEXT
