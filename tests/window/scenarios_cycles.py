# SPDX-License-Identifier: GPL-3.0-or-later
"""The Cycles rig in a window: the button, F12 and Ctrl-F12, a farm without the add-on, and no remains."""

import pathlib
import shutil
import subprocess
import sys
import tempfile
import time

import bpy
import numpy as np
from driver import DRAW, PATIENCE, build_scene, differing
from scenarios_lifetime import disabled_and_enabled

# Pixels that may differ where nothing has changed: a cursor, a flicker of text.
HARDLY = 100
# Rows at the bottom of a viewport where the panel of the last operator comes and goes.
HUD = 60
KINDS = ("objects", "meshes", "cameras", "materials", "collections", "node_groups", "actions", "scenes")
FRAMES = (1, 10)


def counts():
    """The number of datablocks of each kind."""
    return {kind: len(getattr(bpy.data, kind)) for kind in KINDS}


def prepare(driver):
    """A bent, animated volume, and settings that take Cycles a moment."""
    build_scene(percentage=8)
    driver.add_camera("nonlinear_twist")
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = FRAMES
    middle = scene.camera.scfpf.surfaces[1].object
    middle.keyframe_insert("location", frame=FRAMES[0])
    middle.location.x += 4
    middle.keyframe_insert("location", frame=FRAMES[1])
    scene.frame_set(FRAMES[0])
    scene.cycles.samples, scene.cycles.use_denoising = 4, False
    bpy.context.preferences.view.render_display_type = "AREA"
    return scene


def f12(driver, **modifiers):
    """Generator: press F12 and wait for the picture, or with Ctrl for the animation."""
    done = []
    bpy.app.handlers.render_complete.append(lambda *_: done.append(True))
    driver.key("F12", **modifiers)
    end = time.monotonic() + PATIENCE
    # A render of this size may be over before it is looked at.
    while not done or bpy.app.is_job_running("RENDER"):
        assert time.monotonic() < end, "F12 renders nothing, or does not end"
        yield 0.1
    bpy.app.handlers.render_complete.pop()
    yield DRAW


def rendered(path):
    """The pixels of an image file, (H, W, 4)."""
    image = bpy.data.images.load(str(path))
    pixels = np.array(image.pixels[:]).reshape(image.size[1], image.size[0], 4)
    bpy.data.images.remove(image)
    return pixels


def blocks(pixels, side=8):
    """The means of squares of an image's pixels."""
    rows, columns = (length // side for length in pixels.shape[:2])
    return pixels[: rows * side, : columns * side].reshape(rows, side, columns, side, -1).mean(axis=(1, 3))


def steady(driver):
    """Generator: wait until the viewport stops changing; returns its pixels."""
    end = time.monotonic() + PATIENCE
    pixels = driver.region_pixels()[HUD:]
    while True:
        yield DRAW
        before, pixels = pixels, driver.region_pixels()[HUD:]
        if differing(before, pixels) == 0 or time.monotonic() > end:
            return pixels


def rig_of(scene):
    """The collection of a scene's rig, or None."""
    found = (c for c in bpy.data.collections if c.scfpf_rig.is_rig and c.scfpf_rig.scene == scene)
    return next(found, None)


def module(name):
    """A module of the extension."""
    return next(m for full, m in sys.modules.items() if full.endswith(name))


def price(driver):
    """The price before the rig is made, progress while it is, and Esc."""
    scene = prepare(driver)
    camera, frame = scene.camera, scene.frame_current
    before = counts()
    depsgraph = bpy.context.evaluated_depsgraph_get()
    answers = module(".cycles.prices").compute(camera, scene, depsgraph)
    assert answers.chords > 1 and answers.portals == answers.chords + 1, answers
    with driver.override():
        assert bpy.ops.scfpf.cycles_rig("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    driver.key("ESC")
    yield DRAW
    driver.shot("canceled")
    assert rig_of(scene) is None and scene.camera == camera and scene.frame_current == frame
    assert counts() == before, (before, counts())


def rig(driver):
    """The panel's button, F12, `blender -b --factory-startup`, and the button again."""
    scene = prepare(driver)
    camera = scene.camera
    driver.show_data_tab()
    yield DRAW
    before, looked = counts(), (yield from steady(driver))
    with driver.override():
        assert bpy.ops.scfpf.cycles_rig("INVOKE_DEFAULT") == {"RUNNING_MODAL"}
    end = time.monotonic() + PATIENCE
    while rig_of(scene) is None:
        assert time.monotonic() < end, "the rig is not made"
        yield 0.1
    yield DRAW
    assert scene.camera != camera and scene.render.engine == "CYCLES"
    changed = differing(looked, (yield from steady(driver)))
    driver.shot("switched")
    assert changed < HARDLY, f"the viewport shows something of the rig: {changed} pixels"
    with driver.override():
        bpy.ops.wm.call_panel(name="SCFPF_PT_view_cycles")
    yield DRAW
    driver.shot("panel")
    driver.key("ESC")
    yield DRAW
    blend = driver.folder / "rig.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend), copy=True)
    farm = farm_render(blend)
    yield from f12(driver)
    driver.shot("rendered")
    here = driver.folder / "here.png"
    bpy.data.images["Render Result"].save_render(str(here))
    assert farm.wait(PATIENCE) == 0, "blender -b --factory-startup fails"
    first, last = (rendered(f"{blend}.{frame:04}.png") for frame in FRAMES)
    picture = rendered(here)
    assert picture[..., :3].std(axis=(0, 1)).min() > 0.03, "the picture is of one colour"
    assert np.abs(picture - first).max() < 0.01, "without the add-on the picture is another one"
    assert np.abs(first - last).mean() > 0.01, "the animated surface does not move without the add-on"
    driver.area("IMAGE_EDITOR").ui_type = "VIEW_3D"
    yield DRAW
    with driver.override():
        assert bpy.ops.scfpf.cycles_rig("INVOKE_DEFAULT") == {"FINISHED"}
    yield DRAW
    assert scene.camera == camera and counts() == before, (before, counts())


def moving(driver):
    """Ctrl-F12 of a moving volume: rays skip chords in every frame; the images are those of whole sheets."""
    scene = prepare(driver)
    scene.frame_step = FRAMES[1] - FRAMES[0]
    with driver.override():
        assert bpy.ops.scfpf.cycles_rig() == {"FINISHED"}
    blend = driver.folder / "moving.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend), copy=True)
    farm = farm_render(blend)
    skipped = {}
    skips = module(".cycles.skipping.refresh").skips

    def note(*_):
        skipped[scene.frame_current] = skips(rig_of(scene))

    scene.render.filepath = str(driver.folder / "moving.####.png")
    scene.render.image_settings.file_format = "PNG"
    bpy.app.handlers.render_post.append(note)
    try:
        yield from f12(driver, ctrl=True)
    finally:
        bpy.app.handlers.render_post.remove(note)
    driver.shot("rendered")
    assert skipped == dict.fromkeys(FRAMES, True), skipped
    assert farm.wait(PATIENCE) == 0, "blender -b --factory-startup fails"
    for frame in FRAMES:
        picture, whole = (rendered(f"{path}.{frame:04}.png") for path in (driver.folder / "moving", blend))
        assert picture[..., :3].std(axis=(0, 1)).min() > 0.03, "the picture is of one colour"
        # Rays that pass other portals draw other random numbers: blocks of pixels are compared, not pixels.
        off = np.abs(blocks(picture) - blocks(whole)).mean()
        assert off < 0.01, f"frame {frame} is another image: {off:.3f}"


def farm_render(blend):
    """Start a Blender without the add-on on two frames of a file."""
    frames = ",".join(map(str, FRAMES))
    command = [bpy.app.binary_path, "--background", "--factory-startup", str(blend)]
    command += ["--render-output", f"{blend}.####", "--render-format", "PNG", "--render-frame", frames]
    return subprocess.Popen(command)


def animation(driver, camera, thing, ended):
    """Render the frame range into files as the button beside it does; return the counts of datablocks."""
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end = 1, 2
    thing.keyframe_insert("location", frame=1)
    thing.location.x += 2.0
    thing.keyframe_insert("location", frame=2)
    scene.frame_set(1)
    before = counts()
    folder = pathlib.Path(tempfile.mkdtemp(prefix="scfpf-frames-"))
    scene.render.filepath = f"{folder}/at_##.png"
    with driver.override():
        invoked = bpy.ops.scfpf.layers_render("INVOKE_DEFAULT", camera=camera.name, animation=True)
    assert invoked == {"RUNNING_MODAL"}
    yield 0.5
    yield from ended()
    driver.shot("animation")
    frames = sorted(folder.iterdir())
    assert [path.name for path in frames] == ["at_01.png", "at_02.png"], frames
    assert frames[0].read_bytes() != frames[1].read_bytes(), "the second frame is the first one"
    assert scene.frame_current == 1 and counts() == before, (scene.frame_current, counts())
    shutil.rmtree(folder)
    return before


def layers(driver):
    """Render Layers with Cycles: render by render, the picture in an editor, then Esc; nothing is left."""
    build_scene(percentage=8)
    driver.add_camera("perspective")
    scene = bpy.context.scene
    scene.cycles.samples, scene.cycles.use_denoising = 2, False
    bpy.context.preferences.view.render_display_type = "AREA"
    camera = scene.camera
    thing = bpy.data.objects["Cube"]
    group = bpy.data.collections.new("Thing")
    scene.collection.children.link(group)
    group.objects.link(thing)
    with driver.override():
        assert bpy.ops.scfpf.layer_add(camera=camera.name, collection="Thing") == {"FINISHED"}
    driver.open_image_editor()
    yield DRAW
    before = counts()
    result = module(".bridge.render.result_image").result_image

    def ended():
        end = time.monotonic() + PATIENCE
        while len(bpy.data.scenes) > before["scenes"] or bpy.app.is_job_running("RENDER"):
            assert time.monotonic() < end, "the render does not end"
            yield 0.1
        yield DRAW

    with driver.override():
        assert bpy.ops.scfpf.layers_render("INVOKE_DEFAULT", camera=camera.name) == {"RUNNING_MODAL"}
    yield 0.5
    driver.shot("progress")
    yield from ended()
    driver.shot("done")
    assert result() is not None and driver.pixels().reshape(-1, 4)[:, :3].std() > 0.02, "no picture"
    assert counts() == before, (before, counts())
    before = yield from animation(driver, camera, thing, ended)
    kept = driver.pixels().copy()
    scene.world.color = (0.9, 0.1, 0.1)
    scene.cycles.samples = 3
    # Blender itself sees Esc while it renders, but no simulated one: its handler stands for that.
    for cancel in (lambda: driver.key("ESC", "IMAGE_EDITOR"), module(".layers.layer_render")._note_cancel):
        with driver.override("IMAGE_EDITOR"):
            assert bpy.ops.scfpf.layers_render("INVOKE_DEFAULT", camera=camera.name) == {"RUNNING_MODAL"}
        cancel()
        yield from ended()
        yield 1.0
        yield from ended()
    assert counts() == before, (before, counts())
    assert np.array_equal(driver.pixels(), kept), "Esc has changed the picture"


def layers_disabled(driver):
    """The extension is disabled while Cycles renders layers, early and late: the scene is as before."""
    build_scene()
    driver.add_camera("angular_fisheye")
    scene = bpy.context.scene
    scene.cycles.use_adaptive_sampling, scene.cycles.use_denoising = False, False
    # How long a render takes shall not depend on the number of cores.
    scene.render.threads_mode, scene.render.threads = "FIXED", 1
    bpy.context.preferences.view.render_display_type = "NONE"
    group = bpy.data.collections.new("Thing")
    scene.collection.children.link(group)
    group.objects.link(bpy.data.objects["Cube"])
    with driver.override():
        assert bpy.ops.scfpf.layer_add(camera=scene.camera.name, collection="Thing") == {"FINISHED"}
    yield DRAW
    before = [obj.name for obj in bpy.data.objects], [one.name for one in bpy.data.scenes]
    functions = {name: len(getattr(bpy.app.handlers, name)) for name in ("render_init", "render_cancel")}
    for wait, samples in ((0.0, 8), (0.7, 64), (3.0, 64)):
        scene.render.resolution_percentage, scene.cycles.samples = 10, samples
        camera, engine = scene.camera, scene.render.engine
        with driver.override():
            done = bpy.ops.scfpf.layers_render("INVOKE_DEFAULT", camera=camera.name)
        assert done == {"RUNNING_MODAL"}
        yield wait
        print(f"disabled after {wait} s, rendering: {bpy.app.is_job_running('RENDER')}")
        yield from disabled_and_enabled()
        driver.shot(f"{wait}")
        assert before == ([obj.name for obj in bpy.data.objects], [one.name for one in bpy.data.scenes])
        assert (scene.camera, scene.render.engine) == (camera, engine)
        assert functions == {name: len(getattr(bpy.app.handlers, name)) for name in functions}
    with driver.override():
        bpy.ops.ed.undo()
        yield DRAW
        bpy.ops.ed.redo()
        yield DRAW


SCENARIOS = (price, rig, moving, layers, layers_disabled)
