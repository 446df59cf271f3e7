# SPDX-License-Identifier: GPL-3.0-or-later
"""A pixel error above 0 is a bound: no silhouette is farther than that from where the exact image has it.

Pixels that differ from the exact image are looked up in it: exact projectors all round, up to the
pixel error away. One of them must show what the pixel shows, or see past what should hide it.
"""

import math

import numpy as np
import pytest

from benchmarks.extremes import random_projection
from benchmarks.hard_scenes import open_fan, sphere
from benchmarks.scenes import bent_projection, boxes, columns
from scfpf_addon.casting.cast import cast
from scfpf_addon.casting.common.hits import CastCounts
from scfpf_addon.casting.curves.plane_hits import solve
from scfpf_addon.casting.curves.projector_batch import ProjectorBatch
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.surfaces.surface import Disc, Point, SphereSector
from scfpf_addon.projection.volume.reparameterisation import Polar
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

WIDTH, HEIGHT = 64, 36
SIZE = (1 / WIDTH, 1 / HEIGHT)

# Places on a circle that are looked at, and circles.
PLACES, CIRCLES = 48, 25


def depth(hits):
    return np.where(np.isfinite(hits.t), hits.t, 2.0)


def surroundings(scene, triangles):
    """Triangles (M,) with two rings of neighbours, (M, R); -2 where there is none."""
    rings = triangles[:, None]
    for _ in range(2):
        across = np.where(rings >= 0, scene.neighbours[:, rings], -1)
        rings = np.concatenate([rings, *across], axis=1)
    return np.where(rings >= 0, rings, -2)


def plane_depth(scene, inside, x, y, triangle, t):
    """The t at which projectors meet the planes of triangles, nearest to t, (N,); 2 where they do not."""
    points, _ = inside.projectors(x, y)
    batch = ProjectorBatch(inside.volume.spans, points)
    span = inside.volume.spans.locate(np.minimum(t, 1.0))[0]
    found = solve(batch, scene, np.maximum(triangle, 0), span, t - 0.05, np.minimum(t + 0.05, 1.0))
    return np.where((triangle >= 0) & ~np.isnan(found.t), found.t, 2.0)


def farthest(scene, projection, pixel_error, width=WIDTH, height=HEIGHT):
    """Distances, in pixels, where the exact image shows what differing pixels do; their number; the bound.

    inf: farther than 1.05 times that bound, or the pixel error if that is more.
    """
    inside = projection.transformed(scene.matrix)
    x, y = pixel_centres(width, height, (0, height))
    size = (1 / width, 1 / height)
    counts = CastCounts()
    shown = cast(scene, inside, x, y, size, pixel_error, counts, width)
    bound = max(pixel_error, counts.error_bound)
    true = cast(scene, inside, x, y, size, 0.0, None, width)
    pixels = np.flatnonzero(np.abs(depth(shown) - depth(true)) > 1e-9)
    distance = np.full(len(pixels), np.inf)
    angle = np.arange(PLACES) * (2 * np.pi / PLACES)
    own, hiding = (surroundings(scene, hits.triangle[pixels]) for hits in (shown, true))
    for radius in np.linspace(0.0, 1.05 * bound, CIRCLES):
        rest = np.flatnonzero(np.isinf(distance))
        if len(rest) == 0:
            break
        which = np.repeat(pixels[rest], PLACES)
        ring = np.tile(angle, len(rest))
        around_x = np.clip(x[which] + radius * np.cos(ring) / width, 0, 1)
        around_y = np.clip(y[which] + radius * np.sin(ring) / height, 0, 1)
        exact = cast(scene, inside, around_x, around_y, size, 0.0)
        same = (exact.triangle[:, None] == np.repeat(own[rest], PLACES, axis=0)).any(axis=1)
        same |= (exact.triangle < 0) & (shown.triangle[which] < 0)
        behind = plane_depth(scene, inside, around_x, around_y, shown.triangle[which], depth(shown)[which])
        same |= (shown.triangle[which] >= 0) & (depth(exact) >= behind - 1e-9)
        front = plane_depth(scene, inside, around_x, around_y, true.triangle[which], depth(true)[which])
        other = (exact.triangle[:, None] != np.repeat(hiding[rest], PLACES, axis=0)).all(axis=1)
        same |= (depth(true) < depth(shown))[which] & other & (depth(exact) > front)
        distance[rest[same.reshape(-1, PLACES).any(axis=1)]] = radius
    return distance, len(pixels), counts.error_bound


def placed(surface, *position):
    matrix = np.eye(4)
    matrix[:3, 3] = position
    return surface.transformed(matrix)


def tilted(surface, angle):
    cos, sin = math.cos(angle), math.sin(angle)
    return surface.transformed(np.array([[1, 0, 0, 0], [0, cos, -sin, 0], [0, sin, cos, 0], [0, 0, 0, 1.0]]))


def volumes():
    centre = (6.0, 0.5, -12.0)
    spheres = [placed(tilted(SphereSector(r), 0.2 * r), *centre) for r in (0.1, 2.0, 14.0)]
    discs = [
        placed(Disc(0.3), 6, 1, 0),
        placed(tilted(Disc(2.0), 0.3), 7, 1.5, -6),
        placed(Disc(9), 8, 0, -20),
    ]
    bent = bent_projection(3, math.radians(150)).volume.surfaces
    return {
        "10°": bent_projection(2, math.radians(10)),
        "60°": bent_projection(2, math.radians(60)),
        "180°": bent_projection(3, math.radians(180)),
        "degree 5": bent_projection(5, math.radians(180)),
        "spline": Projection(ViewingVolume(bent, "B_SPLINE"), aspect=16 / 9),
        "smooth": Projection(ViewingVolume(bent, "SMOOTH", (1.0, 2.0, 4.0, 9.0)), aspect=16 / 9),
        "poles": Projection(ViewingVolume(tuple(spheres))),
        "point": Projection(ViewingVolume((placed(Point(), *centre), *spheres[1:]))),
        "polar": Projection(ViewingVolume(tuple(discs)), Polar()),
    }


MESHES = {
    "columns": lambda: columns(6000),
    "boxes": lambda: boxes(12_000),
    "fan": lambda: open_fan(40),
}


@pytest.fixture(scope="module")
def scenes():
    return {name: CastScene(*make()) for name, make in MESHES.items()}


@pytest.mark.parametrize("name", volumes())
def test_nothing_is_farther_off_than_the_pixel_error(scenes, name):
    differing = 0
    for scene in scenes.values():
        for pixel_error in (1.0, 0.1):
            distance, count, bound = farthest(scene, volumes()[name], pixel_error)
            differing += count
            assert bound <= pixel_error * 1.0001
            assert np.isfinite(distance).all(), (name, pixel_error)
    assert differing > 0


def test_random_volumes_keep_the_bound():
    """Any kinds of surfaces, degrees up to 5; the reported bound counts where float32 limits it."""
    generator = np.random.default_rng(5)
    scene, differing, curved, kept = CastScene(*boxes(2000)), 0, 0, 0
    while curved < 4:
        projection = random_projection(generator)
        matrix = np.linalg.inv(scene.matrix)
        projection = projection.transformed(matrix)
        spans = projection.volume.spans
        x, y = pixel_centres(40, 24, (0, 24))
        seen = cast(scene, projection.transformed(scene.matrix), x, y, (1 / 40, 1 / 24), 0.0, None, 40)
        if spans.degree < 2 or (seen.triangle >= 0).mean() < 0.1:
            continue
        curved += 1
        distance, count, bound = farthest(scene, projection, 1.0, 40, 24)
        differing += count
        kept += bound <= 1.0001
        assert np.isfinite(distance).all(), curved
    assert differing > 0 and kept >= 0.9 * curved


@pytest.mark.parametrize("pixel_error", [0.0, 0.1, 1.0])
@pytest.mark.parametrize(("degree", "angle"), [(1, 0), (2, 60), (3, 180)])
def test_a_closed_mesh_never_shows_its_inside(pixel_error, degree, angle):
    """A sphere whose edges are shorter than the pixel error, from outside: every hit is on its front."""
    projection = bent_projection(degree, math.radians(angle))
    vertices, triangles = sphere(120)
    centre = projection.volume.evaluate(np.array([0.5]), np.array([0.5]), np.array([0.55])).position
    scene = CastScene(1.3 * vertices + centre.T, triangles)
    x, y = pixel_centres(160, 90, (0, 90))
    hits = cast(scene, projection.transformed(scene.matrix), x, y, (1 / 160, 1 / 90), pixel_error, None, 160)
    hit = hits.triangle >= 0
    assert hit.sum() > 300
    normal = scene.normals(hits.triangle[hit])
    corners = scene.vertices[:, scene.triangles[hits.triangle[hit]].T]
    outward = np.einsum("cn,cn->n", normal, corners.mean(axis=1) - scene.vertices.mean(axis=1)[:, None])
    facing = np.einsum("cn,cn->n", normal, hits.tangent[:, hit]) * np.sign(outward)
    length = np.linalg.norm(hits.tangent[:, hit], axis=0)
    # At the limb a chord may meet a triangle that its curve sees edge-on.
    assert (facing < 1e-9 * length).all() if pixel_error == 0.0 else (facing < 0.05 * length).all()
