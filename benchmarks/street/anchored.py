# SPDX-License-Identifier: GPL-3.0-or-later
"""Anchors of presets on the demo's street: how many, how long, and how exact; whole pictures by EEVEE.

    python3 dev.py bench --anchors [--only PRESET …] [--width PIXELS] [--whole] [--rig]

For each preset: anchors of the first plan and further ones, their pixels as a multiple of the picture's,
processor seconds of planning (with the further ones) and of the look-up of a million points, the share of
points on things that no anchor shows, and the share of joined positions within half a pixel of the
Position pass, by one sample in each pixel's centre. The anchors' pictures are positions, as the caster finds
them.

--whole renders each preset by EEVEE with 4 samples as well, and an ordinary camera's picture of the same
size in the same place.

--rig joins each preset from renders by Cycles with 64 samples, 16 hits a pixel in light that does not bounce,
and compares it with Cycles' own through the rig, with 256. Of pixels beside which no colours change, the
root mean square of the differences, and that of two pictures through the rig with other noise; then the
shares off by more than 0.1 of these pixels and of all, and the same of two pictures through the rig.
"""

from __future__ import annotations

import argparse
import importlib
import sys
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))

from demo import render_demo
from demo.recipes.scenes import land
from demo.render_thumbnails import LAND, OWN, USUAL

PRESETS = Path(__file__).resolve().parents[2] / "presets"
WIDTH = 640
# Wider than high by so much, if a preset is no square one.
WIDE = {"around_the_car": 3.0}
SAMPLES = 4
# Beside the rig: hits of a pixel, samples of the renders and of Cycles through the rig, and what is off.
# Colours that differ by more than EDGE are those of an edge.
HITS, RENDER_SAMPLES, RIG_SAMPLES, OFF, EDGE = 16, 64, 256, 0.1, 0.1
# The bars: a second of two cores.
MOST_HOLES, LEAST_WITHIN, MOST_SECONDS = 5e-4, 0.995, 2.0


def room(name: str):
    """A module of the add-on as Blender has loaded it."""
    return importlib.import_module(f"{render_demo.MODULE}.scfpf_addon.{name}")


def shot(scene, path: Path, width: int):
    """A preset's camera in a copy of the scene, with an image of a width."""
    import bpy

    own = LAND.get(path.stem) or OWN.get(path.stem, USUAL)
    copy = render_demo.another_scene(scene)
    for obj in scene.collection.objects:
        copy.collection.objects.link(obj)
    camera = render_demo.add_shot(copy, path.read_text(encoding="utf-8"), own)
    aspect = WIDE.get(path.stem, own.size[0] / own.size[1])
    copy.render.resolution_x, copy.render.resolution_y = width, round(width / aspect)
    bpy.context.window.scene = copy
    bpy.context.view_layer.update()
    return copy, camera


def geometry(depsgraph):
    """What the street has that cameras see."""
    read = room("bridge.scene.read_scene").read_scene(depsgraph)
    there, names = read.geometry, read.material_names
    scene = room("casting.scene.cast_scene").CastScene(there.vertices, there.triangles)
    directional = room("engines.directional").directional(names, there.material)
    return room("anchors.seen_scene").SeenScene(scene, directional=directional)


def positions(views) -> list[np.ndarray]:
    """Pictures (H, W, 4) whose colours are what the pixels' centres of anchors meet."""
    made = []
    for view in views:
        height, width = view.depth.shape
        column, row = np.tile(np.arange(width), height), np.repeat(np.arange(height), width)
        begin, way = view.anchor.rays(column, row)
        far = np.where(np.isfinite(view.depth), view.depth, 0.0).ravel() - view.anchor.start
        found = np.ones((height * width, 4), np.float32)
        found[:, :3] = (begin + way * far).T
        made.append(found.reshape(height, width, 4))
    return made


def looked_up(seen, projection, size, views) -> tuple[float, float, float]:
    """Processor seconds of a million points, the share of holes, and of positions within half a pixel."""
    tiles, joining, points_of = room("casting.tiles"), room("anchors.join"), room("anchors.shown_points")
    shown, own = points_of.shown_points, room("anchors.anchor_view").ViewSet
    width, height = size
    every, pictures = own(tuple(range(len(views)))), positions(views)
    points = {}

    def cast(job):
        rows = np.arange(job.rows.start, job.rows.stop)
        x, y = np.tile((np.arange(width) + 0.5) / width, len(rows)), np.repeat((rows + 0.5) / height, width)
        found = shown(seen, projection, x, y, (1.0 / width, 1.0 / height))
        return found.take(np.flatnonzero(found.is_hit))

    def join(job):
        return joining.join(together[job.rows.start], views, [every], pictures)

    bands = tiles.image_tiles(width, height)
    tiles.run_tiles(cast, bands, 0, lambda rows, found: points.update({rows.start: found}))
    # As many as are looked up together in pictures of several samples.
    cast_rows = [rows for rows in bands if rows.start in points]
    at_once = room("engines.joined_tiles").samples_at_once(len(views))
    few = max(1, at_once // (width * (bands[0].stop - bands[0].start)))
    groups = [cast_rows[k : k + few] for k in range(0, len(cast_rows), few)]
    together = {
        group[0].start: points_of.joined_points([points[rows.start] for rows in group]) for group in groups
    }
    joined = {}
    begun = process_time()
    tiles.run_tiles(
        join, [group[0] for group in groups], 0, lambda rows, found: joined.update({rows.start: found})
    )
    seconds = process_time() - begun
    count = holes = within = 0
    for start, (color, is_hole) in joined.items():
        own = together[start]
        off = color[:, :3].T - own.position
        off -= own.direction * np.einsum("cn,cn->n", off, own.direction)
        near = np.linalg.norm(off, axis=0) < 0.5 * own.length
        count, holes, within = count + len(near), holes + is_hole.sum(), within + (near & ~is_hole).sum()
    count = max(count, 1)
    return seconds * 1e6 / count, float(holes / count), float(within / max(count - holes, 1))


def rendered(scene, camera) -> tuple[float, float]:
    """Seconds of the joined picture by EEVEE, and of an ordinary one in its place."""
    import bpy

    renderer = room("bridge.blender.versions").EEVEE
    scene.render.engine, camera.scfpf.samples = renderer, SAMPLES
    scene.eevee.taa_render_samples = SAMPLES
    with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
        begun = perf_counter()
        room("engines.anchors_job").render_anchors(bpy.context, camera)
        joined = perf_counter() - begun
        begun = perf_counter()
        bpy.ops.render.render(scene=scene.name)
        return joined, perf_counter() - begun


def result(scene) -> np.ndarray:
    """The picture (H, W, 3) of the Render button's image."""
    import bpy

    width, height = scene.render.resolution_x, scene.render.resolution_y
    values = np.empty(width * height * 4, np.float32)
    bpy.data.images["SCFPF Render"].pixels.foreach_get(values)
    return values.reshape(height, width, 4)[..., :3]


def by_cycles(scene, seed: int) -> np.ndarray:
    """The picture (H, W, 3) of the scene's camera by Cycles."""
    import bpy

    scene.cycles.samples, scene.cycles.seed = RIG_SAMPLES, seed
    scene.render.filepath = str(Path(bpy.app.tempdir, "anchored.exr"))
    scene.render.image_settings.file_format, scene.render.image_settings.color_depth = "OPEN_EXR", "32"
    bpy.ops.render.render(write_still=True, scene=scene.name)
    image = bpy.data.images.load(scene.render.filepath)
    values = np.empty(len(image.pixels), np.float32)
    image.pixels.foreach_get(values)
    bpy.data.images.remove(image)
    return values.reshape(scene.render.resolution_y, scene.render.resolution_x, -1)[..., :3]


def beside_rig(scene, camera) -> list[str]:
    """Cells of the table: how a picture joined from renders by Cycles differs from that through the rig."""
    import bpy

    cycles, scene.render.engine = scene.cycles, "CYCLES"
    cycles.use_denoising = cycles.use_adaptive_sampling = False
    cycles.max_bounces, cycles.samples, camera.scfpf.samples = 0, RENDER_SAMPLES, HITS
    # Pixels are boxes in both.
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    scene.scfpf_sampling.pixel_filter, scene.render.filter_size = "BOX", 1.0
    scene.camera = camera
    with bpy.context.temp_override(scene=scene, view_layer=scene.view_layers[0]):
        room("engines.anchors_job").render_anchors(bpy.context, camera)
        joined = result(scene)
        made = room("cycles.rig").switch_on(bpy.context, camera)
        rig, other = (by_cycles(scene, seed) for seed in (0, 1))
        room("cycles.rig").switch_off(made)
    grown = np.pad(0.5 * (rig + other), [(1, 1), (1, 1), (0, 0)], mode="edge")
    height, width = rig.shape[:2]
    beside = [grown[i : i + height, j : j + width] for i in range(3) for j in range(3)]
    inner = (np.max(beside, axis=0) - np.min(beside, axis=0)).max(axis=2) <= EDGE
    off, other_off = (np.abs(each - rig).max(axis=2) > OFF for each in (joined, other))
    mean, noise = (float(np.sqrt(np.mean((each - rig)[inner] ** 2))) for each in (joined, other))
    cells = [f"{mean:.4f}", f"{noise:.4f}"]
    return cells + [f"{each[inner].mean():.2%}, {each.mean():.2%}" for each in (off, other_off)]


def measured(path: Path, street, options) -> str:
    """A line of the table, with * at what misses its bar."""
    scene, camera = shot(street, path, options.width)
    size = scene.render.resolution_x, scene.render.resolution_y

    def read(depsgraph):
        reading = room("bridge.camera.read_projection")
        return geometry(depsgraph), reading.read_projection(camera, depsgraph, size[0] / size[1])

    reading = room("bridge.scene.render_depsgraph")
    seen, projection = reading.with_render_depsgraph(scene, scene.view_layers[0], read)
    axes = np.array(camera.matrix_world.to_3x3().normalized())
    begun = process_time()
    plan = room("anchors.plan").plan_anchors([seen], [projection], size, axes)
    views = room("anchors.anchor_view").traced_views(seen, plan.anchors)
    done = room("anchors.completion").completed(seen, projection, size, views)
    planned = process_time() - begun
    views, _ = room("anchors.anchor_view").without_unused(done.views, [done.own])
    pixels = sum(view.anchor.count for view in views) / (size[0] * size[1])
    seconds, holes, within = looked_up(seen, projection, size, views)
    cells = [
        path.stem,
        f"{len(views) - len(done.added)} + {len(done.added)}",
        f"{pixels:.1f} ×",
        f"{planned:.1f} s",
        f"{seconds:.2f} s{'*' * (seconds > MOST_SECONDS)}",
        f"{holes:.3%}{'*' * (holes > MOST_HOLES)}",
        f"{within:.2%}{'*' * (within < LEAST_WITHIN)}",
    ]
    if options.whole:
        joined, ordinary = rendered(scene, camera)
        cells.append(f"{joined:.1f} s, {joined / ordinary:.1f} ×")
    if options.rig:
        cells += beside_rig(scene, camera)
    return f"| {' | '.join(cells)} |"


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", nargs="+", default=[], metavar="PRESET", help="these presets alone")
    parser.add_argument("--width", type=int, default=WIDTH, help="of the pictures, in pixels")
    parser.add_argument("--whole", action="store_true", help="render the pictures by EEVEE as well")
    parser.add_argument("--rig", action="store_true", help="compare with the Cycles rig as well")
    options = parser.parse_args()
    with render_demo.scratch_profile() as scratch:
        render_demo.enable_add_on(scratch)
        heads = ["preset", "anchors", "pixels", "plan", "a million points", "holes", "within half a pixel"]
        heads += ["by EEVEE"] * options.whole
        heads += ["RMSE", "RMSE of two", "off", "off of two"] * options.rig
        print(f"| {' | '.join(heads)} |\n|{'---|' * len(heads)}")
        for build, is_land in ((render_demo.build_street, False), (land, True)):
            paths = [
                path
                for path in sorted(PRESETS.glob("*.json"))
                if (path.stem in LAND) == is_land and (not options.only or path.stem in options.only)
            ]
            if not paths:
                continue
            scene = build()
            for path in paths:
                print(measured(path, scene, options), flush=True)


if __name__ == "__main__":
    main()
