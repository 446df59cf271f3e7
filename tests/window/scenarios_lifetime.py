# SPDX-License-Identifier: GPL-3.0-or-later
"""Cameras hidden or deleted, the extension disabled, files saved and opened; edits and Esc in mid-render."""

import pathlib
import tempfile
import time

import bpy
import numpy as np
from driver import DRAW, IMAGE, PATIENCE, build_scene, set_slow, surfaces, volume
from scenarios_preview import SETTLE, artist_area, preview_areas, source_of, toggle, until_shown


def module():
    """The extension's name, as the preferences list it."""
    return next(name for name in bpy.context.preferences.addons.keys() if name.endswith(".scfpf"))


def activate(obj):
    for other in bpy.context.selected_objects:
        other.select_set(False)
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj


def green(driver):
    return driver.surface_lines().sum()


def until(condition):
    """Generator: wait until a condition holds."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "it does not come about"
        yield DRAW


def camera_is_hidden_and_deleted(driver):
    """H, Alt-H, X and undo: volume and surfaces vanish and come back; a deleted camera's preview closes."""
    build_scene()
    driver.add_camera("angular_fisheye")
    driver.look("FRONT", room=2.0)
    yield from until(lambda: green(driver) > 200)
    camera = bpy.context.scene.camera
    names = [slot.object.name for slot in camera.scfpf.surfaces]
    shown = green(driver)
    driver.shot("shown")
    activate(camera)
    driver.key("H")
    yield from until(lambda: green(driver) == 0)
    driver.shot("hidden")
    assert bpy.context.scene.camera.hide_get()
    assert not any(bpy.data.objects[name].visible_get() for name in names)
    driver.key("H", alt=True)
    yield from until(lambda: green(driver) > shown // 2)
    driver.shot("again")
    assert all(bpy.data.objects[name].visible_get() for name in names)
    activate(bpy.context.scene.camera)
    with driver.override():
        bpy.ops.ed.undo_push(message="before")
    toggle(driver)
    yield from until_shown(driver, 1)
    activate(bpy.context.scene.camera)
    driver.key("H")
    yield SETTLE
    driver.shot("preview-of-hidden")
    assert len(preview_areas(driver)) == 1
    driver.key("H", alt=True)
    yield SETTLE
    activate(bpy.context.scene.camera)
    yield DRAW
    with bpy.context.temp_override(window=driver.window, area=artist_area(driver)):
        bpy.ops.object.delete("INVOKE_DEFAULT", True, confirm=False)
    yield from until_shown(driver, 0)
    driver.shot("deleted")
    left = [obj.name for obj in bpy.context.scene.objects if "Flexible" in obj.name]
    assert not left, (left, bpy.data.user_map(subset={bpy.data.objects[left[0]]}))
    assert not [name for name in names if name in bpy.data.objects]
    yield from until(lambda: green(driver) == 0)
    with driver.override():
        bpy.ops.ed.undo()
    yield from until_shown(driver, 1)
    driver.shot("undone")
    assert all(bpy.data.objects[name].visible_get() for name in names)
    with driver.override():
        bpy.ops.ed.redo()
    yield from until_shown(driver, 0)
    assert not [name for name in names if name in bpy.data.objects]


def disabled_and_enabled(at_once=False):
    """Generator: disable the extension, let Blender go on, enable it again, or at once while a job runs."""
    name = module()
    assert bpy.ops.preferences.addon_disable(module=name) == {"FINISHED"}
    yield SETTLE
    if at_once:
        assert bpy.app.is_job_running("RENDER") and hasattr(bpy.types.Object, "scfpf")
    else:
        yield from until(lambda: not bpy.app.is_job_running("RENDER"))
        yield DRAW
        assert not hasattr(bpy.types.Object, "scfpf")
    assert bpy.ops.preferences.addon_enable(module=name) == {"FINISHED"}
    yield SETTLE
    assert hasattr(bpy.types.Object, "scfpf")


def disabled_during_f12(driver):
    """With preview and rig on, by SCFPF and by Cycles, early and late: F12 ends, and works afterwards."""
    build_scene()
    driver.add_camera("angular_fisheye")
    camera, scene = bpy.context.scene.camera, bpy.context.scene
    activate(camera)
    with driver.override():
        bpy.ops.scfpf.cycles_rig()
    activate(camera)
    toggle(driver)
    yield from until_shown(driver, 1)
    scene.cycles.use_adaptive_sampling = False
    # How long a render takes shall not depend on the number of cores.
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    bpy.context.preferences.view.render_display_type = "NONE"
    for engine, wait in (("SCFPF", 0.0), ("SCFPF", 1.0), ("CYCLES", 0.0), ("CYCLES", 0.3), ("CYCLES", 2.0)):
        scene.render.engine = engine
        scene.render.resolution_percentage = 50 if engine == "SCFPF" else 10
        scene.cycles.samples, camera.scfpf.samples = 192 if wait == 0.3 else 64, 24
        bpy.ops.render.render("INVOKE_DEFAULT")
        yield wait
        yield from disabled_and_enabled(at_once=wait == 0.3)
        yield from until(lambda: not bpy.app.is_job_running("RENDER"))
        driver.shot(f"{engine}-{wait}")
        scene.render.resolution_percentage = 2
        scene.cycles.samples = camera.scfpf.samples = 1
        bpy.ops.render.render("INVOKE_DEFAULT")
        yield from until(lambda: not bpy.app.is_job_running("RENDER"))
        yield DRAW


def disabled_at_work(driver):
    """During the Render operator, in a viewport in Rendered shading, and while an animation plays."""
    build_scene()
    driver.add_camera("angular_fisheye")
    bpy.context.scene.camera.scfpf.samples = 1024
    bpy.context.scene.render.resolution_percentage = 100
    driver.start_render()
    yield DRAW
    assert bpy.ops.scfpf.render_cancel.poll()
    yield from disabled_and_enabled()
    assert not bpy.ops.scfpf.render_cancel.poll()
    bpy.context.scene.camera.scfpf.samples = 4
    bpy.context.scene.render.engine = "SCFPF"
    space = driver.area("VIEW_3D").spaces.active
    space.shading.type = "RENDERED"
    space.region_3d.view_perspective = "CAMERA"
    yield DRAW
    yield from disabled_and_enabled()
    space.shading.type = "SOLID"
    activate(bpy.context.scene.camera)
    toggle(driver)
    yield from until_shown(driver, 1)
    with driver.override():
        bpy.ops.screen.animation_play()
    yield DRAW
    yield from disabled_and_enabled()
    with driver.override():
        bpy.ops.screen.animation_cancel()
    yield DRAW
    driver.shot("end")
    assert source_of(bpy.context.scene.camera) is not None


def saves(driver):
    """Save, start afresh, open: the same volume, the same picture, the same lines, the same render."""
    build_scene(percentage=25)
    driver.add_camera("cylindrical_panorama")
    for kind in ("SPHERE", "NURBS"):
        with driver.override():
            bpy.ops.scfpf.surface_add("INVOKE_DEFAULT", True, kind=kind)
    driver.look("FRONT")
    driver.start_render()
    yield from driver.finished()
    camera = bpy.context.scene.camera
    before, picture, lines = volume(camera), driver.pixels(), driver.surface_lines()
    assert len(surfaces(camera)) == 4 and lines.sum() > 1000
    driver.shot("before")
    with tempfile.TemporaryDirectory() as folder:
        path = str(pathlib.Path(folder, "saved.blend"))
        with driver.override():
            assert bpy.ops.wm.save_as_mainfile(filepath=path) == {"FINISHED"}
            bpy.ops.wm.read_homefile()
        yield DRAW
        assert IMAGE not in bpy.data.images and not bpy.context.scene.camera.scfpf.enabled
        driver.shot("fresh-file")
        with driver.override():
            bpy.ops.wm.open_mainfile(filepath=path)
        yield 2 * DRAW
    driver.shot("opened")
    camera = bpy.context.scene.camera
    assert volume(camera) == before
    assert np.array_equal(driver.pixels(), picture), "the picture did not outlive the file"
    changed = (driver.surface_lines() ^ lines).sum()
    assert changed < 0.02 * lines.sum(), f"{changed} of {lines.sum()} green pixels are others"
    driver.start_render()
    yield from driver.finished()
    assert np.array_equal(driver.pixels(), picture), "the file opened renders otherwise"


def cancels(driver):
    """Esc in mid-render leaves the old picture as it was, and Blender answers meanwhile."""
    build_scene()
    driver.open_image_editor()
    driver.add_camera()
    driver.start_render()
    yield from driver.finished()
    before = driver.pixels()
    set_slow()
    driver.start_render()
    yield from driver.tiles_shown()
    driver.shot("tiles")
    assert bpy.ops.scfpf.render_cancel.poll(), "the slow render has ended before it could be cancelled"
    frame = bpy.context.scene.frame_current
    driver.key("RIGHT_ARROW")
    yield 0.5
    assert bpy.context.scene.frame_current == frame + 1, "Blender does not answer during a render"
    driver.key("ESC")
    yield from driver.finished()
    driver.shot("cancelled")
    assert np.array_equal(driver.pixels(), before)


def edits_during_render(driver):
    """Undo, a renamed camera and a deleted one while a render runs."""
    build_scene()
    for edit in (
        lambda: bpy.ops.ed.undo(),
        lambda: setattr(bpy.context.scene.camera, "name", "Renamed"),
        lambda: bpy.data.objects.remove(bpy.context.scene.camera),
    ):
        driver.add_camera()
        set_slow()
        driver.start_render()
        yield 0.5
        with driver.override():
            edit()
        yield 0.5
        assert bpy.ops.scfpf.render_cancel.poll(), "the edit has ended the render"
        driver.key("ESC")
        yield from driver.finished()
        assert IMAGE not in bpy.data.images
    for edit in (
        lambda: setattr(bpy.context.scene.camera, "name", "Renamed Again"),
        lambda: bpy.data.objects.remove(bpy.context.scene.camera),
    ):
        driver.add_camera()
        bpy.context.scene.render.resolution_percentage = 25
        driver.start_render()
        with driver.override():
            edit()
        yield from driver.finished()
        assert bpy.data.images[IMAGE].size[0] == 480
        bpy.data.images.remove(bpy.data.images[IMAGE])
        camera = bpy.context.scene.camera
        assert camera is None or camera.scfpf.report, "the report did not find the renamed camera"


def window_closed_during_render(driver):
    """Closing the window that a render was started in ends it; the old picture stays."""
    build_scene()
    driver.open_image_editor()
    driver.add_camera()
    driver.start_render()
    yield from driver.finished()
    before = driver.pixels()
    set_slow()
    with driver.override():
        bpy.ops.wm.window_new_main()
    yield DRAW
    window = bpy.context.window_manager.windows[-1]
    with bpy.context.temp_override(window=window):
        assert bpy.ops.scfpf.render("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    yield from driver.tiles_shown()
    with bpy.context.temp_override(window=window):
        bpy.ops.wm.window_close()
    yield 0.5
    assert not bpy.ops.scfpf.render_cancel.poll(), "the render goes on without its window"
    assert np.array_equal(driver.pixels(), before)


def file_opened_during_render(driver):
    """Opening another file ends the render; nothing of it reaches the new file."""
    build_scene()
    driver.open_image_editor()
    driver.add_camera()
    set_slow()
    driver.start_render()
    yield from driver.tiles_shown()
    with driver.override():
        bpy.ops.wm.read_homefile()
    yield 1.0
    assert not bpy.ops.scfpf.render_cancel.poll(), "the render goes on in another file"
    assert IMAGE not in bpy.data.images


SCENARIOS = (
    camera_is_hidden_and_deleted,
    disabled_during_f12,
    disabled_at_work,
    saves,
    cancels,
    edits_during_render,
    window_closed_during_render,
    file_opened_during_render,
)
