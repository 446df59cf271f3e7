# SPDX-License-Identifier: GPL-3.0-or-later
"""Make the compositions of docs/compositions.md, or some by their names: pictures and .blend files.

    python demo/compositions/make.py [--percentage N] [--samples N] [--output FOLDER] [COMPOSITION ...]

It runs under a Python that has bpy; `python3 dev.py compositions` finds or makes one. Pictures go to
docs/compositions/, files to demo/output/compositions/.
"""

from __future__ import annotations

import argparse
import importlib
import sys
import time
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from demo.render_demo import enable_add_on, open_on, render, scratch_profile  # noqa: E402

FOLDER = ROOT / "docs" / "compositions"
OUTPUT = ROOT / "demo" / "output" / "compositions"
QUALITY = 86
SAMPLES = 64
# By name: the module, whose ``build`` makes the scene, or the function in it.
COMPOSITIONS = {
    "behind": "squares.behind",
    "tour": "squares.tour",
    "joiner": "joiner",
    "room": "room",
    "graph-street": "graph_street",
}
# Prints that overlap are islands that overlap, which the engine shows and Cycles' rig does not.
BY_ENGINE = {"joiner"}


def build(name: str):
    """Open a new file with a composition, and return its scene."""
    import bpy

    where, _, function = COMPOSITIONS[name].partition(".")
    made = importlib.import_module(f"demo.compositions.{where}")
    scene = getattr(made, function or "build")()
    bpy.context.window.scene = scene
    scene.scfpf_sampling.world_shadows = True
    bpy.context.view_layer.update()
    return scene


def make(name: str, folder: Path, percentage: int, samples: int) -> None:
    """Write the .blend of a composition and its picture. samples: of each pixel."""
    import bpy
    from PIL import Image

    from demo.path_traced import path_traced

    scene = build(name)
    scene.camera.scfpf.samples = samples
    OUTPUT.mkdir(parents=True, exist_ok=True)
    folder.mkdir(parents=True, exist_ok=True)
    open_on(scene)
    path = OUTPUT / f"{name}.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)
    scene.render.resolution_percentage = percentage
    raw = OUTPUT / f"{name}.png"
    begun = time.process_time()
    if name in BY_ENGINE:
        render(scene, raw)
    else:
        path_traced(scene, raw, samples)
    seconds = time.process_time() - begun
    picture = folder / f"{name}.jpg"
    Image.open(raw).convert("RGB").save(picture, quality=QUALITY, optimize=True)
    sizes = f"{picture.stat().st_size / 1000:.0f} kB, {path.stat().st_size / 1e6:.1f} MB"
    print(f"{name}: {seconds:.0f} s of the processor; {sizes}", flush=True)


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "compositions", nargs="*", metavar="COMPOSITION", help=f"one of {', '.join(COMPOSITIONS)}"
    )
    parser.add_argument(
        "--percentage", type=int, default=100, metavar="N", help="size of the pictures in percent"
    )
    parser.add_argument("--samples", type=int, default=SAMPLES, metavar="N", help="a pixel, before denoising")
    parser.add_argument("--output", type=Path, default=FOLDER, metavar="FOLDER", help="where pictures go")
    options = parser.parse_args(arguments)
    if unknown := sorted(set(options.compositions) - set(COMPOSITIONS)):
        parser.error(f"no composition is named {', '.join(unknown)}")
    with scratch_profile() as scratch:
        enable_add_on(scratch)
        for name in options.compositions or COMPOSITIONS:
            make(name, options.output.absolute(), options.percentage, options.samples)


if __name__ == "__main__":
    main(sys.argv[1:])
