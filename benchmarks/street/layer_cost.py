# SPDX-License-Identifier: GPL-3.0-or-later
"""Cost of a layer on a fifth of the picture, on the demo's street, as ratios with their goals.

    python3 dev.py bench --layers [--quick] [--only engine|cycles]

The car is shown by the picture's own camera, where the picture stays the same; by another ordinary camera,
from its side; and unfolded by a volume. The last two show it larger than the picture does, so that its
pixels, which reflect, are paid for too. Each layer, its halo of ground included, is made as large as SHARE
of the picture. Each picture is rendered without and with the layer by turns, by the engine and by Cycles,
at each of SIZES, and the whole picture by the layer's camera alone: its time times the layer's share is the
camera's own price, without which no layer can be. The median of the ratios of processor time counts. A rig
that Cycles needs is made anew for each picture with the layer.
"""

from __future__ import annotations

import argparse
import statistics
import sys
import tempfile
from collections.abc import Sequence
from itertools import product
from pathlib import Path
from time import process_time
from typing import NamedTuple

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from demo import render_demo
from demo.recipes.layer_pictures import SIZE, add_camera, add_layer, both_sides, select_only

# The share of the picture that shows the layer, and the width of the halo about it.
SHARE, HALO = 0.2, 0.12
# The most that a picture with the layer may take, as a multiple of the one without.
GOALS = {"engine": 1.3, "cycles": 1.5}
# Images are this percentage of their size, with so many samples: a small one, in which all that a picture
# needs once weighs most, and one as artists render it. Path tracing needs many samples for a picture, and the
# distances that join layers are the same nine a pixel for any number. Turns of each picture.
SIZES, RUNS = {"engine": ((40, 16), (100, 4)), "cycles": ((40, 16), (100, 32))}, 3


def from_the_side():
    """The car from its left, by an ordinary camera."""
    import bpy

    scene = render_demo.build_street()
    scene.camera = add_camera(scene, "Street", (0.0, -14.0, 2.2), (0.0, 2.0, 3.2), 28.0)
    eye = add_camera(scene, "Side", (-9.0, -7.0, 2.5), (0.0, 0.0, 0.8), 50.0)
    add_layer(scene.camera, "Car", eye, position=(0.5, 0.27))
    bpy.context.view_layer.update()
    return scene


def by_its_own_camera():
    """The car from its left, by the picture's own camera: the picture is the same without the layer."""
    import bpy

    scene = render_demo.build_street()
    scene.camera = add_camera(scene, "Street", (-9.0, -7.0, 2.5), (0.0, 0.0, 0.8), 50.0)
    eye = scene.camera.copy()
    scene.collection.objects.link(eye)
    add_layer(scene.camera, "Car", eye)
    bpy.context.view_layer.update()
    return scene


CASES = {"own camera": by_its_own_camera, "ordinary camera": from_the_side, "unfolded": both_sides}


def fit(camera) -> float:
    """Scale the camera's layer to SHARE of the picture; returns the share that it then has.

    The layer of a twin, which has the camera's own lens, is scaled by that.
    """
    import bpy

    (layer,) = camera.scfpf.layers
    for _ in range(3):
        scale = (SHARE / checked_share(camera)) ** 0.5
        if layer.camera.data == camera.data:
            camera.data.lens *= scale
            select_only(camera)
            bpy.ops.scfpf.camera_from_camera()
        else:
            layer.size = layer.size[0] * scale, layer.size[1] * scale
    return checked_share(camera)


def checked_share(camera) -> float:
    """The share of the picture that the camera's layer has."""
    import bpy

    if bpy.ops.scfpf.layer_check(camera=camera.name) != {"FINISHED"}:
        sys.exit("The layer could not be checked; the lines above say why.")
    (layer,) = camera.scfpf.layers
    return layer.share


def seconds(engine: str, camera, path: str) -> float:
    """Processor seconds of a picture."""
    import bpy

    started = process_time()
    if engine == "engine":
        done = bpy.ops.scfpf.render(camera=camera.name)
    elif any(layer.is_on for layer in camera.scfpf.layers):
        done = bpy.ops.scfpf.layers_render(camera=camera.name, filepath=path)
    else:
        # An image that is not written may not be rendered.
        bpy.context.scene.render.filepath = path
        done = bpy.ops.render.render(write_still=True)
    if done != {"FINISHED"}:
        sys.exit("A picture was not rendered; the lines above say why.")
    return process_time() - started


def seconds_alone(engine: str, eye, path: str) -> tuple[float, float]:
    """Processor seconds of the whole picture by a layer's camera, and of making the rig that Cycles needs."""
    import bpy

    scene, needs_rig = bpy.context.scene, engine == "cycles" and eye.scfpf.enabled
    if engine == "engine" and not eye.scfpf.enabled:
        # Of an ordinary camera, a copy.
        eye = eye.copy()
        scene.collection.objects.link(eye)
        select_only(eye)
        bpy.ops.scfpf.camera_from_camera()
        bpy.context.view_layer.update()
    eye.scfpf.samples = scene.camera.scfpf.samples
    before, scene.camera = scene.camera, eye
    select_only(eye)
    started = process_time()
    if needs_rig:
        bpy.ops.scfpf.cycles_rig()
    made = process_time() - started
    rendered = seconds(engine, eye, path)
    if needs_rig:
        bpy.ops.scfpf.cycles_rig()
    scene.camera = before
    return rendered, made


class Price(NamedTuple):
    """Medians of processor times, as multiples of the picture without the layer.

    layered: with it. alone: of the whole picture by its camera. rig: of making that camera's rig.
    """

    layered: float
    alone: float
    rig: float


def price(engine: str, camera, path: str, runs: int) -> Price:
    """Render the pictures by turns."""
    (layer,) = camera.scfpf.layers
    found = []
    # What is read once is not the layer's price.
    seconds(engine, camera, path)
    for _ in range(runs):
        layer.is_on = False
        without = seconds(engine, camera, path)
        alone = seconds_alone(engine, layer.camera, path)
        layer.is_on = True
        found.append([part / without for part in (seconds(engine, camera, path), *alone)])
    return Price(*(statistics.median(each) for each in zip(*found, strict=True)))


def measure(title: str, make, engines: Sequence[str], runs: int, folder: Path) -> None:
    """Print the lines of a case."""
    import bpy

    scene = make()
    bpy.context.window.scene = scene
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    # Its own frustum in this size.
    select_only(scene.camera)
    bpy.ops.scfpf.camera_from_camera()
    scene.cycles.use_denoising = scene.cycles.use_adaptive_sampling = False
    (layer,) = scene.camera.scfpf.layers
    for engine, halo in product(engines, (0.0, HALO)):
        layer.halo = halo
        share = fit(scene.camera)
        scene.render.engine = "CYCLES" if engine == "cycles" else "SCFPF"
        for percentage, samples in SIZES[engine]:
            scene.render.resolution_percentage = percentage
            scene.cycles.samples = scene.camera.scfpf.samples = samples
            size = " × ".join(str(side * percentage // 100) for side in SIZE)
            found = price(engine, scene.camera, str(folder / "layers.png"), runs)
            missed = ", MISSED" if found.layered > GOALS[engine] else ""
            about = " with its halo" if halo else ""
            print(
                f"{size}, {samples} samples: {title}{about}, {share:.0%}: "
                f"{engine} {found.layered:.2f} × (goal {GOALS[engine]:g}{missed}); "
                f"its camera alone 1 + {share:.2f} · {found.alone:.2f} = {1 + share * found.alone:.2f} ×, "
                f"making its rig {found.rig:.2f}",
                flush=True,
            )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--quick", action="store_true", help="one turn each")
    parser.add_argument("--only", choices=GOALS, help="one of the renderers")
    options = parser.parse_args()
    with render_demo.scratch_profile(), tempfile.TemporaryDirectory() as folder:
        render_demo.enable_add_on(Path(folder))
        for title, make in CASES.items():
            engines = [options.only] if options.only else [*GOALS]
            measure(title, make, engines, 1 if options.quick else RUNS, Path(folder))


if __name__ == "__main__":
    main()
