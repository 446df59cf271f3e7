# SPDX-License-Identifier: GPL-3.0-or-later
"""Large scenes and images: what is held on the way, in bytes that the same code always asks for."""

import tracemalloc

import numpy as np
import pytest

from benchmarks.scenes import bent_projection, terrain
from scfpf_addon.casting import tiles as tiling
from scfpf_addon.casting.common import memory, parallel
from scfpf_addon.casting.common.hits import CastError
from scfpf_addon.casting.scene import occupancy
from scfpf_addon.casting.scene.cast_scene import CastScene
from scfpf_addon.casting.scene.culling import within_volume
from scfpf_addon.casting.scene.neighbours import edge_neighbours
from scfpf_addon.casting.scene.occupancy import Occupancy
from scfpf_addon.shading.frame import render_frame
from scfpf_addon.shading.lights import scene_culling
from scfpf_addon.shading.settings.frame_settings import FrameSettings

TRIANGLES = 60_000


def most_held(work):
    """The most bytes that ``work`` has held at a time, and what it gave."""
    tracemalloc.start()
    try:
        given = work()
        return tracemalloc.get_traced_memory()[1], given
    finally:
        tracemalloc.stop()


@pytest.mark.parametrize("curved", [False, True])
def test_what_an_image_takes_beside_its_pixels_does_not_grow_with_it(build, monkeypatch, curved):
    """One thread, tiles of equal size, three times as many of them."""
    scene = build.scene([build.sphere(6, radius=0.8)])
    heights, shifts = ((2, 0.3, -1), (0, 0.5, 0)) if curved else ((1, -1), None)
    projection = build.looking_down(*heights, size=1.8, shifts=shifts)
    monkeypatch.setattr(tiling, "TILE_PIXELS", 1 << 9)
    above = []
    for height, count in ((128, 16), (384, 48)):
        assert len(tiling.image_tiles(64, height)) == count
        settings = FrameSettings(64, height, samples=1, threads=1)
        held, frame = most_held(lambda settings=settings: render_frame(projection, scene, settings))
        above.append(held - frame.pixels.nbytes)
    assert above[1] < 1.2 * above[0]


def test_an_image_is_made_in_the_array_that_is_given(build):
    scene, projection = build.scene([build.square(0.5)]), build.looking_down(1, -1)
    settings = FrameSettings(16, 9, samples=1)
    pixels = np.full((9, 16, 4), 7.0, np.float32)
    frame = render_frame(projection, scene, settings, pixels=pixels)
    assert frame.pixels is pixels
    assert np.array_equal(pixels, render_frame(projection, scene, settings).pixels)


def test_culling_takes_little_beside_the_triangles(monkeypatch):
    vertices, triangles = terrain(TRIANGLES)
    volume = bent_projection(2, 1.0).volume
    at_once = within_volume(vertices, triangles, volume)
    assert 0.1 < at_once.mean() < 0.9
    # The integral image of its cells is as large as many triangles.
    fixed, _ = most_held(lambda: within_volume(vertices[:3], np.int32([[0, 1, 2]]), volume))
    monkeypatch.setattr(parallel, "AT_ONCE", 1000)
    held, kept = most_held(lambda: within_volume(vertices, triangles, volume))
    assert np.array_equal(kept, at_once)
    assert held - fixed < 10 * len(triangles)


def test_empty_space_takes_little_beside_the_triangles(monkeypatch):
    vertices, triangles = terrain(TRIANGLES)
    corners = vertices.T.take(triangles.T, 1).swapaxes(0, 1)
    monkeypatch.setattr(occupancy, "CELLS", 1000)
    monkeypatch.setattr(occupancy, "CELLS_EACH", 0)
    at_once = Occupancy.of(corners)
    monkeypatch.setattr(occupancy, "AT_ONCE", 1000)
    held, made = most_held(lambda: Occupancy.of(corners))
    assert np.array_equal(made.sums, at_once.sums) and np.array_equal(made.finer, at_once.finer)
    assert held < 40 * len(triangles)


def test_neighbours_take_little_beside_the_triangles():
    _, triangles = terrain(TRIANGLES)
    held, neighbours = most_held(lambda: edge_neighbours(triangles))
    assert (neighbours >= 0).mean() > 0.98
    assert held < 130 * len(triangles)


def test_exact_casting_refuses_before_anything_is_built(build, monkeypatch):
    """It names the memory that the triangles in reach need, and what to do."""
    built = []
    monkeypatch.setattr(scene_culling, "CastScene", lambda *given: built.append(1) or CastScene(*given))
    monkeypatch.setattr(memory, "available_memory", lambda: 1e6)
    scene = build.scene([build.square(1.5, -0.8), build.sphere(24, radius=0.5), build.sphere(24, (9, 9, 9))])
    projection = build.looking_down(2, 0.3, -1, size=1.8, shifts=(0, 0.5, 0))
    with pytest.raises(
        CastError, match=r"needs 0\.0 GB of memory for [\d,]+ triangles.*set the pixel error"
    ) as told:
        render_frame(projection, scene, FrameSettings(8, 8, pixel_error=0.0))
    in_reach = within_volume(scene.geometry.vertices, scene.geometry.triangles, projection.volume).sum()
    assert f"for {in_reach:,} triangles" in str(told.value) and in_reach < len(scene.geometry.triangles)
    assert not built
    assert render_frame(projection, scene, FrameSettings(8, 8, pixel_error=0.1)) is not None, "chords do"
    assert built
