# SPDX-License-Identifier: GPL-3.0-or-later
"""The render engine in a window: F12, Esc while it renders, an animation, its panels."""

import subprocess
import time

import bpy
from driver import DRAW, PATIENCE, build_scene

# Seconds from Esc to the end of the job. The software renderer and what else runs share the cores.
ESC_SECONDS = 0.5


def prepare(driver, preset="nonlinear_twist"):
    """A scene for the engine, whose result is shown in the 3D viewport's place."""
    build_scene()
    driver.add_camera(preset)
    bpy.context.scene.render.engine = "SCFPF"
    bpy.context.preferences.view.render_display_type = "AREA"


def running():
    return bpy.app.is_job_running("RENDER")


def ended(job_name="render"):
    """Generator: wait for the render job."""
    end = time.monotonic() + PATIENCE
    while running():
        assert time.monotonic() < end, f"the {job_name} does not end"
        yield 0.05
    yield DRAW


def show(driver, tab):
    driver.area("PROPERTIES").spaces.active.context = tab


def f12(driver):
    """F12: progress, tiles, the picture; the panels of the engine beside it."""
    prepare(driver)
    scene = bpy.context.scene
    view_layer = scene.view_layers[0]
    view_layer.use_pass_z = view_layer.scfpf.use_pass_parameters = True
    scene.camera.scfpf.samples = 8
    show(driver, "RENDER")
    yield DRAW
    driver.key("F12")
    end = time.monotonic() + PATIENCE
    while not running():
        assert time.monotonic() < end, "F12 renders nothing"
        yield 0.05
    yield 1.0
    driver.shot("progress")
    yield from ended()
    driver.shot("done")
    assert driver.region_pixels("IMAGE_EDITOR").std() > 10, "the Image Editor shows nothing"
    for tab in ("OUTPUT", "VIEW_LAYER", "WORLD"):
        show(driver, tab)
        yield DRAW
        driver.shot(f"tab-{tab.lower()}")


def escape(driver):
    """Esc in mid-render ends the job within half a second, and F12 works again."""
    prepare(driver)
    scene = bpy.context.scene
    scene.camera.scfpf.samples = 256
    driver.key("F12")
    end = time.monotonic() + PATIENCE
    while not running():
        assert time.monotonic() < end, "F12 renders nothing"
        yield 0.05
    yield 2.0
    assert running(), "the render is too quick to be cancelled"
    driver.shot("rendering")
    # A real key: Blender notes an Esc that breaks renders where keys come in, not where events are simulated.
    subprocess.run(["xdotool", "mousemove", "400", "400", "key", "Escape"], check=True)
    pressed = time.monotonic()
    while running():
        assert time.monotonic() - pressed < PATIENCE, "Esc does not end the render"
        yield 0.02
    took = time.monotonic() - pressed
    print(f"Esc took {took:.2f} s", flush=True)
    assert took < ESC_SECONDS, f"Esc took {took:.2f} s"
    yield DRAW
    driver.shot("cancelled")
    scene.camera.scfpf.samples = 1
    driver.key("F12", "IMAGE_EDITOR")
    yield 0.5
    yield from ended()
    driver.shot("again")
    assert driver.region_pixels("IMAGE_EDITOR").std() > 10, "the Image Editor shows nothing"


def animation(driver):
    """Ctrl-F12 writes every frame while the window lives; a broken volume stops it with a message."""
    prepare(driver)
    scene = bpy.context.scene
    surface = scene.camera.scfpf.surfaces[1].object
    for frame, angle in ((1, 0.0), (3, 0.6)):
        surface.rotation_euler.z = angle
        surface.keyframe_insert("rotation_euler", frame=frame)
    scene.camera.scfpf.samples = 1
    scene.frame_start, scene.frame_end = 1, 3
    scene.render.filepath = str(driver.folder / "frame_")
    driver.key("F12", ctrl=True)
    yield 0.5
    yield from ended("animation")
    made = sorted(driver.folder.glob("frame_*.png"))
    assert len(made) == 3, made
    assert len({path.read_bytes() for path in made}) == 3, "frames are equal"
    driver.shot("done")
    for path in made:
        path.unlink()
    scene.camera.scfpf.surfaces.clear()
    driver.key("F12", "IMAGE_EDITOR", ctrl=True)
    yield 0.5
    yield from ended("animation")
    driver.shot("refused")
    assert not list(driver.folder.glob("frame_*.png")), "pictures of a failure were written"


SCENARIOS = (f12, escape, animation)
