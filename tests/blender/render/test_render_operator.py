# SPDX-License-Identifier: GPL-3.0-or-later
"""Render through the operator: the image, its size, bad input, cancellation, undo, files."""

import threading
import weakref

import bpy
import numpy as np
import pytest

IMAGE = "SCFPF Render"


@pytest.fixture
def camera():
    """A small scene with a light and a flexible camera that renders quickly."""
    bpy.ops.mesh.primitive_cube_add()
    bpy.ops.object.light_add(type="SUN", rotation=(0.4, 0.3, 0))
    bpy.context.object.data.energy = 3
    render = bpy.context.scene.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 64, 36, 100
    bpy.ops.scfpf.camera_add()
    camera = bpy.context.object
    camera.scfpf.samples = 1
    return camera


def pixels():
    image = bpy.data.images[IMAGE]
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    return values.reshape(image.size[1], image.size[0], 4)


def render(**options):
    assert bpy.ops.scfpf.render(**options) == {"FINISHED"}
    return pixels()


def make_slow(camera):
    """Set a camera so that a render takes many times as long as any test waits."""
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 2048
    camera.scfpf.samples = 64


# The picture


def test_image_shows_the_scene_and_the_report_is_stored(camera):
    bpy.context.scene.render.film_transparent = True
    picture = render()
    assert picture.shape == (36, 64, 4)
    assert picture[18, 32, 3] == 1 and picture[0, 0, 3] == 0
    assert picture[18, 32, :3].max() > 0.01
    assert "64×36" in camera.scfpf.report


def test_film_is_opaque_unless_transparent(camera):
    assert (render()[..., 3] == 1).all()


@pytest.mark.parametrize(
    ("resolution", "percentage", "size"),
    [((64, 36), 50, (32, 18)), ((33, 9), 50, (16, 4)), ((4, 4), 1, (1, 1))],
)
def test_size_is_that_of_blenders_own_render(camera, resolution, percentage, size):
    settings = bpy.context.scene.render
    settings.resolution_x, settings.resolution_y = resolution
    settings.resolution_percentage = percentage
    picture = render()
    assert picture.shape[1::-1] == size


def test_pixel_aspect_counts_in_the_aspect(addon, camera):
    settings = bpy.context.scene.render
    settings.pixel_aspect_x, settings.pixel_aspect_y = 2, 1
    sizes = addon("bridge.render.image_size")
    assert sizes.image_aspect(bpy.context.scene) == pytest.approx(2 * 64 / 36)
    assert addon("bridge.render.render_inputs").prepare(
        bpy.context.scene, bpy.context.view_layer, camera
    ).projection.aspect == pytest.approx(2 * 64 / 36)


def test_second_render_updates_the_same_image(camera):
    first = render()
    image = bpy.data.images[IMAGE]
    camera.location.x += 1
    second = render()
    assert [i for i in bpy.data.images if i.name.startswith(IMAGE)] == [image]
    assert not np.array_equal(first, second)


def test_image_follows_edit_mode(camera):
    bpy.context.view_layer.objects.active = bpy.data.objects["Cube"]
    before = render()
    bpy.ops.object.mode_set(mode="EDIT")
    bpy.ops.mesh.select_all(action="SELECT")
    bpy.ops.transform.resize(value=(0.3, 0.3, 0.3))
    after = render()
    assert bpy.context.mode == "EDIT_MESH"
    assert not np.array_equal(before, after)


def test_image_goes_to_an_open_image_editor_but_not_to_a_pinned_one(camera):
    screen = bpy.context.window_manager.windows[0].screen
    kinds = ("DOPESHEET_EDITOR", "OUTLINER")
    areas = [next(area for area in screen.areas if area.type == kind) for kind in kinds]
    for area in areas:
        area.ui_type = "IMAGE_EDITOR"
    areas[0].spaces.active.use_image_pin = True
    render()
    assert areas[0].spaces.active.image is None
    assert areas[1].spaces.active.image == bpy.data.images[IMAGE]
    for area, kind in zip(areas, ("DOPESHEET", "OUTLINER"), strict=True):
        area.ui_type = kind


def test_show_without_an_image_or_a_window_says_why(camera):
    with pytest.raises(RuntimeError, match="no picture yet"):
        bpy.ops.scfpf.result_show()
    render()
    with pytest.raises(RuntimeError, match="in the background"):
        bpy.ops.scfpf.result_show()


# Which camera, which scene


def test_camera_is_the_named_one_else_the_scenes_else_the_active_one(camera):
    through_first = render()
    bpy.ops.scfpf.camera_add()
    second = bpy.context.object
    second.scfpf.samples = 1
    second.location.x += 2
    assert bpy.context.scene.camera == camera
    assert np.array_equal(render(), through_first)
    through_second = render(camera=second.name)
    assert not np.array_equal(through_second, through_first)
    bpy.ops.object.camera_add()
    bpy.context.scene.camera = bpy.context.object
    bpy.context.view_layer.objects.active = second
    assert np.array_equal(render(), through_second)


def test_two_scenes_render_their_own(camera):
    one = bpy.context.scene
    first = render()
    two = bpy.data.scenes.new("Two")
    two.render.resolution_x, two.render.resolution_y = 20, 10
    window = bpy.context.window_manager.windows[0]
    with bpy.context.temp_override(window=window):
        window.scene = two
        with pytest.raises(RuntimeError, match="no flexible camera"):
            bpy.ops.scfpf.render()
        with pytest.raises(RuntimeError, match="is in the scene 'Scene', not in 'Two': link it"):
            bpy.ops.scfpf.render(camera=camera.name)
        bpy.ops.mesh.primitive_ico_sphere_add()
        bpy.ops.scfpf.camera_add()
        assert render().shape[:2] == (10, 20)
        window.scene = one
        assert np.array_equal(render(), first)


# Bad input: one clear error, and the old picture is as it was


def no_surfaces(camera):
    camera.scfpf.surfaces.clear()


def one_surface(camera):
    bpy.ops.scfpf.surface_remove()


def deleted_surface(camera):
    bpy.ops.scfpf.surface_select(index=0)
    bpy.ops.object.delete()


def removed_surface(camera):
    bpy.data.objects.remove(camera.scfpf.surfaces[0].object)


def wrong_type(camera):
    bpy.ops.object.light_add()
    camera.scfpf.surfaces[0].object = bpy.context.object


def mesh_without_uv_map(camera):
    bpy.ops.mesh.primitive_monkey_add(calc_uvs=False)
    camera.scfpf.surfaces[0].object = bpy.context.object


def zero_size_surface(camera):
    camera.scfpf.surfaces[1].object.scale = (0, 0, 0)


def zero_size_camera(camera):
    camera.scale = (0, 0, 0)


def infinite_place(camera):
    camera.scfpf.surfaces[1].object.location.x = float("inf")


def not_a_number(camera):
    camera.rotation_euler.x = float("nan")


def empty_scene(camera):
    bpy.data.objects.remove(bpy.data.objects["Cube"])


def hidden_scene(camera):
    bpy.data.objects["Cube"].hide_render = True


def absurd_size(camera):
    bpy.context.scene.render.resolution_x = bpy.context.scene.render.resolution_y = 65536


def empty_range(camera):
    camera.scfpf.u_range = (0.5, 0.5)


def ordinary_camera(camera):
    camera.scfpf.enabled = False


USER_ERRORS = {
    no_surfaces: "needs at least two",
    one_surface: "needs at least two",
    deleted_surface: "deleted",
    removed_surface: "empty",
    wrong_type: "neither a mesh",
    mesh_without_uv_map: "UV map",
    zero_size_surface: "no size",
    zero_size_camera: "no size",
    infinite_place: "not finite",
    not_a_number: "not finite",
    empty_scene: "nothing to render",
    hidden_scene: "nothing to render",
    absurd_size: "GB of memory",
    empty_range: "range",
    ordinary_camera: "flexible camera",
}


@pytest.mark.parametrize("spoil", USER_ERRORS, ids=lambda spoil: spoil.__name__)
def test_bad_input_is_one_clear_error_and_nothing_is_lost(camera, capfd, spoil):
    old = render()
    report = camera.scfpf.report
    spoil(camera)
    with pytest.raises(RuntimeError, match=USER_ERRORS[spoil]) as caught:
        bpy.ops.scfpf.render(camera=camera.name)
    message = str(caught.value).strip()
    assert message.startswith("Error: ") and message.count("\n") == 0
    assert "Traceback" not in "".join(capfd.readouterr())
    assert np.array_equal(pixels(), old)
    assert camera.scfpf.report == report


def test_no_camera_and_unknown_camera_give_a_remedy():
    with pytest.raises(RuntimeError, match="Add > Camera > Flexible Camera"):
        bpy.ops.scfpf.render()
    with pytest.raises(RuntimeError, match='no object "Nobody"'):
        bpy.ops.scfpf.render(camera="Nobody")
    bpy.ops.mesh.primitive_cube_add()
    with pytest.raises(RuntimeError, match="not a flexible camera"):
        bpy.ops.scfpf.render(camera="Cube")
    assert IMAGE not in bpy.data.images


def test_warnings_of_the_reader_are_reported(camera, capfd):
    bpy.ops.mesh.primitive_cube_add()
    bpy.context.object.location.x = float("nan")
    render(camera=camera.name)
    assert "not finite" in "".join(capfd.readouterr())


def test_failure_of_the_thread_is_raised_where_the_result_is_asked_for(addon, camera, monkeypatch):
    job = addon("bridge.render.render_job")
    old = render()

    def fail(*_arguments, **_options):
        raise MemoryError

    monkeypatch.setattr(addon("bridge.render.scene_preparation"), "render_frame", fail)
    with pytest.raises(RuntimeError, match="not enough memory"):
        bpy.ops.scfpf.render()
    assert np.array_equal(pixels(), old)
    assert job.current() is None


# Cancelling


def test_cancelled_job_stops_its_thread_and_gives_no_image(addon, camera):
    module = addon("bridge.render.render_job")
    make_slow(camera)
    inputs = addon("bridge.render.render_inputs").prepare(bpy.context.scene, bpy.context.view_layer, camera)
    threads = threading.active_count()
    job = module.start(inputs)
    assert module.current() is job and job.running
    with pytest.raises(addon("projection.user_error").UserError, match="already running"):
        module.start(inputs)
    with pytest.raises(RuntimeError, match="already running"):
        bpy.ops.scfpf.render()
    bpy.ops.scfpf.render_cancel()
    assert job.cancelled
    assert job.result() is None
    assert job.progress < 1
    assert not job.running and module.current() is None
    assert threading.active_count() == threads
    assert IMAGE not in bpy.data.images


def test_tiles_of_a_running_job_add_up_to_the_image(addon, camera):
    module = addon("bridge.render.render_job")
    inputs = addon("bridge.render.render_inputs").prepare(bpy.context.scene, bpy.context.view_layer, camera)
    job = module.RenderJob(inputs, with_tiles=True)
    assert job.new_tiles() is None
    job.start()
    frame = job.result()
    assert np.array_equal(job.new_tiles(), frame.pixels)
    assert job.new_tiles() is None
    assert job.progress == 1


def test_a_coarse_image_of_the_whole_comes_first(addon, camera, monkeypatch):
    module = addon("bridge.render.render_job")
    job = module.RenderJob(
        addon("bridge.render.render_inputs").prepare(bpy.context.scene, bpy.context.view_layer, camera),
        with_tiles=True,
    )
    shown = []
    preparation = addon("bridge.render.scene_preparation")
    monkeypatch.setattr(preparation, "render_frame", lambda *_given, **_named: shown.append(job.new_tiles()))
    assert job.building
    job.start()
    job.wait()
    assert not job.building
    coarse = shown[0].copy()
    assert np.array_equal(coarse[:, ::8], coarse[:, 7::8]) and np.ptp(coarse[..., :3]) > 0.1
    monkeypatch.undo()
    difference = np.abs(coarse - render()).max(axis=2)
    assert np.median(difference) < 0.05


def test_invoked_without_windows_it_runs_straight_through(camera):
    assert bpy.ops.scfpf.render("INVOKE_DEFAULT") == {"FINISHED"}
    assert pixels().shape == (36, 64, 4)


def test_disabling_the_extension_ends_a_render(addon, camera):
    module = addon("bridge.render.render_job")
    make_slow(camera)
    job = module.start(
        addon("bridge.render.render_inputs").prepare(bpy.context.scene, bpy.context.view_layer, camera)
    )
    operators = addon("operators.image.render")
    operators.unregister()
    try:
        assert not job.running and job.cancelled
    finally:
        operators.register()


def test_inputs_hold_no_blender_data(addon, camera):
    module = addon("bridge.render.render_job")
    inputs = addon("bridge.render.render_inputs").prepare(bpy.context.scene, bpy.context.view_layer, camera)
    expected = render()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    job = module.RenderJob(inputs)
    job.start()
    assert np.array_equal(job.result().pixels, expected)


def test_reading_leaves_the_scene_as_it_was(addon, camera):
    scene = bpy.context.scene
    objects, meshes, engine = set(bpy.data.objects), set(bpy.data.meshes), scene.render.engine
    selected, active = list(bpy.context.selected_objects), bpy.context.object
    render()
    assert (set(bpy.data.objects), set(bpy.data.meshes), scene.render.engine) == (objects, meshes, engine)
    assert (list(bpy.context.selected_objects), bpy.context.object) == (selected, active)


# Undo and files


def test_undo_and_redo_of_a_render(camera):
    with bpy.context.temp_override(window=bpy.context.window_manager.windows[0]):
        bpy.ops.ed.undo_push(message="before")
        first = render()
        bpy.context.scene.camera.location.x += 1
        bpy.ops.ed.undo_push(message="moved")
        second = render()
        bpy.ops.ed.undo()
        bpy.ops.ed.undo()
        assert np.array_equal(pixels(), first), "undoing the move and the second render has lost the first"
        bpy.data.images[IMAGE].reload()
        assert np.array_equal(pixels(), first), "what is shown is not what a saved file would hold"
        bpy.ops.ed.undo()
        assert IMAGE not in bpy.data.images
        for _ in range(3):
            bpy.ops.ed.redo()
        assert np.array_equal(pixels(), second)


def test_image_survives_save_and_reload_and_renders_the_same(camera, tmp_path):
    bpy.context.scene.render.film_transparent = True
    before = render()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "picture.blend"))
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "picture.blend"))
    assert np.array_equal(pixels(), before)
    assert "64×36" in bpy.context.scene.camera.scfpf.report
    assert np.allclose(render(), before, atol=1e-6)


def test_the_film_is_released_before_the_image_is_packed(addon, camera, monkeypatch):
    """Each takes 4 GB for an image of 16384 × 16384."""
    operator, held = addon("operators.image.render"), []
    show, keep = operator.show_progress, operator.keep_result

    def shown(pixels):
        held.append(weakref.ref(pixels))
        return show(pixels)

    def kept():
        assert len(held) == 1 and held[0]() is None
        return keep()

    monkeypatch.setattr(operator, "show_progress", shown)
    monkeypatch.setattr(operator, "keep_result", kept)
    assert bpy.ops.scfpf.render() == {"FINISHED"}
    assert held and bpy.data.images["SCFPF Render"].packed_file


def test_an_image_that_no_file_can_hold_is_shown_with_a_warning(addon, camera, monkeypatch, capfd):
    packing = addon("bridge.blender.packing")
    before = render()
    assert "Save As" not in capfd.readouterr().out
    monkeypatch.setattr(packing, "LARGEST_FILE", packing.BESIDES_PIXELS)
    assert np.array_equal(render(), before)
    assert not bpy.data.images[IMAGE].packed_file
    assert "'SCFPF Render' has more than the 2 GB" in capfd.readouterr().out


def test_the_image_in_the_making_is_the_film_itself(addon, camera):
    job = addon("bridge.render.render_job")
    running = job.start(
        addon("bridge.render.render_inputs").prepare(bpy.context.scene, bpy.context.view_layer, camera),
        with_tiles=True,
    )
    frame = running.result()
    assert running.new_tiles() is frame.pixels
    job.stop()
