# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames by hand: those of a view and a layer are dragged in Live View, and the image follows."""

import math
import pathlib
import tempfile
import time

import bpy
import numpy as np
from driver import DRAW, PATIENCE
from scenarios_clicks import STEP, place_in_frame, select_only, undo
from scenarios_live import module, settled

# Of 255: the mean change of an image in which something has moved, and of one that is the same.
MOVED, SAME = 0.5, 0.3


def block(name, place, size, color):
    """A box on the ground."""
    bpy.ops.mesh.primitive_cube_add(size=1.0, location=place)
    obj = bpy.context.object
    obj.name, obj.scale = name, size
    material = bpy.data.materials.new(name)
    material.diffuse_color = (*color, 1.0)
    obj.data.materials.append(material)
    return obj


def prepare(driver):
    """Generator: a car between houses, a view of it, and Live View through the camera.

    Solves take one way, judged by a small image: these scenarios are about events.
    """
    rounds = module("aim.rounds")
    module("bridge.aim.solve_targets").COLUMNS = 64
    rounds.other_ways, rounds.MENDABLE = (lambda first: []), 0.0
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    bpy.ops.mesh.primitive_plane_add(size=60)
    car = bpy.data.collections.new("Car")
    bpy.context.scene.collection.children.link(car)
    parts = [
        block("Body", (0.0, 0.0, 0.65), (1.8, 4.2, 0.8), (0.05, 0.4, 0.5)),
        block("Cabin", (0.0, 0.3, 1.3), (1.5, 2.0, 0.6), (0.1, 0.1, 0.12)),
        block("Lamps", (0.0, -2.12, 0.75), (1.4, 0.06, 0.2), (1.0, 0.9, 0.4)),
    ]
    for part in parts:
        for collection in part.users_collection:
            collection.objects.unlink(part)
        car.objects.link(part)
    for number, (x, y, high) in enumerate(((-9, 14, 7), (-3, 20, 11), (5, 18, 5), (11, 13, 9))):
        block(f"House {number}", (x, y, high / 2), (5.0, 4.0, high), (0.7, 0.3 + 0.1 * number, 0.3))
    bpy.ops.object.camera_add(location=(0, -12, 2), rotation=(math.radians(89), 0, 0))
    scene, camera = bpy.context.scene, bpy.context.object
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = 1200, 600
    select_only("Cabin", "Body", "Lamps")
    with driver.override():
        done = bpy.ops.scfpf.aim_view_add("INVOKE_DEFAULT", True, camera=camera.name, collection="Car")
    assert done == {"FINISHED"} and camera.scfpf.enabled
    space = driver.area("VIEW_3D").spaces.active
    space.shading.color_type = "MATERIAL"
    select_only(camera.name)
    with driver.override():
        assert bpy.ops.scfpf.view_live("INVOKE_DEFAULT", True) == {"FINISHED"}
        bpy.ops.view3d.view_center_camera()
    yield from driver.show_sidebar()
    yield from settled()
    return camera


def in_frame(driver, target, u, v):
    """The pixel of the window at a place of a target's sphere, each from -1 to 1."""
    scene = bpy.context.scene
    aspect = scene.render.resolution_x / scene.render.resolution_y
    x, y = target.position[0] + u * target.width / 2, target.position[1] + v * target.width / 2 * aspect
    return place_in_frame(driver, x, y)


def drag_mouse(driver, start, end, name, steps=6):
    """Generator: press at a pixel of the window, move to another, and take a picture before the release."""
    for step in range(-1, steps + 1):
        share = max(step, 0) / steps
        x, y = (round(a + share * (b - a)) for a, b in zip(start, end, strict=True))
        driver.window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)
        yield STEP
        if step == -1:
            driver.shot(f"{name}-before")
            driver.window.event_simulate("LEFTMOUSE", "PRESS", x=x, y=y)
            yield STEP
    driver.shot(f"{name}-dragged")
    driver.window.event_simulate("LEFTMOUSE", "RELEASE", x=x, y=y)


def picture(driver):
    """Generator: the pixels of the viewport once all is drawn, without frames: the mouse highlights them."""
    space = driver.area("VIEW_3D").spaces.active
    space.show_gizmo = False
    yield from settled()
    pixels = driver.region_pixels()
    space.show_gizmo = True
    yield DRAW
    return pixels


def solved(driver):
    """Generator: wait until no solve is under way or due."""
    live, end = module("bridge.aim.live_aim"), time.monotonic() + PATIENCE
    while live.is_busy() or any("aim" in o.bl_idname for o in driver.window.modal_operators):
        assert time.monotonic() < end, "the solve hangs"
        yield 0.1
    yield from settled()


def a_frame_is_dragged(driver):
    """The car's frame is dragged in Live View: the image follows, and undo leads back."""
    camera = yield from prepare(driver)
    target = camera.scfpf.aim_targets[0]
    first, place = (yield from picture(driver)), tuple(target.position)
    start = in_frame(driver, target, 0.0, 0.0)
    yield from drag_mouse(driver, start, (start[0] + 90, start[1] + 10), "move")
    yield STEP
    yield from solved(driver)
    driver.shot("moved")
    target = bpy.context.scene.camera.scfpf.aim_targets[0]
    assert target.position[0] > place[0] + 0.03, f"the view is at {tuple(target.position)}"
    assert np.abs((yield from picture(driver)) - first).mean() > MOVED, "the image is as before"
    undo(driver)
    yield from settled()
    target = bpy.context.scene.camera.scfpf.aim_targets[0]
    assert np.allclose(target.position, place), "undo leaves the view where it was dragged"
    assert np.abs((yield from picture(driver)) - first).mean() < SAME, "undo leaves another image"


def shown_at(driver, camera, point):
    """The pixels of the window, from the frame's corner, at which the camera's volume shows a world point."""
    size = np.subtract(place_in_frame(driver, 1.0, 1.0), place_in_frame(driver, 0.0, 0.0))
    depsgraph = bpy.context.evaluated_depsgraph_get()
    projection = module("bridge.camera.read_projection").read_projection(camera, depsgraph, 2.0)
    found = module("projection.volume.inverse").find_in_image(projection, np.array(point)[:, None])
    assert found.found.all()
    return np.array([found.x[0], found.y[0]]) * size


def a_drag_keeps_up(driver):
    """The frame is dragged by 10 pixels an event: as each is handled, the lamps are where the mouse is."""
    camera = yield from prepare(driver)
    with driver.override():
        assert bpy.ops.scfpf.aim_solve("INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}
    yield from solved(driver)
    target, lamps = camera.scfpf.aim_targets[0], (0.0, -2.15, 0.75)
    (x, y), before = in_frame(driver, target, 0.0, 0.0), shown_at(driver, camera, lamps)
    move = driver.window.event_simulate
    move("MOUSEMOVE", "NOTHING", x=x, y=y)
    yield STEP
    move("LEFTMOUSE", "PRESS", x=x, y=y)
    yield STEP
    lags = []
    for event in range(1, 10):
        move("MOUSEMOVE", "NOTHING", x=x + 10 * event, y=y)
        yield STEP
        lags.append(np.hypot(*(shown_at(driver, camera, lamps) - before - (10.0 * event, 0.0))))
    driver.shot("kept-up")
    move("LEFTMOUSE", "RELEASE", x=x + 90, y=y)
    yield STEP
    yield from solved(driver)
    print("lag of the drag, pixels:", np.round(lags, 2).tolist())
    assert np.median(lags) <= 1.0, f"the car is behind the mouse by {np.round(lags, 2).tolist()} pixels"


def press(driver, key):
    """Press and release a key where the mouse is."""
    for value in ("PRESS", "RELEASE"):
        driver.window.event_simulate(key, value, x=driver.region("VIEW_3D").x + 300, y=400)


def the_eye_is_turned(driver):
    """The volume follows the view's camera; keys move the frame, and Esc leads back; a file keeps all."""
    camera = yield from prepare(driver)
    name = camera.name
    with driver.override():
        assert bpy.ops.scfpf.aim_solve("INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}
    yield from solved(driver)
    with driver.override():
        assert bpy.ops.scfpf.aim_live("EXEC_DEFAULT", True, camera=camera.name) == {"FINISHED"}
    before = yield from picture(driver)
    for _ in range(2):
        with driver.override():
            assert bpy.ops.scfpf.aim_turn("EXEC_DEFAULT", True, left=math.radians(8)) == {"FINISHED"}
        yield 2 * STEP
        assert "Follows within" in camera.scfpf.aim.message, camera.scfpf.aim.message
    yield from solved(driver)
    driver.shot("turned")
    turned = yield from picture(driver)
    assert np.abs(turned - before).mean() > MOVED, "the image does not follow the view's camera"
    assert "points within" in camera.scfpf.aim.message, camera.scfpf.aim.message
    target = camera.scfpf.aim_targets[0]
    place, eye = tuple(target.position), target.eye.name
    with driver.override():
        assert bpy.ops.scfpf.aim_drag("INVOKE_DEFAULT", True) == {"RUNNING_MODAL"}
    yield STEP
    for key in ("RIGHT_ARROW", "RIGHT_ARROW", "UP_ARROW"):
        press(driver, key)
        yield STEP
    driver.shot("keys")
    assert np.allclose(np.array(target.position) - place, (2 / 1200, 1 / 600), atol=1e-5), (
        "arrows do not move it"
    )
    press(driver, "ESC")
    yield from settled()
    assert np.allclose(target.position, place) and camera.scfpf.aim.live, "Esc does not lead back"
    assert np.abs((yield from picture(driver)) - turned).mean() < SAME, "Esc leaves another image"
    path = str(pathlib.Path(tempfile.mkdtemp()) / "aim.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.open_mainfile(filepath=path)
    yield from settled()
    target = bpy.data.objects[name].scfpf.aim_targets[0]
    assert (target.eye.name, target.name) == (eye, "Car") and np.allclose(target.position, place)
    assert np.abs((yield from picture(driver)) - turned).mean() < SAME, "the file shows another image"
    with driver.override():
        bpy.ops.view3d.view_camera()
    yield DRAW
    driver.shot("scene")


def a_corner_in_an_image_editor(driver):
    """A corner of the frame is dragged over the render: the view grows about the opposite corner."""
    camera = yield from prepare(driver)
    bpy.context.scene.render.resolution_percentage = 40
    driver.area("PROPERTIES").ui_type = "IMAGE_EDITOR"
    driver.start_render()
    yield from driver.finished()
    with driver.override("IMAGE_EDITOR"):
        bpy.ops.image.view_all(fit_view=True)
    yield DRAW
    target = camera.scfpf.aim_targets[0]
    width, place = target.width, np.array(target.position)
    region = driver.region("IMAGE_EDITOR")
    area = driver.area("IMAGE_EDITOR")
    with bpy.context.temp_override(window=driver.window, area=area, region=region):
        image = module("bridge.frames.shown_image").shown_image(bpy.context)
        (found,) = module("bridge.aim.shown_targets").shown_targets(bpy.context, image)
    corner, opposite = found.frame.corners[:, 2], found.frame.corners[:, 0]
    start = np.array([region.x, region.y]) + corner
    yield from drag_mouse(driver, start, start + 0.15 * (corner - opposite), "corner", steps=3)
    yield STEP
    yield from solved(driver)
    driver.shot("larger")
    target = bpy.context.scene.camera.scfpf.aim_targets[0]
    assert abs(target.width / width - 1.15) < 0.05, f"the view is {target.width / width:.3f} times as large"
    assert target.position[0] > place[0] and target.position[1] > place[1]


def the_ring_turns_the_thing(driver):
    """The ring around the car's frame is dragged to the right: its eye goes left, and undo leads back."""
    camera = yield from prepare(driver)
    first = yield from picture(driver)
    target = camera.scfpf.aim_targets[0]
    start, region = target.eye.matrix_world.copy(), driver.region("VIEW_3D")
    with driver.override():
        image = module("bridge.frames.shown_image").shown_image(bpy.context)
        (found,) = module("bridge.aim.shown_targets").shown_targets(bpy.context, image)
        ring = found.frame.ring(bpy.context.preferences.system.ui_scale)
    side = np.array([region.x, region.y]) + ring[:, ring.shape[1] // 2]
    yield from drag_mouse(driver, side, side + np.array([30, 0]), "ring")
    yield STEP
    yield from solved(driver)
    driver.shot("turned")
    eye = bpy.context.scene.camera.scfpf.aim_targets[0].eye
    went = start.inverted() @ eye.matrix_world.translation
    assert went.x < -1.0 and abs(went.y) < 0.2 * abs(went.x), f"the eye went to {went[:]}"
    assert np.abs((yield from picture(driver)) - first).mean() > MOVED, "the image is as before"
    undo(driver)
    yield from settled()
    eye = bpy.context.scene.camera.scfpf.aim_targets[0].eye
    assert np.allclose(eye.matrix_world, start, atol=1e-5), "undo leaves the eye where it was led"


def a_layers_frame_is_dragged(driver):
    """A layer's corner and the dot in its middle are dragged; other clicks select, and undo leads back."""
    for obj in list(bpy.data.objects):
        if obj.type != "CAMERA":
            bpy.data.objects.remove(obj)
    bpy.ops.mesh.primitive_plane_add(size=60)
    block("Ball", (0.0, 0.0, 1.0), (2.0, 2.0, 2.0), (0.9, 0.3, 0.1))
    block("House", (4.0, 9.0, 3.0), (5.0, 4.0, 6.0), (0.3, 0.4, 0.7))
    scene, camera = bpy.context.scene, bpy.context.scene.camera
    camera.location, camera.rotation_euler = (0.0, -12.0, 2.0), (math.pi / 2, 0.0, 0.0)
    scene.render.resolution_x, scene.render.resolution_y = 1200, 600
    select_only("Ball")
    with driver.override():
        assert bpy.ops.scfpf.layer_add("EXEC_DEFAULT", True, camera=camera.name) == {"FINISHED"}
    select_only(camera.name)
    driver.area("VIEW_3D").spaces.active.shading.color_type = "MATERIAL"
    with driver.override():
        assert bpy.ops.scfpf.view_live("INVOKE_DEFAULT", True) == {"FINISHED"}
        bpy.ops.view3d.view_center_camera()
    # Off the borders, which toolbars cover.
    camera.scfpf.layers[0].size = 0.6, 0.6
    yield from settled()
    first = yield from picture(driver)
    low, high = (np.array(place_in_frame(driver, share, share)) for share in (0.0, 1.0))
    yield from drag_mouse(driver, low + 0.8 * (high - low), low + 0.5 * (high - low), "layer-corner")
    yield from settled()
    layer = bpy.context.scene.camera.scfpf.layers[0]
    assert np.allclose(layer.size, 0.3, atol=0.02), f"the layer's size is {tuple(layer.size)}"
    assert np.allclose(layer.position, 0.35, atol=0.02), "the opposite corner has moved"
    smaller = yield from picture(driver)
    assert np.abs(smaller - first).mean() > MOVED, "the image is as before"
    middle = low + 0.35 * (high - low)
    yield from drag_mouse(driver, middle, middle + 0.2 * (high - low), "layer-middle")
    yield from settled()
    driver.shot("placed")
    layer = bpy.context.scene.camera.scfpf.layers[0]
    assert np.allclose(layer.position, 0.55, atol=0.02), f"the layer is at {tuple(layer.position)}"
    # On the ball, below the dot.
    x, y = place_in_frame(driver, 0.55, 0.48)
    for kind, value in (("MOUSEMOVE", "NOTHING"), ("LEFTMOUSE", "PRESS"), ("LEFTMOUSE", "RELEASE")):
        driver.window.event_simulate(kind, value, x=round(x), y=round(y))
        yield 2 * STEP
    yield DRAW
    assert bpy.context.object.name == "Ball", f"the click has selected {bpy.context.object.name}"
    for _ in range(2):
        undo(driver)
    yield from settled()
    layer = bpy.context.scene.camera.scfpf.layers[0]
    assert np.allclose(layer.size, 0.3, atol=0.02) and np.allclose(layer.position, 0.35, atol=0.02)


SCENARIOS = (
    a_frame_is_dragged,
    a_drag_keeps_up,
    the_eye_is_turned,
    the_ring_turns_the_thing,
    a_corner_in_an_image_editor,
    a_layers_frame_is_dragged,
)
