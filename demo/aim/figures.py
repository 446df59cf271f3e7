# SPDX-License-Identifier: GPL-3.0-or-later
"""Figures 1, 10 and 11 of the paper by Aim, beside the presets: `python3 dev.py pictures aim-figures`.

Each one starts from straight projectors and gets at most 24 pins from the preset's image: points of the
scene, their places, and the directions in which they are seen.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .pictures import FOLDER, module

# Pins that a figure may have.
MOST_PINS = 24
# The gap between both images in pixels.
GAP = 6


@dataclass(frozen=True)
class Figure:
    """A figure of the paper.

    stem, preset: its plate in the gallery, and the number of the panel there. start: the preset to begin
    with. changed: values of its surfaces that differ. add: adds targets to a camera, and is given the scene
    and the camera of the preset. width: of each image in pixels. net, degree: of the solved surfaces.
    is_wide: whether the images are above each other. hidden: collections that are not shown.
    """

    stem: str
    preset: int
    start: str
    changed: dict
    add: Callable
    width: int
    net: tuple[int, int]
    degree: int
    is_wide: bool
    hidden: tuple[str, ...] = ()


def pins(columns, rows, halo: float, only: str = ""):
    """Return what adds pins at image positions, all pairs of columns and rows, where the preset shows things.

    only: the beginning of the names of the objects that get pins.
    """

    def add(camera, scene, preset) -> None:
        import bpy

        layer = scene.view_layers[0]
        with bpy.context.temp_override(scene=scene, view_layer=layer):
            depsgraph = layer.depsgraph
            depsgraph.update()
            arrays = module("bridge.aim.read_problem").read_arrays(depsgraph)
            aspect = module("bridge.render.image_size").image_aspect(scene)
            projection = module("bridge.camera.read_projection").read_projection(preset, depsgraph, aspect)
        positions = np.stack(np.meshgrid(columns, rows)).reshape(2, -1)
        hits = arrays.scene.hits(projection, *positions, 1920)
        names = np.array([name.startswith(only) for name, _ in arrays.names])
        objects = arrays.scene.objects[hits.triangle]
        shown = np.flatnonzero((hits.triangle >= 0) & names[objects])[:MOST_PINS]
        points = arrays.scene.world(hits.position[:, shown])
        directions = hits.tangent[:, shown] / np.linalg.norm(hits.tangent[:, shown], axis=0)
        for point, direction, place in zip(points.T, directions.T, positions[:, shown].T, strict=True):
            bpy.ops.scfpf.aim_pin_add(camera=camera.name, point=point, position=place, direction=direction)
            camera.scfpf.aim_targets[-1].halo = halo

    return add


FIGURES = (
    Figure(
        "figure-1",
        0,
        "orthographic",
        {
            0: {"width": 12.4, "height": 4.2, "location": [0, 0.1, -0.1]},
            1: {"width": 12.4, "height": 4.2, "location": [0, 0.1, -40]},
        },
        pins((0.04, 0.17, 0.3, 0.43, 0.57, 0.7, 0.83, 0.96), (0.45, 0.58, 0.7), 100.0, "Car"),
        480,
        # A finer net ripples between the pins, since nothing stays.
        (12, 6),
        5,
        False,
        ("Houses", "Street furniture", "Trees"),
    ),
    Figure(
        "figure-10",
        1,
        "perspective",
        {
            0: {"width": 0.12, "height": 0.09, "location": [0, 0, -0.1]},
            1: {"width": 120, "height": 90, "location": [0, 0, -100]},
        },
        pins((0.36, 0.39, 0.44, 0.5, 0.56, 0.61, 0.64), (0.41, 0.48, 0.54, 0.6), 1.0, "Car"),
        480,
        (16, 10),
        3,
        False,
    ),
    Figure(
        "figure-11",
        1,
        "street_panorama",
        {},
        pins((0.25, 0.28, 0.3, 0.32, 0.35, 0.65, 0.68, 0.7, 0.72, 0.75), (0.2, 0.4), 1.5),
        960,
        (16, 6),
        3,
        True,
    ),
)


def make(figure: Figure, scratch: Path) -> str:
    """Aim a figure's camera, render both images, and return its figures as a line."""
    import bpy

    from demo import render_demo, render_gallery
    from demo.gallery_panels import preset_text
    from demo.gallery_plates import PLATES

    plate = next(plate for plate in PLATES if plate.stem == figure.stem)
    panel = plate.panels[figure.preset]
    street = render_gallery.build(panel.scene)
    percentage = 100 * figure.width / panel.shot.size[0]
    cameras = []
    for text in (preset_text(panel.preset, panel.changed), preset_text(figure.start, figure.changed)):
        scene = render_demo.another_scene(street)
        for name in set(figure.hidden) & set(scene.collection.children.keys()):
            scene.collection.children.unlink(scene.collection.children[name])
        camera = render_demo.add_shot(scene, text, panel.shot)
        scene.render.resolution_percentage = round(percentage)
        cameras.append((scene, camera))
    (scene, preset), (own, camera) = cameras
    bpy.context.window.scene = own
    aim = camera.scfpf.aim
    (aim.columns, aim.rows), aim.degree = figure.net, figure.degree
    figure.add(camera, scene, preset)
    own.view_layers[0].update()
    try:
        bpy.ops.scfpf.aim_solve(camera=camera.name)
    except RuntimeError as error:
        return f"{figure.stem}: {error}"
    names = [scratch / f"{figure.stem}-{number}.png" for number in range(2)]
    for (each, _), name in zip(cameras, names, strict=True):
        render_demo.render(each, name)
    join(names, FOLDER / f"aim-{figure.stem}.jpg", figure.is_wide)
    most = max(target.residual_max for target in camera.scfpf.aim_targets)
    return f"{figure.stem}: {len(camera.scfpf.aim_targets)} targets, at most {most:.2f} px, {aim.message}"


def make_all(scratch: Path) -> None:
    """Make all pictures, and print what each solve says."""
    for figure in FIGURES:
        print(make(figure, scratch), flush=True)


def join(paths: list[Path], path: Path, is_wide: bool) -> None:
    """Put images beside or above each other."""
    from PIL import Image

    images = [Image.open(p).convert("RGB") for p in paths]
    width, height = images[0].size
    size = (width, 2 * height + GAP) if is_wide else (2 * width + GAP, height)
    whole = Image.new("RGB", size, "white")
    for number, image in enumerate(images):
        step = number * ((height if is_wide else width) + GAP)
        whole.paste(image, (0, step) if is_wide else (step, 0))
    whole.save(path, quality=88)
