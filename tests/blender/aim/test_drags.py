# SPDX-License-Identifier: GPL-3.0-or-later
"""Drags of targets, by the class that operators use and by the handler of Live Aim."""

import math

import bpy
import numpy as np
import pytest
from aim_scenes import box_scene, points_of, solve, turned_view


@pytest.fixture
def solved():
    """A camera whose view of a box is solved."""
    camera = turned_view(box_scene(bpy.context.scene), 5.0)
    assert solve(camera) == {"FINISHED"}
    return camera


def depsgraph():
    return bpy.context.evaluated_depsgraph_get()


def shows(target, found):
    """The distance of the middle of the box's front from where the view wants it, in pixels."""
    wanted = np.array(target.position) * (960, 540)
    return np.linalg.norm(found - wanted)


def test_the_volume_follows_a_dragged_frame(solved, addon, places):
    drag = addon("bridge.aim.drag").AimDrag(solved, depsgraph())
    target = solved.scfpf.aim_targets[0]
    corner = [(1.0, -0.8, 1.0)]
    start = places(solved, corner)
    for step in range(1, 5):
        target.position[0] += 10 / 960
        drag.step(depsgraph())
        bpy.context.view_layer.update()
        # The lag of one step an event stays below the move of an event.
        assert abs(places(solved, corner)[0, 0] - start[0, 0] - 10 * step) < 10.0
    for _ in range(4):
        residual = drag.step(depsgraph())
    bpy.context.view_layer.update()
    assert abs(places(solved, corner)[0, 0] - start[0, 0] - 40) < 2.0 and residual < 1.5
    assert "points within" in drag.finish(depsgraph())
    bpy.context.view_layer.update()
    assert abs(places(solved, corner)[0, 0] - start[0, 0] - 40) < 2.0


def test_a_drag_is_restored(solved, addon):
    before = points_of(solved)
    drag = addon("bridge.aim.drag").AimDrag(solved, depsgraph())
    solved.scfpf.aim_targets[0].position[0] += 0.02
    drag.step(depsgraph())
    assert not np.array_equal(points_of(solved), before)
    drag.restore()
    assert np.array_equal(points_of(solved), before)
    assert addon("bridge.aim.aimed_volume").start_of(solved) is not None


def test_a_drag_that_is_not_taken_leaves_the_volume(solved, addon, monkeypatch):
    before = points_of(solved)
    drag = addon("bridge.aim.drag").AimDrag(solved, depsgraph())
    solved.scfpf.aim_targets[0].position[0] += 0.02
    drag.step(depsgraph())
    judge = addon("casting.aim.judge")
    monkeypatch.setattr(judge.Judgement, "worse_than", lambda _self, _old: "MIRRORED")
    with pytest.raises(addon("bridge.aim.target_views").AimError, match="Not taken"):
        drag.finish(depsgraph())
    assert np.array_equal(points_of(solved), before)


def test_a_drag_begins_on_any_volume(addon, places):
    camera = turned_view(box_scene(bpy.context.scene), 0.0)
    grid = [(x, 0.0, z) for x in (-4, 0, 4) for z in (0, 2, 3)]
    before = places(camera, grid)
    addon("bridge.aim.drag").AimDrag(camera, depsgraph())
    bpy.context.view_layer.update()
    assert np.abs(places(camera, grid) - before).max() < 0.5
    assert [slot.object.type for slot in camera.scfpf.surfaces] == ["SURFACE"] * 3


def test_a_drag_ends_when_its_camera_is_gone(solved, addon):
    drag = addon("bridge.aim.drag").AimDrag(solved, depsgraph())
    bpy.data.objects.remove(solved)
    bpy.context.view_layer.update()
    with pytest.raises(addon("bridge.aim.target_views").AimError, match="begin again"):
        drag.step(depsgraph())


def test_live_aim_follows_the_camera_of_a_view(solved, addon):
    target, before = solved.scfpf.aim_targets[0], points_of(solved)
    eye = target.eye
    eye.location.x -= 0.05
    bpy.context.view_layer.update()
    assert np.array_equal(points_of(solved), before), "Live Aim is off"
    solved.scfpf.aim.live = True
    bpy.context.view_layer.update()
    assert np.array_equal(points_of(solved), before), "nothing has moved since it was switched on"
    for _ in range(4):
        eye.location.x -= 0.05
        bpy.context.view_layer.update()
    assert not np.array_equal(points_of(solved), before)
    assert solved.scfpf.aim.message.startswith("Follows within")
    assert float(solved.scfpf.aim.message.split()[2]) < 2.0
    # Its solution is one: the start is kept.
    assert addon("bridge.aim.aimed_volume").start_of(solved) is not None
    assert solve(solved) == {"FINISHED"}


def test_live_aim_and_undo_agree(solved):
    solved.scfpf.aim.live = True
    name = solved.name
    bpy.context.view_layer.update()
    bpy.ops.ed.undo_push(message="Before")
    before = points_of(solved)
    eye = solved.scfpf.aim_targets[0].eye
    eye.location.x -= 0.1
    bpy.context.view_layer.update()
    after = points_of(solved)
    assert not np.array_equal(after, before)
    bpy.ops.ed.undo_push(message="After")
    bpy.ops.ed.undo()
    assert np.array_equal(points_of(bpy.data.objects[name]), before)
    bpy.context.view_layer.update()
    assert np.array_equal(points_of(bpy.data.objects[name]), before)
    bpy.ops.ed.redo()
    bpy.context.view_layer.update()
    assert np.array_equal(points_of(bpy.data.objects[name]), after)


def test_live_aim_reads_a_changed_scene_again(solved, addon):
    live = addon("bridge.aim.live_aim")
    solved.scfpf.aim.live = True
    eye = solved.scfpf.aim_targets[0].eye
    bpy.context.view_layer.update()
    eye.location.x -= 0.05
    bpy.context.view_layer.update()
    assert len(live._drags) == 1
    bpy.data.objects["Left Wall"].location.x -= 1.0
    bpy.context.view_layer.update()
    assert not live._drags
    solved.scfpf.aim.live = False
    bpy.context.view_layer.update()
    assert not live._seen


def test_live_aim_waits_for_the_first_solution():
    camera = turned_view(box_scene(bpy.context.scene), 0.0)
    camera.scfpf.aim.live = True
    bpy.context.view_layer.update()
    surfaces = [slot.object for slot in camera.scfpf.surfaces]
    camera.scfpf.aim_targets[0].eye.location.x -= math.radians(5)
    bpy.context.view_layer.update()
    assert [slot.object for slot in camera.scfpf.surfaces] == surfaces
    assert "Press Solve once" in camera.scfpf.aim.message
