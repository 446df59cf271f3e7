# SPDX-License-Identifier: GPL-3.0-or-later
"""Work in a viewport that shows a flexible camera's image: clicks, drags, and the buttons of the panel."""

import itertools
import pathlib

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from driver import DRAW, differing
from mathutils import Vector
from scenarios_live import settled

# The four sides of a box as long as a car: the location and size of each.
PLATES = {
    "Front": ((0.0, -2.2, 0.0), (1.7, 0.1, 1.5)),
    "Back": ((0.0, 2.2, 0.0), (1.7, 0.1, 1.5)),
    "Left": ((-0.9, 0.0, 0.0), (0.1, 4.3, 1.5)),
    "Right": ((0.9, 0.0, 0.0), (0.1, 4.3, 1.5)),
}
# Shares of the frame's width at which the preset Around the Car shows them, from the figure of the paper.
SHOWN_AT = {"Back": 0.04, "Left": 0.25, "Front": 0.5, "Right": 0.75}
# Where the image shows no plate: its lower border.
EMPTY = (0.5, 0.01)
STEP = 0.3


def prepare(driver):
    """Generator: the plates, seen around in a viewport that looks through the camera."""
    for obj in list(bpy.data.objects):
        if obj.type == "MESH":
            bpy.data.objects.remove(obj)
    for name, (place, size) in PLATES.items():
        bpy.ops.mesh.primitive_cube_add(size=1.0, location=place)
        bpy.context.object.name, bpy.context.object.scale = name, size
    for name in PLATES:
        bpy.data.objects[name].select_set(True)
    scene = bpy.context.scene
    scene.render.resolution_x, scene.render.resolution_y = 1200, 400
    bpy.context.view_layer.update()
    driver.add_camera("around_the_car")
    space = driver.area("VIEW_3D").spaces.active
    space.region_3d.view_perspective = "CAMERA"
    space.region_3d.view_camera_zoom = 12
    yield from settled()
    select_only()


def select_only(*names):
    for obj in bpy.context.view_layer.objects:
        obj.select_set(obj.name in names)
    bpy.context.view_layer.objects.active = bpy.data.objects[names[0]] if names else None


def selected():
    return {obj.name for obj in bpy.context.view_layer.objects if obj.select_get()}


def active():
    found = bpy.context.view_layer.objects.active
    return found.name if found else ""


def place_in_frame(driver, x, y):
    """The pixel of the window at shares of the camera's frame."""
    scene, region = bpy.context.scene, driver.region("VIEW_3D")
    camera = scene.camera
    corners = camera.data.view_frame(scene=scene)
    low = Vector((corners[2].x, corners[2].y, corners[2].z))
    high = Vector((corners[0].x, corners[0].y, corners[0].z))
    matrix = camera.matrix_world.normalized()
    view = driver.area("VIEW_3D").spaces.active.region_3d
    first, last = (location_3d_to_region_2d(region, view, matrix @ corner) for corner in (low, high))
    return (
        region.x + round(first.x + x * (last.x - first.x)),
        region.y + round(first.y + y * (last.y - first.y)),
    )


def click(driver, x, y, button="LEFTMOUSE", **held):
    """Generator: click at shares of the camera's frame."""
    across, up = place_in_frame(driver, x, y)
    where = {"x": across, "y": up}
    driver.window.event_simulate("MOUSEMOVE", "NOTHING", **where)
    yield STEP
    driver.window.event_simulate(button, "PRESS", **where, **held)
    yield STEP
    driver.window.event_simulate(button, "RELEASE", **where, **held)
    yield STEP


def drag(driver, start, end, button="LEFTMOUSE"):
    """Generator: press at one place of the camera's frame, move, and release at another."""
    for step in range(7):
        share = max(step - 1, 0) / 5
        across, up = place_in_frame(driver, *(a + share * (b - a) for a, b in zip(start, end, strict=True)))
        driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=across, y=up)
        yield STEP
        if step == 0:
            driver.window.event_simulate(button, "PRESS", x=across, y=up)
            yield STEP
    driver.window.event_simulate(button, "RELEASE", x=across, y=up)
    yield STEP


def choose_tool(driver, name):
    with driver.override():
        bpy.ops.wm.tool_set_by_id(name=name)


def undo(driver):
    with driver.override():
        bpy.ops.ed.undo()


def click_selects_what_is_seen(driver):
    """Each side of the box is selected where the image shows it, with two tools; Shift, nothing, undo."""
    yield from prepare(driver)
    driver.shot("seen")
    for tool in ("builtin.select_box", "builtin.select"):
        choose_tool(driver, tool)
        select_only()
        for name, x in SHOWN_AT.items():
            yield from click(driver, x, 0.5)
            assert (selected(), active()) == ({name}, name), f"{tool}, {name}: {selected()}, {active()}"
        undo(driver)
        assert selected() == {"Front"}, f"{tool}: one step of undo leads to {selected()}"
        yield from click(driver, SHOWN_AT["Left"], 0.5)
        yield from click(driver, SHOWN_AT["Back"], 0.5, shift=True)
        assert (selected(), active()) == ({"Left", "Back"}, "Back"), f"{tool}: {selected()}, {active()}"
        yield from click(driver, SHOWN_AT["Left"], 0.5, shift=True)
        assert (selected(), active()) == ({"Left", "Back"}, "Left"), f"{tool}: {selected()}, {active()}"
        yield from click(driver, SHOWN_AT["Left"], 0.5, shift=True)
        assert selected() == {"Back"}, f"{tool}: {selected()}"
        yield from click(driver, *EMPTY, shift=True)
        assert selected() == {"Back"}, f"{tool}: {selected()}"
        yield from click(driver, *EMPTY)
        assert not selected(), f"{tool}: {selected()}"


def clicks_elsewhere_are_blenders(driver):
    """Outside of the frame, without Live View and in Edit Mode a click does what it does in Blender."""
    yield from prepare(driver)
    bpy.ops.mesh.primitive_cube_add(size=2.0, location=(0.0, 4.0, -2.5))
    bpy.context.object.name = "Below"
    select_only()
    yield DRAW
    yield from click(driver, 0.5, -0.6)
    assert selected() == {"Below"}, f"outside of the frame: {selected()}"
    camera = bpy.context.scene.camera
    camera.scfpf.show_live = False
    # A straight view never shows the back of the box.
    yield from click(driver, SHOWN_AT["Back"], 0.5)
    assert not selected(), f"without Live View: {selected()}"
    camera.scfpf.show_live = True
    bpy.data.objects["Back"].hide_select = True
    yield from click(driver, SHOWN_AT["Back"], 0.5)
    assert "Back" not in selected(), "it cannot be selected"
    bpy.data.objects["Back"].hide_select = False
    select_only("Front")
    with driver.override():
        bpy.ops.object.mode_set(mode="EDIT")
        bpy.ops.mesh.select_all(action="SELECT")
    yield from click(driver, SHOWN_AT["Back"], 0.5)
    assert bpy.context.mode == "EDIT_MESH" and selected() == {"Front"}, f"in Edit Mode: {selected()}"
    with driver.override():
        bpy.ops.object.mode_set(mode="OBJECT")


def drags_are_blenders(driver):
    """Select Box draws its box; Tweak and the right button move what they press on, in a step of its own."""
    yield from prepare(driver)
    choose_tool(driver, "builtin.select_box")
    yield from drag(driver, (-0.05, -0.1), (1.05, 1.1))
    assert selected() >= {"Front"}, f"the box has selected {selected()}"
    choose_tool(driver, "builtin.select")
    preferences = bpy.context.window_manager.keyconfigs.active.preferences
    try:
        for button in ("LEFTMOUSE", "RIGHTMOUSE"):
            preferences.select_mouse = button.removesuffix("MOUSE")
            yield DRAW
            select_only("Left")
            bpy.ops.ed.undo_push(message="Ready")
            back = bpy.data.objects["Back"].location.copy()
            yield from drag(driver, (SHOWN_AT["Back"], 0.5), (0.2, 0.6), button)
            assert selected() == {"Back"}, f"{button}: {selected()}"
            assert (bpy.data.objects["Back"].location - back).length > 0.1, f"{button}: it has not moved"
            undo(driver)
            assert (bpy.data.objects["Back"].location - back).length < 1e-5, f"{button}: move not undone"
            assert selected() == {"Back"}, f"{button}: {selected()}"
            undo(driver)
            assert selected() == {"Left"}, f"{button}: {selected()}"
    finally:
        preferences.select_mouse = "LEFT"


def set_keymap(name):
    """Choose one of Blender's configurations of keys."""
    folders = (pathlib.Path(folder) for folder in bpy.utils.preset_paths("keyconfig"))
    path = next(folder / f"{name}.py" for folder in folders if (folder / f"{name}.py").is_file())
    bpy.utils.keyconfig_set(str(path))


def other_keymaps_select_alike(driver):
    """Industry Compatible, and 2.7X with its right button, which keeps the selection where nothing is."""
    yield from prepare(driver)
    try:
        for name, button, kept in (
            ("Industry_Compatible", "LEFTMOUSE", set()),
            ("Blender_27x", "RIGHTMOUSE", {"Left", "Back"}),
        ):
            set_keymap(name)
            yield DRAW
            select_only()
            yield from click(driver, SHOWN_AT["Left"], 0.5, button)
            assert selected() == {"Left"}, f"{name}: {selected()}"
            yield from click(driver, SHOWN_AT["Back"], 0.5, button, shift=True)
            assert (selected(), active()) == ({"Left", "Back"}, "Back"), f"{name}: {selected()}"
            yield from click(driver, *EMPTY, button)
            assert selected() == kept, f"{name}: {selected()}"
    finally:
        set_keymap("Blender")


def sidebar(driver):
    return driver.region_pixels("VIEW_3D", "UI")


def buttons_show_what_is_on(driver):
    """The row in the panel: Live View, Blender's own view and back, Rendered; leaving the camera's view."""
    yield from prepare(driver)
    yield from driver.show_sidebar()
    space, camera = driver.area("VIEW_3D").spaces.active, bpy.context.scene.camera
    driver.area("VIEW_3D").spaces.active.show_gizmo = False
    yield DRAW
    live, panel = driver.region_pixels(), sidebar(driver)
    driver.shot("live")
    with driver.override():
        bpy.ops.view3d.view_camera()
    yield 2 * DRAW
    assert space.region_3d.view_perspective != "CAMERA"
    driver.shot("left")
    assert differing(sidebar(driver), panel) > 100, "the button is lit though no viewport shows Live View"
    with driver.override():
        assert bpy.ops.scfpf.view_live("INVOKE_DEFAULT", True) == {"FINISHED"}
    yield from settled()
    assert camera.scfpf.show_live and differing(sidebar(driver), panel) == 0
    assert np.abs(driver.region_pixels() - live).mean() < 1, "Live View is not back"
    with driver.override():
        assert bpy.ops.scfpf.view_live("INVOKE_DEFAULT", True) == {"FINISHED"}
    yield DRAW
    driver.shot("blenders")
    assert np.abs(driver.region_pixels() - live).mean() > 3, "Blender's own view is not shown"
    undo(driver)
    yield from settled()
    assert bpy.context.scene.camera.scfpf.show_live, "the switch is not undone"
    bpy.context.scene.render.engine = "SCFPF"
    with driver.override():
        assert bpy.ops.scfpf.view_rendered("INVOKE_DEFAULT") == {"FINISHED"}
    yield 4 * DRAW
    driver.shot("rendered")
    assert space.shading.type == "RENDERED" and differing(sidebar(driver), panel) > 100
    # The engine's image is clicked like a live one.
    select_only()
    yield from click(driver, SHOWN_AT["Left"], 0.5)
    assert selected() == {"Left"}, f"in Rendered shading: {selected()}"


def a_drag_is_seen(driver):
    """G moves what was clicked, drawn on the way; Esc puts it back, and Numpad 0 leaves the camera's view."""
    yield from prepare(driver)
    yield from click(driver, SHOWN_AT["Left"], 0.5)
    assert active() == "Left"
    yield from settled()
    before, place = driver.region_pixels(), bpy.data.objects["Left"].location.copy()
    across, up = place_in_frame(driver, SHOWN_AT["Left"], 0.5)
    driver.window.event_simulate("G", "PRESS", x=across, y=up)
    driver.window.event_simulate("G", "RELEASE", x=across, y=up)
    yield STEP
    shown = []
    for step in range(1, 5):
        driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=across, y=up + 40 * step)
        yield DRAW
        shown.append(driver.region_pixels())
    driver.shot("dragged")
    moved = [float(np.abs(image - before).mean()) for image in shown]
    assert moved[-1] > 2, f"nothing moves: {moved}"
    # The first events may come before the operator is ready.
    steps = sum(np.abs(a - b).mean() > 0.2 for a, b in itertools.pairwise(shown))
    assert steps >= 2, f"the picture stands still on the way: {moved}"
    driver.window.event_simulate("ESC", "PRESS", x=across, y=up)
    driver.window.event_simulate("ESC", "RELEASE", x=across, y=up)
    yield from settled()
    assert (bpy.data.objects["Left"].location - place).length < 1e-6
    assert np.abs(driver.region_pixels() - before).mean() < 1, "the picture is not that of before"
    driver.window.event_simulate("NUMPAD_0", "PRESS", x=across, y=up)
    driver.window.event_simulate("NUMPAD_0", "RELEASE", x=across, y=up)
    yield 2 * DRAW
    driver.shot("own")
    assert driver.area("VIEW_3D").spaces.active.region_3d.view_perspective != "CAMERA"


SCENARIOS = (
    click_selects_what_is_seen,
    clicks_elsewhere_are_blenders,
    drags_are_blenders,
    other_keymaps_select_alike,
    buttons_show_what_is_on,
    a_drag_is_seen,
)
