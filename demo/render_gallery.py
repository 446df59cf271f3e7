# SPDX-License-Identifier: GPL-3.0-or-later
"""Render the gallery: for each image the volume's diagram, its set-up in the scene, and the result.

    python demo/render_gallery.py --output PAGE [--percentage N] [--only PLATE ...] [--cycles | --engine]

`python3 dev.py gallery` runs it under a Python that has bpy, for docs/gallery.md and docs/gallery/.
"""

from __future__ import annotations

import argparse
import importlib
import json
import sys
import time
from collections.abc import Sequence
from pathlib import Path
from string import ascii_lowercase
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from demo.gallery_panels import Panel, Plate

ROOT = Path(__file__).resolve().parents[1]
# The images of a panel, and the endings of their files.
PARTS = {"diagram": "png", "set-up": "jpg", "result": "jpg"}
# Images that are also rendered with Cycles, with so many samples per pixel before denoising.
WITH_CYCLES = (
    "figure-1",
    "figure-3",
    "figure-7-b",
    "figure-8",
    "figure-9",
    "figure-10-b",
    "figure-11-b",
    "figure-12",
    "figure-13-b",
)
CYCLES_SAMPLES = 64
# Beside the images: processor seconds of each with Cycles, and of the same camera without a volume.
CYCLES_TIMES = "cycles-times.json"
# The pixel error of their projectors; a smaller one takes more chords without a visible difference.
CYCLES_PIXEL_ERROR = 0.5
# The image whose ordinary camera is a perspective of this focal length in millimetres: its volume begins as a
# small rectangle before the car, and an orthographic camera there sees the car's front alone.
STREET_VIEW, STREET_LENS = "figure-1", 24.0
# Images wider than this multiple of their height have rows of their own; others stand in this many columns.
WIDE, ACROSS = 2.5, 3
HEAD = """# Gallery

`python3 dev.py gallery` makes every picture here. A diagram shows the volume from above and from the right,
with control surfaces in green and projectors in blue. The set-up shows it in the scene, and the result is its
camera's picture. Diagram and set-up replace very small or distant surfaces by others of the same view.
"""
QUALITY = 85
# The recipes of docs/recipes that plates lead to; the others lead to the one for any preset.
ANY_RECIPE = "any-preset"
RECIPES = {
    "figure-1": "all-sides",
    "figure-2": "oblique",
    "figure-5": "panini",
    "figure-6": "long-pan",
    "figure-8": "fulldome-master",
    "figure-11": "street-unrolled",
    "stereographic": "tiny-planet",
    "equirectangular": "tiny-planet",
    "oblique": "oblique",
    "digital-cubism": "best-side",
    "strip-camera": "all-sides",
    "tiles": "all-sides",
}

CYCLES_TEXT = """Cycles in a stock Blender path-traces the same volumes: the button *Cycles* sends its rays
along the projectors. Reflections, bounced light and soft shadows are those of the scene."""
TIMES_TEXT = f"""Each picture has {CYCLES_SAMPLES} samples a pixel and is denoised. Times are processor
seconds with the reading of the scene and the denoising. The ordinary camera has the same place and size.
That of figure 1 is a perspective 74° wide: an orthographic one would see the car's front alone."""


def save_jpeg(source: Path, path: Path) -> None:
    """Replace a rendered PNG by a JPEG on white."""
    import bpy
    import numpy as np

    image = bpy.data.images.load(str(source))
    pixels = np.empty(image.size[0] * image.size[1] * 4, np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(-1, 4)
    pixels[:, :3] = pixels[:, :3] * pixels[:, 3:] + 1.0 - pixels[:, 3:]
    pixels[:, 3] = 1.0
    paper = bpy.data.images.new("Paper", *image.size)
    paper.pixels.foreach_set(pixels.ravel())
    paper.file_format, paper.filepath_raw = "JPEG", str(path)
    paper.save(quality=QUALITY)
    for used in (image, paper):
        bpy.data.images.remove(used)
    source.unlink()


def page(plates: Sequence[Plate], folder: str, shown: set[str], times: dict[str, list[float]]) -> str:
    """The text of docs/gallery.md, whose images are in ``folder`` beside it.

    shown: see ``with_cycles``. times: as of ``cycles_times``.
    """
    from demo import gallery_animation

    lines = [HEAD]
    for beyond in (False, True):
        lines += ["## " + ("Beyond the paper" if beyond else "The figures of the paper"), ""]
        if beyond:
            title, text = gallery_animation.HEADING, gallery_animation.TEXT
            picture = f"![{title}]({folder}/{gallery_animation.STEM}.webp)"
            lines += [f"### {title}", "", f"{text} {recipe_link(gallery_animation.STEM)}", "", picture, ""]
        for plate in plates:
            if plate.paper != beyond:
                lines += [f"### {plate.heading}", "", f"{plate.text} {recipe_link(plate.stem)}", ""]
                lines += _table(plate, folder)
    lines += ["## Rendered with Cycles", "", CYCLES_TEXT, ""]
    for plate in plates:
        for stem in sorted(shown & set(stems(plate))):
            lines += [f"![{plate.heading}, with Cycles]({folder}/{stem}-cycles.jpg)", ""]
    if times:
        lines += [TIMES_TEXT, "", "| Picture | Volume | Ordinary camera | Ratio |", "|---|---|---|---|"]
    for stem, (curved, straight) in times.items():
        name = stem.replace("-", " ")
        lines += [f"| {name} | {curved:.0f} s | {straight:.0f} s | {curved / straight:.1f} |"]
    return "\n".join([*lines, ""] if times else lines)


def recipe_link(stem: str) -> str:
    """The way from a plate to its recipe."""
    return f"[Recipe](recipes/{RECIPES.get(stem, ANY_RECIPE)}.md)"


def with_cycles(folder: Path) -> set[str]:
    """The stems of the images with Cycles that a folder has."""
    return {stem for stem in WITH_CYCLES if (folder / f"{stem}-cycles.jpg").exists()}


def _table(plate: Plate, folder: str) -> list[str]:
    """The table of a plate with one column a panel; very wide results follow one below the other."""

    def picture(stem: str, panel: Panel, part: str) -> str:
        title = panel.title or plate.heading
        return f"![{title}: {part}]({folder}/{stem}-{part}.{PARTS[part]})"

    columns = list(zip(stems(plate), plate.panels, strict=True))
    wide = any(panel.shot.size[0] > WIDE * panel.shot.size[1] for panel in plate.panels)
    lines = []
    for first in range(0, len(columns), ACROSS):
        some = columns[first : first + ACROSS]
        lines += ["| " + " | ".join(panel.title or " " for _, panel in some) + " |", "|---" * len(some) + "|"]
        for part in ("diagram", "set-up") if wide else PARTS:
            lines += ["| " + " | ".join(picture(stem, panel, part) for stem, panel in some) + " |"]
        lines += [""]
    if wide:
        for stem, panel in columns:
            lines += [*([f"{panel.title}:", ""] if panel.title else []), picture(stem, panel, "result"), ""]
    return lines


def stems(plate: Plate) -> list[str]:
    """The beginning of the file names of each panel."""
    if len(plate.panels) == 1:
        return [plate.stem]
    return [f"{plate.stem}-{letter}" for letter, _ in zip(ascii_lowercase, plate.panels, strict=False)]


def build(name: str):
    """Open a new file with one of the gallery's scenes, and return the scene."""
    import bpy

    from demo.gallery_scenes import SCENES
    from demo.render_demo import build_street

    if name == "street":
        return build_street()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    SCENES[name](scene)
    return scene


def add_shot(street, panel, percentage: int):
    """A scene with a panel's camera, and the camera; its collections are those of the scene ``street``."""
    from demo import render_demo
    from demo.gallery_panels import preset_text

    scene = render_demo.another_scene(street)
    text = preset_text(panel.preset, panel.changed)
    camera = render_demo.add_shot(scene, text, panel.shot, render_demo.FINE)
    scene.render.resolution_percentage = percentage
    return scene, camera


def render_panel(street, panel, stem: Path, percentage: int) -> list[Path]:
    """Render diagram, set-up and result of a panel, whose collections are those of the scene ``street``."""
    import bpy

    from demo import render_demo, volume_pictures
    from demo.gallery_panels import preset_text

    scene, camera = add_shot(street, panel, percentage)
    aspect = panel.shot.size[0] / panel.shot.size[1]
    if panel.style:
        styles = importlib.import_module(f"{render_demo.MODULE}.scfpf_addon.bridge.settings.stylised_styles")
        styles.apply_style(scene, panel.style)
    files = [stem.with_name(f"{stem.name}-{part}.{end}") for part, end in PARTS.items()]
    raw = files[2].with_suffix(".png")
    print(f"  {stem.name}: {render_demo.render(scene, raw)}", flush=True)
    save_jpeg(raw, files[2])
    presets = importlib.import_module(f"{render_demo.MODULE}.scfpf_addon.projection.presets.preset")
    drawn = presets.load_preset(preset_text(panel.preset, {**panel.changed, **panel.drawn}))
    projection = drawn.projection(aspect)
    volume_pictures.draw_diagram(render_demo.MODULE, projection, panel.projectors, panel.reach, files[0])
    set_up = render_demo.another_scene(street)
    for name in panel.hidden:
        set_up.collection.children.unlink(set_up.collection.children[name])
    scaled = projection.transformed(_scaling(panel.shot.scale))
    volume_pictures.add_set_up(
        render_demo.MODULE,
        set_up,
        camera,
        scaled,
        projectors=panel.projectors,
        reach=panel.reach * panel.shot.scale,
        direction=panel.direction,
    )
    set_up.render.engine, set_up.scfpf_sampling.world_shadows = "SCFPF", True
    set_up.render.filepath = str(files[1].with_suffix(".png"))
    set_up.render.image_settings.file_format = "PNG"
    set_up.render.resolution_percentage = percentage
    with bpy.context.temp_override(scene=set_up, view_layer=set_up.view_layers[0]):
        bpy.ops.render.render(write_still=True, scene=set_up.name)
    save_jpeg(files[1].with_suffix(".png"), files[1])
    return files


def render_with_cycles(street, panel, path: Path, percentage: int) -> None:
    """Render a panel with Cycles through its rig, and without it, for the time."""
    import bpy

    raw = path.with_suffix(".png")
    scene, camera = add_shot(street, panel, percentage)
    camera.scfpf.pixel_error = CYCLES_PIXEL_ERROR
    scene.render.engine = "CYCLES"
    scene.cycles.samples, scene.cycles.use_denoising = CYCLES_SAMPLES, True
    scene.render.filepath, scene.render.image_settings.file_format = str(raw), "PNG"
    layer = scene.view_layers[0]
    layer.objects.active = camera
    bpy.context.window.scene = scene
    if bpy.ops.scfpf.cycles_rig() != {"FINISHED"}:
        sys.exit(f"The Cycles rig of {scene.name} was not made; the lines above say why.")
    begun = time.process_time()
    bpy.ops.render.render(write_still=True)
    curved = time.process_time() - begun
    bpy.ops.scfpf.cycles_rig()
    save_jpeg(raw, path)
    scene.render.engine = "CYCLES"
    if path.stem == f"{STREET_VIEW}-cycles":
        scene.camera = _perspective(scene, camera)
    begun = time.process_time()
    # An image that is not written may not be rendered.
    bpy.ops.render.render(write_still=True)
    straight = time.process_time() - begun
    raw.unlink()
    print(f"  {path.name}: {curved:.0f} s of the processor, without the rig {straight:.0f} s", flush=True)
    times = cycles_times(path.parent) | {path.stem.removesuffix("-cycles"): [curved, straight]}
    places = {stem: times[stem] for stem in WITH_CYCLES if stem in times}
    (path.parent / CYCLES_TIMES).write_text(json.dumps(places, indent=1) + "\n", encoding="utf-8")


def _perspective(scene, camera):
    """A perspective camera in a scene, at the place of a flexible one."""
    import bpy

    made = bpy.data.objects.new("Ordinary", bpy.data.cameras.new("Ordinary"))
    made.matrix_world, made.data.lens = camera.matrix_world, STREET_LENS
    scene.collection.objects.link(made)
    return made


def cycles_times(folder: Path) -> dict[str, list[float]]:
    """The times of images with Cycles that are known."""
    path = folder / CYCLES_TIMES
    return json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}


def _scaling(factor: float):
    import numpy as np

    return np.diag([factor, factor, factor, 1.0])


def main(arguments: list[str]) -> None:
    from demo import gallery_animation, render_demo
    from demo.gallery_plates import PLATES

    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--output", type=Path, required=True, metavar="PAGE", help="the page; its pictures go beside it"
    )
    parser.add_argument(
        "--percentage", type=int, default=75, metavar="N", help="size of the pictures in percent (default 75)"
    )
    choices = [*(plate.stem for plate in PLATES), gallery_animation.STEM]
    parser.add_argument("--only", metavar="PLATE", choices=choices, nargs="+", help="some plates")
    alone = parser.add_mutually_exclusive_group()
    alone.add_argument("--cycles", action="store_true", help="the pictures with Cycles alone")
    alone.add_argument("--engine", action="store_true", help="all others")
    options = parser.parse_args(arguments)
    output = options.output.absolute()
    folder = output.with_suffix("")
    folder.mkdir(parents=True, exist_ok=True)
    plates = [plate for plate in PLATES if options.only is None or plate.stem in options.only]
    with render_demo.scratch_profile() as scratch:
        render_all(scratch, folder, plates, options)
        if not options.cycles and (options.only is None or gallery_animation.STEM in options.only):
            gallery_animation.render_animation(build("house"), folder, scratch, render_demo.QUICK.least)
    output.write_text(page(PLATES, folder.name, with_cycles(folder), cycles_times(folder)), encoding="utf-8")


def render_all(scratch: Path, folder: Path, plates, options) -> None:
    from demo import render_demo

    started = time.perf_counter()
    render_demo.enable_add_on(scratch)
    wanted = [
        (panel.scene, number, panel, plate)
        for plate in plates
        for number, panel in enumerate(plate.panels)
        if not options.cycles or stems(plate)[number] in WITH_CYCLES
    ]
    # Each scene is built once.
    for name in dict.fromkeys(scene for scene, *_ in wanted):
        street = build(name)
        print(f"{name} ({time.perf_counter() - started:.0f} s)", flush=True)
        for scene, number, panel, plate in wanted:
            stem = folder / stems(plate)[number]
            if scene == name and not options.cycles:
                render_panel(street, panel, stem, options.percentage)
            if scene == name and stem.name in WITH_CYCLES and not options.engine:
                path = stem.with_name(f"{stem.name}-cycles.jpg")
                render_with_cycles(street, panel, path, options.percentage)
    print(f"All done in {time.perf_counter() - started:.0f} s", flush=True)


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    main(sys.argv[1:])
