# SPDX-License-Identifier: GPL-3.0-or-later
"""Speed and accuracy of the caster, as ratios taken in one run.

    python3 dev.py bench [--json FILE] [--quick] [--million]

Every time is the least of several runs that take turns with what they are compared
with. *Raw* is Embree alone: the straight frame's rays, made beforehand, through
``embreex`` in the same tiles and threads. The counts depend on nothing but the code.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.document import check_files
from benchmarks.raw import raw_embree
from benchmarks.scenes import SCENES, Mesh, bent_projection
from scfpf_addon.casting.cast import CastCounts, Hits, cast
from scfpf_addon.casting.common.geometry import Geometry
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.casting.tiles import image_tiles
from scfpf_addon.projection.volume.viewing_volume import Projection
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.materials.constants import Materials
from scfpf_addon.shading.scene.shading_scene import Light, Scene
from scfpf_addon.shading.settings.frame_settings import FrameSettings

THREADS = 2
PIXEL_ERROR = 0.1
BENDS = ((2, 10), (2, 60), (3, 180))

# A straight frame at this share of raw Embree, curved casts at most these multiples of it:
# with PIXEL_ERROR, and exact.
STRAIGHT_GOAL = 0.75
CURVED_GOALS = {10: (3.5, 7.0), 60: (5.0, 10.0), 180: (6.0, 14.0)}

# Deterministic counts that are printed, of both kinds of casts.
COUNTS = (("refined", "on_neighbours", "unresolved"), ("tested", "unresolved"))

# Exact casts take longer and vary less: they are run this often at most.
EXACT_RUNS = 2


class Image:
    """The size of an image and its tiles."""

    def __init__(self, width: int, height: int) -> None:
        self.width, self.height = width, height
        self.tiles = image_tiles(width, height)

    def cast_tile(
        self, scene: CastScene, projection: Projection, rows: slice, error: float, grid: bool = True
    ) -> tuple[Hits, CastCounts]:
        """One tile of the image; grid: let empty space be skipped for blocks of pixels."""
        counts = CastCounts()
        x, y = pixel_centres(self.width, self.height, (rows.start, rows.stop))
        size = (1 / self.width, 1 / self.height)
        columns = self.width if grid else None
        return cast(scene, projection, x, y, size, error, counts, columns), counts


def timed(work: Callable[[Any], object], tiles: list[Any], threads: int) -> float:
    """Seconds to do all tiles in so many threads; ``work`` should keep nothing large."""
    with ThreadPoolExecutor(threads) as pool:
        start = perf_counter()
        for done in [pool.submit(work, tile) for tile in tiles]:
            done.result()
        return perf_counter() - start


def counted(
    image: Image, scene: CastScene, inside: Projection, error: float, threads: int
) -> tuple[float, CastCounts]:
    """Seconds that all tiles of a cast take, and its counts."""
    parts: list[CastCounts] = []

    def work(rows: slice) -> None:
        parts.append(image.cast_tile(scene, inside, rows, error)[1])

    seconds = timed(work, image.tiles, threads)
    total = CastCounts()
    for part in parts:
        total.add(part)
    return seconds, total


def raw_rays(scene: CastScene, projection: Projection, image: Image) -> list[tuple[Any, ...]]:
    """The rays of a straight frame, tile by tile, as Embree takes them."""
    tiles = []
    for rows in image.tiles:
        points, _ = projection.projectors(*pixel_centres(image.width, image.height, (rows.start, rows.stop)))
        way = (points[1] - points[0]).astype(np.float32)
        tiles.append((points[0].astype(np.float32), way, np.ones(way.shape[1], np.float32)))
    return tiles


def lit(mesh: Mesh, smooth: bool = False) -> Scene:
    """The mesh with flat or smooth normals, one material and a sun, for whole frames."""
    vertices, triangles = mesh
    corners = vertices[triangles]
    normal = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    normals = np.repeat(normal[:, None], 3, axis=1)
    if smooth:
        at_vertex = np.zeros_like(vertices)
        np.add.at(at_vertex, triangles, normals)
        normals = at_vertex[triangles]
    normals /= np.maximum(np.linalg.norm(normals, axis=2, keepdims=True), 1e-30)
    normals = normals.astype(np.float32)
    if not smooth:
        # As the reader of Blender's meshes has it: one normal in memory, shown thrice.
        normals = np.broadcast_to(normals[:, :1].copy(), normals.shape)
    count = len(triangles)
    geometry = Geometry(
        vertices,
        triangles,
        normals,
        np.zeros(count, np.int32),
        np.zeros(count, np.int32),
    )
    one = np.ones(1)
    materials = Materials(0.8 * np.ones((1, 3)), 0 * one, 0.5 * one, 0.04 * one, np.zeros((1, 3)))
    sun = np.eye(4)
    sun[:3, :3] = [[0.8, 0.0, 0.6], [0.36, 0.8, -0.48], [-0.48, 0.6, 0.64]]
    return Scene(geometry, materials, (Light("SUN", np.full(3, 2.0), sun, casts_shadow=False),))


def speed(name: str, mesh: Mesh, image: Image, runs: int, threads: int) -> dict[str, Any]:
    """Times of one scene, straight and curved, and the deterministic counts."""
    start = perf_counter()
    scene = CastScene(*mesh)
    build = perf_counter() - start
    straight = bent_projection(1, 0.0)
    flat, smooth = lit(mesh), lit(mesh, smooth=True)
    settings = FrameSettings(image.width, image.height, samples=1, threads=threads)
    rays = raw_rays(scene, straight.transformed(scene.matrix), image)
    cast_raw = raw_embree(scene)
    works: dict[str, Callable[[], float]] = {
        "raw": lambda: timed(lambda ray: cast_raw(*ray) is None, rays, threads),
        "frame": lambda: _seconds(lambda: render_frame(straight, flat, settings, scene)),
        "smooth": lambda: _seconds(lambda: render_frame(straight, smooth, settings, scene)),
    }
    counts: dict[str, dict[str, Any]] = {}

    def casting(title: str, inside: Projection, error: float) -> Callable[[], float]:
        def work() -> float:
            seconds, total = counted(image, scene, inside, error, threads)
            counts[title] = vars(total)
            return seconds

        return work

    works["straight"] = casting("straight", straight.transformed(scene.matrix), PIXEL_ERROR)
    for degree, angle in BENDS:
        inside = bent_projection(degree, math.radians(angle)).transformed(scene.matrix)
        works[f"{angle}°"] = casting(f"{angle}°", inside, PIXEL_ERROR)
        works[f"{angle}° exact"] = casting(f"{angle}° exact", inside, 0.0)
    start = perf_counter()
    _ = scene.prisms, scene.occupancy
    extra = perf_counter() - start
    best = dict.fromkeys(works, math.inf)
    for run in range(runs):
        for title, work in works.items():
            if run < EXACT_RUNS or "exact" not in title:
                best[title] = min(best[title], work())
    return {
        "scene": name,
        "triangles": len(mesh[1]),
        "build": build,
        "build_exact": extra,
        "seconds": best,
        "counts": counts,
    }


def _seconds(work: Callable[[], object]) -> float:
    start = perf_counter()
    work()
    return perf_counter() - start


def mismatch(name: str, mesh: Mesh, image: Image) -> list[dict[str, Any]]:
    """Share of pixels whose t differs from that of an exact cast."""
    scene = CastScene(*mesh)
    rows = []
    for degree, angle in BENDS:
        inside = bent_projection(degree, math.radians(angle)).transformed(scene.matrix)

        def depths(error: float, inside: Projection = inside) -> np.ndarray:
            tiles = [image.cast_tile(scene, inside, rows, error)[0].t for rows in image.tiles]
            t = np.concatenate(tiles)
            return np.where(np.isfinite(t), t, 2.0)

        reference = depths(0.0)
        row: dict[str, Any] = {"scene": name, "bend": f"{angle}°"}
        for error in (1.0, PIXEL_ERROR, PIXEL_ERROR / 10):
            row[f"{error:g} px"] = float(np.mean(np.abs(depths(error) - reference) > 1e-6))
        rows.append(row)
    return rows


def report(result: dict[str, Any]) -> None:
    """Print one scene's figures."""
    seconds, counts = result["seconds"], result["counts"]
    pixels = counts["straight"]["projectors"]
    print(
        f"\n{result['scene']}, {result['triangles']:,} triangles (built in {result['build']:.2f} s; "
        f"prisms and empty space {result['build_exact']:.2f} s)"
    )
    raw = seconds["raw"]
    print(f"  raw Embree             {raw:7.3f} s   {pixels / raw / 1e6:6.1f} Mray/s")
    for title, label in (
        ("straight", "straight cast"),
        ("frame", "frame, flat shading"),
        ("smooth", "frame, smooth shading"),
    ):
        goal = "" if title == "straight" else f"  (goal {STRAIGHT_GOAL:.0%})"
        print(f"  {label:22s} {seconds[title]:7.3f} s   {raw / seconds[title]:6.0%} of raw{goal}")
    for _, angle in BENDS:
        for kind, goal in zip(("", " exact"), CURVED_GOALS[angle], strict=True):
            title, count = f"{angle}°{kind}", counts[f"{angle}°{kind}"]
            print(
                f"  bent by {title:14s} {seconds[title]:7.3f} s   {seconds[title] / raw:5.1f} × raw "
                f"(goal {goal:g}), {seconds[title] / seconds['straight']:.1f} × straight"
            )
            each = {k: f"{count[k] / pixels:.3g}" for k in ("chords", "rays", *COUNTS[bool(kind)])}
            print("      a projector: " + ", ".join(f"{v} {k}" for k, v in each.items()))


def main() -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE", help="write all figures to FILE too")
    parser.add_argument("--quick", action="store_true", help="a quarter of the pixels, fewer runs")
    parser.add_argument("--million", action="store_true", help="also scenes of a million triangles")
    what = "threads of both, raw Embree and ours"
    parser.add_argument("--threads", type=int, default=THREADS, metavar="N", help=f"{what} ({THREADS})")
    options = parser.parse_args()
    check_files(parser, written=options.json)
    image = Image(960, 540) if options.quick else Image(1920, 1080)
    runs = 2 if options.quick else 5
    sizes = [100_000] + [1_000_000] * options.million
    print(f"{image.width} × {image.height} pixels, {options.threads} threads, pixel error {PIXEL_ERROR}")
    results = []
    for size in sizes:
        for name, make in SCENES.items():
            results.append(speed(name, make(size), image, runs, options.threads))
            report(results[-1])
    small = Image(480, 270)
    size = f"{small.width} × {small.height}"
    print(f"\npixels whose t differs from that of an exact cast, {size}")
    rows = [row for name, make in SCENES.items() for row in mismatch(name, make(sizes[0]), small)]
    for row in rows:
        print("  " + "  ".join(f"{k} {v:.1e}" if "px" in k else f"{v:8s}" for k, v in row.items()))
    if options.json:
        Path(options.json).write_text(json.dumps({"speed": results, "mismatch": rows}, indent=1) + "\n")


if __name__ == "__main__":
    main()
