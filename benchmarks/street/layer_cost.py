# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost of a layer on a fifth of the picture, on the demo's street, as ratios with their goals.

    python3 dev.py bench --layers [--quick]

The car is shown by an ordinary camera from its side, and unfolded by a volume, without and with a halo of
ground; its layer is made as large as SHARE of the picture. Each picture is rendered without and with the
layer by turns, by the engine and by Cycles. The median of the ratios of processor time counts.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
from pathlib import Path
from time import process_time

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from demo import render_demo
from demo.recipes.layer_pictures import SIZE, add_camera, add_layer, both_sides

# The share of the picture that shows the layer, and the width of the halo about it.
SHARE, HALO = 0.2, 0.12
# The most that a picture with the layer may take, as a multiple of the one without.
GOALS = {"engine": 1.3, "cycles": 1.5}
# Images are this share of their size, with so many samples. Turns of each picture.
PERCENTAGE, SAMPLES, RUNS = 40, 8, 5


def from_the_side():
    """The car from its left, by an ordinary camera."""
    import bpy

    scene = render_demo.build_street()
    scene.camera = add_camera(scene, "Street", (0.0, -14.0, 2.2), (0.0, 2.0, 3.2), 28.0)
    eye = add_camera(scene, "Side", (-9.0, -7.0, 2.5), (0.0, 0.0, 0.8), 50.0)
    add_layer(scene.camera, "Car", eye, position=(0.5, 0.27))
    bpy.context.view_layer.update()
    return scene


CASES = {"ordinary camera": from_the_side, "unfolded": both_sides}


def fit(camera) -> float:
    """Scale the camera's layer to SHARE of the picture; returns the share that it then has."""
    import bpy

    (layer,) = camera.scfpf.layers
    for _ in range(3):
        if bpy.ops.scfpf.layer_check(camera=camera.name) != {"FINISHED"}:
            sys.exit("The layer could not be checked; the lines above say why.")
        scale = (SHARE / layer.share) ** 0.5
        layer.size = layer.size[0] * scale, layer.size[1] * scale
    bpy.ops.scfpf.layer_check(camera=camera.name)
    return layer.share


def seconds(engine: str, camera, path: str) -> float:
    """Processor seconds of a picture."""
    import bpy

    started = process_time()
    if engine == "engine":
        done = bpy.ops.scfpf.render(camera=camera.name)
    elif camera.scfpf.layers[0].is_on:
        done = bpy.ops.scfpf.layers_render(camera=camera.name, filepath=path)
    else:
        # An image that is not written may not be rendered.
        bpy.context.scene.render.filepath = path
        done = bpy.ops.render.render(write_still=True)
    if done != {"FINISHED"}:
        sys.exit("A picture was not rendered; the lines above say why.")
    return process_time() - started


def ratio(engine: str, camera, path: str, runs: int) -> float:
    """The median of the ratios with and without the layer."""
    (layer,) = camera.scfpf.layers
    found = []
    for _ in range(runs):
        layer.is_on = False
        without = seconds(engine, camera, path)
        layer.is_on = True
        found.append(seconds(engine, camera, path) / without)
    return statistics.median(found)


def measure(title: str, make, runs: int, folder: Path) -> None:
    """Print the lines of a case."""
    import bpy

    scene = make()
    bpy.context.window.scene = scene
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = PERCENTAGE
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    scene.cycles.samples = scene.camera.scfpf.samples = SAMPLES
    (layer,) = scene.camera.scfpf.layers
    layer.halo = 0.0
    share = fit(scene.camera)
    for halo in (0.0, HALO):
        layer.halo = halo
        for engine, goal in GOALS.items():
            scene.render.engine = "CYCLES" if engine == "cycles" else "SCFPF"
            found = ratio(engine, scene.camera, str(folder / "layers.png"), runs)
            missed = ", MISSED" if found > goal else ""
            about = " with its halo" if halo else ""
            print(f"{title}{about}, {share:.0%}: {engine} {found:.2f} × (goal {goal:g}{missed})", flush=True)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one turn each")
    options = parser.parse_args()
    with render_demo.scratch_profile(), tempfile.TemporaryDirectory() as folder:
        render_demo.enable_add_on(Path(folder))
        for title, make in CASES.items():
            measure(title, make, 1 if options.quick else RUNS, Path(folder))


if __name__ == "__main__":
    main()
