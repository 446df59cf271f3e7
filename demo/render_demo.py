# SPDX-License-Identifier: GPL-3.0-or-later
"""Build the demo's street, render it through seven presets, and save two .blend files.

    python demo/render_demo.py --output FOLDER [--percentage N] [--only PRESET]

It runs under a Python that has bpy; `python3 dev.py demo` finds or makes one. In demo.blend each preset has a
scene with its own resolution, and all share the street. Choose a scene and press Render in the camera's
properties. tutorial.blend has the scene of the tutorial in README.md.
"""

from __future__ import annotations

import argparse
import contextlib
import importlib
import os
import sys
import tempfile
import time
from dataclasses import dataclass
from math import radians
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).resolve().parents[1]
MODULE = "bl_ext.checkout.scfpf"
# The engine of F12. New files have EEVEE, which ignores volumes.
ENGINE = "SCFPF"
OPENING_SCENE = "around_the_car"
# The 3D viewport as the file opens: its centre, distance, angles (degrees) and far clip.
VIEW_CENTRE, VIEW_DISTANCE, VIEW_ANGLES, VIEW_END = (0.0, -2.5, 0.8), 24.0, (46.0, 0.0, -16.0), 1000.0
TUTORIAL_DISTANCE = 72.0


class Sampling(NamedTuple):
    """The least and most samples per pixel of adaptive sampling, and its noise threshold."""

    least: int
    most: int
    noise: float


QUICK, FINE = Sampling(4, 16, 0.04), Sampling(4, 64, 0.02)


@dataclass(frozen=True)
class Shot:
    """The place and target of a preset's camera, the scale of its volume, and the size of the image."""

    location: tuple[float, float, float]
    target: tuple[float, float, float]
    scale: float = 1.0
    size: tuple[int, int] = (1280, 720)


SHOTS = {
    "around_the_car": Shot((0.0, -10.0, 1.0), (0.0, 0.0, 1.0), size=(1800, 600)),
    "perspective": Shot((-3.0, -20.0, 1.9), (0.2, 1.0, 2.9)),
    "orthographic": Shot((-15.0, -22.0, 34.0), (1.5, 1.5, 0.0), 2.4),
    "inverted_perspective": Shot((0.0, -8.8, 3.0), (0.0, 0.0, 0.7), 0.42),
    "cylindrical_panorama": Shot((-2.4, -4.2, 1.6), (0.0, 0.0, 1.6)),
    "angular_fisheye": Shot((-1.7, -3.9, 1.2), (0.0, 0.0, 1.9), size=(800, 800)),
    "nonlinear_twist": Shot((0.0, -20.5, 10.5), (0.0, 66.0, -1.5), 4.4, (800, 800)),
}


def enable_add_on(folder: Path) -> None:
    """Enable the checkout as an extension, through a repository in a folder of its own."""
    import bpy

    repository = folder / "repository"
    repository.mkdir()
    link = repository / "scfpf"
    if os.name == "nt":
        import _winapi

        _winapi.CreateJunction(str(ROOT), str(link))  # Symbolic links need a privilege on Windows.
    else:
        link.symlink_to(ROOT, target_is_directory=True)
    bpy.context.preferences.extensions.repos.new(
        name="checkout", module="checkout", custom_directory=str(repository), remote_url=""
    )
    if bpy.ops.preferences.addon_enable(module=MODULE) != {"FINISHED"}:
        sys.exit("The add-on could not be enabled; the lines above say why.")


@contextlib.contextmanager
def scratch_profile():
    """A temporary folder with an empty profile for Blender; it must be entered before bpy is imported."""
    with tempfile.TemporaryDirectory(prefix="scfpf-demo-", ignore_cleanup_errors=True) as scratch:
        profile = Path(scratch, "profile")
        profile.mkdir()  # Blender ignores a folder that does not exist.
        os.environ["BLENDER_USER_RESOURCES"] = str(profile)
        yield Path(scratch)


def preset_files() -> dict[str, Path]:
    """The presets that the demo renders, by the stems of their files."""
    return {stem: ROOT / "presets" / f"{stem}.json" for stem in sorted(SHOTS)}


def build_street():
    """Open a new file with the demo's scene, and return the scene."""
    import bpy

    from demo.street import build_scene

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    scene = bpy.context.scene
    build_scene(scene)
    return scene


def another_scene(street):
    """A scene that shares the street's collections, its world and its view."""
    import bpy

    from demo.street import set_view

    scene = bpy.data.scenes.new(street.name)
    for collection in street.collection.children:
        scene.collection.children.link(collection)
    scene.world = street.world
    set_view(scene)
    return scene


def place_camera(camera, shot: Shot) -> None:
    """Move and turn a camera as a shot says."""
    from mathutils import Vector

    camera.location = shot.location
    direction = Vector(shot.target) - Vector(shot.location)
    camera.rotation_euler = direction.to_track_quat("-Z", "Y").to_euler()


def add_shot(scene, text: str, shot: Shot, samples: Sampling = QUICK):
    """Give a scene the flexible camera of a preset (its file's text); returns the camera."""
    import bpy

    presets = importlib.import_module(f"{MODULE}.scfpf_addon.projection.presets.preset")
    flexible_camera = importlib.import_module(f"{MODULE}.scfpf_addon.bridge.camera.flexible_camera")
    preset = presets.load_preset(text)
    scene.name = preset.name
    scene.render.engine = ENGINE
    scene.render.resolution_x, scene.render.resolution_y = shot.size
    scene.render.resolution_percentage = 100
    collection = bpy.data.collections.new(f"{preset.name} camera")
    scene.collection.children.link(collection)
    camera = bpy.data.objects.new(preset.name, bpy.data.cameras.new(preset.name))
    place_camera(camera, shot)
    collection.objects.link(camera)
    scene.camera = camera
    layer = scene.view_layers[0]
    layer.objects.active = camera
    camera.select_set(True, view_layer=layer)
    flexible_camera.apply_preset(camera, preset, shot.size[0] / shot.size[1], shot.scale)
    camera.scfpf.samples = samples.most
    sampling = scene.scfpf_sampling
    sampling.use_adaptive = sampling.world_shadows = True
    sampling.adaptive_least, sampling.adaptive_threshold = samples.least, samples.noise
    return camera


def render(scene, path: Path) -> str:
    """Render a scene's camera as the button Render does, and write the image; returns the report."""
    import bpy

    results, files = (
        importlib.import_module(f"{MODULE}.scfpf_addon.bridge.render.{name}")
        for name in ("result_image", "image_file")
    )
    with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
        if bpy.ops.scfpf.render(camera=scene.camera.name) != {"FINISHED"}:
            sys.exit(f"{scene.name} was not rendered; the lines above say why.")
    files.save_result(bpy.data.images[results.IMAGE_NAME], str(path), scene)
    return scene.camera.scfpf.report


def open_on(scene, centre=VIEW_CENTRE, distance=VIEW_DISTANCE) -> None:
    """Set all windows and viewports to a scene, around a centre, at a distance, in material colours."""
    import bpy
    from mathutils import Euler

    for window in bpy.context.window_manager.windows:
        window.scene = scene
    for screen in bpy.data.screens:
        for area in screen.areas:
            if area.type == "VIEW_3D":
                space = area.spaces.active
                space.shading.color_type = "MATERIAL"
                space.clip_end = VIEW_END
                view = space.region_3d
                view.view_perspective = "PERSP"
                view.view_location, view.view_distance = centre, distance
                view.view_rotation = Euler([radians(angle) for angle in VIEW_ANGLES]).to_quaternion()


def save_tutorial(path: Path) -> None:
    """Write a file that has only the tutorial's scene."""
    import bpy

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    (empty,) = bpy.data.scenes
    if bpy.ops.scfpf.tutorial_scene() != {"FINISHED"}:
        sys.exit("The tutorial's scene was not made; the lines above say why.")
    bpy.data.scenes.remove(empty)
    open_on(bpy.context.scene, (0.0, 0.0, 0.0), TUTORIAL_DISTANCE)
    bpy.ops.wm.save_as_mainfile(filepath=str(path), compress=True)


def main(arguments: list[str]) -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument(
        "--output", type=Path, required=True, metavar="FOLDER", help="where the pictures and demo.blend go"
    )
    parser.add_argument(
        "--percentage",
        type=int,
        default=100,
        metavar="N",
        help="size of the pictures in percent (default 100)",
    )
    parser.add_argument(
        "--only", metavar="PRESET", choices=sorted(preset_files()), help="one preset, by its file's name"
    )
    options = parser.parse_args(arguments)
    if not 1 <= options.percentage <= 1000:
        parser.error("--percentage must be from 1 to 1000")
    folder = options.output.absolute()
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        parser.error(f"cannot make the folder {folder}: {error.strerror}")
    with scratch_profile() as scratch:
        files = make(scratch, folder, options.percentage, options.only)
    print("Written:")
    for file in files:
        print(f"  {file}")


def make(scratch: Path, folder: Path, percentage: int, only: str | None) -> list[Path]:
    """Build, render and save everything; returns the files that were written."""
    import bpy

    started = time.perf_counter()
    enable_add_on(scratch)
    street = build_street()
    print(f"The street is built ({time.perf_counter() - started:.1f} s)", flush=True)
    presets = {stem: path for stem, path in preset_files().items() if only in (None, stem)}
    # The scenes are made before the street gets a camera of its own.
    scenes = dict(
        zip(presets, [street, *(another_scene(street) for _ in range(len(presets) - 1))], strict=True)
    )
    files = []
    for number, (stem, scene) in enumerate(scenes.items(), 1):
        add_shot(scene, presets[stem].read_text(encoding="utf-8"), SHOTS[stem])
        scene.render.resolution_percentage = percentage
        begun = time.perf_counter()
        print(f"[{number}/{len(scenes)}] {scene.name} ...", flush=True)
        files.append(folder / f"{stem}.png")
        report = render(scene, files[-1])
        print(
            f"[{number}/{len(scenes)}] {scene.name}: {time.perf_counter() - begun:.1f} s, {report}",
            flush=True,
        )
        scene.render.resolution_percentage = 100
    open_on(scenes.get(OPENING_SCENE, street))
    files.append(folder / "demo.blend")
    bpy.ops.wm.save_as_mainfile(filepath=str(files[-1]), compress=True)
    files.append(folder / "tutorial.blend")
    save_tutorial(files[-1])
    print(f"All done in {time.perf_counter() - started:.0f} s", flush=True)
    return files


if __name__ == "__main__":
    sys.path.insert(0, str(ROOT))
    main(sys.argv[1:])
