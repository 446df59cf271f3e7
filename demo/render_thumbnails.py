# SPDX-License-Identifier: GPL-3.0-or-later
"""Render an evening square, or a landscape, through every preset, as thumbnails of the preset menus.

    python demo/render_thumbnails.py [--only PRESET]

It writes presets/thumbnails/PRESET.png, with a diagram of the volume in the corner. It runs under a Python
that has bpy; `python3 dev.py thumbnails` finds or makes one.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT))

from demo.recipes.scenes import land  # noqa: E402
from demo.render_demo import (  # noqa: E402
    MODULE,
    SHOTS,
    Shot,
    enable_add_on,
    place_camera,
    render,
    scratch_profile,
)

FOLDER = ROOT / "presets" / "thumbnails"
# Sharp on screens of two pixels a point, where menus show them.
SIZE = (192, 144)
SAMPLES = 24
# Colors of an image, which is a fifth as large as with all of them.
COLORS = 256
# Where projectors end in the diagram of a volume, from the camera, and how far the diagram is off the corner.
REACH, OFF = 1e6, 3
# The shot of presets without one of their own: in front of the kiosk, with the preset's own size.
USUAL = Shot((-3.0, -15.0, 2.4), (0.2, 0.0, 1.6))
# Shots of presets that need another place, or another size of the volume.
OWN = {
    **{stem: Shot(shot.location, shot.target, shot.scale) for stem, shot in SHOTS.items()},
    **dict.fromkeys(
        ("equisolid_fisheye", "polynomial_fisheye", "mirror_ball", "crystal_ball", "fulldome_master"),
        SHOTS["angular_fisheye"],
    ),
    "anamorphic_billboard": Shot((-1.5, -13.0, 2.3), (0.6, 0.0, 2.3)),
    "cavalier": Shot((0.0, -8.4, 1.6), (0.0, 0.0, 1.6), 0.56),
    "deep_curvy_volume": Shot((-5.0, -13.0, 2.6), (-4.0, 0.0, -0.2)),
    "dimetric": Shot((0.0, -12.75, 1.4), (0.0, 0.0, 1.4), 0.85),
    "inward_sphere": Shot((0.0, -5.0, 0.8), (0.0, 0.0, 0.8)),
    "digital_cubism": Shot((-2.2, -8.0, 2.6), (0.0, 0.0, 0.9), 0.8),
    "equirectangular": Shot((-1.7, -3.9, 1.2), (0.0, 0.0, 1.6)),
    "house_of_stairs": Shot((-1.0, -7.0, 2.2), (0.0, 0.0, 2.6)),
    "irregular_perspective": Shot((0.0, -6.5, 1.9), (0.0, 0.0, 1.9)),
    "multiperspective_tiles": Shot((0.0, -8.0, 1.5), (0.0, 0.0, 1.5), 0.42),
    "long_pan": Shot((0.0, -10.0, 2.0), (0.0, 0.0, 2.0)),
    "military": Shot((0.0, -9.0, 1.0), (0.0, 0.0, 1.0), 0.6),
    **dict.fromkeys(("panini", "panini_compressed"), Shot((-2.4, -4.4, 1.4), (0.2, 0.0, 1.4))),
    "panini_vertical": Shot((0.0, 50.0, 1.6), (0.0, 66.0, 1.6)),
    "three_quarter": Shot((0.0, -14.25, 1.2), (0.0, 0.0, 1.2), 0.95),
    "inverted_perspective": Shot((0.0, -11.0, 3.0), (0.0, 0.0, 1.1), 0.62),
    "linear_twist": Shot((-3.0, -15.0, 2.4), (0.2, 0.0, 1.6), 1.7),
    "nonlinear_twist": Shot((-1.0, -17.0, 3.2), (0.0, 0.0, 2.8), 1.8),
    "orthographic": Shot((-3.4, -16.0, 12.0), (0.4, 0.6, 0.9), 0.8),
    "telephoto": Shot((-2.6, -56.0, 3.0), (0.5, 0.0, 1.9)),
    **dict.fromkeys(("street_panorama", "street_panorama_curved"), Shot((-3.0, -9.0, 2.2), (0.2, 0.0, 1.8))),
    "strip_camera": Shot((0.0, -10.0, 1.0), (0.0, 0.0, 1.0)),
    "tiny_planet": Shot((0.0, -0.6, 5.0), (0.0, 9.0, 5.0)),
}


# The presets that show a landscape.
LAND = {"panorama_map": Shot((0.0, -10.0, 12.0), (0.0, 10.0, 12.0))}


def make(only: str | None) -> None:
    """Write the thumbnails, or one of them."""
    for build, is_land in ((square, False), (land, True)):
        paths = [
            path
            for path in sorted((ROOT / "presets").glob("*.json"))
            if only in (None, path.stem) and (path.stem in LAND) == is_land
        ]
        if paths:
            render_all(build(), paths)


def square():
    """Open a new file with the square, and return its scene."""
    import bpy

    from demo.square import build_square

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    build_square(bpy.context.scene)
    return bpy.context.scene


def render_all(scene, paths: list[Path]) -> None:
    """Write the thumbnails of some presets, which show a scene."""
    import bpy

    scene.scfpf_sampling.world_shadows = True
    camera = bpy.data.objects.new("Thumbnail", bpy.data.cameras.new("Thumbnail"))
    scene.collection.objects.link(camera)
    scene.camera = camera
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    presets = importlib.import_module(f"{MODULE}.scfpf_addon.projection.presets.preset")
    flexible = importlib.import_module(f"{MODULE}.scfpf_addon.bridge.camera.flexible_camera")
    FOLDER.mkdir(exist_ok=True)
    for path in paths:
        shot = LAND.get(path.stem) or OWN.get(path.stem, USUAL)
        place_camera(camera, shot)
        flexible.apply_preset(camera, presets.read_preset(path), SIZE[0] / SIZE[1], shot.scale)
        camera.scfpf.samples = SAMPLES
        camera.scfpf.pixel_error = 0.1
        bpy.context.view_layer.update()
        print(f"{path.stem}: {render(scene, FOLDER / f'{path.stem}.png')}", flush=True)
        add_diagram(camera, FOLDER / f"{path.stem}.png")


def add_diagram(camera, path: Path) -> None:
    """Lay the diagram of a camera's volume over the lower right corner of an image; make its file small."""
    import bpy
    from PIL import Image

    from demo.volume_icon import volume_icon

    reading = importlib.import_module(f"{MODULE}.scfpf_addon.bridge.camera.read_projection")
    depsgraph = bpy.context.evaluated_depsgraph_get()
    projection = reading.read_projection(camera, depsgraph, SIZE[0] / SIZE[1])
    inverse = np.linalg.inv(np.array(camera.matrix_world))
    icon = Image.fromarray(volume_icon(MODULE, projection.transformed(inverse), REACH))
    image = Image.open(path).convert("RGBA")
    image.alpha_composite(icon, (SIZE[0] - OFF - icon.width, SIZE[1] - OFF - icon.height))
    image.quantize(COLORS, Image.Quantize.FASTOCTREE).save(path, optimize=True)


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", metavar="PRESET", help="one preset, by its file's name")
    options = parser.parse_args(arguments)
    with scratch_profile() as scratch:
        enable_add_on(scratch)
        make(options.only)


if __name__ == "__main__":
    main(sys.argv[1:])
