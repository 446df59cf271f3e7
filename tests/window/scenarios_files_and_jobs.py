# SPDX-License-Identifier: GPL-3.0-or-later
"""A file saved and opened again; Esc, edits, a closed window or another file in mid-render."""

import pathlib
import tempfile

import bpy
import numpy as np
from driver import DRAW, IMAGE, build_scene, set_slow, surfaces, volume


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


SCENARIOS = (saves, cancels, edits_during_render, window_closed_during_render, file_opened_during_render)
