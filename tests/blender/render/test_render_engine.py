# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine SCFPF through Blender's own render operator: its image is the Render button's."""

import glob
import os
import subprocess

import bpy
import numpy as np
import pytest
from engine_images import button, f12, passes
from interpreters import after, interpreter

COMBINED = "ViewLayer.Combined"


def apply(preset):
    bpy.context.view_layer.objects.active = bpy.context.scene.camera
    assert bpy.ops.scfpf.preset_apply(preset=preset) == {"FINISHED"}


# The picture


@pytest.mark.parametrize(
    ("preset", "transparent"),
    [
        ("perspective", False),
        ("cylindrical_panorama", True),
        ("nonlinear_twist", False),
        ("around_the_car", True),
    ],
)
def test_image_is_the_render_buttons(engine_scene, preset, transparent):
    apply(preset)
    engine_scene.render.film_transparent = transparent
    picture = f12(engine_scene)[COMBINED]
    assert picture.shape == (36, 64, 4) and np.ptp(picture[..., :3]) > 0.01
    assert (picture[..., 3].min() == 1) or transparent
    assert np.array_equal(picture, button())


def test_percentage_and_pixel_aspect_count(engine_scene):
    engine_scene.render.resolution_percentage, engine_scene.render.pixel_aspect_x = 50, 1.5
    picture = f12(engine_scene)[COMBINED]
    assert picture.shape == (18, 32, 4)
    assert np.array_equal(picture, button())


@pytest.mark.parametrize("engine", ["CYCLES", "BLENDER_WORKBENCH", "SCFPF"])
def test_button_works_with_any_engine_and_keeps_it(engine_scene, engine):
    expected = f12(engine_scene)[COMBINED]
    engine_scene.render.engine = engine
    assert np.array_equal(button(), expected)
    assert engine_scene.render.engine == engine


def test_image_does_not_depend_on_threads(engine_scene):
    apply("nonlinear_twist")
    expected = f12(engine_scene)[COMBINED]
    engine_scene.render.threads_mode, engine_scene.render.threads = "FIXED", 3
    assert np.array_equal(f12(engine_scene)[COMBINED], expected)


# Borders


BORDERS = [(0.26, 0.77, 0.13, 0.61), (0.1, 0.3, 0.7, 0.95), (0.0, 1.0, 0.4, 0.5), (0.9, 1.0, 0.0, 1.0)]


def set_border(scene, left, right, bottom, top, crop):
    render = scene.render
    render.use_border, render.use_crop_to_border = True, crop
    render.border_min_x, render.border_max_x = left, right
    render.border_min_y, render.border_max_y = bottom, top


@pytest.mark.parametrize("preset", ["perspective", "nonlinear_twist"])
@pytest.mark.parametrize("border", BORDERS)
def test_border_is_a_part_of_the_whole_image(engine_scene, preset, border):
    apply(preset)
    whole = f12(engine_scene)[COMBINED]
    left, right, bottom, top = border
    columns = slice(int(np.float32(left) * 64), int(np.float32(right) * 64))
    rows = slice(int(np.float32(bottom) * 36), int(np.float32(top) * 36))
    set_border(engine_scene, *border, crop=True)
    assert np.array_equal(f12(engine_scene)[COMBINED], whole[rows, columns])
    set_border(engine_scene, *border, crop=False)
    expected = np.zeros_like(whole)
    expected[rows, columns] = whole[rows, columns]
    assert np.array_equal(f12(engine_scene)[COMBINED], expected)


RENDER_PART = """
import sys, bpy
repository, blend, out, first, threads = sys.argv[-5:]
bpy.context.preferences.extensions.repos.new(
    name="checkout", module="checkout", custom_directory=repository, remote_url="")
assert bpy.ops.preferences.addon_enable(module="bl_ext.checkout.scfpf") == {"FINISHED"}
bpy.ops.wm.open_mainfile(filepath=blend)
scene = bpy.context.scene
render = scene.render
render.threads_mode, render.threads = "FIXED", int(threads)
render.use_crop_to_border = True
for part in (int(first), 3 - int(first)):
    column, row = part % 2, part // 2
    render.use_border = True
    render.border_min_x, render.border_max_x = 0.5 * column, 0.5 + 0.5 * column
    render.border_min_y, render.border_max_y = 0.5 * row, 0.5 + 0.5 * row
    render.filepath = out + "part" + str(part)
    scene.frame_set(1)
    bpy.ops.render.render(write_still=True)
    # Its share of the animation: one frame.
    render.use_border = False
    scene.frame_start = scene.frame_end = part + 1
    render.filepath = out + "share_"
    bpy.ops.render.render(animation=True)
"""


def test_processes_make_the_parts_of_one_image(engine_scene, tmp_path, extension):
    """As on a farm: a frame in four tiles, an animation of four frames, with one and two threads.

    Adaptive sampling, a wide filter and motion blur are on, which reach beyond a tile.
    """
    apply("nonlinear_twist")
    sampling = engine_scene.scfpf_sampling
    sampling.use_adaptive, sampling.adaptive_least, sampling.adaptive_threshold = True, 2, 0.03
    sampling.pixel_filter, engine_scene.render.filter_size = "GAUSSIAN", 4.0
    engine_scene.camera.scfpf.samples, sampling.motion_steps = 8, 2
    engine_scene.render.use_motion_blur = True
    surface = engine_scene.camera.scfpf.surfaces[1].object
    for frame, angle in ((1, 0.0), (4, 0.5)):
        surface.rotation_euler.z = angle
        surface.keyframe_insert("rotation_euler", frame=frame)
    engine_scene.frame_set(1)
    view_layer = engine_scene.view_layers[0]
    view_layer.use_pass_z = view_layer.use_pass_normal = True
    view_layer.scfpf.use_pass_diffuse = view_layer.use_pass_shadow = True
    engine_scene.render.resolution_x, engine_scene.render.resolution_y = 48, 32
    whole = f12(engine_scene)
    blend = str(tmp_path / "farm.blend")
    bpy.ops.wm.save_as_mainfile(filepath=blend)
    repository = os.path.dirname(os.path.dirname(extension.__file__))
    script = tmp_path / "part.py"
    script.write_text(RENDER_PART)
    out = str(tmp_path / "by_")
    started = [
        subprocess.Popen(
            [*interpreter(), str(script), *after(), repository, blend, out, str(first), str(1 + first)],
            env={**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path)},
            stdout=subprocess.DEVNULL,
        )
        for first in (0, 1)
    ]
    assert [process.wait(120) for process in started] == [0, 0]
    parts = [passes(f"{out}part{part}.exr") for part in range(4)]
    names = ("Combined", "Depth", "Normal", "Diffuse", "Shadow")
    assert set(whole) == {f"ViewLayer.{name}" for name in names}
    for name, picture in whole.items():
        bottom, top = (np.concatenate([parts[i][name], parts[i + 1][name]], axis=1) for i in (0, 2))
        assert np.array_equal(np.concatenate([bottom, top]), picture), name
    engine_scene.frame_start, engine_scene.frame_end = 1, 4
    engine_scene.render.filepath = str(tmp_path / "whole_")
    assert bpy.ops.render.render(animation=True) == {"FINISHED"}
    frames = []
    for frame in range(1, 5):
        mine, its = (passes(f"{path}_{frame:04}.exr") for path in (tmp_path / "whole", f"{out}share"))
        assert set(mine) == set(its) == set(whole)
        assert all(np.array_equal(mine[name], its[name]) for name in mine), frame
        frames.append(mine[COMBINED])
    assert not np.array_equal(frames[0], frames[3])


# Layers, cameras, animation


def test_each_view_layer_has_its_own_image(engine_scene):
    second = engine_scene.view_layers.new("Second")
    hidden = bpy.data.collections.new("Hidden")
    engine_scene.collection.children.link(hidden)
    hidden.objects.link(bpy.data.objects["Cube"])
    engine_scene.collection.objects.unlink(bpy.data.objects["Cube"])
    second.layer_collection.children["Hidden"].exclude = True
    second.scfpf.use_pass_diffuse = True
    layers = f12(engine_scene)
    assert np.array_equal(layers[COMBINED], button())
    assert "ViewLayer.Diffuse" not in layers and not layers["Second.Diffuse"].any()
    assert np.ptp(layers[COMBINED]) > 0.01
    # Nothing is left in it: its background.
    assert np.ptp(layers["Second.Combined"][..., :3]) == 0 and layers["Second.Combined"].shape == (36, 64, 4)


def test_markers_change_the_camera(engine_scene, tmp_path):
    first = engine_scene.camera
    bpy.ops.scfpf.camera_add(preset="nonlinear_twist")
    second = bpy.context.object
    for frame, camera in ((1, first), (2, second)):
        engine_scene.timeline_markers.new(camera.name, frame=frame).camera = camera
    engine_scene.frame_start, engine_scene.frame_end = 1, 2
    engine_scene.render.filepath = str(tmp_path / "frame_")
    assert bpy.ops.render.render(animation=True) == {"FINISHED"}
    made = sorted(glob.glob(str(tmp_path / "frame_*.exr")))
    assert len(made) == 2
    for path, camera in zip(made, (first, second), strict=True):
        assert np.array_equal(passes(path)[COMBINED], button(camera=camera.name))


def test_animated_volume_and_scene_are_those_of_each_frame(engine_scene, tmp_path):
    apply("nonlinear_twist")
    surface = engine_scene.camera.scfpf.surfaces[1].object
    for frame, angle in ((1, 0.0), (3, 0.5)):
        surface.rotation_euler.z = angle
        surface.keyframe_insert("rotation_euler", frame=frame)
    surface.hide_set(True)
    engine_scene.frame_start, engine_scene.frame_end = 1, 3
    engine_scene.render.filepath = str(tmp_path / "frame_")
    bpy.ops.render.render(animation=True)
    made = [passes(path)[COMBINED] for path in sorted(glob.glob(str(tmp_path / "frame_*.exr")))]
    assert len(made) == 3
    for frame, picture in enumerate(made, 1):
        engine_scene.frame_set(frame)
        assert np.array_equal(picture, button())
    assert not np.array_equal(made[0], made[1]) and not np.array_equal(made[1], made[2])


def test_duplicate_with_hidden_surfaces_renders_before_anything_is_evaluated(engine_scene):
    """A script that copies a camera need not evaluate anything before a render."""
    expected = f12(engine_scene)[COMBINED]
    camera = engine_scene.camera
    parts = [camera, *(slot.object for slot in camera.scfpf.surfaces)]
    for part in parts:
        part.hide_select = False
    for each in bpy.data.objects:
        each.select_set(each in parts)
    bpy.ops.object.duplicate()
    copy = next(o for o in bpy.data.objects if o.type == "CAMERA" and o != camera)
    for slot in copy.scfpf.surfaces:
        slot.object.hide_viewport = slot.object.hide_render = True
    height = copy.location.z
    copy.location.z += 1
    engine_scene.camera = copy
    moved = f12(engine_scene)[COMBINED]
    assert not np.array_equal(moved, expected)
    copy.location.z = height
    assert np.array_equal(f12(engine_scene)[COMBINED], expected)


def test_persistent_data_builds_only_changed_scenes_again(addon, engine_scene, tmp_path):
    preparation, pipeline = (
        addon("bridge.render.scene_preparation"),
        addon("shading.lights.scene_culling"),
    )
    built = []

    class Counted(preparation.CastScene):
        def __init__(self, *arguments):
            built.append(engine_scene.frame_current)
            super().__init__(*arguments)

    apply("nonlinear_twist")
    camera, cube = engine_scene.camera, bpy.data.objects["Cube"]
    for frame, x in ((1, 0.0), (4, 0.6)):
        camera.location.x += x
        camera.keyframe_insert("location", frame=frame)
    for frame, x in ((2, 0.0), (3, 0.2)):
        cube.location.x = x
        cube.keyframe_insert("location", frame=frame)
    engine_scene.frame_start, engine_scene.frame_end = 1, 4
    made = []
    for keeps in (False, True):
        engine_scene.render.use_persistent_data = keeps
        engine_scene.render.filepath = str(tmp_path / f"{len(made)}_")
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(preparation, "CastScene", Counted)
            patch.setattr(pipeline, "CastScene", Counted)
            built.clear()
            assert bpy.ops.render.render(animation=True) == {"FINISHED"}
        made.append([passes(path)[COMBINED] for path in sorted(glob.glob(str(tmp_path / f"{len(made)}_*")))])
        # The cube moves between the second and the third frame, the camera always.
        assert built == ([1, 3] if keeps else [1, 2, 3, 4])
    assert all(np.array_equal(a, b) for a, b in zip(*made, strict=True)) and len(made[0]) == 4


@pytest.mark.parametrize("keeps", [False, True])
def test_button_builds_nothing_again_with_persistent_data(addon, engine_scene, monkeypatch, keeps):
    """The volume alone is moved, then an object, then persistent data is disabled."""
    built = []
    for module in ("bridge.render.scene_preparation", "shading.lights.scene_culling"):

        class Counted(addon(module).CastScene):
            def __init__(self, *arguments):
                built.append(len(arguments[1]))
                super().__init__(*arguments)

        monkeypatch.setattr(addon(module), "CastScene", Counted)
    engine_scene.render.use_persistent_data = keeps
    counts = []
    for thing in (engine_scene.camera, engine_scene.camera, bpy.data.objects["Cube"]):
        thing.location.x += 0.1
        picture = button()
        counts.append(len(built))
        assert np.array_equal(f12(engine_scene)[COMBINED], picture)
        del built[counts[-1] :]
    assert counts == ([1, 1, 2] if keeps else [1, 2, 3])
    engine_scene.render.use_persistent_data = False
    button()
    assert len(built) == counts[-1] + 1
    assert addon("bridge.render.render_job")._cache is None


# What Blender builds around a picture


def test_each_slot_keeps_its_image(engine_scene, tmp_path):
    engine_scene.render.film_transparent = True
    f12(engine_scene)
    result = bpy.data.images["Render Result"]
    result.save_render(str(tmp_path / "before"))
    result.render_slots.active_index = 1
    bpy.data.objects["Cube"].hide_render = True
    f12(engine_scene)
    saved = []
    for slot in (0, 1):
        result.render_slots.active_index = slot
        result.save_render(str(tmp_path / f"slot{slot}"))
        saved.append(passes(tmp_path / f"slot{slot}")[COMBINED])
    assert np.array_equal(saved[0], passes(tmp_path / "before")[COMBINED])
    assert not saved[1].any() and saved[0].any()


# Ordinary cameras


LENSES = [
    {"lens": 35.0},
    {"lens": 50.0, "shift_x": 0.1, "shift_y": -0.2, "sensor_fit": "VERTICAL"},
    {"type": "ORTHO", "ortho_scale": 5.0},
]


@pytest.mark.parametrize("lens", LENSES)
def test_ordinary_camera_gives_the_image_of_its_volume(engine_scene, lens):
    bpy.ops.object.camera_add(location=(4, -4, 3), rotation=(1.05, 0.1, 0.8))
    camera = bpy.context.object
    camera.data.clip_end = 20
    for key, value in lens.items():
        setattr(camera.data, key, value)
    engine_scene.camera = camera
    objects = set(bpy.data.objects)
    picture = f12(engine_scene)[COMBINED]
    assert set(bpy.data.objects) == objects, "rendering made or removed objects"
    assert np.ptp(picture[..., :3]) > 0.01
    bpy.context.view_layer.objects.active = camera
    assert bpy.ops.scfpf.camera_from_camera() == {"FINISHED"} and camera.scfpf.enabled
    # The volume's surfaces are stored in float32.
    assert (np.abs(f12(engine_scene)[COMBINED] - picture) > 1e-3).mean() < 2e-3


def test_engine_can_be_taken_away_and_put_back(addon, engine_scene):
    expected = f12(engine_scene)[COMBINED]
    engine = addon("bridge.render.render_engine")
    engine.unregister()
    try:
        with pytest.raises(TypeError, match="SCFPF"):
            bpy.data.scenes.new("Other").render.engine = "SCFPF"
    finally:
        engine.register()
    assert np.array_equal(f12(engine_scene)[COMBINED], expected)
