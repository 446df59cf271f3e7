# SPDX-License-Identifier: GPL-3.0-or-later
"""A flexible camera that is hidden or deleted; the extension disabled while Blender is at work."""

import time

import bpy
from driver import DRAW, PATIENCE, build_scene
from scenarios_preview import SETTLE, artist_area, preview_areas, source_of, toggle, until_shown


def module():
    """The extension's name, as the preferences list it."""
    return next(name for name in bpy.context.preferences.addons.keys() if name.endswith(".scfpf"))


def activate(obj):
    for other in bpy.context.selected_objects:
        other.select_set(False)
    obj.select_set(True)
    bpy.context.view_layer.objects.active = obj


def green(driver):
    return driver.surface_lines().sum()


def until(condition):
    """Generator: wait until a condition holds."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, "it does not come about"
        yield DRAW


def camera_is_hidden_and_deleted(driver):
    """H, Alt-H, X and undo: volume and surfaces vanish and come back; a deleted camera's preview closes."""
    build_scene()
    driver.add_camera("angular_fisheye")
    driver.look("FRONT", room=2.0)
    yield from until(lambda: green(driver) > 200)
    camera = bpy.context.scene.camera
    names = [slot.object.name for slot in camera.scfpf.surfaces]
    shown = green(driver)
    driver.shot("shown")
    activate(camera)
    driver.key("H")
    yield from until(lambda: green(driver) == 0)
    driver.shot("hidden")
    assert bpy.context.scene.camera.hide_get()
    assert not any(bpy.data.objects[name].visible_get() for name in names)
    driver.key("H", alt=True)
    yield from until(lambda: green(driver) > shown // 2)
    driver.shot("again")
    assert all(bpy.data.objects[name].visible_get() for name in names)
    activate(bpy.context.scene.camera)
    with driver.override():
        bpy.ops.ed.undo_push(message="before")
    toggle(driver)
    yield from until_shown(driver, 1)
    activate(bpy.context.scene.camera)
    driver.key("H")
    yield SETTLE
    driver.shot("preview-of-hidden")
    assert len(preview_areas(driver)) == 1
    driver.key("H", alt=True)
    yield SETTLE
    activate(bpy.context.scene.camera)
    yield DRAW
    with bpy.context.temp_override(window=driver.window, area=artist_area(driver)):
        bpy.ops.object.delete("INVOKE_DEFAULT", True, confirm=False)
    yield from until_shown(driver, 0)
    driver.shot("deleted")
    left = [obj.name for obj in bpy.context.scene.objects if "Flexible" in obj.name]
    assert not left, (left, bpy.data.user_map(subset={bpy.data.objects[left[0]]}))
    assert not [name for name in names if name in bpy.data.objects]
    yield from until(lambda: green(driver) == 0)
    with driver.override():
        bpy.ops.ed.undo()
    yield from until_shown(driver, 1)
    driver.shot("undone")
    assert all(bpy.data.objects[name].visible_get() for name in names)
    with driver.override():
        bpy.ops.ed.redo()
    yield from until_shown(driver, 0)
    assert not [name for name in names if name in bpy.data.objects]


def disabled_and_enabled(at_once=False):
    """Generator: disable the extension, let Blender go on, enable it again, or at once while a job runs."""
    name = module()
    assert bpy.ops.preferences.addon_disable(module=name) == {"FINISHED"}
    yield SETTLE
    if at_once:
        assert bpy.app.is_job_running("RENDER") and hasattr(bpy.types.Object, "scfpf")
    else:
        yield from until(lambda: not bpy.app.is_job_running("RENDER"))
        yield DRAW
        assert not hasattr(bpy.types.Object, "scfpf")
    assert bpy.ops.preferences.addon_enable(module=name) == {"FINISHED"}
    yield SETTLE
    assert hasattr(bpy.types.Object, "scfpf")


def disabled_during_f12(driver):
    """With preview and rig on, by SCFPF and by Cycles, early and late: F12 ends, and works afterwards."""
    build_scene()
    driver.add_camera("angular_fisheye")
    camera, scene = bpy.context.scene.camera, bpy.context.scene
    activate(camera)
    with driver.override():
        bpy.ops.scfpf.cycles_rig()
    activate(camera)
    toggle(driver)
    yield from until_shown(driver, 1)
    scene.cycles.use_adaptive_sampling = False
    bpy.context.preferences.view.render_display_type = "NONE"
    for engine, wait in (("SCFPF", 0.0), ("SCFPF", 1.0), ("CYCLES", 0.0), ("CYCLES", 0.3), ("CYCLES", 2.0)):
        scene.render.engine = engine
        scene.render.resolution_percentage = 50 if engine == "SCFPF" else 10
        scene.cycles.samples, camera.scfpf.samples = 1024 if wait == 0.3 else 128, 64
        bpy.ops.render.render("INVOKE_DEFAULT")
        yield wait
        yield from disabled_and_enabled(at_once=wait == 0.3)
        yield from until(lambda: not bpy.app.is_job_running("RENDER"))
        driver.shot(f"{engine}-{wait}")
        scene.render.resolution_percentage = 2
        scene.cycles.samples = camera.scfpf.samples = 1
        bpy.ops.render.render("INVOKE_DEFAULT")
        yield from until(lambda: not bpy.app.is_job_running("RENDER"))
        yield DRAW


def disabled_at_work(driver):
    """During the Render operator, in a viewport in Rendered shading, and while an animation plays."""
    build_scene()
    driver.add_camera("angular_fisheye")
    bpy.context.scene.camera.scfpf.samples = 1024
    bpy.context.scene.render.resolution_percentage = 100
    driver.start_render()
    yield DRAW
    assert bpy.ops.scfpf.render_cancel.poll()
    yield from disabled_and_enabled()
    assert not bpy.ops.scfpf.render_cancel.poll()
    bpy.context.scene.camera.scfpf.samples = 4
    bpy.context.scene.render.engine = "SCFPF"
    space = driver.area("VIEW_3D").spaces.active
    space.shading.type = "RENDERED"
    space.region_3d.view_perspective = "CAMERA"
    yield DRAW
    yield from disabled_and_enabled()
    space.shading.type = "SOLID"
    activate(bpy.context.scene.camera)
    toggle(driver)
    yield from until_shown(driver, 1)
    with driver.override():
        bpy.ops.screen.animation_play()
    yield DRAW
    yield from disabled_and_enabled()
    with driver.override():
        bpy.ops.screen.animation_cancel()
    yield DRAW
    driver.shot("end")
    assert source_of(bpy.context.scene.camera) is not None


SCENARIOS = (camera_is_hidden_and_deleted, disabled_during_f12, disabled_at_work)
