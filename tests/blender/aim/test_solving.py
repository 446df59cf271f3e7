# SPDX-License-Identifier: GPL-3.0-or-later
"""Solve, headless: the solved volume against Blender's own cameras, and what stays when it fails."""

import math
import time

import bpy
import numpy as np
import pytest
from aim_scenes import box_scene, points_of, solve, turned_view
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Vector


@pytest.fixture
def scene():
    return box_scene(bpy.context.scene)


def test_a_solved_view_is_what_its_camera_sees(scene, places):
    camera = turned_view(scene)
    assert solve(camera) == {"FINISHED"}
    target = camera.scfpf.aim_targets[0]
    # Points on the side that the view's camera sees, as Blender projects them, in the eye's frame.
    line = np.linspace(-0.8, 0.8, 5)
    points = [(1 + 1.5 * a, -0.8, 1 + b) for a in line for b in line]
    seen = np.array([world_to_camera_view(scene, target.eye, Vector(p))[:2] for p in points])
    wide, high = np.ptp([v[:] for v in target.eye.data.view_frame(scene=scene)], axis=0)[:2]
    seen *= (1.0, high / wide)
    shown = places(camera, points)
    # The image of the view is a similarity of that, without a turn.
    scale, *off = np.linalg.lstsq(
        np.concatenate(
            [np.c_[seen[:, 0], np.ones(25), np.zeros(25)], np.c_[seen[:, 1], np.zeros(25), np.ones(25)]]
        ),
        shown.T.ravel(),
        rcond=None,
    )[0]
    assert np.abs(shown - scale * seen - off).max() < 2.0
    assert 0.0 <= target.residual_median <= target.residual_max < 1.5
    assert target.hidden_by == "" and camera.scfpf.aim.flaws == ""
    assert "points within 1.5 px" in camera.scfpf.aim.message
    # Over all that the eye sees of the box, its front, left and top, each point as large as it is seen, from
    # where the view has it: the middle of the box at its position, a sphere around it as wide as it says.
    line = (np.arange(60) + 0.5) / 30 - 1
    a, b = (part.ravel() for part in np.meshgrid(line, line))
    sides = ((a, -1, b), (-1, a, b), (a, b, 1))
    faces = [np.stack(np.broadcast_arrays(1 + 1.5 * x, 0.8 * y, 1.0 + z), axis=1) for x, y, z in sides]
    points, normal = np.concatenate(faces), np.repeat([1, 0, 2], len(a))
    areas = np.repeat([1.5, 0.8, 1.5 * 0.8], len(a))
    matrix = np.array(target.eye.matrix_world)
    way = points - matrix[:3, 3]
    towards = np.abs(way[np.arange(len(way)), normal])
    sizes = areas * towards / np.abs(way @ matrix[:3, 2]) ** 3
    middle, radius = Vector((1.0, 0.0, 1.0)), math.hypot(1.5, 0.8, 1.0)
    seen = np.array([world_to_camera_view(scene, target.eye, p)[:] for p in (middle, *map(Vector, points))])
    sphere = radius / seen[0, 2] / math.tan(target.eye.data.angle / 2)
    wanted = (seen[1:, :2] - seen[0, :2]) * (1.0, high / wide) * (960 * target.width / sphere)
    wanted += np.array(target.position) * (960, 540)
    distances = np.linalg.norm(places(camera, points) - wanted, axis=1)
    order = np.argsort(distances)
    share = np.cumsum(sizes[order]) / sizes.sum()
    # A few of them are hidden in the image.
    least, most = (distances[order][np.searchsorted(share, part)] for part in (0.94, 0.96))
    assert least < target.whole_95 < most
    assert target.whole_max == pytest.approx(distances.max(), rel=0.05)
    assert target.message.startswith(f"95 % within {target.whole_95:.{1 if target.whole_95 < 10 else 0}f} px")
    assert camera.scfpf.aim.message.startswith(f"Box: {target.message} · background: 95 % within")
    worst = np.array(target.whole_worst) * (960, 540)
    nearest = np.linalg.norm(places(camera, points) - worst, axis=1).argmin()
    assert distances[nearest] > 0.7 * target.whole_max


def test_what_is_far_from_the_view_stays(scene, places):
    camera = turned_view(scene)
    far = [(-6.5, 14, 3), (-6.5, 10, 1), (-5, 17.5, 3), (7, 17.5, 2)]
    before = places(camera, far)
    assert solve(camera) == {"FINISHED"}
    assert np.abs(places(camera, far) - before).max() < 8.0
    assert 0.0 <= camera.scfpf.aim.background_median < 3.0


def test_the_result_is_ordinary_surfaces(scene):
    camera = turned_view(scene)
    solve(camera)
    surfaces = [slot.object for slot in camera.scfpf.surfaces]
    assert [s.type for s in surfaces] == ["SURFACE"] * 3
    assert all(s.parent == camera and s.scfpf_surface.kind == "NURBS" for s in surfaces)
    spline = surfaces[0].data.splines[0]
    assert (spline.point_count_u, spline.point_count_v, spline.order_u) == (8, 6, 4)
    assert camera.scfpf.basis == "BEZIER" and bpy.ops.scfpf.edit_volume.poll()


def test_the_same_targets_give_the_same_volume_again(scene):
    camera = turned_view(scene)
    solve(camera)
    before, names = points_of(camera), [slot.object.name for slot in camera.scfpf.surfaces]
    assert solve(camera) == {"FINISHED"}
    assert np.abs(points_of(camera) - before).max() < 1e-3
    assert [slot.object.name for slot in camera.scfpf.surfaces] == names


def test_targets_that_are_met_change_nothing(scene, places):
    camera = turned_view(scene, 0.0)
    grid = [(x, 0.0, z) for x in (-4, 0, 4) for z in (0, 2, 3)]
    before = places(camera, grid)
    assert solve(camera) == {"FINISHED"}
    assert np.abs(places(camera, grid) - before).max() < 0.5


def test_a_pin_and_a_straight_line_are_solved(scene, reading):
    camera = scene.camera
    pins = (((-7, -6, 6), (0.1, 0.8)), ((-6.5, 18, 6), (0.4, 0.7)))
    for point, position in pins:
        bpy.ops.scfpf.aim_pin_add(camera=camera.name, point=point, position=position)
    first, second = (target.handle.name for target in camera.scfpf.aim_targets)
    bpy.ops.scfpf.aim_line_add(camera=camera.name, first=first, second=second)
    assert solve(camera) == {"FINISHED"}, camera.scfpf.aim.message
    # The projectors at their places meet them within 1.5 pixels. A hidden point may be on another one, too.
    projection = reading.read_projection(camera, bpy.context.evaluated_depsgraph_get(), 960 / 540)
    t = np.linspace(0.0, 1.0, 40001)[:, None]
    for point, (x, y) in pins:
        near, middle, far = np.moveaxis(
            projection.projectors(np.array([x, x + 1 / 960]), np.full(2, y))[0], 2, 1
        )
        here, beside = (
            (1 - t) ** 2 * a + 2 * t * (1 - t) * b + t**2 * c
            for a, b, c in zip(near, middle, far, strict=True)
        )
        miss = np.linalg.norm(here - point, axis=1)
        nearest = miss.argmin()
        assert miss[nearest] < 1.5 * np.linalg.norm(beside[nearest] - here[nearest])


def test_a_solution_that_is_worse_is_not_taken(scene, addon, monkeypatch):
    camera = turned_view(scene)
    solve(camera)
    before = points_of(camera)
    rounds = addon("aim.rounds")
    right = rounds.solve

    def bad(problem, is_cancelled, schedule):
        result = right(problem, is_cancelled, schedule)
        if result is None:  # late
            return None
        patches = tuple(type(p)(p.points[:, ::-1] + 5.0) for p in result.patches)
        return type(result)(patches, result.t, result.residuals, result.steps)

    monkeypatch.setattr(rounds, "solve", bad)
    # The first way is as bad as all others.
    monkeypatch.setattr(addon("bridge.aim.solve_targets"), "BUDGET", 0.0)
    with pytest.raises(RuntimeError, match="Not taken, because"):
        solve(camera)
    assert np.array_equal(points_of(camera), before)


def test_a_watched_solve_finds_the_same(scene, addon):
    """With a thread for the work, as in a window."""
    camera, work = turned_view(scene), addon("bridge.aim.solve_work")
    keyed = addon("bridge.aim.keyed_targets")
    assert solve(camera) == {"FINISHED"}
    expected, message = points_of(camera), camera.scfpf.aim.message
    watched = work.WatchedSolve(keyed.solving_animation(camera, bpy.context))
    shares = []
    while not watched.is_done():
        shares.append(watched.share)
        time.sleep(0.005)
    assert np.abs(points_of(camera) - expected).max() < 1e-5 and watched.message == message
    assert shares == sorted(shares) and shares[-1] > 0.5


def test_a_cancelled_solve_changes_nothing(scene, addon):
    camera, work = turned_view(scene), addon("bridge.aim.solve_work")
    keyed = addon("bridge.aim.keyed_targets")
    before = [slot.object for slot in camera.scfpf.surfaces]
    watched = work.WatchedSolve(keyed.solving_animation(camera, bpy.context))
    while watched.share < 0.2:
        time.sleep(0.002)
    watched.cancel()
    with pytest.raises(addon("casting.common.cancellation").Cancelled):
        watched.task.result()
    assert [slot.object for slot in camera.scfpf.surfaces] == before
    # The scene stays at its frame when targets have keys.
    target = camera.scfpf.aim_targets[0]
    for frame, off in ((1, 0.0), (11, 0.02)):
        target.position[0] += off
        target.keyframe_insert("position", frame=frame)
    scene.frame_set(4)
    watched = work.WatchedSolve(keyed.solving_animation(camera, bpy.context))
    assert scene.frame_current == 1
    watched.cancel()
    assert scene.frame_current == 4
    assert [slot.object for slot in camera.scfpf.surfaces] == before


def test_a_camera_that_is_deleted_meanwhile_is_told(scene, addon):
    camera, work = turned_view(scene), addon("bridge.aim.solve_work")
    watched = work.WatchedSolve(addon("bridge.aim.keyed_targets").solving_animation(camera, bpy.context))
    bpy.data.objects.remove(camera)
    with pytest.raises(addon("projection.user_error").UserError, match="The camera is gone"):
        while not watched.is_done():
            time.sleep(0.005)


def test_with_a_view_alone_the_background_does_not_count(scene):
    camera = turned_view(scene, 60.0)
    target = camera.scfpf.aim_targets[0]
    target.alone, target.width = True, 2.5 * target.width
    assert solve(camera) == {"FINISHED"}, camera.scfpf.aim.message
    assert target.residual_max < 1.5
    assert camera.scfpf.aim.background_median == -1.0 and "background" not in camera.scfpf.aim.message


def test_a_refused_first_target_leaves_an_ordinary_camera(scene):
    camera, names = scene.camera, set(bpy.data.objects.keys())
    with pytest.raises(RuntimeError, match="no collection 'Nothing'"):
        bpy.ops.scfpf.aim_view_add(camera=camera.name, collection="Nothing")
    bpy.context.view_layer.update()
    assert not camera.scfpf.enabled and not len(camera.scfpf.surfaces)
    assert {
        name for name in bpy.data.objects.keys() if not bpy.data.objects[name].scfpf_surface.is_volume
    } <= names


def test_faults_of_targets_are_told_and_change_nothing(scene):
    camera = scene.camera
    with pytest.raises(RuntimeError, match="no view and no pin"):
        solve(camera)
    turned_view(scene)
    target = camera.scfpf.aim_targets[0]
    before = [slot.object for slot in camera.scfpf.surfaces]
    for change, message in (
        (lambda: setattr(target, "position", (3.0, 0.5)), "outside the picture"),
        (lambda: setattr(target, "object", None), "shows nothing"),
        (lambda: setattr(target, "eye", None), "has no camera"),
    ):
        kept = tuple(target.position), target.object, target.eye
        change()
        with pytest.raises(RuntimeError, match=message):
            solve(camera)
        target.position, target.object, target.eye = kept
    target.eye.matrix_world.translation = (1, 40, 1)
    bpy.context.view_layer.update()
    with pytest.raises(RuntimeError, match="looks away"):
        solve(camera)
    assert [slot.object for slot in camera.scfpf.surfaces] == before


def test_solving_is_one_step_of_undo(scene):
    camera = turned_view(scene)
    name, uid = camera.name, camera.session_uid
    bpy.ops.ed.undo_push(message="Before")
    assert bpy.ops.scfpf.aim_solve("EXEC_DEFAULT", True, camera=name) == {"FINISHED"}
    solved = points_of(bpy.data.objects[name])
    bpy.ops.ed.undo()
    camera = bpy.data.objects[name]
    assert camera.session_uid == uid
    assert [slot.object.type for slot in camera.scfpf.surfaces] == ["MESH", "MESH"]
    bpy.ops.ed.redo()
    assert np.array_equal(points_of(bpy.data.objects[name]), solved)


def test_a_solved_volume_survives_saving_and_is_solved_further(scene, tmp_path, places):
    camera = turned_view(scene)
    solve(camera)
    name, path, before = camera.name, str(tmp_path / "aim.blend"), points_of(camera)
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    camera = bpy.data.objects[name]
    assert np.array_equal(points_of(camera), before)
    assert camera.scfpf.aim_targets[0].residual_max < 1.5
    # Turned back, the volume is the old one again: the start is in the file.
    bpy.ops.scfpf.aim_turn(camera=name, left=math.radians(-15))
    bpy.context.view_layer.update()
    assert solve(camera) == {"FINISHED"}
    grid = [(x, 2.0, z) for x in (-4, 0, 4) for z in (1, 3)]
    solved = places(camera, grid)
    camera.scfpf.enabled = False
    for point, place in zip(grid, solved, strict=True):
        plain = world_to_camera_view(bpy.context.scene, camera, Vector(point))
        assert np.abs(place - np.array([plain.x * 960, plain.y * 540])).max() < 2.0


def test_an_edited_volume_is_a_new_start(scene, addon):
    camera = turned_view(scene)
    solve(camera)
    volume = addon("bridge.aim.aimed_volume")
    assert volume.start_of(camera) is not None
    point = camera.scfpf.surfaces[1].object.data.splines[0].points[10]
    point.co[0] += 0.1
    assert volume.start_of(camera) is None
    assert solve(camera) == {"FINISHED"}
    assert volume.start_of(camera) is not None


def test_a_duplicate_is_solved_by_itself(scene):
    camera = turned_view(scene)
    solve(camera)
    before = points_of(camera)
    bpy.context.view_layer.objects.active = camera
    bpy.ops.object.select_all(action="DESELECT")
    camera.select_set(True)
    assert bpy.ops.scfpf.camera_duplicate() == {"FINISHED"}
    copy = bpy.context.object
    assert copy != camera and np.array_equal(points_of(copy), before)
    copy.scfpf.aim_targets[0].position[0] -= 0.1
    assert solve(copy) == {"FINISHED"}
    assert np.array_equal(points_of(camera), before)
    assert not np.array_equal(points_of(copy), before)


def test_cameras_of_two_scenes_are_solved_in_their_own(scene):
    first = turned_view(scene)
    solve(first)
    before = points_of(first)
    other = bpy.data.scenes.new("Other")
    bpy.context.window.scene = other
    second = turned_view(box_scene(other), 10.0, "Box.001")
    assert solve(second) == {"FINISHED"}
    assert np.array_equal(points_of(first), before) and second.scfpf.aim.is_solved


@pytest.mark.parametrize("kind", ["object", "mask"])
def test_a_locked_region_stays_where_it_was(scene, places, kind):
    camera = scene.camera
    bpy.ops.mesh.primitive_cube_add(location=(3.2, -1, 0.5), scale=(0.3, 0.3, 0.5))
    bpy.context.object.name = "Post"
    bpy.ops.scfpf.aim_view_add(camera=camera.name, object="Box")
    bpy.ops.scfpf.aim_turn(camera=camera.name, left=math.radians(20))
    target = camera.scfpf.aim_targets[0]
    target.halo = 4.0
    bpy.context.view_layer.update()
    corner = [(3.2, -1.3, 0.5)]
    before = places(camera, corner)
    if kind == "object":
        bpy.ops.scfpf.aim_stay_add(camera=camera.name, object="Post")
    else:
        image = bpy.data.images.new("Mask", 96, 54)
        pixels = np.zeros((54, 96, 4), np.float32)
        x, y = (before[0] / 10).astype(int)
        pixels[y - 6 : y + 6, x - 4 : x + 4] = 1.0
        image.pixels.foreach_set(pixels.ravel())
        bpy.ops.scfpf.aim_stay_add(camera=camera.name, mask="Mask")
    camera.scfpf.aim_targets[1].is_on = False
    assert solve(camera) == {"FINISHED"}
    free = np.abs(places(camera, corner) - before).max()
    assert camera.scfpf.aim_targets[1].whole_95 == -1.0
    camera.scfpf.aim_targets[1].is_on = True
    assert solve(camera) == {"FINISHED"}
    moved = np.abs(places(camera, corner) - before).max()
    assert moved < min(3.0, free / 2)
    stay = camera.scfpf.aim_targets[1]
    assert 0.0 <= stay.whole_95 <= stay.whole_max < 10.0 and "95 % within" in stay.message
