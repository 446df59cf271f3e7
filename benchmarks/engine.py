# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine beside Cycles: from the click to the image, and the memory that it takes.

    python3 dev.py bench --engine [--json FILE] [--markdown FILE] [--quick] [--runs N]

A million triangles, flat, one sun with shadows, a straight volume made of an ordinary camera, one sample a
pixel; Cycles on the CPU, with direct light only, as here, and with the bounces that it has by default. Every
figure comes from a Blender of its own that opens the same
file, renders, renders again, and renders after the camera has moved; both engines take turns. Memory is the
most that the process has held after the first image, Blender and the file included.

Before that the scenes that artists have: the demo's street, and a room of many materials.
"""

from __future__ import annotations

import argparse
import json
import math
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import Any

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.document import check_files, replace_section
from benchmarks.scenes import SCENES
from demo.render_demo import SHOTS, place_camera
from demo.street import build_scene
from scfpf_addon import bridge
from scfpf_addon.bridge.camera.flexible_camera import volume_from_camera
from scfpf_addon.bridge.render.type_registration import register_types
from scfpf_addon.casting.common.memory import peak_memory

TRIANGLES = 1_000_000
# What is measured: the engine, and how often light bounces in Cycles.
SUBJECTS = {"SCFPF": ("SCFPF", 0), "direct": ("CYCLES", 0), "default": ("CYCLES", 12)}
# What happens to a scene in turn, each timed.
STEPS = ("cold", "again", "camera moved")
TIME_GOAL, MEMORY_GOAL = 3.0, 1.0
MEBIBYTE = 2**20
SECTION = "engine and Cycles"
REAL_SECTION = "real scenes"
# Limits of bounces in the images of real scenes.
BOUNCES = {"no bounces": 0, "default bounces": 12}
# The room: half its sides along x and y, and its height, in metres.
SEED, OBJECTS = 20, 400
HALF, HEIGHT = 8.0, 5.0


def write_scene(name: str, path: Path, size: tuple[int, int]) -> None:
    """Save a file with one of the benchmark's scenes, lit by a sun, before a flexible camera."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    vertices, triangles = SCENES[name](TRIANGLES)
    mesh = bpy.data.meshes.new(name)
    mesh.from_pydata(vertices, [], triangles)
    sun = bpy.data.lights.new("Sun", "SUN")
    sun.energy, sun.angle = 3.0, 0.0
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    lamp = bpy.data.objects.new("Sun", sun)
    # The scenes' own up is Y, as it is for a camera that is not turned.
    lamp.rotation_euler = -math.pi / 3, 0.4, 0.0
    camera.location.y, camera.rotation_euler.x = 1.5, -0.15
    camera.data.sensor_fit, camera.data.angle = "VERTICAL", 0.6
    camera.data.clip_start, camera.data.clip_end = 0.1, 100.0
    for thing in (bpy.data.objects.new(name, mesh), lamp, camera):
        scene.collection.objects.link(thing)
    scene.camera = camera
    render, cycles = scene.render, scene.cycles
    (render.resolution_x, render.resolution_y), render.resolution_percentage = size, 100
    cycles.samples, cycles.device = 1, "CPU"
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    bpy.context.view_layer.update()
    volume_from_camera(camera, scene)
    camera.scfpf.samples = 1
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


def measure(path: Path, subject: str, persistent: bool) -> dict[str, Any]:
    """The figures of one of SUBJECTS, in this process: seconds by step, memory in MB."""
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.max_bounces = SUBJECTS[subject]
    scene.render.use_persistent_data = persistent
    seconds, processor, most = {}, {}, 0
    for step in STEPS:
        if step == "camera moved":
            scene.camera.location.x += 0.5
        started, busy = perf_counter(), process_time()
        bpy.ops.render.render()
        seconds[step], processor[step] = perf_counter() - started, process_time() - busy
        most = most or peak_memory()
    return {"seconds": seconds, "processor": processor, "memory": most / MEBIBYTE}


def room_materials(count: int, generator: np.random.Generator) -> list:
    """Principled materials: a tenth glass, a fifth coated, a quarter metal, the rest plain."""
    kinds = np.array(["glass", "coated", "metal", "plain"])
    shares = np.cumsum([0.1, 0.2, 0.25])
    # Evenly spread numbers: few materials are of all kinds, too.
    chosen = kinds[np.searchsorted(shares, (np.arange(count) + 0.5) / count)]
    made = []
    for number, kind in enumerate(chosen):
        material = bpy.data.materials.new(f"{kind} {number}")
        if material.node_tree is None:
            material.use_nodes = True
        inputs = material.node_tree.nodes["Principled BSDF"].inputs
        inputs["Base Color"].default_value = (*generator.uniform(0.1, 0.9, 3), 1.0)
        inputs["Roughness"].default_value = generator.uniform(0.05, 0.9)
        if kind == "glass":
            inputs["Transmission Weight"].default_value = 1.0
            inputs["Roughness"].default_value = 0.0
        elif kind == "coated":
            inputs["Coat Weight"].default_value = generator.uniform(0.3, 1.0)
        elif kind == "metal":
            inputs["Metallic"].default_value = 1.0
        made.append(material)
    return made


def room_meshes() -> list:
    """The shapes that objects have: boxes, and round ones with smooth shading."""
    adders = (
        lambda: bpy.ops.mesh.primitive_cube_add(size=1.0),
        lambda: bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16, radius=0.6),
        lambda: bpy.ops.mesh.primitive_cylinder_add(vertices=48, radius=0.45, depth=1.1),
        lambda: bpy.ops.mesh.primitive_torus_add(major_segments=40, minor_segments=16, major_radius=0.5),
    )
    made = []
    for number, add in enumerate(adders):
        add()
        thing = bpy.context.object
        if number % 2:
            bpy.ops.object.shade_smooth()
        made.append(thing.data)
        bpy.data.objects.remove(thing)
    return made


def add_objects(materials: list, generator: np.random.Generator) -> None:
    """The things in the room, each with one of the materials in turn."""
    meshes = room_meshes()
    for number in range(OBJECTS):
        mesh = meshes[number % len(meshes)].copy()
        mesh.materials.append(materials[number % len(materials)])
        thing = bpy.data.objects.new(f"Thing {number}", mesh)
        thing.location = generator.uniform((-HALF + 1, -HALF + 1, 0.3), (HALF - 1, HALF - 1, 3.5))
        thing.rotation_euler = generator.uniform(-math.pi, math.pi, 3)
        thing.scale = (generator.uniform(0.4, 1.1),) * 3
        bpy.context.collection.objects.link(thing)


def add_walls() -> None:
    """A floor and three walls of grey; the fourth side and the ceiling are open to the sky."""
    vertices = [(x, y, z) for z in (0.0, HEIGHT) for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1))]
    vertices = [(x * HALF, y * HALF, z) for x, y, z in vertices]
    mesh = bpy.data.meshes.new("Walls")
    mesh.from_pydata(vertices, [], [(0, 1, 2, 3), (1, 2, 6, 5), (2, 3, 7, 6), (3, 0, 4, 7)])
    bpy.context.collection.objects.link(bpy.data.objects.new("Walls", mesh))


def add_light() -> None:
    """Four area lamps below the ceiling, a sun, and a sky."""
    places = [(x, y, HEIGHT - 0.2) for x in (-4.0, 4.0) for y in (-4.0, 4.0)]
    for number, place in enumerate([*places, (0.0, 0.0, HEIGHT + 5.0)]):
        kind = "SUN" if number == len(places) else "AREA"
        lamp = bpy.data.lights.new(f"Lamp {number}", kind)
        if kind == "SUN":
            lamp.energy, lamp.angle = 2.0, 0.02
        else:
            lamp.energy, lamp.size = 150.0, 1.5
        placed = bpy.data.objects.new(lamp.name, lamp)
        placed.location = place
        placed.rotation_euler = (0.6, 0.3, 0.0) if kind == "SUN" else (0.0, 0.0, 0.0)
        bpy.context.collection.objects.link(placed)
    world = bpy.context.scene.world = bpy.data.worlds.new("Sky")
    if world.node_tree is None:
        world.use_nodes = True
    tree = world.node_tree
    sky = tree.nodes.new("ShaderNodeTexSky")
    sky.sky_type = "PREETHAM"
    tree.nodes["Background"].inputs["Strength"].default_value = 0.3
    tree.links.new(sky.outputs["Color"], tree.nodes["Background"].inputs["Color"])


def write_street(path: Path) -> None:
    """Save the demo's street before the camera of its perspective shot."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene, shot = bpy.context.scene, SHOTS["perspective"]
    build_scene(scene)
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    place_camera(camera, shot)
    save_real(camera, path, shot.size, 8)


def write_room(materials: int, path: Path) -> None:
    """Save the room of so many materials."""
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    add_objects(room_materials(materials, np.random.default_rng(SEED)), np.random.default_rng(SEED + 1))
    add_walls()
    add_light()
    camera = bpy.data.objects.new("Camera", bpy.data.cameras.new("Camera"))
    camera.location, camera.rotation_euler = (0.0, -HALF - 3.0, 2.6), (math.pi / 2 - 0.05, 0.0, 0.0)
    camera.data.lens = 24.0
    save_real(camera, path, (960, 540), 4)


def save_real(camera: bpy.types.Object, path: Path, size: tuple[int, int], samples: int) -> None:
    """Save a scene before a flexible camera that sees as an ordinary one does."""
    scene = bpy.context.scene
    scene.collection.objects.link(camera)
    scene.camera = camera
    (scene.render.resolution_x, scene.render.resolution_y), scene.render.resolution_percentage = size, 100
    scene.cycles.samples, scene.cycles.device = samples, "CPU"
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    bpy.context.view_layer.update()
    volume_from_camera(camera, scene)
    camera.scfpf.samples, scene.scfpf_sampling.use_adaptive = samples, False
    bpy.ops.wm.save_as_mainfile(filepath=str(path))


# Real scenes: what writes each file.
REAL = {
    "the demo's street, 8 samples": write_street,
    "a room, 200 materials, 4 samples": partial(write_room, 200),
    "the room with 5 materials": partial(write_room, 5),
}


def measure_once(path: Path, engine: str, bounces: int) -> dict[str, Any]:
    """Seconds and processor time of one image, in this process."""
    bpy.ops.wm.open_mainfile(filepath=str(path))
    scene = bpy.context.scene
    scene.render.engine, scene.cycles.max_bounces = engine, bounces
    started, busy = perf_counter(), process_time()
    bpy.ops.render.render()
    return {"seconds": perf_counter() - started, "processor": process_time() - busy}


def compare_real(folder: Path, runs: int) -> list[str]:
    """Measure the real scenes; the least times of the runs as lines of Markdown."""
    lines = ["| scene | engine: clock, processor | cores busy | Cycles: clock, processor | Cycles : engine |"]
    lines.append("|---|---|---|---|---|")
    for name, write in REAL.items():
        path = Path(folder, "real.blend")
        write(path)
        for limit, bounces in BOUNCES.items():
            rows = {
                engine: [run_apart("--real", str(path), engine, str(bounces)) for _ in range(runs)]
                for engine in ("SCFPF", "CYCLES")
            }
            (clock, busy), (other, most) = (
                [min(row[kind] for row in each) for kind in ("seconds", "processor")]
                for each in rows.values()
            )
            ratios = f"{other / clock:.2f} × clock, {most / busy:.2f} × processor"
            lines.append(
                f"| {name}, {limit} | {clock:.1f} s, {busy:.1f} s | {busy / clock:.2f} "
                f"| {other:.1f} s, {most:.1f} s | {ratios} |"
            )
    return lines


def in_own_process(path: Path, subject: str, persistent: bool) -> dict[str, Any]:
    """``measure`` in a Blender of its own."""
    return run_apart("--one", str(path), subject, *["--persistent"] * persistent)


def run_apart(*arguments: str) -> dict[str, Any]:
    """The output of this file in a Blender of its own."""
    command = [sys.executable, __file__, *arguments]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    if done.returncode:
        sys.exit(f"{arguments} could not be measured:\n{done.stdout[-2000:]}{done.stderr[-2000:]}")
    return json.loads(next(line for line in reversed(done.stdout.splitlines()) if line.startswith("{")))


def compare(path: Path, persistent: bool, runs: int) -> dict[str, Any]:
    """Medians of all subjects' figures."""
    found: dict[str, list[dict[str, Any]]] = {subject: [] for subject in SUBJECTS}
    for _ in range(runs):
        for subject, rows in found.items():
            rows.append(in_own_process(path, subject, persistent))
    return {
        subject: {
            **{
                kind: {step: median(row[kind][step] for row in rows) for step in STEPS}
                for kind in ("seconds", "processor")
            },
            "memory": median(row["memory"] for row in rows),
        }
        for subject, rows in found.items()
    }


def ratios(figures: dict[str, Any], kind: str, step: str) -> list[float]:
    """Cycles' time as a multiple of the engine's, with direct light and by default."""
    own, *others = (figures[subject][kind][step] for subject in SUBJECTS)
    return [other / own for other in others]


def table(results: dict[str, dict[str, Any]]) -> list[str]:
    """The figures as lines of Markdown."""
    lines = [
        "| scene | picture | seconds, processor time | "
        f"Cycles, direct light, clock (goal {TIME_GOAL:g}) | processor | "
        "Cycles, default bounces, clock | processor |",
        "|---|---|---|---|---|---|---|",
    ]
    memory = [f"| scene | MB | of Cycles' (goal {MEMORY_GOAL:g}) |", "|---|---|---|"]
    for name, kinds in results.items():
        for kind, figures in kinds.items():
            where = f"{name}, persistent data" if kind == "on" else name
            for step in STEPS:
                clock, busy = (ratios(figures, each, step) for each in ("seconds", "processor"))
                times = (f"{ratio:.1f} ×" for pair in zip(clock, busy, strict=True) for ratio in pair)
                own = (f"{figures['SCFPF'][kind][step]:.2f}" for kind in ("seconds", "processor"))
                lines.append(f"| {where} | {step} | {', '.join(own)} | {' | '.join(times)} |")
            share = figures["SCFPF"]["memory"] / figures["direct"]["memory"]
            memory.append(f"| {where} | {figures['SCFPF']['memory']:.0f} | {share:.2f} |")
    return [*lines, "", *memory]


def is_met(figures: dict[str, Any]) -> bool:
    """Whether both goals are, beside Cycles with direct light."""
    share = figures["SCFPF"]["memory"] / figures["direct"]["memory"]
    return ratios(figures, "seconds", "cold")[0] >= TIME_GOAL and share <= MEMORY_GOAL


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", type=Path, metavar="FILE", help="write the figures there too")
    parser.add_argument("--markdown", metavar="FILE", help="put the tables into a document")
    parser.add_argument("--quick", action="store_true", help="a quarter of the pixels")
    parser.add_argument("--runs", type=int, default=3, metavar="N", help="medians of N runs, 3 by default")
    parser.add_argument("--one", nargs=2, metavar=("FILE", "SUBJECT"), help=argparse.SUPPRESS)
    parser.add_argument("--persistent", action="store_true", help=argparse.SUPPRESS)
    parser.add_argument("--real", nargs=3, metavar=("FILE", "ENGINE", "BOUNCES"), help=argparse.SUPPRESS)
    parser.add_argument("--only-real", action="store_true", help="the street and the room alone")
    options = parser.parse_args()
    check_files(parser, written=options.json, document=options.markdown, sections=[SECTION, REAL_SECTION])
    register_types(bridge.TYPES)
    bridge.register()
    if options.one:
        path, subject = options.one
        print(json.dumps(measure(Path(path), subject, options.persistent)))
        return
    if options.real:
        path, engine, bounces = options.real
        print(json.dumps(measure_once(Path(path), engine, int(bounces))))
        return
    with tempfile.TemporaryDirectory() as folder:
        lines = compare_real(Path(folder), options.runs)
    print("\n".join(lines))
    if options.markdown:
        replace_section(options.markdown, REAL_SECTION, lines)
    if options.only_real:
        return
    size = (960, 540) if options.quick else (1920, 1080)
    results: dict[str, dict[str, Any]] = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in SCENES:
            path = Path(folder, f"{name}.blend")
            write_scene(name, path, size)
            results[name] = {
                kind: compare(path, persistent, options.runs)
                for kind, persistent in (("off", False), ("on", True))
            }
    lines = table(results)
    print("\n".join(lines))
    said = (f"{name} {'met' if is_met(kinds['off']) else 'MISSED'}" for name, kinds in results.items())
    print(f"goals ({TIME_GOAL:g} times faster when cold, memory no more than Cycles'): {', '.join(said)}")
    if options.json:
        options.json.write_text(json.dumps(results, indent=1), encoding="utf-8")
    if options.markdown:
        replace_section(options.markdown, SECTION, lines)


if __name__ == "__main__":
    main()
