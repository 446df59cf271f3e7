# SPDX-License-Identifier: GPL-3.0-or-later
"""Scenes that artists have, by the engine and by Cycles: with an ordinary camera, and through the rig.

    python3 dev.py bench --engine --only-real [--markdown FILE] [--percentage N] [--only SCENE]

Both take the same samples, without bounces and with the default ones. *At equal noise* multiplies the ratio
of their times by that of their variances: the mean squares of the differences between an image of these
samples and one of REFERENCE times as many by the same engine, at a quarter of the size. Every image comes
from a Blender of its own, and engines take turns.
"""

from __future__ import annotations

import argparse
import atexit
import json
import sys
import tempfile
from pathlib import Path
from time import perf_counter, process_time
from typing import NamedTuple

import bpy
import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from benchmarks.real import real_scenes
from benchmarks.real.blender_apart import run_apart
from benchmarks.real.foreign_scenes import FOREIGN
from scfpf_addon import bridge
from scfpf_addon.bridge.render.type_registration import register_types, unregister_types
from scfpf_addon.cycles import rig, rig_properties
from scfpf_addon.projection.typing import Array

SECTION = "real scenes"
SCENES = real_scenes.SCENES | FOREIGN
# Limits of bounces.
BOUNCES = {"no bounces": 0, "default bounces": 12}
ENGINE, CAMERA, RIG = "engine", "camera", "rig"
# Size of the images whose noise is measured, and samples of the reference, as multiples.
NOISE_SHARE, REFERENCE = 0.25, 16
# Cores that an image of the engine keeps busy, and how much longer 200 materials may take than 5.
CORES_GOAL, MATERIALS_GOAL = 1.8, 1.3
HEAD = (
    "| scene | engine: clock, processor | cores busy | Cycles, camera: clock, processor, equal noise "
    "| Cycles, rig: clock, processor, equal noise |"
)


class Figures(NamedTuple):
    """Seconds by the clock and of the processor for an image, and its noise: a root mean square."""

    seconds: float
    processor: float
    noise: float

    def ratios(self, own: Figures) -> tuple[float, float, float]:
        """By the clock, of the processor, and of the processor at equal noise, over those of ``own``."""
        processor = self.processor / own.processor
        worse = (self.noise / own.noise) ** 2 if own.noise > 0.0 else 1.0
        return self.seconds / own.seconds, processor, processor * worse


def register() -> None:
    """Register the extension's properties, as it does itself; Blender 4.5 crashes if any are left."""
    types = (*bridge.TYPES, rig_properties)
    register_types(types)
    bridge.register()
    atexit.register(unregister_types, types)
    atexit.register(bridge.unregister)


def open_scene(path: str, subject: str, bounces: int, percentage: float) -> None:
    """Open a scene, to be rendered by one of ENGINE, CAMERA and RIG."""
    bpy.ops.wm.open_mainfile(filepath=path)
    scene = bpy.context.scene
    scene.render.resolution_percentage = max(round(percentage), 1)
    scene.render.engine = "SCFPF" if subject == ENGINE else "CYCLES"
    if subject == RIG:
        rig.switch_on(bpy.context, scene.camera)
    scene.cycles.max_bounces = bounces


def image(samples: int) -> Array:
    """The scene at so many samples, scene-linear, no more than white: fireflies do not count for more."""
    scene = bpy.context.scene
    scene.cycles.samples = scene.camera.scfpf.samples = samples
    scene.cycles.seed = samples
    path = Path(bpy.app.tempdir, "image.exr")
    scene.render.image_settings.file_format, scene.render.filepath = "OPEN_EXR", str(path)
    bpy.ops.render.render(write_still=True)
    loaded = bpy.data.images.load(str(path))
    pixels = np.empty(len(loaded.pixels), np.float32)
    loaded.pixels.foreach_get(pixels)
    bpy.data.images.remove(loaded)
    return np.clip(pixels.reshape(-1, 4)[:, :3], 0.0, 1.0).astype(np.float64)


def measure(path: str, subject: str, bounces: int, percentage: float) -> Figures:
    """The figures of one image, in this process."""
    open_scene(path, subject, bounces, percentage)
    scene = bpy.context.scene
    samples = scene.cycles.samples
    started, busy = perf_counter(), process_time()
    bpy.ops.render.render()
    seconds, processor = perf_counter() - started, process_time() - busy
    scene.render.resolution_percentage = max(round(percentage * NOISE_SHARE), 1)
    difference = image(samples) - image(REFERENCE * samples)
    return Figures(seconds, processor, float(np.sqrt(np.mean(difference**2))))


def measure_apart(path: Path, subject: str, bounces: int, percentage: float) -> Figures:
    """``measure`` in a Blender of its own."""
    return Figures(**run_apart(__file__, "--one", str(path), subject, str(bounces), str(percentage)))


def compare(name: str, folder: Path, percentage: float) -> dict[str, dict[str, Figures]]:
    """The figures of each subject that shows a scene, by bounces."""
    path = folder / "real.blend"
    real_scenes.write(name, path, SCENES)
    subjects = (ENGINE, *[CAMERA] * SCENES[name].ordinary, RIG)
    return {
        limit: {each: measure_apart(path, each, bounces, percentage) for each in subjects}
        for limit, bounces in BOUNCES.items()
    }


def line(name: str, limit: str, found: dict[str, Figures], goal: float | None) -> tuple[str, bool]:
    """A row of the table, and whether its goals are met."""
    own = found[ENGINE]
    cores = own.seconds and own.processor / own.seconds
    cells, met = [], True
    for subject in (CAMERA, RIG):
        if subject not in found:
            cells.append("")
            continue
        shown = [f"{each:.2g} ×" for each in found[subject].ratios(own)]
        if goal and subject == CAMERA and found[subject].ratios(own)[0] < goal:
            shown[0], met = f"*{shown[0]}*", False
        cells.append(", ".join(shown))
    busy = f"{cores:.2f}"
    if cores < CORES_GOAL:
        busy, met = f"*{busy}*", False
    where = f"{name}, {limit}" + (f" (goal {goal:g})" if goal else "")
    return f"| {where} | {own.seconds:.1f}, {own.processor:.1f} s | {busy} | {' | '.join(cells)} |", met


def table(results: dict[str, dict[str, dict[str, Figures]]]) -> list[str]:
    """The results as lines of Markdown; prints which goals are missed."""
    lines, missed = [HEAD, "|---|---|---|---|---|"], []
    for name, by_limit in results.items():
        for (limit, found), goal in zip(by_limit.items(), SCENES[name].goals, strict=True):
            row, met = line(name, limit, found, goal)
            lines.append(row)
            missed += [] if met else [f"{name}, {limit}"]
    many, few = (results.get(f"room, {count} materials") for count in (200, 5))
    if many and few:
        more = [many[limit][ENGINE].processor / few[limit][ENGINE].processor for limit in BOUNCES]
        shown = ", ".join(f"{each:.2f}" if each <= MATERIALS_GOAL else f"*{each:.2f}*" for each in more)
        lines += ["", f"200 materials take {shown} × the time of 5 (goal {MATERIALS_GOAL:g})."]
        missed += ["200 materials"] * (max(more) > MATERIALS_GOAL)
    print("\n".join(lines))
    print(f"MISSED: {'; '.join(missed)}" if missed else "goals met")
    return lines


def compare_all(percentage: float, only: str | None) -> list[str]:
    """Measure the scenes; the table."""
    results = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in [only] if only else SCENES:
            results[name] = compare(name, Path(folder), percentage)
            for limit, found in results[name].items():
                print(line(name, limit, found, None)[0], flush=True)
    return table(results)


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("--one", nargs=4)
    file, shown_by, depth, share = parser.parse_args().one
    register()
    print(json.dumps(measure(file, shown_by, int(depth), float(share))._asdict()))
