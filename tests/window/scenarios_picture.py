# SPDX-License-Identifier: GPL-3.0-or-later
"""Editing the volume with the mouse, a magic lens, finding things in the picture, framing; on both themes."""

import pathlib

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from driver import DRAW, build_scene
from mathutils import Matrix, Vector
from scenarios_preview import SETTLE, look, preview_areas, toggle


def beside(driver, camera, turn=0.55, distance=13.0):
    """Look at the near surface of a camera's volume from beside, above and behind."""
    with driver.override():
        view = bpy.context.region_data
        view.view_perspective = "PERSP"
        place = camera.matrix_world @ Vector((0, 0, -4))
        rotation = (
            camera.matrix_world.to_3x3() @ Matrix.Rotation(turn, 3, "Y") @ Matrix.Rotation(-0.3, 3, "X")
        )
        view.view_location, view.view_distance = place, distance
        view.view_rotation = rotation.to_quaternion()
        view.update()


def light_theme():
    """Blender's own light theme; the scenario's end must bring the dark one back."""
    for folder in bpy.utils.preset_paths("interface_theme"):
        for path in pathlib.Path(folder).glob("Blender_Light.xml"):
            bpy.ops.script.execute_preset(
                filepath=str(path), menu_idname="USERPREF_MT_interface_theme_presets"
            )
            return
    raise AssertionError("Blender has no light theme")


def both_themes(driver, name):
    """Generator: a picture on each of Blender's themes."""
    driver.shot(f"{name}-dark")
    light_theme()
    yield 2 * DRAW
    driver.shot(f"{name}-light")
    bpy.ops.preferences.reset_default_theme()
    yield DRAW


def flexible_camera(driver, preset="VIEW"):
    build_scene(percentage=25)
    driver.add_camera(preset)
    return bpy.context.scene.camera


def pixel(driver, point):
    """The window's pixel that shows a point of the scene."""
    area = driver.area("VIEW_3D")
    region = next(region for region in area.regions if region.type == "WINDOW")
    x, y = location_3d_to_region_2d(region, area.spaces.active.region_3d, Vector(point))
    return {"x": region.x + round(x), "y": region.y + round(y)}


def click(driver, where):
    driver.window.event_simulate("MOUSEMOVE", "NOTHING", **where)
    driver.window.event_simulate("LEFTMOUSE", "PRESS", **where)
    driver.window.event_simulate("LEFTMOUSE", "RELEASE", **where)


def on_surface(surface, u, v):
    """A point of a plane's drawn shape, in the world."""
    corners = np.array(surface.bound_box)
    low, high = corners.min(axis=0), corners.max(axis=0)
    return surface.matrix_world @ Vector(low + (high - low) * (u, v, 0))


def edit_volume(driver):
    """Outside the mode a click passes through the surfaces, in it the click selects; undo ends it."""
    camera = flexible_camera(driver, "nonlinear_twist")
    yield from driver.show_sidebar()
    beside(driver, camera)
    yield DRAW
    near = camera.scfpf.surfaces[0].object
    point = on_surface(near, 0.0, 0.75)
    click(driver, pixel(driver, point))
    yield DRAW
    assert not near.select_get(), "a click selects a surface outside the mode"
    bpy.context.view_layer.objects.active = camera
    yield DRAW
    yield from both_themes(driver, "off")
    with driver.override():
        bpy.ops.scfpf.edit_volume("INVOKE_DEFAULT", True)
    yield DRAW
    yield from both_themes(driver, "on")
    click(driver, pixel(driver, point))
    yield DRAW
    assert bpy.context.object == near and near.select_get(), f"clicked {bpy.context.object}"
    driver.shot("clicked")
    # Where two of the drawn lines cross inside the surface, before the scene.
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    click(driver, pixel(driver, on_surface(near, 0.375, 0.375)))
    yield DRAW
    assert near.select_get(), f"clicked {bpy.context.object}"
    yield DRAW
    driver.shot("clicked-inside")
    with driver.override():
        for _ in range(3):
            bpy.ops.ed.undo()
    yield DRAW
    assert not bpy.context.scene.camera.scfpf.edit_volume, "undo does not end the mode"


def found_in_picture(driver):
    """An object that is selected is marked in the picture, and its projector drawn."""
    camera = flexible_camera(driver)
    yield from driver.show_sidebar()
    driver.area("PROPERTIES").ui_type = "IMAGE_EDITOR"
    driver.start_render()
    yield from driver.finished()
    with driver.override():
        bpy.context.region_data.view_location = (3, -1, 2)
        bpy.context.region_data.view_distance = 26.0
        bpy.ops.object.select_all(action="DESELECT")
        bpy.data.objects["Suzanne.001"].select_set(True)
        bpy.context.view_layer.objects.active = bpy.data.objects["Suzanne.001"]
        assert bpy.ops.scfpf.find_in_image("INVOKE_DEFAULT", True) == {"FINISHED"}
    assert camera.scfpf.show_found and camera.scfpf.pick_object == "Suzanne.001"
    with driver.override("IMAGE_EDITOR"):
        bpy.ops.image.view_all(fit_view=True)
    yield 2 * DRAW
    yield from both_themes(driver, "marked")
    with driver.override():
        bpy.ops.ed.undo()
    yield DRAW
    assert not bpy.context.scene.camera.scfpf.show_found, "undo does not take the mark back"


def framing(driver):
    """The mouse frames the volume; Esc restores it to the last bit; accepted, it is one step of undo."""
    camera = flexible_camera(driver, "nonlinear_twist")
    yield from driver.show_sidebar()
    beside(driver, camera, distance=30.0)
    yield DRAW

    def state():
        slots = bpy.context.scene.camera.scfpf.surfaces
        return [np.array(slot.object.matrix_parent_inverse) for slot in slots]

    def move(dx, dy, **modifiers):
        place["x"], place["y"] = place["x"] + dx, place["y"] + dy
        driver.window.event_simulate("MOUSEMOVE", "NOTHING", **place, **modifiers)

    def start():
        driver.window.event_simulate("MOUSEMOVE", "NOTHING", **place)
        with driver.override():
            assert bpy.ops.scfpf.volume_frame("INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}

    area = driver.area("VIEW_3D")
    place = {"x": area.x + area.width // 3, "y": area.y + area.height // 2}
    before = state()
    start()
    for _ in range(10):
        move(12, 5)
        yield 0.05
    move(0, 10, ctrl=True)
    move(0, 10, shift=True)
    yield DRAW
    assert not np.array_equal(state(), before)
    yield from both_themes(driver, "mid-drag")
    driver.window.event_simulate("ESC", "PRESS", **place)
    driver.window.event_simulate("ESC", "RELEASE", **place)
    yield DRAW
    assert np.array_equal(state(), before), "Esc does not restore the volume"
    start()
    driver.window.event_simulate("R", "PRESS", **place)
    driver.window.event_simulate("R", "RELEASE", **place)
    move(0, 60)
    yield DRAW
    driver.shot("rolling")
    driver.window.event_simulate("LEFTMOUSE", "PRESS", **place)
    driver.window.event_simulate("LEFTMOUSE", "RELEASE", **place)
    yield DRAW
    assert not np.array_equal(state(), before)
    assert bpy.context.window_manager.operators[-1].bl_idname == "SCFPF_OT_volume_frame"
    with driver.override():
        bpy.ops.ed.undo()
    yield DRAW
    assert np.array_equal(state(), before), "undo does not take the framing back in one step"
    assert camera is not None


def safe_areas(driver):
    """The safe areas that the camera shows are drawn in the frame on the near surface, at once."""
    camera = flexible_camera(driver, "nonlinear_twist")
    yield from driver.show_sidebar()
    beside(driver, camera)
    camera.data.show_safe_areas = True
    camera.data.show_safe_center = True
    yield 2 * DRAW
    yield from both_themes(driver, "shown")
    bpy.context.scene.safe_areas.title = (0.6, 0.6)
    yield DRAW
    driver.shot("wider")


# Where the lens goes, as shares of the picture, and how large it is, in halves of its longer side.
PLACE, RADIUS = (0.68, 0.42), 0.3
# Colours that differ by more than what smoothed edges do.
OTHER = 0.08


def in_picture(driver, x, y):
    """The window's pixel of a place of the picture in the Image Editor."""
    region = driver.region("IMAGE_EDITOR")
    column, row = region.view2d.view_to_region(x, y, clip=False)
    return {"x": region.x + column, "y": region.y + row}


def frame_of(area):
    """The camera's frame in a viewport's main region: its low and its high corner, pixels."""
    space = area.spaces.active
    region = next(region for region in area.regions if region.type == "WINDOW")
    camera = space.camera
    corners = [camera.matrix_world @ corner for corner in camera.data.view_frame(scene=bpy.context.scene)]
    places = np.array([location_3d_to_region_2d(region, space.region_3d, corner) for corner in corners])
    return places.min(axis=0), places.max(axis=0)


def rendered(driver):
    """The picture, (H, W, 3)."""
    width, height = bpy.data.images["SCFPF Render"].size
    return driver.pixels().reshape(height, width, 4)[..., :3]


def framed(driver, area, name):
    """The pixels of a viewport inside the camera's frame, (H, W, 3)."""
    picture = look(driver, area, name)
    low, high = (np.rint(corner).astype(int) for corner in frame_of(area))
    return picture[max(low[1], 0) : high[1], max(low[0], 0) : high[0]]


def change(before, after):
    """The share of pixels that differ between two pictures: within the lens, and outside of it."""
    height, width = before.shape[:2]
    x, y = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    away = np.hypot((x - PLACE[0]) * width, (y - PLACE[1]) * height) / (RADIUS * max(width, height) / 2)
    other = np.abs(after - before).max(axis=2) > OTHER
    return other[away < 1].mean(), other[away > 1].mean()


def lens_on_picture(driver):
    """Add a lens and click: render and preview change at that place in the same way, and nowhere else."""
    build_scene(percentage=25)
    driver.add_camera()
    camera = bpy.context.scene.camera
    yield from driver.show_sidebar()
    driver.area("PROPERTIES").ui_type = "IMAGE_EDITOR"
    toggle(driver)
    yield SETTLE
    (shown,) = preview_areas(driver)
    driver.start_render()
    yield from driver.finished()
    with driver.override("IMAGE_EDITOR"):
        bpy.ops.image.view_all(fit_view=True)
    yield DRAW
    before, live_before = rendered(driver), framed(driver, shown, "without")
    with driver.override():
        assert bpy.ops.scfpf.mapping_add("INVOKE_DEFAULT", True, kind="LENS") == {"FINISHED"}
        lens = camera.scfpf.mappings[0]
        lens.radius, lens.magnification = RADIUS, 2.5
        bpy.ops.ed.undo_push(message="Lens")
        assert bpy.ops.scfpf.mapping_place("INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}
    yield DRAW
    driver.shot("waiting-for-the-click")
    where = in_picture(driver, *PLACE)
    for event, value in (("MOUSEMOVE", "NOTHING"), ("LEFTMOUSE", "PRESS"), ("LEFTMOUSE", "RELEASE")):
        driver.window.event_simulate(event, value, **where)
    yield DRAW
    assert np.abs(np.array(lens.centre) - PLACE).max() < 0.01, f"the lens is at {tuple(lens.centre)}"
    driver.start_render()
    yield from driver.finished()
    yield SETTLE
    after, live_after = rendered(driver), framed(driver, shown, "placed")
    for name, (inside, outside) in {
        "render": change(before, after),
        "preview": change(live_before, live_after),
    }.items():
        # Outside, edges of larger faces move by less than a pixel as the preview divides them anew.
        assert inside > 0.05 and outside < 0.004, f"{name}: {inside} of the lens, {outside} of the rest"
    with driver.override():
        bpy.ops.ed.undo()  # of the render
        bpy.ops.ed.undo()
    yield DRAW
    centre = bpy.context.scene.camera.scfpf.mappings[0].centre
    assert tuple(centre) == (0.5, 0.5), f"undo leaves the lens at {tuple(centre)}"


SCENARIOS = (edit_volume, found_in_picture, framing, safe_areas, lens_on_picture)
