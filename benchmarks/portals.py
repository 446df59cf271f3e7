# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost of the Cycles rig by its number of chords, as ratios to an ordinary camera with the same samples.

    python3 dev.py bench --cycles [--json FILE] [--quick]

The same perspective volume is cut into 1, 8, 16 and 32 chords, so that all images are alike. Times are
processor seconds of Cycles' sampling on the CPU: of a whole render less those of one with a single sample,
after one that warms up. Cameras take turns; a ratio is the median of those of all rounds.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from pathlib import Path
from statistics import median
from time import process_time

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.document import check_files
from scfpf_addon import bridge
from scfpf_addon.bridge.camera.flexible_camera import volume_from_camera
from scfpf_addon.bridge.render.type_registration import register_types
from scfpf_addon.cycles import rig_properties
from scfpf_addon.cycles.chords.chord_plan import ChordPlan
from scfpf_addon.cycles.rig_data import make_rig, write_sheets

CHORDS = (1, 8, 16, 32)
# Cells of a sheet across and up, as curved volumes need them.
CELLS = (64, 64)
# The goals on the heavy scene, by number of chords.
GOALS = {1: 1.2, 16: 3.0}
SIZE, RUNS = (160, 90), 5
# Samples a pixel, by scene: plain cameras take some seconds.
SAMPLES = {"light": 64, "heavy": 8}


def add_material(name: str, **inputs):
    """A Principled material."""
    material = bpy.data.materials.new(name)
    if material.node_tree is None:
        material.use_nodes = True
    node = material.node_tree.nodes["Principled BSDF"]
    for key, value in inputs.items():
        node.inputs[key.replace("_", " ")].default_value = value
    return material


def light_scene() -> None:
    """A few diffuse objects under the sky: two bounces or so."""
    bpy.ops.mesh.primitive_plane_add(size=60, location=(0, 0, -2))
    for place in ((-1.5, 6, -0.5), (1.2, 7, -0.3), (0, 5, -1.2)):
        bpy.ops.mesh.primitive_uv_sphere_add(location=place)


def heavy_scene() -> None:
    """A room of subdivided, glossy and glass things with lamps: many bounces, a million triangles."""
    bpy.ops.mesh.primitive_cube_add(size=24, location=(0, 10, 6))
    kinds = (
        add_material("Glass", Transmission_Weight=1.0, Roughness=0.05),
        add_material("Metal", Metallic=1.0, Roughness=0.2),
        add_material("Paint", Base_Color=(0.8, 0.3, 0.1, 1), Coat_Weight=1.0),
    )
    generator = np.random.default_rng(3)
    for number in range(48):
        bpy.ops.mesh.primitive_torus_add(major_segments=150, minor_segments=70)
        thing = bpy.context.object
        thing.location = generator.uniform((-6, 3, -4), (6, 18, 5))
        thing.rotation_euler = generator.uniform(-math.pi, math.pi, 3)
        thing.data.materials.append(kinds[number % 3])
    for _ in range(12):
        lamp = bpy.data.lights.new("Lamp", "AREA")
        lamp.energy = 200
        placed = bpy.data.objects.new("Lamp", lamp)
        placed.location = generator.uniform((-6, 2, 6), (6, 18, 10))
        bpy.context.scene.collection.objects.link(placed)


SCENES = {"light": light_scene, "heavy": heavy_scene}


def new_scene(build):
    """A file with a scene and a flexible camera that sees as an ordinary one does."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    build()
    world = scene.world = bpy.data.worlds.new("World")
    if world.node_tree is None:
        world.use_nodes = True
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.data.lens, camera.data.clip_start, camera.data.clip_end = 30.0, 0.5, 60.0
    camera.rotation_euler.x = math.pi / 2 - 0.1
    scene.collection.objects.link(camera)
    scene.camera = camera
    render = scene.render
    render.engine, (render.resolution_x, render.resolution_y) = "CYCLES", SIZE
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    bpy.context.view_layer.update()
    volume_from_camera(camera, scene)
    return camera


def even_chords(count: int) -> ChordPlan:
    """A plan of so many chords, whatever the volume asks for."""
    breaks = np.linspace(0.0, 1.0, count + 1)
    return ChordPlan(breaks, np.zeros(count + 1), CELLS, 0.0, 0.0)


def rendering_time(samples: int) -> float:
    """Processor seconds of a render, less those of one with a single sample: Cycles' sampling alone."""
    scene, times = bpy.context.scene, []
    scene.render.filepath = str(Path(bpy.app.tempdir, "portals.png"))
    for number in (1, 1 + samples):
        scene.cycles.samples = number
        started = process_time()
        # An image that is not written may not be rendered.
        bpy.ops.render.render(write_still=True)
        times.append(process_time() - started)
    return times[1] - times[0]


def measure(name: str, runs: int) -> dict[int, float]:
    """Ratios to an ordinary camera by number of chords."""
    camera = new_scene(SCENES[name])
    scene = bpy.context.scene
    rig = make_rig(scene, camera, even_chords(CHORDS[-1]))
    ratios: dict[int, list[float]] = {count: [] for count in CHORDS}
    rendering_time(1)
    for _ in range(runs):
        scene.camera = camera
        plain = rendering_time(SAMPLES[name])
        scene.camera = rig.scfpf_rig.view_camera
        for count in CHORDS:
            write_sheets(rig, even_chords(count))
            ratios[count].append(rendering_time(SAMPLES[name]) / plain)
    return {count: median(found) for count, found in ratios.items()}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there too")
    parser.add_argument("--quick", action="store_true", help="one run each")
    options = parser.parse_args()
    check_files(parser, written=options.json)
    register_types((*bridge.TYPES, rig_properties))
    bridge.register()
    results = {}
    for name in SCENES:
        results[name] = measure(name, 1 if options.quick else RUNS)
        for count, ratio in results[name].items():
            goal = f"  (goal {GOALS[count]})" if name == "heavy" and count in GOALS else ""
            print(f"{name} scene, {count:2} chords: {ratio:5.2f} × an ordinary camera{goal}", flush=True)
    if options.json:
        options.json.write_text(json.dumps(results, indent=1), encoding="utf-8")


if __name__ == "__main__":
    main()
