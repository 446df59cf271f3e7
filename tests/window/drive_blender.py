# SPDX-License-Identifier: GPL-3.0-or-later
"""Run the scenarios of scenarios_*.py in a Blender with a window.

    xvfb-run -s "-screen 0 1024x640x24" blender --factory-startup --enable-event-simulate \\
        --window-geometry 0 0 1024 640 --python tests/window/drive_blender.py -- [OPTION ...] [SCENARIO ...]

A scenario is a generator that starts in a fresh file and yields the seconds to leave Blender to itself; the
tuple SCENARIOS at the end of its module lists it. It fails by an exception, by a traceback that Blender
prints meanwhile, and by taking too long. The folder of --folder gets the screenshots (by ImageMagick's
``import``), what was printed (output.txt), and a line a scenario (results.txt). Exit code 1 if one failed.
"""

import argparse
import ctypes
import faulthandler
import functools
import importlib
import os
import pathlib
import subprocess
import sys
import tempfile
import time
import traceback

import bpy

FOLDER = pathlib.Path(__file__).resolve().parent
sys.path.insert(0, str(FOLDER))
# A checkout's demo; elsewhere it lies beside the scenarios.
sys.path.append(str(FOLDER.parents[1]))

from driver import DRAW, Driver, build_scene, set_slow

# Seconds that a scenario may take before it is taken to hang; the slowest takes a tenth of it.
LIMIT = 240.0
TRACEBACK = "Traceback (most recent call last)"


class Output:
    """The output of Blender, C code included, which is shown and kept in a file."""

    def __init__(self, path: pathlib.Path):
        self.path = path
        self.tee = subprocess.Popen(["tee", str(path)], stdin=subprocess.PIPE)
        for descriptor in (1, 2):
            os.dup2(self.tee.stdin.fileno(), descriptor)
        self.read = 0

    def fresh(self):
        """Generator: wait for the file, and return the output after the last call."""
        sys.stdout.flush()
        sys.stderr.flush()
        ctypes.CDLL(None).fflush(None)
        yield 0.3
        with self.path.open("rb") as file:
            file.seek(self.read)
            new = file.read()
        self.read += len(new)
        return new.decode("utf-8", "replace")


def enable_extension(zip_file: str | None) -> None:
    """Install and enable the zip, else this checkout as an extension."""
    if zip_file:
        done = bpy.ops.extensions.package_install_files(
            filepath=zip_file, repo="user_default", enable_on_install=True
        )
        assert done == {"FINISHED"} and "bl_ext.user_default.scfpf" in bpy.context.preferences.addons
        return
    folder = pathlib.Path(tempfile.mkdtemp(prefix="scfpf-repo-"))
    (folder / "scfpf").symlink_to(FOLDER.parents[1], target_is_directory=True)
    bpy.context.preferences.extensions.repos.new(
        name="checkout", module="checkout", custom_directory=str(folder), remote_url=""
    )
    assert bpy.ops.preferences.addon_enable(module="bl_ext.checkout.scfpf") == {"FINISHED"}


def collect(wanted: list[str]) -> list:
    """The scenarios in the modules of this folder: one by module::name or name, those of a module, or all."""
    chosen = []
    for path in sorted(FOLDER.rglob("scenarios_*.py")):
        if str(path.parent) not in sys.path:
            sys.path.append(str(path.parent))
        for scenario in importlib.import_module(path.stem).SCENARIOS:
            if not wanted or {path.stem, title(scenario), scenario.__name__} & set(wanted):
                chosen.append(scenario)
    return chosen


def title(scenario) -> str:
    """The name of a scenario among those of all modules."""
    return f"{scenario.__module__}::{scenario.__name__}"


def run(driver, scenarios, output, plain):
    """Generator: run all scenarios, report each, and quit Blender."""
    results = (driver.folder / "results.txt").open("w", buffering=1)
    print("scenarios:", *map(title, scenarios), file=results)
    failed = []
    for scenario in scenarios:
        name, driver.scenario = title(scenario), scenario.__name__
        started, before = time.monotonic(), processor_seconds()
        faulthandler.dump_traceback_later(LIMIT, exit=True)
        bpy.ops.wm.read_homefile(use_factory_startup=False, use_splash=False)
        # A render that opens nothing; a scenario that is about what it opens chooses another.
        bpy.context.preferences.view.render_display_type = "NONE"
        # The panel of the last operator comes and goes over what is compared.
        for area in driver.window.screen.areas:
            if area.type == "VIEW_3D":
                area.spaces.active.show_region_hud = False
                if plain:
                    overlay = area.spaces.active.overlay
                    overlay.show_floor = overlay.show_axis_x = overlay.show_axis_y = False
        yield DRAW
        try:
            yield from scenario(driver)
        except Exception:
            traceback.print_exc()
            driver.shot("failed")
            if bpy.ops.scfpf.render_cancel.poll():
                bpy.ops.scfpf.render_cancel()
        if TRACEBACK in (yield from output.fresh()):
            failed.append(name)
        line = f"{'FAILED' if name in failed else 'ok'}: {name} ({time.monotonic() - started:.0f} s"
        line += f", {processor_seconds() - before:.1f} s of the processor's time)"
        print(line, flush=True)
        print(line, file=results)
    faulthandler.dump_traceback_later(LIMIT, exit=True)
    print(f"{len(scenarios) - len(failed)} of {len(scenarios)} scenarios passed", flush=True)
    if failed or not scenarios:
        os._exit(1)
    # Quitting is the last check: a render that runs must not keep Blender alive, nor make it crash. The last
    # scenario may have left a screen without a 3D viewport.
    bpy.ops.wm.read_homefile(use_factory_startup=False, use_splash=False)
    yield DRAW
    build_scene()
    driver.add_camera()
    set_slow()
    driver.start_render()
    yield DRAW
    bpy.ops.wm.quit_blender()


def processor_seconds() -> float:
    """The processor's time that Blender and the programs which it ran have taken."""
    return sum(os.times()[:4])


def rest(driver) -> float:
    """Leave the processor to others for a moment: with simulated events Blender itself does not."""
    time.sleep(driver.rest)
    return 0.0


def main() -> None:
    parser = argparse.ArgumentParser(prog="drive_blender.py")
    parser.add_argument("--zip", help="install this zip; without it the checkout is enabled")
    parser.add_argument("--folder", default=str(FOLDER / "shots"), help="where the pictures go")
    parser.add_argument("scenarios", nargs="*", help="scenarios, or modules such as scenarios_panels")
    parser.add_argument("--plain", action="store_true", help="without floors and smooth lines: half the time")
    options = parser.parse_args(sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else [])
    folder = pathlib.Path(options.folder).absolute()
    folder.mkdir(parents=True, exist_ok=True)
    output = Output(folder / "output.txt")
    # A crash tells where Python was; Blender's own report of it follows.
    faulthandler.enable()
    try:
        enable_extension(options.zip)
        scenarios = collect(options.scenarios)
    except Exception:
        # Blender would go on, with nobody to close it.
        traceback.print_exc()
        sys.stderr.flush()
        os._exit(1)
    bpy.context.preferences.view.show_splash = False
    # A tooltip that opens by itself would lie over what a picture shows.
    bpy.context.preferences.view.show_tooltips = False
    # A software renderer would draw each view eight times.
    bpy.context.preferences.system.viewport_aa = "OFF"
    if options.plain:
        bpy.context.preferences.system.use_overlay_smooth_wire = False
        bpy.context.preferences.system.use_edit_mode_smooth_wire = False
    bpy.context.preferences.edit.undo_steps = 128
    driver = Driver(folder)
    bpy.app.timers.register(functools.partial(rest, driver), persistent=True)
    steps = run(driver, scenarios, output, options.plain)
    bpy.app.timers.register(lambda: next(steps, None), first_interval=DRAW, persistent=True)


main()
