# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixel error 0 against all triangles of large scenes, in blocks of neighbouring pixels.

SCFPF_FULL_TESTS=1 in the environment asks for a million triangles and 10,000 projectors in each volume.
"""

import math
import os
from dataclasses import replace

import numpy as np
import pytest

from benchmarks.hard_scenes import cube, sphere
from benchmarks.scenes import SCENES, bent_projection
from scfpf_addon.casting.cast import cast
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.casting.scene.culling import within_volume
from scfpf_addon.projection.surfaces.surface import Grid
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

FULL = bool(os.environ.get("SCFPF_FULL_TESTS"))
TRIANGLES, BLOCKS = (1_000_000, 100) if FULL else (100_000, 3)

# Straight, bends of all sizes, a loop; degrees 1 to 5 and the other bases.
VOLUMES = {
    "straight": (1, 0),
    "10°": (2, 10),
    "60°": (2, 60),
    "180°": (3, 180),
    "loop": (4, 300),
    "quintic": (5, 180),
}
VOLUMES |= {"POLYLINE": (5, 120), "B_SPLINE": (5, 120)}

# Pixels along a block, and in a row of the image.
SIDE, ACROSS = 10, 1920

# Two hits count as one when their t differ by less.
SAME = 1e-9


def depth(t):
    return np.where(np.isfinite(t), t, 2.0)


@pytest.mark.parametrize("scene", SCENES)
def test_blocks_of_a_large_scene(reference, scene):
    """A block's own volume tells which triangles its projectors can meet; they are met with all of those."""
    vertices, triangles = SCENES[scene](TRIANGLES)
    made, wrong, count = CastScene(vertices, triangles), 0, 0
    generator = np.random.default_rng(8)
    for name, (degree, angle) in VOLUMES.items():
        basis = name if name.isupper() else "BEZIER"
        bent = bent_projection(degree, math.radians(angle))
        projection = replace(bent, volume=replace(bent.volume, basis=basis))
        inside = projection.transformed(made.matrix)
        for corner in generator.uniform(0.02, 0.97, (BLOCKS, 2)):
            x, y = (
                a.ravel() + start
                for a, start in zip(np.meshgrid(*[np.arange(SIDE) / ACROSS] * 2), corner, strict=True)
            )
            hits = cast(made, inside, x, y, (1 / ACROSS, 1 / ACROSS), 0.0, None, SIDE)
            points, _ = projection.projectors(x, y)
            grids = tuple(Grid(p.T.reshape(SIDE, SIDE, 3)) for p in points)
            near = np.flatnonzero(within_volume(vertices, triangles, ViewingVolume(grids, basis)))
            t = np.full(len(x), np.inf)
            if len(near):
                t, _ = reference.brute_force(vertices, triangles[near], projection, x, y)
            wrong += int((np.abs(depth(hits.t) - depth(t)) > SAME).sum())
            count += len(x)
        print(f"{scene}, {len(triangles)} triangles, to {name}: {wrong} of {count} differ", flush=True)
    assert count == len(VOLUMES) * BLOCKS * SIDE**2
    assert wrong == 0


@pytest.mark.parametrize(("degree", "angle"), [(1, 0), (2, 10), (3, 150), (4, 300), (5, 180)])
@pytest.mark.parametrize("closed", [sphere, cube])
def test_closed_meshes_from_inside(reference, closed, degree, angle):
    """No projector leaves a closed mesh unseen, and each sees what brute force sees."""
    projection = bent_projection(degree, math.radians(angle))
    start = projection.volume.evaluate(np.array([0.5]), np.array([0.5]), np.zeros(1)).position
    vertices, triangles = closed(10)
    mesh = 4.0 * vertices + start.T, triangles
    x, y = (a.ravel() for a in np.meshgrid(*[(np.arange(24) + 0.5) / 24] * 2))
    t, _ = reference.brute_force(*mesh, projection, x, y)
    hits = reference.cast_image(CastScene(*mesh), projection, 24, 24, 0.0)
    assert (np.abs(depth(hits.t) - depth(t)) < SAME).all()
    ends = projection.projectors(x, y).points[-1] - start
    outside = (np.abs(ends).max(axis=0) if closed is cube else np.linalg.norm(ends, axis=0)) > 4.0
    assert outside.any() and (hits.triangle[outside] >= 0).all()


def folded():
    """A volume that is turned inside out along a part of its projectors: its sheets cross."""
    u, v = np.meshgrid(np.linspace(-1, 1, 13), np.linspace(-1, 1, 7))
    grids = []
    for bend, z in ((1.0, 0.0), (-2.5, -9.0), (1.6, -18.0)):
        x = 6 + 5 * bend * u + 2 * np.sin(3 * u + z)
        grids.append(Grid(np.stack([x, 3.0 * v + 0.4 * u * v * bend, z - 2 + 1.5 * u * u], axis=-1)))
    return Projection(ViewingVolume(tuple(grids)))


@pytest.mark.parametrize("pixel_error", [0.0, 0.1])
@pytest.mark.parametrize("scene", SCENES)
def test_a_folded_volume_shows_the_first_hit_by_t(reference, scene, pixel_error):
    vertices, triangles = SCENES[scene](1000)
    x, y = (a.ravel() for a in np.meshgrid((np.arange(64) + 0.5) / 64, (np.arange(36) + 0.5) / 36))
    t, triangle = reference.brute_force(vertices, triangles, folded(), x, y)
    hits = reference.cast_image(CastScene(vertices, triangles), folded(), 64, 36, pixel_error)
    differ = np.abs(depth(hits.t) - depth(t)) > SAME
    assert np.isfinite(t).mean() > 0.1
    if pixel_error == 0.0:
        assert not differ.any()
    else:
        assert not (differ & reference.interior(triangle, 64)).any() and differ.mean() < 0.02
