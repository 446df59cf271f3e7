# SPDX-License-Identifier: GPL-3.0-or-later
"""What may happen while a render runs: Esc, edits, a closed window, another file."""

import bpy
import numpy as np
from driver import DRAW, IMAGE, build_scene, set_slow


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


SCENARIOS = (cancels, edits_during_render, window_closed_during_render, file_opened_during_render)
