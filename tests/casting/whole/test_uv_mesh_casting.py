# SPDX-License-Identifier: GPL-3.0-or-later
"""A volume of several islands makes the images of its parts side by side; its holes show nothing."""

import numpy as np
import pytest

from scfpf_addon.casting.frame import cast_frame
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.projection.surfaces.uv_chart import UVChart
from scfpf_addon.projection.surfaces.uv_mesh import UVMesh
from scfpf_addon.projection.volume.viewing_volume import Projection, ViewingVolume

WIDTH, HEIGHT = 120, 90
# Two casts of the same projectors agree to this share of the volume's length; what remains are
# silhouettes, which another schedule of chords may place differently by the pixel error: against brute
# force 2e-3 to 4.5e-3 of these pixels are wrong, shards being all silhouette.
ROUNDING = 1e-9

# The bend of the projectors, and the share of pixels that may differ.
bends = pytest.mark.parametrize(("bend", "wrong"), [(0.0, 0.0), (1.5, 4e-3)], ids=["straight", "bent"])


def shards():
    """A cloud of triangles between z = -7 and -3."""
    random = np.random.default_rng(1)
    centres = random.uniform((-3, -2, -7), (3, 2, -3), (150, 3))
    corners = centres[:, None] + random.normal(size=(150, 3, 3)) * 0.35
    return CastScene(corners.reshape(-1, 3), np.arange(450, dtype=np.int32).reshape(-1, 3))


def sheets(bend, seed):
    """Points (m+1, 5, 5, 3) of control surfaces that open towards -Z, waved; three of them if bent."""
    random = np.random.default_rng(seed)
    x, y = np.meshgrid(np.linspace(-1, 1, 5), np.linspace(-1, 1, 5))
    depths = (0.0, 4.0, 8.0) if bend else (0.0, 8.0)
    middle = random.uniform(-0.5, 0.5, 2)
    result = []
    for depth in depths:
        wave = random.normal(size=(5, 5)) * 0.05
        aside = bend * np.sin(np.pi * depth / 8)
        points = np.stack([x * (0.3 + depth / 3) + aside, y * (0.2 + depth / 4), wave - depth], axis=-1)
        result.append(points + np.array([*middle, 0.0]))
    return np.array(result)


def chart_of(parts):
    """5 × 5 points a part, in the given places (u0, u1) of the UV square, over the whole of v."""
    line = np.linspace(0, 1, 5)
    u, v = np.meshgrid(line, line)
    uv = [np.stack([(u0 + (u1 - u0) * u).ravel(), v.ravel()], 1) for u0, u1 in parts]
    first = (np.arange(4)[:, None] * 5 + np.arange(4)).ravel()
    quads = np.stack([first, first + 1, first + 6, first + 5], 1)
    one = np.concatenate([quads[:, [0, 1, 2]], quads[:, [0, 2, 3]]])
    triangles = np.concatenate([one + 25 * k for k in range(len(parts))])
    return UVChart(np.concatenate(uv)[triangles], triangles)


def projection_of(volumes, parts, aspect):
    """volumes: points as of ``sheets``, one for each part of the UV square."""
    chart = chart_of(parts)
    layers = (np.concatenate([p.reshape(-1, 3) for p in layer]) for layer in zip(*volumes, strict=True))
    return Projection(ViewingVolume(tuple(UVMesh(points, chart) for points in layers)), aspect=aspect)


def image(scene, projection, width, pixel_error):
    hits = cast_frame(scene, projection, width, HEIGHT, pixel_error, threads=1)
    return (a.reshape(HEIGHT, width) for a in (hits.t, hits.triangle, hits.mask))


def agree(t, other):
    """Return whether two images have the same t, inf for none."""
    return np.isclose(t, other, rtol=0, atol=ROUNDING)


@bends
def test_two_islands_are_two_images_side_by_side(bend, wrong):
    scene = shards()
    volumes = [sheets(bend, 1), sheets(-bend, 2)]
    whole = projection_of(volumes, [(0.0, 0.5), (0.5, 1.0)], 2 * WIDTH / HEIGHT)
    assert len(np.unique(whole.volume.controls(np.array([0.2, 0.8]), np.array([0.5, 0.5])).tile)) == 2
    t, triangle, mask = image(scene, whole, 2 * WIDTH, 0.1)
    assert mask.all() and 0.2 < (triangle >= 0).mean() < 0.98
    for volume, columns in zip(volumes, (slice(0, WIDTH), slice(WIDTH, 2 * WIDTH)), strict=True):
        single = projection_of([volume], [(0.0, 1.0)], WIDTH / HEIGHT)
        own_t, own_triangle, _ = image(scene, single, WIDTH, 0.1)
        same = agree(own_t, t[:, columns]) & (own_triangle == triangle[:, columns])
        assert 1 - same.mean() <= wrong


@bends
def test_a_gap_between_islands_shows_nothing(bend, wrong):
    """The islands are the same as in a volume without the others."""
    scene = shards()
    volumes = [sheets(bend, 1), sheets(bend, 2)]
    places = [(0.0, 0.45), (0.55, 1.0)]
    t, triangle, mask = image(scene, projection_of(volumes, places, 2 * WIDTH / HEIGHT), 2 * WIDTH, 0.1)
    u = (np.arange(2 * WIDTH) + 0.5) / (2 * WIDTH)
    assert np.array_equal(mask, np.broadcast_to((u < 0.45) | (u > 0.55), mask.shape))
    assert (triangle[~mask] == -1).all() and np.isinf(t[~mask]).all()
    for volume, place in zip(volumes, places, strict=True):
        alone = projection_of([volume], [place], 2 * WIDTH / HEIGHT)
        own_t, own_triangle, own = image(scene, alone, 2 * WIDTH, 0.1)
        assert np.array_equal(own, mask & (u > place[0]) & (u < place[1]))
        same = agree(own_t, t) & (own_triangle == triangle)
        # Chords of their own, each within the pixel error.
        assert 1 - same[own].mean() <= 1.5 * wrong
