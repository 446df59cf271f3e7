# SPDX-License-Identifier: GPL-3.0-or-later
"""The place of the Render button's image by the preference Render In; F12 of engines that ignore volumes."""

import sys
import time

import bpy
from driver import DRAW, IMAGE, PATIENCE, build_scene, differing, set_slow
from scenarios_engine import ended, painted


def windows():
    return bpy.context.window_manager.windows


def areas(window):
    return [(area.type, area.x, area.y, area.width, area.height) for area in window.screen.areas]


def until(condition, what):
    """Generator: wait until a condition holds."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, what
        yield 0.1
    yield DRAW


def prepare(driver, display):
    """Generator: a scene and its camera, the panel in sight, and the preference."""
    build_scene()
    driver.add_camera()
    bpy.context.preferences.view.render_display_type = display
    yield from driver.show_sidebar()


def render_job():
    """The extension's module of the running render."""
    return next(m for name, m in sys.modules.items() if name.endswith(".render_job"))


def escape(window):
    """Press Esc in the middle of a window."""
    where = {"x": window.width // 2, "y": window.height // 2}
    window.event_simulate("MOUSEMOVE", "NOTHING", **where)
    window.event_simulate("ESC", "PRESS", **where)
    window.event_simulate("ESC", "RELEASE", **where)


def shown(window):
    """The image editor's space in a window."""
    (area,) = (area for area in window.screen.areas if area.type == "IMAGE_EDITOR")
    assert area.spaces.active.image == bpy.data.images[IMAGE]
    return area


def largest_area(driver):
    """Image Editor: the largest area gives way, Esc cancels, and then goes back to the former editor."""
    yield from prepare(driver, "AREA")
    before = areas(driver.window)
    driver.start_render()
    yield from driver.finished()
    driver.shot("done")
    area = shown(driver.window)
    assert len(windows()) == 1 and area.width * area.height == max(w * h for *_, w, h in before)
    assert driver.region_pixels("IMAGE_EDITOR").std() > 10
    escape(driver.window)
    yield DRAW
    driver.shot("back")
    assert areas(driver.window) == before
    set_slow()
    driver.start_render()
    yield from until(lambda: areas(driver.window) != before, "no editor is opened while it renders")
    escape(driver.window)
    yield from driver.finished()
    assert shown(driver.window), "the Esc that cancels closes the editor too"
    assert tuple(bpy.data.images[IMAGE].size) == (960, 540), "the old picture is lost"
    escape(driver.window)
    yield DRAW
    assert areas(driver.window) == before


def own_window(driver):
    """New Window: one window for all renders; Esc in it cancels, and then closes it.

    The first render is done before Blender comes back to its window.
    """
    yield from prepare(driver, "WINDOW")
    before = areas(driver.window)
    for is_done_at_once in (True, False):
        driver.start_render()
        while is_done_at_once and render_job().current() is not None:
            time.sleep(0.01)
        yield from driver.finished()
        driver.shot("done")
        assert len(windows()) == 2 and areas(driver.window) == before
        assert shown(windows()[1]) and windows()[1].screen.is_temporary
    set_slow()
    driver.start_render()
    yield DRAW
    escape(windows()[1])
    yield from until(lambda: not bpy.ops.scfpf.render_cancel.poll(), "Esc in the window does not cancel")
    yield 2 * DRAW
    assert len(windows()) == 2
    escape(windows()[1])
    yield from until(lambda: len(windows()) == 1, "Esc does not close the window")
    with driver.override():
        assert bpy.ops.scfpf.result_show("INVOKE_DEFAULT") == {"FINISHED"}
    yield DRAW
    driver.shot("shown")
    assert shown(windows()[1])
    escape(windows()[1])
    yield from until(lambda: len(windows()) == 1, "Esc does not close the window")


def full_screen(driver):
    """Full Screen: Esc goes back to all editors."""
    yield from prepare(driver, "SCREEN")
    before = areas(driver.window)
    driver.start_render()
    yield from driver.finished()
    driver.shot("done")
    assert len(windows()) == 1 and shown(driver.window).width > 0.95 * driver.window.width
    escape(driver.window)
    yield DRAW
    driver.shot("back")
    assert sorted(areas(driver.window)) == sorted(before)


def kept_interface(driver):
    """Keep User Interface: nothing moves; somebody's reference image stays where it is."""
    yield from prepare(driver, "NONE")
    driver.open_image_editor()
    reference = bpy.data.images.new("Reference", 8, 8)
    space = driver.area("IMAGE_EDITOR").spaces.active
    space.image = reference
    before = areas(driver.window)
    driver.start_render()
    yield from driver.finished()
    driver.shot("done")
    assert len(windows()) == 1 and areas(driver.window) == before
    assert driver.area("IMAGE_EDITOR").spaces.active.image.name == "Reference"
    bpy.context.preferences.view.render_display_type = "AREA"
    with driver.override():
        assert bpy.ops.scfpf.result_show("INVOKE_DEFAULT") == {"FINISHED"}
    yield DRAW
    kept, ours = sorted(
        area.spaces.active.image.name for area in driver.window.screen.areas if area.type == "IMAGE_EDITOR"
    )
    assert (kept, ours) == ("Reference", IMAGE)


def ignored(driver):
    """F12 with Workbench reports that it ignores the volume; the panels offer the switch."""
    yield from prepare(driver, "AREA")
    scene = bpy.context.scene
    scene.render.engine = "BLENDER_WORKBENCH"
    driver.area("PROPERTIES").spaces.active.context = "RENDER"
    driver.area("DOPESHEET_EDITOR").ui_type = "INFO"
    yield DRAW
    driver.shot("panels")
    done = []
    bpy.app.handlers.render_complete.append(lambda *_: done.append(True))
    driver.key("F12", "INFO")
    # It may be over before one looks whether it runs.
    yield from until(lambda: done, "F12 renders nothing")
    bpy.app.handlers.render_complete.pop()
    yield from ended()
    yield DRAW
    driver.shot("reported")
    with driver.override("INFO"):
        bpy.ops.info.select_all(action="SELECT")
        bpy.ops.info.report_copy()
    said = bpy.context.window_manager.clipboard
    assert "Workbench ignores the volume of 'Flexible Camera'" in said, said


def eyes(driver):
    """A Rendered viewport shows the eye that it looks through, in the frame that Blender draws for it."""
    build_scene()
    driver.add_camera("perspective")
    scene = bpy.context.scene
    scene.render.engine = "SCFPF"
    scene.render.use_multiview = True
    stereo = scene.camera.data.stereo
    stereo.interocular_distance, stereo.convergence_distance, stereo.pivot = 2.0, 8.0, "CENTER"
    space = driver.area("VIEW_3D").spaces.active
    space.region_3d.view_perspective = "CAMERA"
    space.shading.type = "RENDERED"
    seen = {}
    for eye in ("LEFT", "RIGHT", "S3D"):
        space.stereo_3d_camera = eye
        yield from painted()
        driver.shot(eye.lower())
        seen[eye] = driver.region_pixels()
    assert differing(seen["LEFT"], seen["RIGHT"]) > 5000 and differing(seen["LEFT"], seen["S3D"]) > 5000


SCENARIOS = (largest_area, own_window, full_screen, kept_interface, ignored, eyes)
