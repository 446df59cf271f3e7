# SPDX-License-Identifier: GPL-3.0-or-later
"""Exact casting at the extremes: each function answers with figures, the tests with bounds on them.

    python3 dev.py bench --extremes [--json FILE]

Everything is compared with what is known otherwise: with the scene where it was made, with the place
that a curve was aimed at, with a closed form.
"""

from __future__ import annotations

import argparse
import json
import math
import sys
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from benchmarks.document import check_files
from benchmarks.hard_scenes import AIMS, aimed_curves, cube, sphere
from benchmarks.scenes import Mesh, bent_projection, boxes, joined, sheet
from scfpf_addon.casting.cast import cast
from scfpf_addon.casting.common.hits import CastCounts, Hits
from scfpf_addon.casting.curves.projector_batch import ProjectorBatch
from scfpf_addon.casting.exact.exact_cast import cast_exact
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.surfaces.surface import (
    BilinearPatch,
    Cone,
    ControlSurface,
    Cylinder,
    Disc,
    Grid,
    Plane,
    Point,
    SphereSector,
)
from scfpf_addon.projection.typing import Array
from scfpf_addon.projection.volume.basis import span_basis
from scfpf_addon.projection.volume.reparameterisation import Polar, Unrolled
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

WIDTH, HEIGHT = 96, 54


def exact_image(scene: CastScene, projection: Projection, width: int = WIDTH, height: int = HEIGHT) -> Hits:
    """An image of exact hits; projection in world space."""
    x, y = pixel_centres(width, height, (0, height))
    return cast(scene, projection.transformed(scene.matrix), x, y, (1 / width, 1 / height), 0.0, None, width)


def exact_curves(scene: CastScene, controls: Array, counts: CastCounts | None = None) -> Hits:
    """Exact hits of Bézier curves (d+1, 3, N), cast space."""
    batch = ProjectorBatch(span_basis("BEZIER", len(controls)), controls)
    counts = CastCounts() if counts is None else counts
    return cast_exact(scene, batch, np.ones(controls.shape[2], bool), None, counts)


@cache
def where_made(degree: int, angle: float) -> Hits:
    """The image of the scene of ``moved`` where it was made."""
    return exact_image(CastScene(*boxes(3000)), bent_projection(degree, math.radians(angle)))


def moved(offset: float, factor: float, degree: int, angle: float) -> dict[str, float]:
    """A scene and its volume scaled by ``factor``, then moved by ``offset``, against where they were.

    The vertices' own rounding there is part of the difference: offset/factor·1e-16 of a scene of size 10.
    """
    vertices, triangles = boxes(3000)
    projection = bent_projection(degree, math.radians(angle))
    matrix = np.diag([factor, factor, factor, 1.0])
    matrix[:3, 3] = np.array([1.0, -2.0, 0.5]) * offset
    here = where_made(degree, angle)
    there = CastScene(vertices * factor + matrix[:3, 3], triangles)
    hits = exact_image(there, projection.transformed(matrix))
    one, other = (np.where(np.isfinite(h.t), h.t, 2.0) for h in (here, hits))
    apart = np.abs(one - other)
    other_thing = here.triangle != hits.triangle
    return {
        "pixels that see another triangle": float(other_thing.mean()),
        "largest change of t elsewhere": float(apart[~other_thing].max()),
    }


@cache
def closed_scenes() -> tuple[CastScene, CastScene]:
    """A sphere and a cube."""
    return CastScene(*sphere(24)), CastScene(*cube(16))


def edge_leaks(count: int, degree: int) -> dict[str, float]:
    """Curves aimed at the vertices and edges of closed meshes that pass through them."""
    leaks = aimed = 0
    for scene in closed_scenes():
        for aim in AIMS:
            controls, t = aimed_curves(scene.vertices, scene.triangles, degree, count // 8, aim)
            hits = exact_curves(scene, controls)
            leaks += int((~(hits.t <= t + 1e-9)).sum())
            aimed += len(t)
    return {"curves": aimed, "leaks": leaks}


@cache
def wall(cells: int = 16) -> CastScene:
    """A square from -1 to 1 in x and y, at z = 0."""
    x, y = np.meshgrid(*[np.linspace(-1.0, 1.0, cells + 1)] * 2)
    return CastScene(*sheet(np.stack([x, y, np.zeros_like(x)], axis=-1)))


def grazing(angle: float, degree: int, count: int = 2000) -> dict[str, float]:
    """Curves that meet a wall at ``angle`` radians: lost ones, and the largest error of t."""
    scene, generator = wall(), np.random.default_rng(4)
    target = generator.uniform(-0.4, 0.4, (2, count))
    heading = generator.uniform(0, 2 * np.pi, count)
    t = generator.uniform(0.3, 0.7, count)
    way = np.stack([np.cos(heading), np.sin(heading)])
    # In z the curve is the straight line angle·(t - t0)·length; across it bends.
    steps = np.arange(degree + 1) / degree
    controls = np.empty((degree + 1, 3, count))
    controls[:, :2] = target + way * (steps[:, None, None] - t) * 0.8
    if degree > 1:
        controls[1:-1, :2] += 0.05 * way[::-1]
    controls[:, 2] = -math.tan(angle) * 0.8 * (steps[:, None] - t)
    hits = exact_curves(scene, controls)
    found = np.isfinite(hits.t)
    return {"lost": float((~found).sum()), "error of t": float(np.abs(hits.t - t)[found].max(initial=0.0))}


def leading(size: float, degree: int, count: int = 2000) -> dict[str, float]:
    """Curves whose highest power of t has a coefficient of ``size``: lost ones, and the error of t."""
    scene, generator = wall(), np.random.default_rng(5)
    t = generator.uniform(0.1, 0.9, count)
    controls = np.zeros((degree + 1, 3, count))
    controls[:, :2] = generator.uniform(-0.5, 0.5, (2, count))
    steps = np.arange(degree + 1) / degree
    # z = (t0 - t) + size (t^degree - t0^degree): t^degree is 1 in the last coefficient alone.
    controls[:, 2] = t - steps[:, None] - size * t**degree
    controls[-1, 2] += size
    hits = exact_curves(scene, controls)
    found = np.isfinite(hits.t)
    return {"lost": float((~found).sum()), "error of t": float(np.abs(hits.t - t)[found].max(initial=0.0))}


def ends(where: str, degree: int, count: int = 2000) -> dict[str, float]:
    """Curves that meet a wall at t = 0 or 1 (``where``), or begin at that distance from it."""
    scene, generator = wall(), np.random.default_rng(6)
    controls = np.zeros((degree + 1, 3, count))
    controls[:, :2] = generator.uniform(-0.9, 0.9, (degree + 1, 2, count))
    steps = np.arange(degree + 1)[:, None] / degree
    apart = 0.0 if where in ("0", "1") else float(where)
    controls[:, 2] = (1.0 - steps) * 0.5 if where == "1" else apart - 0.5 * steps
    t = 1.0 if where == "1" else 2.0 * apart
    hits = exact_curves(scene, controls)
    found = np.isfinite(hits.t)
    return {"lost": float((~found).sum()), "error of t": float(np.abs(hits.t - t)[found].max(initial=0.0))}


def long_volume(ratio: float, degree: int) -> dict[str, float]:
    """A volume ``ratio`` times as long as wide through a row of walls: lost ones, and the error of t."""
    width, count = 2.0 / ratio, 41
    walls = np.linspace(-0.9, 0.9, count)
    x, y = np.meshgrid([-0.1, 0.1], [-0.1, 0.1])
    scene = CastScene(*sheet(np.stack([x, y, np.full_like(x, walls[0])], axis=-1)))
    surfaces = []
    for step in np.linspace(0.0, 1.0, degree + 1):
        matrix = np.eye(4)
        matrix[:3, 3] = 0.2 * width * math.sin(3.0 * step), 0.0, 1.0 - 2.0 * step
        surfaces.append(Plane(width, width, matrix=matrix))
    hits = exact_image(scene, Projection(ViewingVolume(tuple(surfaces))), 32, 32)
    found = np.isfinite(hits.t)
    return {
        "lost": float((~found).sum()),
        "error of t": float(np.abs(hits.t - 0.5 * (1.0 - walls[0]))[found].max(initial=0.0)),
    }


def small_detail(size: float, degree: int) -> tuple[Mesh, Projection]:
    """A sphere ``size`` times as large as the scene that it is in, and a volume as small as itself round it.

    512 triangles, whose edges are a fifth of ``size`` and less; boxes all round set the thickness of prisms.
    """
    place = np.array([0.7, 0.3, -0.4])
    vertices, triangles = boxes(1200)
    vertices = vertices - np.median(vertices, axis=0)
    ball, faces = sphere(8)
    mesh = joined([(vertices / np.abs(vertices).max(), triangles), (ball * size + place, faces)])
    surfaces = []
    for step in np.linspace(0.0, 1.0, degree + 1):
        matrix = np.eye(4)
        matrix[:3, 3] = place + size * np.array([0.5 * math.sin(3.0 * step), 0.1, 2.2 - 4.4 * step])
        surfaces.append(Plane(2.4 * size, 1.6 * size, matrix=matrix))
    return mesh, Projection(ViewingVolume(tuple(surfaces)))


def random_surface(generator: np.random.Generator) -> ControlSurface:
    """Any kind, anywhere, of any size; now and then collapsed to a point or a line."""
    matrix = np.eye(4)
    matrix[:3, :3] = np.linalg.qr(generator.normal(size=(3, 3)))[0] * 10 ** generator.uniform(-2, 2)
    if generator.random() < 0.3:
        matrix[:3, generator.integers(0, 3)] *= generator.choice([0.0, -1.0, 1e-9, 1e3])
    matrix[:3, 3] = generator.normal(size=3) * 10 ** generator.uniform(-3, 2)
    kind = generator.integers(0, 8)
    if kind == 0:
        surface: ControlSurface = Point()
    elif kind == 1:
        surface = Plane(*generator.uniform(0, 3, 2))
    elif kind == 2:
        surface = BilinearPatch(generator.normal(size=(4, 3)))
    elif kind == 3:
        surface = Disc(generator.uniform(0, 3))
    elif kind == 4:
        surface = Cylinder(*generator.uniform(0.01, 6, 3))
    elif kind == 5:
        surface = Cone(*generator.uniform(0.01, 6, 4))
    elif kind == 6:
        surface = SphereSector(generator.uniform(0, 3))
    else:
        surface = Grid(generator.normal(size=(3, 4, 3)))
    return surface.transformed(matrix)


def random_projection(generator: np.random.Generator) -> Projection:
    """Two to six random surfaces; now and then two coincide, or all do."""
    surfaces = [random_surface(generator) for _ in range(generator.integers(2, 7))]
    if generator.random() < 0.2:
        surfaces[1] = surfaces[0]
    if generator.random() < 0.02:
        surfaces = [surfaces[0]] * len(surfaces)
    kind = generator.choice(["BEZIER", "BEZIER", "POLYLINE", "B_SPLINE"])
    image = Polar() if generator.random() < 0.3 else Unrolled()
    return Projection(ViewingVolume(tuple(surfaces), kind), image)


def random_volumes(count: int, seed: int = 0) -> dict[str, float]:
    """Random volumes cast exactly and with a pixel error; counts what is not a number and what is hit."""
    generator = np.random.default_rng(seed)
    scenes = [CastScene(*mesh) for mesh in (sphere(8), cube(2), boxes(200))]
    broken = projectors = hit = 0
    x, y = pixel_centres(4, 3, (0, 3))
    for number in range(count):
        scene = scenes[number % 3]
        projection = random_projection(generator).transformed(scene.matrix)
        for error in (0.0, 0.5):
            hits = cast(scene, projection, x, y, (0.25, 1 / 3), error, None, 4)
            broken += not sound(hits)
            projectors += int(hits.mask.sum())
            hit += int((hits.triangle >= 0).sum())
    return {"volumes": count, "not sound": broken, "share hit": hit / max(projectors, 1)}


def sound(hits: Hits) -> bool:
    """Return whether an answer keeps what Hits promises."""
    hit: NDArray[np.bool_] = hits.triangle >= 0
    finite = all(np.isfinite(a).all() for a in (hits.position, hits.tangent, hits.barycentric))
    in_range = ((hits.t[hit] >= 0) & (hits.t[hit] <= 1)).all() and np.isposinf(hits.t[~hit]).all()
    weights = hits.barycentric[:, hit]
    inside = (weights >= -1e-6).all() and (weights.sum(axis=0) <= 1 + 1e-6).all()
    return bool(finite and in_range and inside and not (hit & ~hits.mask).any())


def figures(full: bool) -> dict[str, dict[str, float]]:
    """All figures, by what was measured."""
    result: dict[str, dict[str, float]] = {}
    for offset, factor in ((1e3, 1), (1e5, 1), (1e8, 1), (0, 1e-6), (0, 1e6), (1e8, 1e6), (1e3, 1e-6)):
        result[f"moved by {offset:g}, scaled by {factor:g}, 60°"] = moved(offset, factor, 2, 60)
    for degree in (1, 2, 3, 5):
        count = 100_000 if full else 8000
        result[f"aimed at vertices and edges, degree {degree}"] = edge_leaks(count, degree)
    for angle in (1e-2, 1e-4, 1e-6, 1e-8):
        for degree in (1, 2):
            result[f"grazing at {angle:g} rad, degree {degree}"] = grazing(angle, degree)
    for size in (0.0, 1e-18, 1e-12, 1e-6):
        for degree in (2, 3, 5):
            result[f"leading coefficient {size:g}, degree {degree}"] = leading(size, degree)
    for where in ("0", "1", "1e-12", "1e-6", "1e-3"):
        result[f"meets at t = {where}" if where in "01" else f"begins {where} before"] = ends(where, 2)
    for ratio in (1e3, 1e6, 1e7):
        result[f"{ratio:g} times longer than wide"] = long_volume(ratio, 2)
    result["random volumes"] = random_volumes(100_000 if full else 1000)
    return result


def main(arguments: list[str] | None = None) -> None:
    """The command line."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", metavar="FILE", help="write all figures to FILE too")
    parser.add_argument("--full", action="store_true", help="100,000 curves and volumes: some ten minutes")
    options = parser.parse_args(arguments)
    check_files(parser, written=options.json)
    measured: dict[str, Any] = figures(options.full)
    print("| extreme | figures |\n|---|---|")
    for title, row in measured.items():
        print(f"| {title} | " + ", ".join(f"{name} {value:.3g}" for name, value in row.items()) + " |")
    if options.json:
        Path(options.json).write_text(json.dumps(measured, indent=1) + "\n")


if __name__ == "__main__":
    main()
