# SPDX-License-Identifier: GPL-3.0-or-later
"""Live View: viewports that look through a flexible camera follow drags, edits, playback, undo and files."""

import importlib
import sys
import tempfile
import threading
import time

import bmesh
import bpy
import numpy as np
from driver import DRAW, PATIENCE, build_scene
from mathutils import Vector

# Colours, of 255, that differ by more than rounding and half floats.
OTHER = 3
# Images of a drag or a playback, at least: how many there are depends on the machine.
FEWEST_IMAGES = 2


def module(name):
    """A module of the installed extension."""
    package = next(key for key in sys.modules if key.endswith(".scfpf.scfpf_addon"))
    return importlib.import_module(f"{package}.{name}")


def viewports():
    """The live views of the window's viewports."""
    return list(module("bridge.live.live_drawing")._viewports.values())


def settled():
    """Generator: wait until final images are drawn and no other ones come."""
    end, numbers, since = time.monotonic() + PATIENCE, None, time.monotonic()
    while time.monotonic() - since < 2 * DRAW:
        assert time.monotonic() < end, f"no final image comes: {[one.message for one in viewports()]}"
        yield 0.1
        found = viewports()
        now = [(id(one), one.view.painter.number) for one in found]
        is_final = found and not any(one.is_late or one.view.painter.busy for one in found)
        images = [one.view.painter.image for one in found]
        if not is_final or now != numbers or any(image is None or image.step > 1.0 for image in images):
            numbers, since = now, time.monotonic()


def look_through(driver, preset="nonlinear_twist"):
    """Generator: a scene, a flexible camera, and a viewport that looks through it, in Solid shading."""
    build_scene()
    driver.add_camera(preset)
    space = driver.area("VIEW_3D").spaces.active
    space.region_3d.view_perspective = "CAMERA"
    space.show_gizmo = space.overlay.show_text = False
    for obj in bpy.context.selected_objects:
        obj.select_set(False)
    yield from settled()
    return bpy.context.scene.camera


def framed(pixels, image):
    """The part of a region's pixels that an image covers."""
    left, bottom, width, height = (round(number) for number in image.rectangle)
    return pixels[bottom : bottom + height, left : left + width]


def assert_shown(driver, share=0.97):
    """Check that the viewport shows the final image, but for what is drawn on top."""
    (one,) = viewports()
    image = one.view.painter.image
    shown = framed(driver.region_pixels(), image)
    expected = image.pixels[..., :3] * 255
    assert shown.shape == expected.shape
    same = (np.abs(shown - expected) <= OTHER).all(axis=2).mean()
    assert same > share, f"{same:.1%} of the pixels are those of the image"
    return shown


def follows(driver):
    """The image is drawn in the frame and nowhere else; it follows a surface; switches end it."""
    camera = yield from look_through(driver)
    driver.shot("first")
    before, image = assert_shown(driver), viewports()[0].view.painter.image
    whole = driver.region_pixels()
    camera.scfpf.show_live = False
    yield DRAW
    assert not viewports()
    without = driver.region_pixels()
    assert (np.abs(framed(without, image) - before).max(axis=2) > OTHER).mean() > 0.3
    framed(whole, image)[:] = framed(without, image)
    # Blender's own smooth edges need not be the same twice.
    assert (np.abs(whole - without).max(axis=2) > 8 * OTHER).mean() < 1e-3, "pixels outside differ"
    camera.scfpf.show_live = True
    camera.scfpf.surfaces[1].object.location.x += 1.0
    yield from settled()
    driver.shot("moved")
    assert np.abs(assert_shown(driver) - before).mean() > 1
    space = driver.area("VIEW_3D").spaces.active
    for kind in ("RENDERED", "WIREFRAME"):
        space.shading.type = kind
        yield DRAW
        assert not viewports(), kind
    # What EEVEE draws is hidden, and most of its time goes into the shaders of materials.
    for mesh in bpy.data.meshes:
        mesh.materials.clear()
    bpy.context.scene.eevee.taa_samples = 1
    space.shading.type = "MATERIAL"
    yield from settled()
    assert_shown(driver)
    space.region_3d.view_perspective = "PERSP"
    yield DRAW
    assert not viewports()


def steps_aside_in_edit_mode(driver):
    """In Edit Mode the viewport shows the mesh as Blender does, and a line says so; no volume is drawn."""
    camera = yield from look_through(driver)
    driver.add_camera("perspective")
    other = bpy.context.object
    bpy.context.scene.camera = camera
    other.location = camera.matrix_world @ Vector((0.3, 0.0, -4.0))
    cube = bpy.data.objects["Cube"]
    other.select_set(False)
    cube.select_set(True)
    bpy.context.view_layer.objects.active = cube
    yield from settled()
    driver.shot("before")
    # Nothing of the other camera's volume is drawn over the image; the cube's outline is part of it.
    assert_shown(driver, 0.995)
    with driver.override():
        bpy.ops.object.mode_set(mode="EDIT")
    yield DRAW
    driver.shot("edited")
    assert not viewports()
    camera.scfpf.show_live = False
    before = driver.region_pixels()
    yield DRAW
    lines = (np.abs(driver.region_pixels() - before).max(axis=2) > OTHER).mean()
    assert 0 < lines < 0.05, "there is more or less than a line of text"
    camera.scfpf.show_live = True
    with driver.override():
        bpy.ops.object.mode_set(mode="OBJECT")
    yield from settled()
    assert_shown(driver)


def dragged(driver, obj, steps=25):
    """Generator: drag an object with G and the mouse; return the number of images meanwhile."""
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj
    window, region = driver.window, driver.region("VIEW_3D")
    x, y = region.x + region.width // 2, region.y + region.height // 2
    window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)
    yield 0.2
    for value in ("PRESS", "RELEASE"):
        window.event_simulate("G", value, x=x, y=y)
    yield 0.2
    painter = viewports()[0].view.painter
    begun, first = time.monotonic(), painter.answered
    for step in range(steps):
        window.event_simulate("MOUSEMOVE", "NOTHING", x=x + 3 * step, y=y)
        yield 0.05
    driver.shot("dragged")
    images = painter.answered - first
    print(f"{images / (time.monotonic() - begun):.1f} images a second", flush=True)
    for value in ("PRESS", "RELEASE"):
        window.event_simulate("RET", value, x=x, y=y)
    yield from settled()
    obj.select_set(False)
    yield from settled()
    return images


def drags(driver):
    """Images come while a surface and an object are dragged; undo brings the first one back."""
    camera = yield from look_through(driver)
    before = assert_shown(driver)
    camera.scfpf.edit_volume = True
    yield from settled()
    with driver.override():
        bpy.ops.ed.undo_push(message="Before")
    for obj in (camera.scfpf.surfaces[1].object, bpy.data.objects["Suzanne"]):
        place = obj.location.copy()
        images = yield from dragged(driver, obj)
        assert images >= FEWEST_IMAGES
        assert (obj.location - place).length > 0.1
        assert np.abs(assert_shown(driver) - before).mean() > 0.5
    for _ in range(20):
        with driver.override():
            if bpy.ops.ed.undo.poll():
                bpy.ops.ed.undo()
        yield 0.2
        if (bpy.data.objects["Suzanne"].location - place).length < 1e-5:
            break
    yield from settled()
    driver.shot("undone")
    assert_shown(driver, 0.9)


def edits(driver):
    """Edit Mode of a control surface shows its vertices on top, and its edits in the image."""
    camera = yield from look_through(driver, "occlusion_camera")
    surface = camera.scfpf.surfaces[2].object
    camera.scfpf.edit_volume = True
    surface.hide_set(False)
    surface.select_set(True)
    bpy.context.view_layer.objects.active = surface
    yield from settled()
    driver.shot("selected")
    with driver.override():
        bpy.ops.object.mode_set(mode="EDIT")
    yield from settled()
    driver.shot("edit-mode")
    before = assert_shown(driver, 0.3)
    mesh = bmesh.from_edit_mesh(surface.data)
    mesh.verts.ensure_lookup_table()
    for vertex in mesh.verts:
        vertex.co.x += 1.0
    bmesh.update_edit_mesh(surface.data)
    yield from settled()
    driver.shot("edited")
    assert np.abs(assert_shown(driver, 0.3) - before).mean() > 1
    with driver.override():
        bpy.ops.object.mode_set(mode="OBJECT")
    yield from settled()


def plays(driver):
    """Playback makes images of the moving surface."""
    camera = yield from look_through(driver)
    surface = camera.scfpf.surfaces[1].object
    for frame, x in ((1, -1.5), (40, 1.5)):
        surface.location.x = x
        surface.keyframe_insert("location", frame=frame)
    yield from settled()
    painter, first = viewports()[0].view.painter, viewports()[0].view.painter.answered
    with driver.override():
        bpy.ops.screen.animation_play()
    yield 3.0
    made = painter.answered - first
    driver.shot("playing")
    with driver.override():
        bpy.ops.screen.animation_cancel(restore_frame=False)
    print(f"{made / 3:.1f} images a second", flush=True)
    assert made >= FEWEST_IMAGES
    yield from settled()
    assert_shown(driver)


def ends(driver):
    """An error is a line of text; files and closed viewports leave no live view and no thread behind."""
    camera = yield from look_through(driver)
    surface = camera.scfpf.surfaces[1].object
    camera.scfpf.surfaces[1].object = None
    yield DRAW
    driver.shot("error")
    assert "empty" in viewports()[0].message
    camera.scfpf.surfaces[1].object = surface
    yield from settled()
    assert_shown(driver)
    with driver.override():
        bpy.ops.screen.area_split(direction="VERTICAL")
    yield from settled()
    assert len(viewports()) == 2
    driver.shot("two")
    with driver.override():
        bpy.ops.screen.area_close()
    yield 3 * DRAW
    with tempfile.TemporaryDirectory() as folder:
        path = f"{folder}/live.blend"
        with driver.override():
            bpy.ops.wm.save_as_mainfile(filepath=path)
            bpy.ops.wm.open_mainfile(filepath=path)
    yield from settled()
    assert len(viewports()) == 1
    assert_shown(driver)
    with driver.override():
        bpy.ops.wm.read_homefile()
    yield DRAW
    assert not viewports() and not module("bridge.live.live_view").sources()
    assert not [thread for thread in threading.enumerate() if "live" in thread.name]


SCENARIOS = (follows, drags, steps_aside_in_edit_mode, edits, plays, ends)
