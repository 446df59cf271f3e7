# SPDX-License-Identifier: GPL-3.0-or-later
"""The engine beside Cycles: from the click to the image, and the memory that it takes.

    python3 dev.py bench --engine [--json FILE] [--markdown FILE] [--quick] [--runs N] [--only-real]

A million triangles, flat, one sun with shadows, a straight volume made of an ordinary camera, one sample a
pixel; Cycles on the CPU, with direct light only, as here, and with the bounces that it has by default. Every
figure comes from a Blender of its own that opens the same
file, renders, renders again, and renders after the camera has moved; both engines take turns. Memory is the
most that the process has held after the first image, Blender and the file included.

Before that the scenes that artists have, see ``real/beside_cycles.py``.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
import tempfile
from pathlib import Path
from statistics import median
from time import perf_counter, process_time
from typing import Any

import bpy

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.document import check_files, replace_section
from benchmarks.real import beside_cycles
from benchmarks.real.blender_apart import run_apart
from benchmarks.scenes import SCENES
from scfpf_addon.bridge.camera.flexible_camera import volume_from_camera
from scfpf_addon.casting.common.memory import peak_memory

TRIANGLES = 1_000_000
# What is measured: the engine, and how often light bounces in Cycles.
SUBJECTS = {"SCFPF": ("SCFPF", 0), "direct": ("CYCLES", 0), "default": ("CYCLES", 12)}
# What happens to a scene in turn, each timed.
STEPS = ("cold", "again", "camera moved")
TIME_GOAL, MEMORY_GOAL = 3.0, 1.0
MEBIBYTE = 2**20
SECTION = "engine and Cycles"


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


def in_own_process(path: Path, subject: str, persistent: bool) -> dict[str, Any]:
    """``measure`` in a Blender of its own."""
    return run_apart(__file__, "--one", str(path), subject, *["--persistent"] * persistent)


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
    """Return whether both goals are, beside Cycles with direct light."""
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
    parser.add_argument("--only-real", action="store_true", help="the scenes that artists have alone")
    parser.add_argument("--percentage", type=float, default=100, metavar="N", help="the size of their images")
    parser.add_argument("--only", choices=beside_cycles.SCENES, metavar="SCENE", help="one of them")
    options = parser.parse_args()
    sections = [beside_cycles.SECTION, *[SECTION] * (not options.only_real)]
    check_files(parser, written=options.json, document=options.markdown, sections=sections)
    beside_cycles.register()
    if options.one:
        path, subject = options.one
        print(json.dumps(measure(Path(path), subject, options.persistent)))
        return
    lines = beside_cycles.compare_all(options.percentage, options.only)
    if options.markdown:
        replace_section(options.markdown, beside_cycles.SECTION, lines)
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
