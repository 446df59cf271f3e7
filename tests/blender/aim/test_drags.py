# SPDX-License-Identifier: GPL-3.0-or-later
"""Drags of targets, by the class that operators use and by the handler of Live Aim."""

import math
import time

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
    drag = addon("bridge.aim.follower").Follower(solved, depsgraph())
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
    assert "points within" in addon("bridge.aim.solve_work").run_through(drag.finishing(depsgraph()))
    bpy.context.view_layer.update()
    assert abs(places(solved, corner)[0, 0] - start[0, 0] - 40) < 2.0


def test_a_drag_is_restored(solved, addon):
    before = points_of(solved)
    drag = addon("bridge.aim.follower").Follower(solved, depsgraph())
    solved.scfpf.aim_targets[0].position[0] += 0.02
    drag.step(depsgraph())
    assert not np.array_equal(points_of(solved), before)
    drag.restore()
    assert np.array_equal(points_of(solved), before)
    assert addon("bridge.aim.aimed_volume").start_of(solved) is not None


def test_a_drag_that_is_not_taken_leaves_the_volume(solved, addon, monkeypatch):
    before = points_of(solved)
    drag = addon("bridge.aim.follower").Follower(solved, depsgraph())
    solved.scfpf.aim_targets[0].position[0] += 0.02
    drag.step(depsgraph())
    judge = addon("aim.judge")
    monkeypatch.setattr(judge.Judgement, "worse_than", lambda _self, _old: "MIRRORED")
    with pytest.raises(addon("projection.user_error").UserError, match="Not taken"):
        addon("bridge.aim.solve_work").run_through(drag.finishing(depsgraph()))
    assert np.array_equal(points_of(solved), before)


def test_a_drag_begins_on_any_volume(addon, places):
    camera = turned_view(box_scene(bpy.context.scene), 0.0)
    grid = [(x, 0.0, z) for x in (-4, 0, 4) for z in (0, 2, 3)]
    before = places(camera, grid)
    addon("bridge.aim.follower").Follower(camera, depsgraph())
    bpy.context.view_layer.update()
    assert np.abs(places(camera, grid) - before).max() < 0.5
    assert [slot.object.type for slot in camera.scfpf.surfaces] == ["SURFACE"] * 3


def test_a_drag_ends_when_its_camera_is_gone(solved, addon):
    drag = addon("bridge.aim.follower").Follower(solved, depsgraph())
    bpy.data.objects.remove(solved)
    bpy.context.view_layer.update()
    with pytest.raises(addon("projection.user_error").UserError, match="begin again"):
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
    (own,) = live._cameras.values()
    assert own.follower is not None
    bpy.data.objects["Left Wall"].location.x -= 1.0
    bpy.context.view_layer.update()
    assert own.follower is None
    solved.scfpf.aim.live = False
    bpy.context.view_layer.update()
    assert not live._cameras


def test_live_aim_waits_for_the_first_solution():
    camera = turned_view(box_scene(bpy.context.scene), 0.0)
    camera.scfpf.aim.live = True
    bpy.context.view_layer.update()
    surfaces = [slot.object for slot in camera.scfpf.surfaces]
    camera.scfpf.aim_targets[0].eye.location.x -= math.radians(5)
    bpy.context.view_layer.update()
    assert [slot.object for slot in camera.scfpf.surfaces] == surfaces
    assert "Press Solve once" in camera.scfpf.aim.message


def test_the_switch_of_live_aim_prepares_the_volume(places):
    camera = turned_view(box_scene(bpy.context.scene), 0.0)
    grid = [(x, 0.0, z) for x in (-4, 0, 4) for z in (0, 2, 3)]
    before = places(camera, grid)
    assert bpy.ops.scfpf.aim_live(camera=camera.name) == {"FINISHED"} and camera.scfpf.aim.live
    bpy.context.view_layer.update()
    assert np.abs(places(camera, grid) - before).max() < 0.5
    start = points_of(camera)
    for _ in range(2):
        camera.scfpf.aim_targets[0].eye.location.x -= 0.05
        bpy.context.view_layer.update()
    assert not np.array_equal(points_of(camera), start)
    assert bpy.ops.scfpf.aim_live(camera=camera.name) == {"FINISHED"} and not camera.scfpf.aim.live


def rested(live):
    """Wait until Live Aim has solved."""
    end = time.monotonic() + 120.0
    while live.is_busy():
        assert time.monotonic() < end, "the solve hangs"
        live.settle()
        time.sleep(0.02)


def world_points(camera):
    """The control points in world space, as the solver orders them: (points, surfaces, 3)."""
    nets = points_of(camera).reshape(3, 6, 8, 4)[..., :3]
    turn = np.array(camera.matrix_world, np.float64)
    placed = nets @ turn[:3, :3].T + turn[:3, 3]
    return placed.transpose(2, 1, 0, 3).reshape(48, 3, 3)


def test_live_aim_solves_once_when_nothing_moves(solved, addon, monkeypatch):
    live, targets = addon("bridge.aim.live_aim"), addon("bridge.aim.solve_targets")
    monkeypatch.setattr(live, "REST", 0.0)
    solves, right = [], targets.solve_in_rounds
    monkeypatch.setattr(targets, "solve_in_rounds", lambda *a: solves.append(1) or right(*a))
    solved.scfpf.aim.live = True
    bpy.context.view_layer.update()
    eye = solved.scfpf.aim_targets[0].eye
    for _ in range(3):
        eye.location.x -= 0.05
        bpy.context.view_layer.update()
    followed = points_of(solved)
    rested(live)
    assert len(solves) == 1 and "points within 1.5 px" in solved.scfpf.aim.message
    settled = points_of(solved)
    assert not np.array_equal(settled, followed)
    bpy.context.view_layer.update()
    own = live._cameras[solved.session_uid]
    assert own.rests_at is None, "the solve itself is no move"
    # The next move goes on from it, and Solve finds the same.
    solver = own.follower._solver
    assert np.abs(world_points(solved) - solver.points).max() < 1e-3
    assert solve(solved) == {"FINISHED"} and np.abs(points_of(solved) - settled).max() < 1e-5


def test_a_move_cancels_the_solve_of_live_aim(solved, addon, monkeypatch):
    live = addon("bridge.aim.live_aim")
    monkeypatch.setattr(live, "REST", 0.0)
    solved.scfpf.aim.live = True
    bpy.context.view_layer.update()
    eye = solved.scfpf.aim_targets[0].eye
    eye.location.x -= 0.05
    bpy.context.view_layer.update()
    live.settle()
    (own,) = live._cameras.values()
    first = own.solve
    eye.location.x -= 0.05
    bpy.context.view_layer.update()
    assert first.task.cancelled and own.solve is None and own.rests_at is not None
    live.forget()
    assert not live._cameras


def snapshot(camera):
    """The names of everything in the file, and what a volume is."""
    settings = camera.scfpf
    objects = {
        obj.name: (obj.type, obj.hide_select, obj.display_type, sorted(c.name for c in obj.users_collection))
        for obj in bpy.data.objects
    }
    return (
        objects,
        [(slot.object.name, slot.weight) for slot in settings.surfaces],
        [(item.name, item.kind, item.radius, item.grid and item.grid.name) for item in settings.mappings],
        (settings.basis, settings.reparameterisation, settings.fit, tuple(settings.u_range)),
        {len(group) for group in (bpy.data.meshes, bpy.data.curves, bpy.data.actions, bpy.data.cameras)},
    )


@pytest.mark.parametrize("kind", ["ordinary", "preset", "mapped"])
def test_a_first_drag_that_is_restored_leaves_nothing(addon, places, kind):
    camera = turned_view(box_scene(bpy.context.scene), 0.0)
    bpy.context.view_layer.objects.active = camera
    if kind == "preset":
        assert bpy.ops.scfpf.surface_insert() == {"FINISHED"}
        camera.scfpf.surfaces[1].weight = 2.0
    if kind == "mapped":
        addon("bridge.mappings.mapping_edits").add_mapping(camera, "GRID", "Grid")
    bpy.context.view_layer.update()
    before, points = snapshot(camera), [(x, 0.0, z) for x in (-2, 0, 2) for z in (1, 2)]
    shown = places(camera, points)
    drag = addon("bridge.aim.follower").Follower(camera, depsgraph())
    bpy.context.view_layer.update()
    assert [slot.object.type for slot in camera.scfpf.surfaces] == ["SURFACE"] * 3
    camera.scfpf.aim_targets[0].position[0] += 0.02
    drag.step(depsgraph())
    bpy.context.view_layer.update()
    drag.restore()
    bpy.context.view_layer.update()
    assert snapshot(camera) == before
    assert np.abs(places(camera, points) - shown).max() < 1e-6


def test_a_first_drag_that_is_taken_leaves_its_surfaces_only(addon):
    camera = turned_view(box_scene(bpy.context.scene), 0.0)
    cameras = {obj.name for obj in bpy.data.objects if obj.type == "CAMERA"}
    assert bpy.ops.scfpf.aim_drag(shift=(0.02, 0.0)) == {"FINISHED"}
    bpy.context.view_layer.update()
    assert {obj.name for obj in bpy.data.objects if obj.type == "CAMERA"} == cameras
    names = [f"{camera.name} {part}" for part in ("Near", "Surface 2", "Far")]
    assert [slot.object.name for slot in camera.scfpf.surfaces] == names
    made = {obj.name for obj in bpy.data.objects if obj.scfpf_surface.kind != "NONE"}
    assert made == set(names)


def test_keyframed_surfaces_are_not_dragged(addon):
    camera = turned_view(box_scene(bpy.context.scene), 0.0)
    camera.scfpf.surfaces[1].keyframe_insert("weight", frame=1)
    before = snapshot(camera)
    with pytest.raises(addon("projection.user_error").UserError, match="keyframed: press Solve first"):
        addon("bridge.aim.follower").Follower(camera, depsgraph())
    assert snapshot(camera) == before
