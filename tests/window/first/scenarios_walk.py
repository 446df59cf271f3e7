# SPDX-License-Identifier: GPL-3.0-or-later
"""Two walks of a newcomer through the street: a first bent picture, and then Aim, a layer and a screen.

They print the time, the height of the panel and the state of each dialog; their screenshots are for eyes.
"""

import math
import time

import bpy
import numpy as np
from driver import DRAW, PATIENCE, differing, surfaces
from scenarios_clicks import select_only
from scenarios_live import settled

from demo.recipes import scenes

# Dialogs: their operators and properties.
DIALOGS = {
    "quilt": ("quilt", {}),
    "over-time": ("time_render", {}),
    "assemble": ("time_assemble", {}),
    "lens-numbers": ("camera_from_calibration", {"source": "NUMBERS"}),
}
# Pixels that a dialog covers at least, and that a preset changes.
COVERS = 3000
# Presses of the wheel that reach the end of any sidebar.
TURNS = 80


def panel_height(driver):
    """Generator: the height of all panels of the sidebar in pixels, by scrolling to their end and back."""
    area, region = driver.area("VIEW_3D"), driver.region("VIEW_3D", "UI")
    with bpy.context.temp_override(window=driver.window, area=area, region=region):
        for _ in range(TURNS):
            bpy.ops.view2d.scroll_down()
        yield DRAW
        driver.shot("panel-end")
    low = -region.view2d.region_to_view(0, 0)[1]
    with bpy.context.temp_override(window=driver.window, area=area, region=region):
        for _ in range(TURNS):
            bpy.ops.view2d.scroll_up()
    yield DRAW
    return round(low)


def state():
    """The objects, cameras and images of the file, and the settings that dialogs could change."""
    camera = bpy.context.scene.camera
    return (
        sorted(obj.name for obj in bpy.data.objects),
        sorted(image.name for image in bpy.data.images),
        bpy.context.scene.render.resolution_x,
        bpy.context.scene.frame_current,
        [tuple(map(tuple, obj.matrix_world)) for obj in surfaces(camera)],
    )


def popped(driver, name, opened):
    """Generator: call what opens a popup in the middle of the viewport, look at it, and press Esc."""
    region = driver.region("VIEW_3D")
    where = {"x": region.x + region.width // 3, "y": region.y + 3 * region.height // 4}
    driver.window.event_simulate("MOUSEMOVE", "NOTHING", **where)
    yield 0.3
    before, file = driver.region_pixels(), state()
    with driver.override():
        opened()
    yield DRAW
    driver.shot(name)
    assert differing(before, driver.region_pixels()) > COVERS, f"{name} is not shown"
    for value in ("PRESS", "RELEASE"):
        driver.window.event_simulate("ESC", value, **where)
    yield DRAW
    assert state() == file, f"Esc in {name} leaves something"


def dialogs(driver, ending):
    """Generator: open and leave each dialog, the messages and the menu of presets."""
    for name, (operator, properties) in DIALOGS.items():

        def opened(operator=operator, properties=properties):
            getattr(bpy.ops.scfpf, operator)("INVOKE_DEFAULT", **properties)

        yield from popped(driver, f"{name}{ending}", opened)
    yield from popped(driver, f"messages{ending}", lambda: bpy.ops.wm.call_panel(name="SCFPF_PT_messages"))
    yield from popped(
        driver, f"presets{ending}", lambda: bpy.ops.wm.call_menu(name="SCFPF_MT_presets_group_1")
    )


def look_through(driver):
    """Look through the scene's camera, whose frame fills the viewport, with the materials' colors."""
    space = driver.area("VIEW_3D").spaces.active
    space.shading.color_type = "MATERIAL"
    with driver.override():
        bpy.ops.view3d.view_camera()
        bpy.ops.view3d.view_center_camera()


def first_picture(driver):
    """A camera gets a preset, is looked at and rendered; dialogs are opened and left, in German, too."""
    scene = scenes.head()
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 640, 360, 50
    yield DRAW
    select_only(scene.camera.name)
    look_through(driver)
    yield from driver.show_sidebar()
    driver.shot("ordinary")
    print("walk: height of the panel of an ordinary camera:", (yield from panel_height(driver)))
    began = time.monotonic()
    with driver.override():
        assert bpy.ops.scfpf.camera_toggle("INVOKE_DEFAULT", True) == {"FINISHED"}
    yield from settled()
    driver.shot("flexible")
    print("walk: height of the panel of a new flexible camera:", (yield from panel_height(driver)))
    straight = driver.region_pixels()
    with driver.override():
        assert bpy.ops.scfpf.preset_apply("INVOKE_DEFAULT", True, preset="panini") == {"FINISHED"}
    yield from settled()
    driver.shot("preset")
    assert differing(straight, driver.region_pixels()) > COVERS, "the preset bends nothing"
    print(f"walk: a bent picture after {time.monotonic() - began:.1f} s")
    scene.camera.scfpf.samples = 4
    driver.start_render()
    yield from driver.finished()
    driver.shot("rendered")
    yield from dialogs(driver, "")
    view = bpy.context.preferences.view
    view.language = "de_DE"
    view.use_translate_interface = view.use_translate_tooltips = True
    try:
        yield 2 * DRAW
        driver.shot("german")
        yield from panel_height(driver)
        yield from dialogs(driver, "-german")
    finally:
        view.language = "en_US"


def aim_layers_and_screen(driver):
    """A view of the head is added and solved, then shown by a layer; a wall of screens is given a camera."""
    scene = scenes.head()
    scene.render.resolution_x, scene.render.resolution_y, scene.render.resolution_percentage = 640, 360, 50
    yield DRAW
    camera = scene.camera
    select_only("Head")
    look_through(driver)
    yield from driver.show_sidebar()
    with driver.override():
        assert bpy.ops.scfpf.aim_view_add("INVOKE_DEFAULT", True, camera=camera.name) == {"FINISHED"}
    select_only(camera.name)
    yield from settled()
    driver.shot("view")
    with driver.override():
        assert bpy.ops.scfpf.aim_turn("EXEC_DEFAULT", True, left=math.radians(30.0)) == {"FINISHED"}
        assert bpy.ops.scfpf.aim_solve("INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}
    end = time.monotonic() + PATIENCE
    while any("aim" in one.bl_idname for one in driver.window.modal_operators):
        assert time.monotonic() < end, "the solve hangs"
        yield 0.1
    yield from settled()
    driver.shot("solved")
    print("walk: height of the panel with a view of Aim:", (yield from panel_height(driver)))
    yield from popped(driver, "messages", lambda: bpy.ops.wm.call_panel(name="SCFPF_PT_messages"))
    with driver.override():
        assert bpy.ops.scfpf.aim_remove("EXEC_DEFAULT", True) == {"FINISHED"}
    select_only("Head")
    with driver.override():
        assert bpy.ops.scfpf.layer_add("INVOKE_DEFAULT", True, camera=camera.name) == {"FINISHED"}
    select_only(camera.name)
    layer = camera.scfpf.layers[0]
    layer.size, layer.position = (0.7, 0.7), (0.55, 0.5)
    yield from settled()
    driver.shot("layer")
    print("walk: height of the panel with a layer:", (yield from panel_height(driver)))
    scene = scenes.led_wall()
    yield DRAW
    select_only("Screen")
    bpy.data.objects["Eye"].select_set(True)
    with driver.override():
        assert bpy.ops.scfpf.camera_from_screen("EXEC_DEFAULT", True) == {"FINISHED"}
    scene.camera = bpy.context.object
    scene.render.resolution_percentage = 10
    yield DRAW
    driver.shot("screen")
    driver.start_render()
    yield from driver.finished()
    driver.shot("screen-rendered")
    assert np.std(driver.pixels().reshape(-1, 4)[:, :3]) > 0.03, "the screen's picture is empty"


SCENARIOS = (first_picture, aim_layers_and_screen)
