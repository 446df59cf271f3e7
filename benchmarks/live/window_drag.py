# SPDX-License-Identifier: GPL-3.0-or-later
"""Drag control surfaces by the mouse in a Blender with a window, for ``benchmarks/live/street_drag.py``.

The driver of tests/window runs these scenarios on the demo's street. They write live.json, the screenshots of
a drag, and the moving picture of README.md.
"""

import importlib
import json
import pathlib
import statistics
import subprocess
import time

import bpy
from driver import DRAW, PATIENCE
from mathutils import Vector

from demo.render_thumbnails import OWN, USUAL
from demo.street import build_scene

PRESETS = ("perspective", "around_the_car")
HERE = pathlib.Path(__file__).resolve().parent
# Moves of the mouse, and pixels of each.
MOVES, PIXELS = 24, 6
FAR_CLIP = 1000.0
# The width of the moving picture, and how long it shows each move (1/100 s).
RECORDED_WIDTH, HUNDREDTHS = 720, 9
# The final image is shown for so long.
LAST_HUNDREDTHS = 150
RECORDING = "live-drag.webp"


def module(name):
    """A module of the add-on."""
    add_on = next(name for name in bpy.context.preferences.addons.keys() if name.endswith(".scfpf"))
    return importlib.import_module(f"{add_on}.scfpf_addon.{name}")


def painter():
    """The painter of the live viewport, or None before it is drawn."""
    found = list(module("bridge.live.live_drawing")._viewports.values())
    return found[0].view.painter if found else None


def until(condition, what):
    """Generator: let Blender work until the condition holds."""
    end = time.monotonic() + PATIENCE
    while not condition():
        assert time.monotonic() < end, what
        yield 0.0


def look_through(driver, preset):
    """Generator: the street through a preset, its last surface selected; the sidebar is closed."""
    scene = bpy.context.scene
    camera = bpy.data.objects.new(preset, bpy.data.cameras.new(preset))
    scene.collection.objects.link(camera)
    scene.camera = camera
    shot = OWN.get(preset, USUAL)
    scene.render.resolution_x, scene.render.resolution_y = shot.size
    camera.location = shot.location
    way = Vector(shot.target) - Vector(shot.location)
    camera.rotation_euler = way.to_track_quat("-Z", "Y").to_euler()
    read = module("projection.presets.preset").read_preset
    aspect = shot.size[0] / shot.size[1]
    flexible = module("bridge.camera.flexible_camera")
    flexible.apply_preset(camera, read(HERE / "presets" / f"{preset}.json"), aspect, shot.scale)
    # Elsewhere surfaces cannot be grabbed.
    camera.scfpf.edit_volume = True
    space = driver.area("VIEW_3D").spaces.active
    space.shading.color_type = "MATERIAL"
    space.clip_end = FAR_CLIP
    bpy.ops.object.select_all(action="DESELECT")
    moved = camera.scfpf.surfaces[-1].object
    moved.select_set(True)
    bpy.context.view_layer.objects.active = moved
    space.region_3d.view_perspective = "CAMERA"
    driver.rest = 0.005  # what Blender itself rests if nothing happens
    with driver.override():
        bpy.ops.view3d.view_center_camera()
    yield 2 * DRAW


def final():
    """Generator: wait for the final image."""
    yield from until(
        lambda: painter() and painter().image and painter().image.step == 1.0, "no final image comes"
    )


def street():
    """Replace everything in the file by the street."""
    for obj in list(bpy.data.objects):
        bpy.data.objects.remove(obj)
    build_scene(bpy.context.scene)


def dragged(driver, seen):
    """Generator: drag what is selected, and return the seconds from each move to its image, and to the final.

    seen(number): called after each move's image, and with MOVES after the final one; it may be a generator.
    """
    region, window = driver.region("VIEW_3D"), driver.window
    x, y = region.x + region.width // 2, region.y + region.height // 2
    window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)
    yield 0.2
    window.event_simulate("G", "PRESS", x=x, y=y)
    window.event_simulate("G", "RELEASE", x=x, y=y)
    yield DRAW
    seconds = []
    for number in range(MOVES):
        x += PIXELS if number < MOVES // 2 else -PIXELS
        asked = painter().asked
        begun = time.perf_counter()
        window.event_simulate("MOUSEMOVE", "NOTHING", x=x, y=y)

        def is_answered(asked=asked):
            return painter().asked > asked and painter().answered == painter().asked

        yield from until(is_answered, "no image follows the mouse")
        seconds.append(time.perf_counter() - begun)
        yield from seen(number) or ()
    begun = time.perf_counter()
    yield from final()
    last = time.perf_counter() - begun
    yield from seen(MOVES) or ()
    window.event_simulate("ESC", "PRESS", x=x, y=y)
    window.event_simulate("ESC", "RELEASE", x=x, y=y)
    yield DRAW
    return seconds, last


def solid_seconds(driver):
    """The seconds of one drawing of Blender's own Solid view, without Live View."""
    settings = bpy.context.scene.camera.scfpf
    settings.show_live = False
    times = []
    with driver.override():
        for _ in range(6):
            begun = time.perf_counter()
            bpy.ops.wm.redraw_timer(type="DRAW_WIN_SWAP", iterations=1)
            times.append(time.perf_counter() - begun)
    settings.show_live = True
    return statistics.median(times)


def drag(driver):
    """Drag the last surface of each preset, and write the figures."""
    # Workbench would draw the window once more after each move, to smooth its own edges.
    bpy.context.preferences.system.viewport_aa = "OFF"
    street()
    figures = {}
    for preset in PRESETS:
        yield from look_through(driver, preset)
        yield from final()
        seconds, last = yield from dragged(driver, lambda number: None)
        figures[preset] = {
            "median": statistics.median(seconds),
            "longest": max(seconds),
            "rate": len(seconds) / sum(seconds),
            "final": last,
            "solid": solid_seconds(driver),
        }
        driver.shot(preset)
    (driver.folder / "live.json").write_text(json.dumps(figures), encoding="utf-8")


def record(driver):
    """A moving picture of a drag through Around the Car."""
    street()
    space = driver.area("VIEW_3D").spaces.active
    space.show_gizmo = space.show_region_toolbar = space.show_region_tool_header = False
    yield from look_through(driver, "around_the_car")
    yield from final()
    region = driver.region("VIEW_3D")
    box = f"{region.width}x{region.height}+{region.x}+{driver.window.height - region.y - region.height}"
    names = []

    def seen(number):
        yield 0.02 if number < MOVES else DRAW
        names.append(str(driver.folder / f"drag-{number:02d}.png"))
        subprocess.run(["import", "-window", "root", "-crop", box, "+repage", names[-1]], check=True)

    yield from dragged(driver, seen)
    frames = ["-delay", str(HUNDREDTHS), *names[:-1], "-delay", str(LAST_HUNDREDTHS), names[-1]]
    small = ["-resize", f"{RECORDED_WIDTH}x", "-loop", "0", "-quality", "70"]
    subprocess.run(["convert", *frames, *small, str(driver.folder / RECORDING)], check=True)


SCENARIOS = (drag, record)
