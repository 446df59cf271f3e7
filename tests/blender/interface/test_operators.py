# SPDX-License-Identifier: GPL-3.0-or-later
"""Operators that make and edit flexible cameras: their effects, their polls, undo and redo."""

import contextlib
import json

import bpy
import numpy as np
import pytest
from bpy_extras.object_utils import world_to_camera_view
from mathutils import Matrix, Vector
from operator_steps import add_camera, add_cube, poll_message, projection_of, surface_names


def viewport():
    """An override for the 3D viewport of the startup file."""
    window = bpy.context.window_manager.windows[0]
    area = next(area for area in window.screen.areas if area.type == "VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    return bpy.context.temp_override(window=window, area=area, region=region)


@contextlib.contextmanager
def seen(perspective):
    """``viewport`` in another perspective, which a new file may keep."""
    with viewport():
        bpy.context.region_data.view_perspective = perspective
        try:
            yield
        finally:
            bpy.context.region_data.view_perspective = "PERSP"


# Adding a camera


def test_new_camera_sees_the_whole_scene(addon):
    places = [Vector((-6, 7, 2)), Vector((9, 7, 2))]
    corners = [place + Vector(corner) for place in places for corner in add_cube(place).bound_box]
    camera = add_camera()
    scene = bpy.context.scene
    assert scene.camera == camera
    assert camera.scfpf.enabled
    assert camera.select_get() and bpy.context.selected_objects == [camera]
    for corner in corners:
        x, y, depth = world_to_camera_view(scene, camera, corner)
        assert 0 < x < 1 and 0 < y < 1
        assert camera.data.clip_start < depth < camera.data.clip_end


def test_new_camera_volume_is_its_own_frustum(addon):
    add_cube()
    camera = add_camera()
    x = np.array([0.1, 0.5, 0.9])
    sample = projection_of(addon, camera).volume.evaluate(x, x[::-1], np.array([0.2, 0.5, 0.8]))
    for position, u, v in zip(sample.position.T, x, x[::-1], strict=True):
        seen = world_to_camera_view(bpy.context.scene, camera, Vector(position))
        assert seen.x == pytest.approx(u, abs=1e-5)
        assert seen.y == pytest.approx(v, abs=1e-5)


def test_new_camera_in_an_empty_scene_has_a_volume(addon):
    camera = add_camera()
    assert surface_names(camera) == ["Near", "Far"]
    projection_of(addon, camera)


def test_existing_scene_camera_is_kept():
    bpy.ops.object.camera_add()
    ordinary = bpy.context.object
    bpy.context.scene.camera = ordinary
    add_camera()
    assert bpy.context.scene.camera == ordinary


@pytest.mark.parametrize("resolution", [(1920, 1080), (600, 1200)])
def test_new_camera_takes_the_viewport_view(resolution):
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y = resolution
    add_cube()
    with viewport():
        view = bpy.context.region_data
        to_view, to_clip = view.view_matrix.copy(), view.window_matrix.copy()
        camera = add_camera()
    assert np.allclose(camera.matrix_world.inverted(), to_view, atol=1e-5)
    # The frame is inscribed in the region: it touches its borders one way and stays inside the other way.
    corner = camera.data.view_frame(scene=bpy.context.scene)[0]
    x, y = corner.x / -corner.z * to_clip[0][0], corner.y / -corner.z * to_clip[1][1]
    assert max(x, y) == pytest.approx(1, abs=1e-5)
    assert min(x, y) <= 1 + 1e-5


def test_orthographic_view_from_inside_the_scene_is_moved_back():
    add_cube((0, 0, 0)).scale = (50, 50, 50)
    with seen("ORTHO"):
        camera = add_camera()
    for corner in bpy.data.objects["Cube"].bound_box:
        depth = -(camera.matrix_world.inverted() @ (Vector(corner) * 50)).z
        assert camera.data.clip_start < depth < camera.data.clip_end


@pytest.mark.parametrize("size", [0.05, 30.0, 3000.0])
def test_new_camera_inside_a_scene_reaches_through_it(size):
    """A street of eight cubes around the viewport's eye."""
    with viewport():
        eye = bpy.context.region_data.view_matrix.inverted()
    for number in range(8):
        place = Matrix.Translation((0.2 * size, 0, (number / 7 - 0.5) * size))
        add_cube().matrix_world = eye @ place @ Matrix.Scale(0.05 * size, 4)
    with viewport():
        camera = add_camera()
    assert 0.55 * size < camera.data.clip_end < 3 * size
    assert camera.data.clip_start < 0.03 * size


def test_new_camera_that_looks_away_has_a_volume_of_the_scene_size():
    with viewport():
        eye = bpy.context.region_data.view_matrix.inverted()
    add_cube().matrix_world = eye @ Matrix.Translation((0, 0, 50)) @ Matrix.Scale(20, 4)
    with viewport():
        camera = add_camera()
    assert 10 < camera.data.clip_end < 100


@pytest.mark.parametrize("size", [0.05, 2.0, 30.0, 3000.0])
def test_presets_in_a_scene_hold_its_middle(addon, size):
    """From a new camera's place a preset's volume holds a scene of any size, also at the near surface."""
    placement = addon("operators.camera.camera_placement")
    preset_module = addon("operators.camera.presets")
    invert = addon("projection.volume.inverse").invert
    box = placement.SceneBox(np.full(3, -size / 2), np.full(3, size / 2))
    _, matrix = placement.camera_seeing(box, 16 / 9)
    for identifier in ("perspective", "mirror_ball", "orthographic", "oblique", "telephoto", "linear_twist"):
        volume = preset_module.shipped_preset(identifier).fitted(16 / 9).volume()
        scale = placement.reaching_scale(volume, matrix, box)
        seen = np.array(matrix.inverted(), np.float64)[:3, 3:] / scale
        found = invert(volume, seen)
        assert found.found.all(), (identifier, scale)
        if identifier == "orthographic" and size <= 2.0:
            corners = placement.transformed(matrix.inverted(), box.corners).T / scale
            assert invert(volume, corners).found.all()


def test_presets_scale_with_a_tiny_scene_around_the_camera(addon):
    """Volumes are proportional to the scene, and reach a little beyond it."""
    placement = addon("operators.camera.camera_placement")
    preset_module = addon("operators.camera.presets")
    for identifier in ("cavalier", "three_quarter", "linear_twist", "pushbroom", "orthographic"):
        volume = preset_module.shipped_preset(identifier).fitted(16 / 9).volume()
        ratios = []
        for size in (0.02, 0.5):
            box = placement.SceneBox(np.full(3, -size), np.full(3, size))
            matrix = Matrix.Translation((0.3 * size, -0.2 * size, 0.1 * size))
            ratios.append(placement.reaching_scale(volume, matrix, box) / size)
        assert ratios[0] == pytest.approx(ratios[1], rel=1e-6), identifier
        far = np.linalg.norm(volume.surfaces[-1].evaluate(0.5, 0.5).position) * ratios[0]
        assert 1.25 < far < 6, (identifier, far)


def test_new_camera_through_a_camera_view_takes_its_lens():
    add_cube()
    bpy.ops.object.camera_add(location=(3, -8, 2), rotation=(1.3, 0, 0.3))
    ordinary = bpy.context.object
    ordinary.data.lens, ordinary.data.shift_x = 85, 0.1
    bpy.context.scene.camera = ordinary
    with seen("CAMERA"):
        bpy.context.space_data.camera = ordinary
        camera = add_camera()
    assert camera.data != ordinary.data
    assert camera.data.lens == 85 and camera.data.shift_x == pytest.approx(0.1)
    assert np.allclose(camera.matrix_world, ordinary.matrix_world, atol=1e-6)


def test_camera_cannot_be_added_in_edit_mode():
    add_cube()
    bpy.ops.object.mode_set(mode="EDIT")
    assert "Object Mode" in poll_message(bpy.ops.scfpf.camera_add)


# Ordinary and flexible


def test_camera_from_camera_and_toggle(addon):
    bpy.ops.object.camera_add(location=(1, 2, 3))
    camera = bpy.context.object
    assert "Switch on" in poll_message(bpy.ops.scfpf.surface_add)
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"}
    assert camera.scfpf.enabled and surface_names(camera) == ["Near", "Far"]
    camera.scfpf.surfaces[0].object.location.x = 0.25
    bpy.ops.scfpf.camera_toggle()
    assert not camera.scfpf.enabled and len(camera.scfpf.surfaces) == 2
    bpy.ops.scfpf.camera_toggle()
    assert camera.scfpf.enabled
    assert camera.scfpf.surfaces[0].object.location.x == 0.25, "toggling has made a new volume"


def test_toggle_gives_a_camera_without_surfaces_a_volume(addon):
    bpy.ops.object.camera_add()
    bpy.ops.scfpf.camera_toggle()
    projection_of(addon, bpy.context.object)


def test_panoramic_camera_is_refused_with_a_reason():
    bpy.ops.object.camera_add()
    bpy.context.object.data.type = "PANO"
    with pytest.raises(RuntimeError, match="neither a perspective nor an orthographic"):
        bpy.ops.scfpf.camera_from_camera()
    assert len(bpy.context.object.scfpf.surfaces) == 0


def test_operators_without_a_camera_say_what_to_do():
    add_cube()
    assert "Select a camera" in poll_message(bpy.ops.scfpf.camera_from_camera)
    assert "Flexible Camera" in poll_message(bpy.ops.scfpf.surface_add)
    assert "Flexible Camera" in poll_message(bpy.ops.scfpf.preset_apply)


# Presets


def test_every_shipped_preset_can_be_added_and_applied(addon):
    items = addon("operators.camera.presets").preset_items()
    assert len(items) >= 7
    add_cube((2, 3, 4))
    added = add_camera()
    for identifier, _name, description in items:
        assert description
        assert bpy.ops.scfpf.preset_apply(preset=identifier) == {"FINISHED"}
        projection_of(addon, added)
        made = add_camera(preset=identifier)
        projection_of(addon, made)
        # Every camera of the file is followed with each edit.
        bpy.data.batch_remove([*made.children_recursive, made])
        bpy.context.view_layer.objects.active = added


@pytest.mark.parametrize("sizes", [(0.9, 2.2, 0.75), (2.2, 0.9, 0.75), (5, 4, 3)])
def test_preset_made_around_a_subject_goes_around_the_selection(addon, sizes):
    add_cube((40, 0, 0))
    selected = add_cube((5, 6, 7))
    selected.scale = sizes
    camera = add_camera(preset="around_the_car")
    preset = addon("operators.camera.presets").shipped_preset("around_the_car")
    ends = np.array([0.0, 1.0]), np.array([0.0, 1.0]), np.zeros(2)
    diagonals = [
        np.linalg.norm(np.diff(volume.evaluate(*ends).position))
        for volume in (projection_of(addon, camera).volume, preset.fitted(16 / 9).volume())
    ]
    scale = diagonals[0] / diagonals[1]
    to_camera = camera.matrix_world.inverted()
    corners = [to_camera @ selected.matrix_world @ Vector(corner) for corner in selected.bound_box]
    low, high = np.min(corners, axis=0), np.max(corners, axis=0)
    assert np.allclose((low + high) / 2, np.array(preset.subject.centre) * scale, atol=1e-4)
    share = (high - low) / (np.array(preset.subject.size) * scale)
    assert share.max() == pytest.approx(1, abs=1e-4), "the subject does not just hold what is selected"
    assert np.allclose(camera.matrix_world.col[1], (0, 0, 1, 0), atol=1e-6), "the camera is not upright"


def test_preset_without_fitting_keeps_its_size_and_the_camera_in_place(addon):
    add_cube((5, 6, 7)).scale = (500, 500, 500)
    camera = add_camera()
    place = camera.matrix_world.copy()
    bpy.ops.scfpf.preset_apply(preset="nonlinear_twist", fit=False)
    assert camera.matrix_world == place
    assert camera.scfpf.surfaces[-1].object.location.z == pytest.approx(-22)
    bpy.ops.scfpf.preset_apply(preset="nonlinear_twist", fit=True)
    assert camera.scfpf.surfaces[-1].object.location.z < -500


@pytest.mark.parametrize(
    ("content", "reason"),
    [
        (None, "cannot read"),
        ("{", "not valid JSON"),
        ('{"format": 1}', "needs"),
        (b"\xff\xfe\x00", "UTF-8"),
        ("[]", "object"),
    ],
)
def test_bad_preset_file_is_refused_and_the_volume_kept(tmp_path, content, reason):
    path = tmp_path / "bad.json"
    if content is not None:
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
    camera = add_camera()
    with pytest.raises(RuntimeError, match=reason) as caught:
        bpy.ops.scfpf.preset_load(filepath=str(path))
    assert "bad.json" in str(caught.value) and "Traceback" not in str(caught.value)
    assert surface_names(camera) == ["Near", "Far"]


def test_preset_file_of_an_artist_is_loaded(addon, tmp_path):
    data = json.loads((addon("operators.camera.presets").FOLDER / "perspective.json").read_text())
    data["name"] = "Mine"
    path = tmp_path / "mine.json"
    path.write_text(json.dumps(data))
    camera = add_camera()
    assert bpy.ops.scfpf.preset_load(filepath=str(path), fit=False) == {"FINISHED"}
    assert camera.scfpf.surfaces[1].object.location.z == pytest.approx(-100)


def test_menu_descriptions_come_from_the_presets(addon):
    items = addon("operators.camera.presets").preset_items()
    operator = addon("operators.camera.presets").SCFPF_OT_preset_apply
    for identifier, _name, description in items:
        assert operator.description(None, type("P", (), {"preset": identifier})) == description


# Undo, files


def state():
    cameras = [o for o in bpy.data.objects if o.type == "CAMERA" and o.scfpf.enabled]
    return [surface_names(camera) for camera in cameras], len(bpy.data.objects)


def test_undo_and_redo_of_every_edit():
    add_cube()
    steps = (
        lambda: bpy.ops.scfpf.camera_add("EXEC_DEFAULT", True),
        lambda: bpy.ops.scfpf.surface_add("EXEC_DEFAULT", True, kind="SPHERE"),
        lambda: bpy.ops.scfpf.surface_add("EXEC_DEFAULT", True, kind="GRID"),
        lambda: bpy.ops.scfpf.surface_move("EXEC_DEFAULT", True, direction="UP"),
        lambda: bpy.ops.scfpf.surface_remove("EXEC_DEFAULT", True),
        lambda: bpy.ops.scfpf.preset_apply("EXEC_DEFAULT", True, preset="angular_fisheye"),
        lambda: bpy.ops.scfpf.camera_from_camera("EXEC_DEFAULT", True),
        lambda: bpy.ops.scfpf.camera_toggle("EXEC_DEFAULT", True),
    )
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.ops.ed.undo_push(message="start")
        states = [state()]
        for step in steps:
            step()
            states.append(state())
        for before in reversed(states[:-1]):
            bpy.ops.ed.undo()
            assert state() == before
        for after in states[1:]:
            bpy.ops.ed.redo()
            assert state() == after


def test_everything_survives_save_and_reload(addon, tmp_path):
    add_cube()
    camera = add_camera(preset="angular_fisheye")
    bpy.ops.scfpf.surface_add(kind="SPHERE")
    camera.scfpf.pixel_error, camera.scfpf.samples = 0.5, 9
    u, v, t = np.random.default_rng(3).random((3, 20))
    before = projection_of(addon, camera).volume.evaluate(u, v, t).position
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "camera.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "camera.blend"))
    camera = bpy.context.scene.camera
    assert (camera.scfpf.pixel_error, camera.scfpf.samples) == (0.5, 9)
    assert np.allclose(projection_of(addon, camera).volume.evaluate(u, v, t).position, before, atol=1e-6)


def test_operators_follow_the_active_camera_of_two():
    first = add_camera()
    second = add_camera()
    bpy.ops.scfpf.surface_add(kind="PLANE")
    assert (len(first.scfpf.surfaces), len(second.scfpf.surfaces)) == (2, 3)
    bpy.context.view_layer.objects.active = first
    bpy.ops.scfpf.surface_remove()
    assert (len(first.scfpf.surfaces), len(second.scfpf.surfaces)) == (1, 3)
    add_cube()
    bpy.ops.scfpf.surface_remove()
    assert len(first.scfpf.surfaces) == 0, "without an active camera the scene's camera is meant"
