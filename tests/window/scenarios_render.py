# SPDX-License-Identifier: GPL-3.0-or-later
"""Renders through the operator: progress, the picture, its window, picking in it, undo."""

import pathlib
import sys

import bpy
import numpy as np
from driver import DRAW, IMAGE, build_scene


def renders(driver):
    """A render through the operator: progress, result in an Image Editor, report in the panel."""
    build_scene()
    driver.add_camera()
    driver.show_data_tab()
    driver.open_image_editor()
    yield from driver.show_sidebar()
    driver.start_render()
    yield 0.4
    driver.shot("progress")
    yield from driver.finished()
    driver.shot("done")
    image = bpy.data.images[IMAGE]
    assert tuple(image.size) == (960, 540), tuple(image.size)
    assert driver.pixels().reshape(-1, 4)[:, :3].std(axis=0).min() > 0.05, "the picture is of one colour"
    assert driver.region_pixels("IMAGE_EDITOR").std() > 10, "the Image Editor shows nothing"
    assert driver.area("IMAGE_EDITOR").spaces.active.image == image
    assert bpy.context.scene.camera.scfpf.report


def picks(driver):
    """A click in the picture draws the projector through that pixel and its hit; undo takes it back."""
    build_scene()
    driver.add_camera("nonlinear_twist")
    camera = bpy.context.scene.camera
    yield from driver.show_sidebar()
    with driver.override():
        try:
            bpy.ops.scfpf.pick("INVOKE_DEFAULT")
        except RuntimeError as error:
            assert "Image Editor" in str(error)
        else:
            raise AssertionError("picking without a picture says nothing")
    driver.open_image_editor()
    driver.start_render()
    yield from driver.finished()
    area = driver.area("IMAGE_EDITOR")
    region = next(region for region in area.regions if region.type == "WINDOW")
    with driver.override():
        bpy.ops.view3d.view_axis(type="FRONT")
        bpy.ops.view3d.view_all("EXEC_DEFAULT")
        assert bpy.ops.scfpf.pick("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    yield DRAW
    driver.key("LEFTMOUSE")
    yield DRAW
    assert not camera.scfpf.show_pick, "a click beside the picture picks"
    u, v = region.view2d.region_to_view(region.width // 2, region.height // 2)
    where = {"x": region.x + region.width // 2, "y": region.y + region.height // 2}
    driver.window.event_simulate("MOUSEMOVE", "NOTHING", **where)
    driver.window.event_simulate("LEFTMOUSE", "PRESS", **where)
    driver.window.event_simulate("LEFTMOUSE", "RELEASE", **where)
    yield 2 * DRAW
    camera = bpy.context.scene.camera
    assert camera.scfpf.show_pick and abs(camera.scfpf.pick[0] - u) + abs(camera.scfpf.pick[1] - v) < 0.02
    driver.shot("picked")
    with driver.override():
        bpy.ops.wm.call_panel(name="SCFPF_PT_view_display")
    yield DRAW
    driver.shot("panel")
    driver.key("ESC")
    yield DRAW
    with driver.override():
        bpy.ops.ed.undo()
    yield DRAW
    assert not bpy.context.scene.camera.scfpf.show_pick, "undo does not take the pick back"
    with driver.override():
        assert bpy.ops.scfpf.pick("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    yield DRAW
    driver.key("ESC")
    yield DRAW
    assert not bpy.context.scene.camera.scfpf.show_pick


def picture_in_a_window(driver):
    """Show Picture opens a window when no Image Editor is open."""
    build_scene()
    driver.add_camera()
    driver.start_render()
    yield from driver.finished()
    with driver.override():
        bpy.ops.scfpf.result_show("INVOKE_DEFAULT")
    yield DRAW
    window = bpy.context.window_manager.windows[-1]
    assert window.screen.areas[0].spaces.active.image.name == IMAGE
    driver.shot("window")
    with bpy.context.temp_override(window=window):
        bpy.ops.wm.window_close()
    yield 0.5


def undo(driver):
    """Undo and redo of an added camera, an added surface and a render."""
    bpy.ops.ed.undo_push(message="start")
    driver.add_camera()
    yield 0.2
    with driver.override():
        bpy.ops.scfpf.surface_add("INVOKE_DEFAULT", True, kind="PLANE")
    yield 0.2
    driver.start_render()
    yield from driver.finished()
    before = driver.pixels()

    def state():
        cameras = [obj for obj in bpy.data.objects if obj.type == "CAMERA" and obj.scfpf.enabled]
        return len(cameras), sum(len(camera.scfpf.surfaces) for camera in cameras), IMAGE in bpy.data.images

    states = [state()]
    for _ in range(3):
        with driver.override():
            bpy.ops.ed.undo()
        yield 0.3
        states.append(state())
    for _ in range(3):
        with driver.override():
            bpy.ops.ed.redo()
        yield 0.3
    assert states == [(1, 3, True), (1, 3, False), (1, 2, False), (0, 0, False)], states
    assert state() == (1, 3, True)
    assert np.array_equal(driver.pixels(), before)


def job_price(driver):
    """Export Render Job from its file browser: another Blender tells the price, Esc ends it."""
    build_scene()
    driver.add_camera()
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 48, 27
    bpy.ops.wm.save_as_mainfile(filepath=str(driver.folder / "job.blend"))
    # The other Blender has the add-on by the preferences of this one.
    bpy.ops.wm.save_userpref()
    preferences = pathlib.Path(bpy.utils.user_resource("CONFIG"), "userpref.blend")
    operator = next(
        cls for cls in modal_job().ModalJob.__subclasses__() if cls.__name__ == "SCFPF_OT_render_job_price"
    )
    folder = driver.folder / "job"
    folder.mkdir()

    def export():
        with driver.override():
            bpy.ops.scfpf.render_job_export("INVOKE_DEFAULT", directory=f"{folder}/")
        yield 1.0
        windows = bpy.context.window_manager.windows
        window, area = next(
            (window, area)
            for window in windows
            for area in window.screen.areas
            if area.type == "FILE_BROWSER"
        )
        where = {"x": area.x + area.width // 2, "y": area.y + area.height // 3}
        window.event_simulate("MOUSEMOVE", "NOTHING", **where)
        yield DRAW
        window.event_simulate("RET", "PRESS", **where)
        window.event_simulate("RET", "RELEASE", **where)
        yield 1.0
        assert (folder / "template.json").exists()
        assert modal_job().is_running(operator), "no price is being told"

    yield from export()
    driver.shot("telling")
    driver.key("ESC")
    yield 1.0
    assert not modal_job().is_running(operator), "Esc does not end it"
    assert "amount.worker.memory" not in (folder / "template.json").read_text()
    yield from export()
    for _ in range(120):
        yield 0.5
        if not modal_job().is_running(operator):
            break
    yield DRAW
    driver.shot("told")
    preferences.unlink()
    assert "amount.worker.memory" in (folder / "template.json").read_text(), "the job has no price"


def modal_job():
    name = next(name for name in sys.modules if name.endswith(".operators.common.modal_job"))
    return sys.modules[name]


SCENARIOS = (renders, picks, picture_in_a_window, undo, job_price)
