# SPDX-License-Identifier: GPL-3.0-or-later
"""Stereoscopy: each view of F12 shows what Cycles shows of it, or what its own camera shows."""

import bpy
import numpy as np
import pytest
from engine_images import button, f12, passes, write_multilayer

POSITION, COMBINED = "ViewLayer.Position", "ViewLayer.Combined"
VIEWS = ("left", "right")
WIDTH, HEIGHT = 32, 18
# Cycles samples pixels within this of their centres, the narrowest that its filter is.
JITTER = 0.01
# Of the scene's size: float32, and Cycles' jitter of a hundredth of a pixel on slanted walls.
NEAR_ENOUGH = 0.01
# Pixels whose jitter falls across an edge of the scene.
EDGES = 0.03


@pytest.fixture
def stereo_scene(tmp_path):
    """A cube in front of a wall, and an ordinary stereoscopic camera that is turned, moved and scaled."""
    scene = bpy.context.scene
    bpy.ops.mesh.primitive_cube_add(location=(0.5, 6, 0), rotation=(0.3, 0.2, 0.5))
    bpy.ops.mesh.primitive_plane_add(size=60, location=(0, 11, 0), rotation=(1.2, 0.1, 0.2))
    bpy.ops.object.camera_add(location=(0.4, -1, 0.3), rotation=(1.5, 0.1, 0.05), scale=(1.5, 1.5, 1.5))
    scene.camera = bpy.context.object
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = (
        WIDTH,
        HEIGHT,
        100,
    )
    scene.render.use_multiview = True
    stereo = scene.camera.data.stereo
    stereo.interocular_distance, stereo.convergence_distance = 0.9, 5.0
    bpy.context.view_layer.use_pass_position = True
    write_multilayer(scene, tmp_path / "out")
    scene.render.image_settings.views_format = "INDIVIDUAL"
    return scene


def cycles_positions(scene):
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising, scene.cycles.use_adaptive_sampling = 1, False, False
    scene.cycles.pixel_filter_type, scene.cycles.filter_width = "BLACKMAN_HARRIS", JITTER
    return positions(scene)


def f12_views(scene):
    """F12 with a file for each view: {view: passes()}."""
    assert bpy.ops.render.render(write_still=True) == {"FINISHED"}
    return {
        view: passes(f"{scene.render.filepath}{scene.render.views[view].file_suffix}.exr") for view in VIEWS
    }


def positions(scene):
    return {view: found[POSITION] for view, found in f12_views(scene).items()}


def engine_positions(scene):
    scene.render.engine = "SCFPF"
    scene.camera.scfpf.samples = 1
    return positions(scene)


def make_flexible(scene):
    bpy.context.view_layer.objects.active = scene.camera
    assert bpy.ops.scfpf.camera_toggle() == {"FINISHED"}
    assert scene.camera.scfpf.enabled


def assert_alike(one, other):
    assert not np.allclose(one["left"], one["right"], atol=0.1), "the views show the same"
    for view in VIEWS:
        away = np.linalg.norm(one[view] - other[view], axis=2)
        scale = np.linalg.norm(other[view], axis=2).max()
        assert np.ptp(one[view]) > 1.0, f"{view} is empty"
        assert (away > NEAR_ENOUGH * scale).mean() <= EDGES, (view, np.sort(away.ravel())[-20:])


MODES = [
    ("OFFAXIS", "CENTER"),
    ("OFFAXIS", "LEFT"),
    ("PARALLEL", "RIGHT"),
    ("TOE", "CENTER"),
    ("TOE", "RIGHT"),
]


@pytest.mark.parametrize(("mode", "pivot"), MODES)
def test_both_eyes_see_what_cycles_sees(stereo_scene, mode, pivot):
    """The ordinary camera's own stereo, then the same camera made flexible."""
    stereo = stereo_scene.camera.data.stereo
    stereo.convergence_mode, stereo.pivot = mode, pivot
    expected = cycles_positions(stereo_scene)
    assert_alike(engine_positions(stereo_scene), expected)
    make_flexible(stereo_scene)
    assert_alike(engine_positions(stereo_scene), expected)


@pytest.mark.parametrize(
    "lens",
    [
        {"sensor_fit": "VERTICAL", "shift_x": 0.2},
        {"type": "ORTHO", "ortho_scale": 7.0},
        {"lens": 22.0, "sensor_width": 20.0},
    ],
)
def test_ordinary_lenses_are_shifted_as_cycles_shifts_them(stereo_scene, lens):
    for name, value in lens.items():
        setattr(stereo_scene.camera.data, name, value)
    expected = cycles_positions(stereo_scene)
    assert_alike(engine_positions(stereo_scene), expected)


def test_what_is_at_the_convergence_distance_has_no_parallax(stereo_scene):
    """Closed form, for a volume that no camera has: there the off-axis eyes meet the middle."""
    scene = stereo_scene
    for obj in [obj for obj in scene.objects if obj.type == "MESH"]:
        bpy.data.objects.remove(obj)
    camera = scene.camera
    camera.location, camera.rotation_euler, camera.scale = (0, 0, 0), (0, 0, 0), (1, 1, 1)
    camera.data.stereo.convergence_distance = 30.0
    bpy.ops.mesh.primitive_plane_add(size=200, location=(0, 0, -30))
    make_flexible(scene)
    assert bpy.ops.scfpf.preset_apply(preset="nonlinear_twist") == {"FINISHED"}
    found = engine_positions(scene)
    scene.render.use_multiview = False
    middle = f12(scene)[POSITION]
    assert np.abs(middle[..., 2] + 30.0).max() < 1e-4
    for view in VIEWS:
        assert np.abs(found[view] - middle).max() < 1e-4


def test_eyes_have_blur_and_lens_of_cameras_beside_it(stereo_scene):
    """Parallel eyes equal ordinary cameras to the left and right, with motion blur and depth of field."""
    scene, camera = stereo_scene, stereo_scene.camera
    scene.render.engine = "SCFPF"
    make_flexible(scene)
    camera.scfpf.samples = 4
    scene.render.use_motion_blur = True
    camera.data.dof.use_dof, camera.data.dof.focus_distance, camera.data.dof.aperture_fstop = True, 6.0, 0.1
    stereo = camera.data.stereo
    stereo.convergence_mode, stereo.pivot = "PARALLEL", "CENTER"
    bpy.context.view_layer.use_pass_vector = True
    aside = np.array(camera.matrix_world.normalized())[:3, 0] * stereo.interocular_distance / 2

    def at(offset):
        for frame in (1, 5):
            camera.location = np.array((0.4, -1, 0.3)) + offset + (0.5 * (frame - 1), 0, 0)
            camera.keyframe_insert("location", frame=frame)
        scene.frame_set(3)

    at(0.0)
    found = f12_views(scene)
    scene.render.use_multiview = False
    for view, side in zip(VIEWS, (-1.0, 1.0), strict=True):
        at(side * aside)
        for name, values in f12(scene).items():
            assert np.allclose(found[view][name], values, atol=2e-3), (view, name)


def test_individual_views_have_their_own_cameras(stereo_scene):
    """The suffix names the camera: one flexible, one ordinary, each as it is rendered alone."""
    scene = stereo_scene
    left, right = scene.camera, scene.camera.copy()
    left.name, right.name = "Camera_L", "Camera_R"
    right.location.x += 2.0
    scene.collection.objects.link(right)
    make_flexible(scene)
    scene.render.engine, scene.render.views_format = "SCFPF", "MULTIVIEW"
    found = f12_views(scene)
    scene.render.use_multiview = False
    for view, camera in zip(VIEWS, (left, right), strict=True):
        scene.camera = camera
        alone = f12(scene)
        assert all(np.array_equal(found[view][name], alone[name]) for name in (POSITION, COMBINED))
        assert np.ptp(alone[POSITION]) > 1.0


def test_a_view_that_fails_leaves_no_file(stereo_scene, tmp_path):
    """The second view's camera has no volume: a message, no crash, no file."""
    scene = stereo_scene
    left, right = scene.camera, scene.camera.copy()
    left.name, right.name = "Camera_L", "Camera_R"
    scene.collection.objects.link(right)
    right.scfpf.enabled = True
    scene.render.engine, scene.render.views_format = "SCFPF", "MULTIVIEW"
    with pytest.raises(RuntimeError, match="'Camera_R' has no control surface:"):
        bpy.ops.render.render(write_still=True)
    assert not list(tmp_path.iterdir())


def test_render_button_says_that_it_makes_one_view(stereo_scene, capfd):
    """The image is that of the camera between the eyes, and a warning names F12."""
    scene = stereo_scene
    make_flexible(scene)
    alike = button()
    assert "press F12 with Flexible Projection for all views" in capfd.readouterr().out
    scene.render.use_multiview = False
    assert np.array_equal(button(), alike)
    assert "all views" not in capfd.readouterr().out


@pytest.mark.usefixtures("built_groups")
def test_rig_gives_every_view_the_same_and_says_so(stereo_scene, addon, capfd):
    """Cycles renders the camera between the eyes twice, rather than past the rig's screen."""
    scene = stereo_scene
    make_flexible(scene)
    assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
    rig = addon("cycles.rig_data").rig_of(scene)
    cautions = addon("cycles.cautions").cautions
    assert any("renders all views alike" in text for text in cautions(scene, bpy.context.view_layer, rig))
    both = cycles_positions(scene)
    assert "Flexible Projection: warning: The Cycles rig renders all views alike" in capfd.readouterr().err
    scene.render.use_multiview = False
    alone = f12(scene)[POSITION]
    assert np.ptp(alone) > 1.0
    assert all(np.array_equal(both[view], alone) for view in VIEWS)


@pytest.mark.usefixtures("built_groups")
def test_rig_and_views_with_cameras_of_their_own_are_refused(stereo_scene):
    scene = stereo_scene
    make_flexible(scene)
    assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
    scene.render.engine, scene.render.views_format = "SCFPF", "MULTIVIEW"
    with pytest.raises(RuntimeError, match="press Remove Cycles Setup"):
        bpy.ops.render.render()
