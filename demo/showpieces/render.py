# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the showpieces for docs/showpieces.md: pictures through Cycles with all of its light, and films.

    python demo/showpieces/render.py [PIECE ...] [--percentage N] [--samples N]

`python3 dev.py showpieces` runs it under a Python that has bpy. Pictures go to docs/showpieces/, .blend files
to demo/output/showpieces/.
"""

from __future__ import annotations

import argparse
import functools
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT))

from demo.recipes.jobs import RECIPES  # noqa: E402
from demo.recipes.steps import Recipe, add, place, prepare, render, size  # noqa: E402
from demo.render_demo import enable_add_on, open_on, scratch_profile  # noqa: E402

FOLDER, OUTPUT = ROOT / "docs" / "showpieces", ROOT / "demo" / "output" / "showpieces"
QUALITY = 88
SAMPLES = 64


class Piece(NamedTuple):
    """A showpiece. recipe: whose steps but the last make it. size: pixels. dress: adds to its scene.

    kept: shares of width and height that are kept, from the upper left corner.
    """

    recipe: Recipe
    size: tuple[int, int]
    dress: Callable[[object], None]
    kept: tuple[float, float] = (1.0, 1.0)


def _recipe(stem: str) -> Recipe:
    return next(one for one in RECIPES if one.stem == stem)


def _nave() -> Recipe:
    """A nave from floor to vault, in a vertical Panini projection."""

    def build():
        from demo.showpieces.cathedral import build_nave

        return build_nave()

    # A volume gets the image's shape as it is when the preset is chosen.
    steps = (size(*NAVE_SIZE), add("panini_vertical"), place((0.0, 2.6, 6.0)), render())
    return Recipe("nave", "A nave from floor to vault", "", build, steps, "")


def _impossible() -> Recipe:
    """A street that turns about its own axis."""

    def build():
        from demo.showpieces.street_film import impossible_street

        return impossible_street()

    return Recipe("impossible-street", "An impossible street", "", build, (render(),), "")


def _evening_car() -> Recipe:
    """A car unfolded before its street, as a layer."""

    def build():
        from demo.showpieces.evening_car import evening_car

        return evening_car(STREET_SIZE)

    return Recipe("evening-car", "A car from both sides before its street", "", build, (render(),), "")


def _evening(scene) -> None:
    """Turn the street's day into an evening."""
    from demo.evening import evening

    evening(scene)


# The pixels of the pictures of the street.
STREET_SIZE, NAVE_SIZE = (1920, 960), (1200, 1920)

PIECES = {
    "impossible-street": Piece(_impossible(), STREET_SIZE, _evening, (0.82, 1.0)),
    "nave": Piece(_nave(), NAVE_SIZE, lambda scene: None),
    "evening-car": Piece(_evening_car(), STREET_SIZE, _evening),
    "evening-street": Piece(_recipe("rising-street"), STREET_SIZE, _evening, (1.0, 0.93)),
}


# The films' size, and the quality of their compression.
FILM_SIZE, FILM_QUALITY = (480, 240), 50
# Frames from one end to the other of the street that rises.
RISING_FRAMES = 26


def street_rises() -> tuple[object, list[Callable[[], None]]]:
    """The scene of the street as it rises and lies down again, and what sets each of its frames."""
    scene = prepare(_recipe("rising-street"))

    def blend(frame: int) -> None:
        share = frame / (RISING_FRAMES - 1)
        scene.camera.scfpf.blend_factor = share * share * (3.0 - 2.0 * share)

    up = [*[0] * 3, *range(RISING_FRAMES), *[RISING_FRAMES - 1] * 3, *range(RISING_FRAMES - 2, 0, -1)]
    return scene, [functools.partial(blend, frame) for frame in up]


def one_volume() -> tuple[object, list[Callable[[], None]]]:
    """The scene of the volume that is twisted and unrolled, and what sets each of its frames."""
    from demo import render_demo
    from demo.showpieces import street_film

    scene = render_demo.build_street()
    street_film.add_camera(scene, render_demo.MODULE)
    frames = range(scene.frame_start, scene.frame_end, 2)
    return scene, [functools.partial(scene.frame_set, frame) for frame in frames]


# The samples of each film, and the milliseconds of its images.
FILMS = {"street-rises": (street_rises, 8, 160), "one-volume": (one_volume, 4, 200)}
# Films that are joined from renders by EEVEE.
JOINED = "inked-street"
JOINED_SAMPLES, JOINED_PAUSE, HELD = 4, 80, 5


def film(name: str) -> None:
    """Render a film by the engine, as an animated WebP."""
    import bpy
    from PIL import Image

    from demo import render_demo

    build, samples, pause = FILMS[name]
    scene, settings = build()
    scene.render.resolution_x, scene.render.resolution_y = FILM_SIZE
    scene.camera.scfpf.samples = samples
    seen: dict[bytes, Image.Image] = {}
    images = []
    for number, setting in enumerate(settings):
        setting()
        bpy.context.view_layer.update()
        state = _state(scene.camera)
        if state not in seen:
            raw = OUTPUT / f"{name}-{number:03}.png"
            render_demo.render(scene, raw)
            seen[state] = Image.open(raw).convert("RGB")
            raw.unlink()
        images.append(seen[state])
    _write_film(name, images, pause)


def joined_film() -> None:
    """Render the inked street by EEVEE, as an animated WebP: forth, a pause, back, a pause."""
    import bpy
    from PIL import Image

    from demo.showpieces.inked_street import inked_street

    scene = inked_street()
    scene.render.resolution_x, scene.render.resolution_y = FILM_SIZE
    scene.eevee.taa_render_samples, scene.view_settings.view_transform = 1, "Standard"
    scene.render.image_settings.file_format = "PNG"
    scene.camera.scfpf.samples = JOINED_SAMPLES
    raw = OUTPUT / f"{JOINED}-###.png"
    options = {"camera": scene.camera.name, "engine": "EEVEE", "animation": True, "filepath": str(raw)}
    if bpy.ops.scfpf.joined_render(**options) != {"FINISHED"}:
        sys.exit("The inked street was not rendered; the lines above say why.")
    forth = []
    for path in sorted(OUTPUT.glob(f"{JOINED}-[0-9]*.png")):
        forth.append(Image.open(path).convert("RGB"))
        path.unlink()
    images = [*[forth[0]] * HELD, *forth, *[forth[-1]] * HELD, *forth[-2:0:-1]]
    _write_film(JOINED, images, JOINED_PAUSE)


def _write_film(name: str, images: list, pause: int) -> None:
    """Write images as an animated WebP, and the file of the film. pause: milliseconds of an image."""
    import bpy

    path = FOLDER / f"{name}.webp"
    options = {"duration": pause, "loop": 0, "quality": FILM_QUALITY, "method": 4}
    images[0].save(path, save_all=True, append_images=images[1:], **options)
    bpy.ops.wm.save_as_mainfile(filepath=str(OUTPUT / f"{name}.blend"), compress=True)
    print(f"{name}: {len(images) * pause / 1000:.0f} s, {path.stat().st_size / 1000:.0f} kB", flush=True)


def _state(camera) -> bytes:
    """The values of all shape keys of a camera's surfaces, by which its frames differ."""
    meshes = [slot.object.data for slot in camera.scfpf.surfaces]
    values = [key.value for mesh in meshes for key in mesh.shape_keys.key_blocks]
    return repr(values).encode()


def make(name: str, percentage: int, samples: int) -> None:
    """Build a showpiece, render it with Cycles, and write its picture and its file."""
    import bpy
    from PIL import Image

    from demo.path_traced import path_traced

    piece = PIECES[name]
    scene = prepare(piece.recipe)
    piece.dress(scene)
    scene.render.resolution_x, scene.render.resolution_y = piece.size
    scene.render.resolution_percentage = percentage
    raw = OUTPUT / f"{name}.png"
    begun = time.process_time()
    path_traced(scene, raw, samples)
    seconds = time.process_time() - begun
    image = Image.open(raw).convert("RGB")
    right, lower = (round(share * side) for share, side in zip(piece.kept, image.size, strict=True))
    image.crop((0, 0, right, lower)).save(FOLDER / f"{name}.jpg", quality=QUALITY, optimize=True)
    open_on(scene)
    bpy.ops.wm.save_as_mainfile(filepath=str(OUTPUT / f"{name}.blend"), compress=True)
    print(f"{name}: {seconds:.0f} s of the processor", flush=True)


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "pieces", nargs="*", metavar="PIECE", help=f"one of {', '.join((*PIECES, *FILMS, JOINED))}"
    )
    parser.add_argument("--percentage", type=int, default=100, metavar="N", help="of the size")
    parser.add_argument("--samples", type=int, default=SAMPLES, metavar="N", help="a pixel, before denoising")
    options = parser.parse_args(arguments)
    if unknown := sorted(set(options.pieces) - {*PIECES, *FILMS, JOINED}):
        parser.error(f"no showpiece is named {', '.join(unknown)}")
    for folder in (FOLDER, OUTPUT):
        folder.mkdir(parents=True, exist_ok=True)
    with scratch_profile() as scratch:
        enable_add_on(scratch)
        for name in options.pieces or (*PIECES, *FILMS, JOINED):
            if name == JOINED:
                joined_film()
            elif name in FILMS:
                film(name)
            else:
                make(name, options.percentage, options.samples)


if __name__ == "__main__":
    main(sys.argv[1:])
