# SPDX-License-Identifier: GPL-3.0-or-later
"""Things much thinner than a pixel, which chords may pass."""

import math

import numpy as np
import pytest

from benchmarks.scenes import bent_projection, joined, sheet
from scfpf_addon.casting.cast import CastCounts
from scfpf_addon.casting.frame import pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene

WIDTH, HEIGHT = 128, 72

# Corners along a wire.
CORNERS = 40


def wires(projection, count, pixels):
    """Ribbons that cross the image straight at random depths, ``pixels`` wide in it."""
    generator = np.random.default_rng(1)
    start, end = generator.uniform(0.05, 0.95, (2, 2, count, 1))
    depth = np.broadcast_to(generator.uniform(0.2, 0.9, (count, 1)), (count, CORNERS)).ravel()
    size = np.array([WIDTH, HEIGHT])[:, None, None]
    along = (end - start) * size
    across = np.stack([along[1], -along[0]]) / np.linalg.norm(along, axis=0) * 0.5 * pixels / size
    middle = start + (end - start) * np.linspace(0, 1, CORNERS)
    edges = []
    for x, y in ((middle - across).reshape(2, -1), (middle + across).reshape(2, -1)):
        image = projection.parameters(x, y)
        edges.append(projection.volume.evaluate(image.u, image.v, depth).position)
    ribbons = np.stack(edges, axis=-1).reshape(3, count, CORNERS, 2)
    return joined([sheet(ribbon.transpose(1, 2, 0)) for ribbon in ribbons.transpose(1, 0, 2, 3)])


def wall(projection):
    """The far surface, cut off above, with a curved edge."""
    x, y = np.meshgrid(np.linspace(0, 1, 20), np.linspace(0, 1, 12))
    y = y * (0.6 + 0.3 * np.sin(6 * x))
    image = projection.parameters(x.ravel(), y.ravel())
    position = projection.volume.evaluate(image.u, image.v, np.full(x.size, 0.95)).position
    return sheet(position.reshape(3, 12, 20).transpose(1, 2, 0))


@pytest.mark.parametrize("pixels", [0.1, 0.5])
def test_wires_keep_their_thickness(reference, pixels):
    projection = bent_projection(2, math.radians(60))
    vertices, triangles = wires(projection, 25, pixels)
    t, _ = reference.brute_force(vertices, triangles, projection, *pixel_centres(WIDTH, HEIGHT, (0, HEIGHT)))
    hits = reference.cast_image(CastScene(vertices, triangles), projection, WIDTH, HEIGHT)
    wire, seen = np.isfinite(t), hits.triangle >= 0
    # Chords that stray by a tenth of a pixel lose that from a thing's edge, not more.
    assert (wire & ~seen).sum() < max(0.12, 0.035 / pixels) * wire.sum()
    assert (seen & ~wire).sum() < 0.02 * wire.sum() + 1


def test_one_wire_before_a_wall_is_found(reference):
    projection = bent_projection(2, math.radians(60))
    wire, behind = wires(projection, 2, 0.25), wall(projection)
    vertices, triangles = joined([wire, behind])
    t, triangle = reference.brute_force(
        vertices, triangles, projection, *pixel_centres(WIDTH, HEIGHT, (0, HEIGHT))
    )
    counts = CastCounts()
    hits = reference.cast_image(CastScene(vertices, triangles), projection, WIDTH, HEIGHT, counts=counts)
    true = (triangle >= 0) & (triangle < len(wire[1]))
    found = (hits.triangle >= 0) & (hits.triangle < len(wire[1]))
    assert true.sum() > 20 and (true & ~found).sum() <= 0.15 * true.sum()
    both = np.isfinite(t) & np.isfinite(hits.t)
    assert (np.abs(hits.t[both] - t[both]) > 1e-9).mean() < 0.002
    assert counts.refined < 0.1 * counts.projectors


def test_solid_things_are_not_cast_twice(reference):
    projection = bent_projection(2, math.radians(60))
    counts = CastCounts()
    reference.cast_image(CastScene(*wall(projection)), projection, WIDTH, HEIGHT, counts=counts)
    assert counts.refined <= 0.1 * counts.projectors
