# SPDX-License-Identifier: GPL-3.0-or-later
"""A magic lens placed with a click in the image: render and live preview agree, and undo removes it."""

import bpy
import numpy as np
from bpy_extras.view3d_utils import location_3d_to_region_2d
from driver import DRAW, build_scene
from scenarios_preview import SETTLE, look, preview_areas, toggle

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


SCENARIOS = (lens_on_picture,)
