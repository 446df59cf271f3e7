# SPDX-License-Identifier: GPL-3.0-or-later
"""Whole images: order, tiles, threads, cancelling."""

import math
import threading
from itertools import pairwise

import numpy as np
import pytest

from benchmarks.scenes import bent_projection, boxes
from scfpf_addon.casting import frame as module
from scfpf_addon.casting import tiles as tiling
from scfpf_addon.casting.common.hits import CastCounts, CastError
from scfpf_addon.casting.common.parallel import thread_count
from scfpf_addon.casting.frame import cast_frame, pixel_centres
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.casting.tiles import image_tiles

WIDTH, HEIGHT = 80, 50


@pytest.fixture(scope="module")
def scene():
    return CastScene(*boxes(6000))


@pytest.fixture
def small_tiles(monkeypatch):
    monkeypatch.setattr(tiling, "TILE_PIXELS", 7 * WIDTH)


@pytest.mark.parametrize(("degree", "angle"), [(1, 0), (2, 60)])
def test_the_number_of_threads_changes_nothing(scene, small_tiles, degree, angle):
    projection = bent_projection(degree, math.radians(angle))
    frames, counts = [], []
    for threads in (1, 2, 5):
        counts.append(CastCounts())
        frames.append(cast_frame(scene, projection, WIDTH, HEIGHT, threads=threads, counts=counts[-1]))
    for other in frames[1:]:
        for one, two in zip(frames[0], other, strict=True):
            np.testing.assert_array_equal(one, two)
    assert counts[0] == counts[1] == counts[2]
    assert counts[0].projectors == WIDTH * HEIGHT


def test_tiles_do_not_show(scene, small_tiles, reference):
    projection = bent_projection(2, math.radians(60))
    counts = CastCounts()
    whole = reference.cast_image(scene, projection, WIDTH, HEIGHT, counts=counts)
    tiled = cast_frame(scene, projection, WIDTH, HEIGHT, counts=counts)
    # Tiles have chords of their own, so silhouettes may differ by the pixel error, and nothing else.
    different = whole.triangle != tiled.triangle
    assert different.mean() < 0.003
    # Hits that no curve bears out are as the chords have them.
    same = np.isclose(whole.t, tiled.t, rtol=0, atol=1e-12)
    assert (~same & ~different).sum() <= counts.unresolved <= 4


def test_hits_come_in_image_order(scene, reference):
    projection = bent_projection(1, 0.0)
    hits = cast_frame(scene, projection, WIDTH, HEIGHT)
    x, y = pixel_centres(WIDTH, HEIGHT, (0, HEIGHT))
    assert (x[:2], x[WIDTH]) == (pytest.approx([0.5 / WIDTH, 1.5 / WIDTH]), pytest.approx(0.5 / WIDTH))
    assert (y[0], y[-1]) == (pytest.approx(0.5 / HEIGHT), pytest.approx(1 - 0.5 / HEIGHT))
    image = projection.transformed(scene.matrix).volume.evaluate(
        x, y, np.where(np.isfinite(hits.t), hits.t, 1)
    )
    np.testing.assert_allclose(hits.position, image.position, atol=1e-12)


@pytest.mark.parametrize(
    ("width", "height"), [(1, 1), (1, 300), (300, 1), (3, 2), (1920, 1080), (200_000, 2), (64, 65536)]
)
def test_tiles_cover_the_image_once(width, height):
    tiles = image_tiles(width, height)
    assert tiles[0].start == 0 and tiles[-1].stop == height
    assert all(a.stop == b.start for a, b in pairwise(tiles))
    assert all(rows.stop > rows.start for rows in tiles)
    assert max(rows.stop - rows.start for rows in tiles) * width <= max(tiling.TILE_PIXELS, width)
    most = height * width // tiling.FEWEST_PIXELS
    assert len(tiles) >= min(height, tiling.FEWEST_TILES, most)


@pytest.mark.parametrize(("width", "height"), [(1, 1), (1, 40), (40, 1), (2, 3)])
def test_images_of_any_shape(scene, width, height):
    for degree in (1, 2):
        hits = cast_frame(scene, bent_projection(degree, degree - 1.0), width, height)
        assert hits.t.shape == (width * height,) and hits.position.shape == (3, width * height)


def test_cancelling_ends_all_threads(scene, small_tiles):
    before = threading.active_count()
    callers, asked = set(), []

    def cancelled():
        callers.add(threading.current_thread())
        asked.append(1)
        return len(asked) > 1

    counts = CastCounts()
    projection = bent_projection(3, math.pi)
    assert cast_frame(scene, projection, WIDTH, HEIGHT, 0.1, 1, cancelled, counts) is None
    assert threading.active_count() == before
    assert callers == {threading.current_thread()}
    assert counts.projectors < WIDTH * HEIGHT


def test_an_error_in_a_tile_reaches_the_caller_after_all_threads_have_ended(scene, small_tiles, monkeypatch):
    before = threading.active_count()

    def fail(*arguments):
        raise RuntimeError("broken tile")

    monkeypatch.setattr(module, "cast", fail)
    with pytest.raises(RuntimeError, match="broken tile"):
        cast_frame(scene, bent_projection(1, 0), WIDTH, HEIGHT, threads=2)
    assert threading.active_count() == before


@pytest.mark.parametrize(("width", "height"), [(0, 10), (10, 0), (-1, 5)])
def test_an_image_without_pixels_is_refused(scene, width, height):
    with pytest.raises(CastError, match="cannot be cast"):
        cast_frame(scene, bent_projection(1, 0), width, height)


def test_threads():
    assert thread_count(3) == 3
    assert thread_count() >= 1
