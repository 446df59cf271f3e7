# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost of the Cycles rig on the demo's street, as ratios to an ordinary camera, with their goals.

    python3 dev.py bench --cycles [--json FILE] [--quick] [--only PRESET]

For each preset: the time of a path (the slope between two numbers of samples), of the first sample, and the
portals that a ray passes, for an image of PERCENTAGE of its size. Then the time of switching the rig on and
the memory of its sheets, for the whole size. Times are processor seconds, but for switching on, for which an
artist waits. The ordinary camera and the rig are rendered by turns, with the same settings; the median of
the ratios of each turn counts, since a machine's speed drifts. Of switching on the shortest counts.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from time import perf_counter, process_time

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.document import check_files
from demo.render_demo import SHOTS, Shot, build_street, place_camera
from demo.render_thumbnails import OWN, USUAL
from scfpf_addon import bridge
from scfpf_addon.bridge.camera.flexible_camera import apply_preset
from scfpf_addon.bridge.render.image_size import image_size
from scfpf_addon.bridge.render.type_registration import register_types
from scfpf_addon.cycles import rig, rig_properties
from scfpf_addon.cycles.prices import price_of_rig
from scfpf_addon.projection.presets.preset import load_preset

PRESETS = Path(__file__).parents[1] / "presets"
# The most that a path may take, as a multiple of an ordinary camera's.
GOALS = {
    "around_the_car": 3.0,
    "nonlinear_twist": 2.0,
    "deep_curvy_volume": 3.0,
    "house_of_stairs": 3.0,
    "curved_convergence": 3.0,
    "occlusion_camera": 3.0,
    "street_panorama_curved": 3.0,
    "perspective": 1.2,
    "cylindrical_panorama": 1.2,
}
# The same for the first sample; seconds of switching on; megabytes of the sheets.
FIRST_GOAL, ON_GOAL, MEMORY_GOAL = 1.5, 2.0, 100.0
# Focal lengths of the ordinary camera, mm: a preset with the picture of one is compared with that one.
SAME_PICTURE, USUAL_LENS = {"perspective": 50.0}, 24.0
# Images are this share of their size. Samples of the two renders whose difference counts.
PERCENTAGE, SAMPLES = 30, (4, 16)
# Turns of each preset.
RUNS = 5


def add_camera(name: str, shot: Shot):
    """A camera of the scene at a shot's place."""
    scene = bpy.context.scene
    camera = bpy.data.objects.new(name, bpy.data.cameras.new(name))
    place_camera(camera, shot)
    scene.collection.objects.link(camera)
    camera.data.lens = USUAL_LENS
    return camera


def set_up() -> None:
    """The street, with settings of Cycles under which samples cost alike."""
    scene = build_street()
    scene.render.engine = "CYCLES"
    scene.render.resolution_percentage = PERCENTAGE
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False


def seconds(samples: int) -> float:
    """Processor seconds of a render."""
    scene = bpy.context.scene
    scene.cycles.samples = samples
    scene.render.filepath = str(Path(bpy.app.tempdir, "portals.png"))
    started = process_time()
    # An image that is not written may not be rendered.
    bpy.ops.render.render(write_still=True)
    return process_time() - started


def figures() -> tuple[float, float]:
    """Processor microseconds of a path, and seconds of the first sample."""
    few, many = (seconds(samples) for samples in SAMPLES)
    pixels = np.prod(image_size(bpy.context.scene))
    return (many - few) / (pixels * (SAMPLES[1] - SAMPLES[0])) * 1e6, seconds(1)


def measure(stem: str, ordinary, runs: int) -> dict[str, float]:
    """The ratios of a preset."""
    scene, shot = bpy.context.scene, SHOTS.get(stem) or OWN.get(stem, USUAL)
    scene.render.resolution_x, scene.render.resolution_y = shot.size
    camera = add_camera(stem, shot)
    scene.camera = camera
    preset = load_preset((PRESETS / f"{stem}.json").read_text(encoding="utf-8"))
    apply_preset(camera, preset, shot.size[0] / shot.size[1], shot.scale)
    bpy.context.view_layer.update()
    scene.render.resolution_percentage = 100
    made, on = None, []
    for _ in range(runs):
        if made is not None:
            rig.switch_off(made)
        started = perf_counter()
        made = rig.switch_on(bpy.context, camera)
        on.append(perf_counter() - started)
    found = {"on": min(on), "memory": price_of_rig(made).memory / 1e6}
    scene.render.resolution_percentage = PERCENTAGE
    rig.update(bpy.context, made)
    settings = made.scfpf_rig
    found |= {"chords": settings.chords, "passed": settings.passed}
    ordinary.data.lens = SAME_PICTURE.get(stem, USUAL_LENS)
    turns = []
    for _ in range(runs):
        for by in (ordinary, settings.view_camera):
            scene.camera = by
            turns.append(figures())
    of_ordinary, of_rig = (np.array(turns[first::2]) for first in (0, 1))
    found["path"], found["first"] = np.median(of_rig / of_ordinary, axis=0).tolist()
    rig.switch_off(made)
    bpy.data.objects.remove(camera)
    return found


def line(stem: str, found: dict[str, float]) -> str:
    """A preset's ratios with their goals, as text."""

    def beside(key: str, form: str, goal: float) -> str:
        return f"{form.format(found[key])} (goal {goal:g}{', MISSED' if found[key] > goal else ''})"

    return (
        f"{stem}: path {beside('path', '{:.2f} ×', GOALS[stem])}, "
        f"first sample {beside('first', '{:.2f} ×', FIRST_GOAL)}, on in {beside('on', '{:.1f} s', ON_GOAL)}, "
        f"{beside('memory', '{:.0f} MB', MEMORY_GOAL)}, "
        f"{found['passed']:.1f} portals for {found['chords']:.0f} chords"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there too")
    parser.add_argument("--quick", action="store_true", help="one run each")
    parser.add_argument("--only", choices=sorted(GOALS), metavar="PRESET", help="one preset")
    options = parser.parse_args()
    check_files(parser, written=options.json)
    register_types((*bridge.TYPES, rig_properties))
    bridge.register()
    set_up()
    ordinary = add_camera("Ordinary", SHOTS["perspective"])
    bpy.context.scene.camera = ordinary
    seconds(1)
    results = {}
    for stem in [options.only] if options.only else GOALS:
        results[stem] = measure(stem, ordinary, 1 if options.quick else RUNS)
        print(line(stem, results[stem]), flush=True)
    if options.json:
        options.json.write_text(json.dumps(results, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
